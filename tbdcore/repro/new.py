"""A chapter to begin with: the example of docs/add_a_paper.md under a name of its own."""

import json
import re

from tbdcore.repro import claims, pages, paths, products

EXAMPLE = "square_law"


def files(paper):
    """The files of a new chapter, path -> text: claims, bibliography with its table, notebook.

    ValueError when the name is no key, or already that of a chapter or of its claims.
    """
    chapters = [*pages.notebooks(), *claims.papers()]
    if not re.fullmatch(r"[a-z][a-z0-9_]*", paper):
        raise ValueError(f"{paper!r}: no name of a paper; use small letters, digits, underscores")
    bibliography = paths.bibliography().read_text(encoding="utf-8")
    if paper in chapters or re.search(rf"(?m)^\[{paper}\]", bibliography):
        raise ValueError(f"{paper}: there is such a chapter; choose another name")
    text = (paths.root() / "docs" / "add_a_paper.md").read_text(encoding="utf-8")
    text = re.sub(rf"\b{EXAMPLE}\b", paper, text)
    blocks = re.findall(r"^```(\w+) ?([\w-]*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    (rows,) = [block for kind, _, block in blocks if kind == "text"]
    (table,) = [block for kind, _, block in blocks if kind == "toml"]
    cells = []
    for kind, tag, block in blocks:
        if kind == "markdown":  # each section begins a cell
            cells += [_cell(kind, tag, part) for part in re.split(r"(?m)^(?=##? )", block)[1:]]
        elif kind == "python" and tag != "declare":
            cells.append(_cell(kind, tag, block))
    cells = [cell | {"id": f"c{number:02d}"} for number, cell in enumerate(cells)]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    about = {"metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    notebook = {"cells": cells} | about
    number = 1 + max(int(pages.path(page).stem[:2]) for page in pages.notebooks())
    return {
        paths.claims() / f"{paper}.csv": rows,
        paths.bibliography(): f"{bibliography.rstrip()}\n\n{table}",
        paths.notebooks() / f"{number:02d}_{paper}.ipynb": json.dumps(notebook, indent=1) + "\n",
    }


def _cell(kind, tag, text):
    """A cell of a notebook; what is folded in the book is so in JupyterLab."""
    about = {"jupyter": {"source_hidden": True}} if tag == "hide-input" else {}
    about |= {"tags": [tag]} if tag else {}
    cell = {"metadata": about, "source": text.rstrip().splitlines(keepends=True)}
    if kind == "markdown":
        return {"cell_type": "markdown"} | cell
    return {"cell_type": "code"} | cell | {"execution_count": None, "outputs": []}


def create(paper):
    """Write the files of a new chapter; returns them."""
    made = files(paper)
    paths.require_writable(*{path.parent for path in made})
    for path, text in made.items():
        products.write(path.parent, {path.name: text.encode()})
    return list(made)
