"""The cells of a notebook, run in this process: what a Jupyter kernel runs, without one, and with kernels compiled once.

What stands in cells tagged ``algorithm`` is taken from ``tbdcore.page``, whose compiled code is kept on disk.
"""

import symtable

import tbdcore
from tbdcore import pages


def run(paper, **parameters):
    """Run all code cells with some parameters; products go to the parameter `out`."""
    known, page, namespace = pages.cells(paper, "parameters")[0], tbdcore.page(paper), {"__name__": "cells"}
    algorithm = [cell for cell in pages.cells(paper, "algorithm") if cell != pages.cells(paper)[0]]
    for cell in pages.cells(paper):
        if cell in algorithm:
            namespace.update({name: getattr(page, name) for name in _defined(cell)})
        else:
            exec(compile(cell, f"{paper}, a cell", "exec"), namespace)
            namespace.update(parameters if cell == known else {})


def _defined(cell):
    """Names that a cell binds at its top level."""
    scope = symtable.symtable(cell, "a cell", "exec")
    return [symbol.get_name() for symbol in scope.get_symbols() if symbol.is_assigned() or symbol.is_imported()]
