"""Single claims of a chapter, judged by the cells that they need: the rest is not executed.

``needed`` finds these cells from the names that each one makes, changes and uses; ``verdicts``
executes them with other parameters, ``definitions`` those that make some names.  What only draws is
left out.
"""

import ast
import json
import symtable
from typing import NamedTuple

import nbformat
import papermill

from tbdcore.repro import pages, paths

CHANGES = ("append", "extend", "add", "update", "setdefault")
DRAWS = ("portfolio.save(", "portfolio.table(", "screen.outcome(")
SHOW = "print(__import__('json').dumps({i: ledger.verdicts[i]._asdict() for i in %r}))"
TABLES = {name: f"portfolio.{name}(" for name in ("methods", "limits")}
SHOW_TABLES = (
    "print(__import__('json').dumps({name: portfolio.files[name].decode() for name in %r}))"
)


class Names(NamedTuple):
    """The names that a cell makes, changes in place, and uses before it makes them."""

    made: set
    changed: set
    used: set


def names(source):
    """The names of a cell, those in the bodies of its functions among them."""
    tree, table = ast.parse(source), symtable.symtable(source, "cell", "exec")
    known = table.get_symbols()
    made = {it.get_name() for it in known if it.is_assigned() or it.is_imported()}
    made |= {it.get_name() for it in known if it.is_namespace()}
    first = {}  # whether a name is stored where it first stands; a line's right side comes first
    added = {id(node.target) for node in ast.walk(tree) if isinstance(node, ast.AugAssign)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            stored = isinstance(node.ctx, ast.Store) and id(node) not in added
            place = (node.lineno, stored, node.col_offset)
            first[node.id] = min(first.get(node.id, place), place)
    used = {it.get_name() for it in known if it.is_referenced()} - made
    used |= {name for name, (_, stored, _) in first.items() if not stored and name in made}
    return Names(made, {*map(_root, ast.walk(tree))} - made - {None}, used | _inner(table))


def _inner(table):
    """Names of the cell, or of others, that functions and comprehensions use."""
    found = set()
    for child in table.get_children():
        found |= {it.get_name() for it in child.get_symbols() if it.is_global()} | _inner(child)
    return found


def _root(node):
    """The name of what a part of the cell changes in place, or nothing."""
    if isinstance(node, ast.AugAssign):
        node = node.target
    elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") in CHANGES:
        node = node.func.value
    elif not (isinstance(node, ast.Subscript | ast.Attribute) and isinstance(node.ctx, ast.Store)):
        return None
    while isinstance(node, ast.Subscript | ast.Attribute):
        node = node.value
    return getattr(node, "id", None)


def needed(cells, ids, made=(), calls=()):
    """Indices of the code cells that judge the claims, make the names `made` or have the `calls`,
    and of those that make what these cells need.

    A name comes from the last cell before that makes it, and from those between that change it.
    """
    code = {i: cell.source for i, cell in enumerate(cells) if cell.cell_type == "code"}
    every = {i: names(source) for i, source in code.items()}
    draws = {i for i, source in code.items() if any(word in source for word in DRAWS)}
    words = [*(f'"{id}"' for id in ids), *calls]
    wanted = [i for i in code if i not in draws and any(word in code[i] for word in words)]
    wanted += [i for i in code if "parameters" in cells[i].metadata.get("tags", ())]
    wanted += [max(i for i in every if name in every[i].made) for name in made]
    found = set()
    while wanted:
        i = wanted.pop()
        if i in found:
            continue
        found.add(i)
        for name in every[i].used:
            makers = [j for j in every if name in every[j].made]
            last = max((j for j in makers if j < i), default=min(makers, default=i))
            between = (j for j in every if last < j < i and j not in draws)
            wanted += [last, *(j for j in between if name in every[j].changed)]
    return sorted(found)


def verdicts(paper, ids, **values):
    """The verdicts on some claims of a run with other parameters, as dicts, by claim."""
    cells = nbformat.read(pages.path(paper), 4).cells
    return _executed(paper, [cells[i] for i in needed(cells, ids)], SHOW % (list(ids),), values)


def tables(paper, **values):
    """The CSV files of methods and limits of a run with other parameters, as text, by name."""
    cells = nbformat.read(pages.path(paper), 4).cells
    source = "".join(cell.source for cell in cells if cell.cell_type == "code")
    names = [name for name, call in TABLES.items() if call in source]
    if not names:
        raise ValueError(f"{paper}: its page calls neither portfolio.methods nor portfolio.limits")
    found = needed(cells, (), calls=[TABLES[name] for name in names])
    show = SHOW_TABLES % ([f"{name}.csv" for name in names],)
    made = _executed(paper, [cells[i] for i in found], show, values)
    return {name: made[f"{name}.csv"] for name in names}


def _executed(paper, cells, show, values):
    """What a last cell prints as JSON after some cells of a page, with other parameters."""
    notebook = nbformat.read(pages.path(paper), 4)
    notebook.cells = [*cells, nbformat.v4.new_code_cell(show)]
    folder = paths.build() / "rows" / paper
    folder.mkdir(parents=True, exist_ok=True)
    source, made = folder / pages.path(paper).name, folder / "executed.ipynb"
    nbformat.write(notebook, source)
    values |= {"out": str(folder / "out")}
    papermill.execute_notebook(source, made, values, cwd=paths.notebooks(), progress_bar=False)
    (shown,) = nbformat.read(made, 4).cells[-1].outputs
    return json.loads(shown.text)


def sources(paper, made):
    """Sources of the cells of a page that make some names, with the cells that these need."""
    cells = nbformat.read(pages.path(paper), 4).cells
    return [cells[i].source for i in needed(cells, (), made)]


def definitions(paper, made):
    """Some names of a page by name, from the cells that make them, executed at the defaults."""
    namespace = {"__name__": "__main__"}  # so that workers get its functions by value
    for source in sources(paper, made):
        exec(source, namespace)
    portfolio = namespace.get("portfolio")
    if portfolio is not None and portfolio.artist:
        portfolio.artist.shutdown()
    return {name: namespace[name] for name in made}
