"""Where the repository is, and every folder of it, each written once.

The repository is the folder that the environment variable ``TBDCORE_REPOSITORY`` names; else the
one that this package is installed from, in place; else the current folder or the nearest of its
parents.  It holds ``notebooks/`` and ``data/papers.toml``.  Without one, every path but ``PACKAGE``
raises OSError.  ``TBDCORE_FIGURES`` moves the products of default runs, ``TBDCORE_BUILD`` the rest.
"""

import os
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]  # the modules themselves, wherever they are installed
PLACES = {
    "ROOT": ".",
    "NOTEBOOKS": "notebooks",  # NN_<paper>.ipynb, committed executed
    "BIBLIOGRAPHY": "data/papers.toml",
    "CLAIMS": "data/claims",  # <paper>.csv: what the papers publish
    "SEEDS": "data/seeds.csv",  # the verdicts under other seeds
    "PRODUCTS": "figures",  # <paper>/fig05.pdf and its kin: the committed products
    "LOCK": "environment.txt",
    "README": "README.md",
    "CITATION": "CITATION.cff",
    "BUILD": "build",  # everything that is neither source nor product
}


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


def __getattr__(name):
    if name == "BUILD" and os.environ.get("TBDCORE_BUILD"):
        return Path(os.environ["TBDCORE_BUILD"]).resolve()
    if name in PLACES:
        return root() / PLACES[name]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def figures():
    """The folder of the committed products, or the one that TBDCORE_FIGURES names."""
    return Path(os.environ.get("TBDCORE_FIGURES") or root() / PLACES["PRODUCTS"]).resolve()


def writable(folder):
    """Whether files can be made in a folder, or in the one that it would be made in."""
    made = next(each for each in (folder, *folder.parents) if each.exists())
    return made.is_dir() and os.access(made, os.W_OK | os.X_OK)


def require_writable(*folders):
    """Raise OSError, naming the first of some folders in which no files can be made."""
    for folder in sorted(folders):
        if not writable(folder):
            raise OSError(f"{folder} cannot be written; work in a clone of your own")
