"""The numerical core of five reproduced radar papers.

A notebook under ``notebooks/`` derives one paper and shows its algorithm.  What two papers use is
in the modules here, such as ``motion``, ``kalman``, ``detection`` and ``particles``, and ``checks``
for their arguments.  The compiled loops of one paper are in ``kernels``, a module a paper, and what
one's own data need in ``recording``.  All need numpy, scipy and numba; ``begin`` and ``page`` load
the harness, ``tbdcore.repro``.

``kernel`` decorates every compiled loop: Numba's ``njit`` with a disk cache and NumPy's division.
No ``fastmath``, no threads: a sum has the same bits for every number of workers, and on another
kind of CPU differs in the last ones at most.
"""

from importlib import import_module
from pkgutil import iter_modules

from tbdcore.jit import kernel

__version__ = "4.0.0"
_MODULES = [it.name for it in iter_modules(__path__) if it.name[0] != "_" and it.name != "repro"]
__all__ = ["begin", "kernel", "page", *_MODULES]


def __getattr__(name):
    """A module of the core, loaded when it is first asked for."""
    if name in _MODULES:
        return import_module(f"tbdcore.{name}")
    raise AttributeError(f"module 'tbdcore' has no attribute {name!r}")


def __dir__():
    return sorted(__all__)


def begin(paper, namespace):
    """Open the run of a notebook; see :func:`tbdcore.repro.publish.begin`."""
    _needs_repository()
    from tbdcore.repro import publish

    return publish.begin(paper, namespace)


def page(paper):
    """The algorithm cells of a notebook as a module; see :func:`tbdcore.repro.pages.page`."""
    _needs_repository()
    from tbdcore.repro import pages

    return pages.page(paper)


def _needs_repository():
    """Say, in one line, that the repository or the extra repro is missing."""
    from tbdcore.repro import paths

    paths.root()
    try:
        import tbdcore.repro.pages  # noqa: F401
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error.name} is missing; this needs the extra repro: pip install 'tbdcore[repro]'"
        ) from None
