"""Where the repository is, and every folder of it, each written once.

The repository is the folder that the environment variable ``TBDCORE_REPOSITORY`` names; else the
one that this package is installed from, in place; else the current folder or the nearest of its
parents.  It holds ``notebooks/`` and ``data/papers.toml``.  Without one, all but ``PACKAGE`` raise
OSError.  ``TBDCORE_FIGURES`` moves the products of default runs, ``TBDCORE_BUILD`` the rest; a
command moves them for itself alone with :func:`moved`.
"""

import contextlib
import os
from contextvars import ContextVar
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]  # the modules themselves, wherever they are installed
_MOVED: ContextVar[dict] = ContextVar("folders that a command has moved", default={})  # noqa: B039


def root():
    """The folder of the repository; OSError, saying how to name it, when there is none."""
    named, here = os.environ.get("TBDCORE_REPOSITORY"), Path.cwd()
    places = [Path(named).resolve()] if named else [PACKAGE.parent, here, *here.parents]
    for place in places:
        if (place / "notebooks").is_dir() and (place / "data" / "papers.toml").is_file():
            return place
    where = f"TBDCORE_REPOSITORY={named} is none" if named else "there is none here"
    advice = "go to the folder of a clone, or name it: TBDCORE_REPOSITORY=/path/to/clone"
    raise OSError(f"this needs the repository, and {where}; {advice}")


def notebooks():
    """Folder of the notebooks, ``NN_<paper>.ipynb``, committed executed."""
    return root() / "notebooks"


def bibliography():
    """File with what is known of the papers."""
    return root() / "data" / "papers.toml"


def claims():
    """Folder of what the papers publish, ``<paper>.csv``."""
    return root() / "data" / "claims"


def seeds():
    """File with the verdicts under other seeds."""
    return root() / "data" / "seeds.csv"


def products():
    """Folder of the committed products, ``<paper>/fig05.pdf`` and its kin."""
    return root() / "figures"


def lock():
    """File with the version of every distribution."""
    return root() / "environment.txt"


def readme():
    """The README; it has the table of the papers."""
    return root() / "README.md"


def citation():
    """File that says how to cite the repository."""
    return root() / "CITATION.cff"


def figures():
    """Folder of the products that are read, and that default runs write."""
    moved_to = _named("TBDCORE_FIGURES")
    return Path(moved_to or products()).resolve()


def build():
    """Folder of everything that is neither source nor product."""
    moved_to = _named("TBDCORE_BUILD")
    return Path(moved_to).resolve() if moved_to else root() / "build"


def _named(variable):
    """The folder that the present command, or an environment variable, has named; or nothing."""
    return _MOVED.get().get(variable) or os.environ.get(variable)


@contextlib.contextmanager
def moved(**folders):
    """Other folders until the block is done: ``moved(TBDCORE_FIGURES="elsewhere")``."""
    token = _MOVED.set(_MOVED.get() | folders)
    try:
        yield
    finally:
        _MOVED.reset(token)


def writable(folder):
    """Whether files can be made in a folder, or in the one that it would be made in."""
    made = next(each for each in (folder, *folder.parents) if each.exists())
    return made.is_dir() and os.access(made, os.W_OK | os.X_OK)


def require_writable(*folders):
    """Raise OSError, naming the first of some folders in which no files can be made."""
    for folder in sorted(folders):
        if not writable(folder):
            raise OSError(f"{folder} cannot be written; work in a clone of your own")
