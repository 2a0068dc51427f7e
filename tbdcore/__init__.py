"""The numerical core of five reproduced radar papers.

A notebook under ``notebooks/`` derives one paper and shows its algorithm.  Textbook formulas,
compiled loops and what two notebooks share are here: ``motion`` ``sensor`` ``detection``
``particles`` ``kalman`` ``association`` ``dynprog`` ``score``, and ``checks`` for their arguments.
They need numpy, scipy and numba; ``begin`` and ``page`` load the harness, ``tbdcore.repro``.

``kernel`` decorates every compiled loop: Numba's ``njit`` with a disk cache and NumPy's division.
No ``fastmath``, no threads: a sum has the same bits for every number of workers, and on another
kind of CPU differs in the last ones at most.
"""

__version__ = "1.0.0"


def kernel(function):
    """Compile a function.  No disk cache in a notebook: it would not see that a callee changed."""
    from numba import njit

    cache = function.__module__ != "__main__"
    return njit(cache=cache, error_model="numpy")(function)


def begin(paper, namespace):
    """Open the run of a notebook; see :func:`tbdcore.repro.run.begin`."""
    _pages()
    from tbdcore.repro import run

    return run.begin(paper, namespace)


def page(paper):
    """The algorithm cells of a notebook as a module; see :func:`tbdcore.repro.pages.page`."""
    return _pages().page(paper)


def _pages():
    """The harness, loaded when it is asked for: it needs the repository and the extra repro."""
    from tbdcore.repro import paths

    paths.root()
    try:
        import tbdcore.repro.pages as pages
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error.name} is missing; this needs the extra repro: pip install 'tbdcore[repro]'"
        ) from None
    return pages
