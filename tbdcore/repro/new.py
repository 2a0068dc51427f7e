"""A chapter to begin with: the example of docs/add_a_paper.md under a name of its own."""

import json
import re

from tbdcore.repro import claims, pages, paths, products

EXAMPLE = "square_law"


def files(paper):
    """The files of a new chapter, path -> text: claims, bibliography with its table, notebook.

    ValueError when the name is no key, or already that of a chapter or of its claims.
    """
    known = [*pages.notebooks(), *claims.papers()]
    if not re.fullmatch(r"[a-z][a-z0-9_]*", paper):
        raise ValueError(f"{paper!r}: no name of a paper; use small letters, digits, underscores")
    if paper in known or re.search(rf"(?m)^\[{paper}\]", paths.BIBLIOGRAPHY.read_text("utf-8")):
        raise ValueError(f"{paper}: there is such a chapter; choose another name")
    text = (paths.ROOT / "docs" / "add_a_paper.md").read_text(encoding="utf-8")
    text = re.sub(rf"\b{EXAMPLE}\b", paper, text)
    blocks = re.findall(r"^```(\w+) ?([\w-]*)\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    (rows,) = [block for kind, _, block in blocks if kind == "text"]
    (table,) = [block for kind, _, block in blocks if kind == "toml"]
    shown = [block for block in blocks if block[0] in ("python", "markdown")]
    shown = [(*block[:2], part) for block in shown for part in _parts(*block)]
    cells = [_cell(*block) for block in shown if block[1] != "declare"]
    cells = [cell | {"id": f"c{number:02d}"} for number, cell in enumerate(cells)]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook = {"cells": cells, "metadata": {"kernelspec": kernel}}
    notebook |= {"nbformat": 4, "nbformat_minor": 5}
    number = 1 + max(int(pages.path(page).stem[:2]) for page in pages.notebooks())
    return {
        paths.CLAIMS / f"{paper}.csv": rows,
        paths.BIBLIOGRAPHY: f"{paths.BIBLIOGRAPHY.read_text('utf-8').rstrip()}\n\n{table}",
        paths.NOTEBOOKS / f"{number:02d}_{paper}.ipynb": json.dumps(notebook, indent=1) + "\n",
    }


def _parts(kind, tag, text):
    """The cells of a block: each section of a text begins one."""
    return re.split(r"(?m)^(?=##? )", text.lstrip())[1:] if kind == "markdown" else [text]


def _cell(kind, tag, text):
    """A cell of a notebook; what is folded in the book is so in JupyterLab."""
    about = {"tags": [tag]} if tag else {}
    about |= {"jupyter": {"source_hidden": True}} if tag == "hide-input" else {}
    lines = text.rstrip().splitlines(keepends=True)
    if kind == "markdown":
        return {"cell_type": "markdown", "metadata": about, "source": lines}
    empty = {"execution_count": None, "outputs": []}
    return {"cell_type": "code", "metadata": about, "source": lines} | empty


def create(paper):
    """Write the files of a new chapter; returns them."""
    made = files(paper)
    for path, text in made.items():
        products.write(path.parent, {path.name: text.encode()})
    return list(made)
