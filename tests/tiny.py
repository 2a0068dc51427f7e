"""A repository with one small notebook and a copy of the package, for tests that execute, interrupt
and resume.

Each copy is a folder of its own: nothing that happens there can touch the real notebooks, figures
or build folder.
"""

import csv
import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from tbdcore.repro import changes, claims, paths

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = paths.PACKAGE  # the one that is imported, which may be a copy itself
CLAIMS = """id,item,quantity,conditions,value,unit,kind,where,rule,evidence,cause
mean,Table 1,mean of the draws,,0.0,,number,Sec. 1,Mean of all draws; runs = 100,measured,
order,text,shifted draws are larger,,larger,,ordering,Sec. 1,Shift of the draws,measured,
price,text,price,,cheap,,statement,Sec. 1,,,
"""
PAPERS = """[tiny]
title = "On the mean of some draws"
authors = []
short = "the tiny paper"
topic = "Means"
"""
CELLS = {
    "algorithm": """import time
from functools import partial

import tbdcore
from tbdcore.repro import trials""",
    "parameters": """seed: int = 20  # root of every random stream; in [0, inf)
n_trials: int = 400  # draws; in [1, inf); quick 40
workers: int = 1  # processes; in [0, inf)
scheduler: str = ""  # address of a dask scheduler
out: str = ""  # folder for products
pause: float = 0.0  # seconds that each trial sleeps; in [0, 60]
shift: float = 1.0  # shift of the draws; in [-5, 5]""",
    "begin": 'ledger, portfolio = tbdcore.begin("tiny", vars())',
    "trials": """def draw(seed, i, pause):
    time.sleep(pause)
    return trials.generator(seed, "tiny", "draw", i, "noise").standard_normal()


where = {"workers": workers, "scheduler": scheduler}
x = trials.run(partial(draw, pause=pause), n_trials, seed=seed, **where)""",
    "claims": """ledger.check("mean", x.mean(), se=x.std() / n_trials**0.5, n=n_trials)
ledger.check("order", shift, se=x.std() / n_trials**0.5, n=n_trials)
ledger.untestable("price", "An opinion.")""",
    "figure": """fig, ax = portfolio.new(width=2, height=1.5)
portfolio.band(ax, range(9), x[:9], name="proposed")
portfolio.save(fig, "fig1", caption="Nine draws, 100 % of them.", claims=["mean"])""",
    "table": """import pandas as pd

frame = pd.DataFrame({"draw": x[:3]})
portfolio.table(frame, "table1", caption="Three draws.", claims=["order"])""",
    "publish": "ledger.table()\nportfolio.publish(ledger)",
}


def notebook(cells):
    """A notebook with these cells, their names as tags."""
    code = [
        {
            "cell_type": "code",
            "execution_count": None,
            "id": name,
            "metadata": {"tags": [name]},
            "outputs": [],
            "source": source,
        }
        for name, source in cells.items()
    ]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return json.dumps(
        {"cells": code, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    )


def copy_package(folder):
    """The package, with the compiled code that belongs to it, in another folder."""
    shutil.copytree(PACKAGE, folder / "tbdcore", ignore=shutil.ignore_patterns("*.pyc"))


def repository(folder):
    """The small repository in a folder; returns a function that runs ``tbdcore`` there."""
    copy_package(folder)
    write(folder)
    return lambda *words: run(folder, *words)


def run(folder, *words):
    """A command in a small repository, in a process of its own."""
    return subprocess.run(
        command(*words), cwd=folder, env=environment(folder), capture_output=True, text=True
    )


def change(folder, **cells):
    """Give the notebook of a small repository some other cells; None leaves one out."""
    changed = {name: text for name, text in (CELLS | cells).items() if text is not None}
    (folder / "notebooks" / "01_tiny.ipynb").write_text(notebook(changed), encoding="utf-8")


def products(folder):
    """Every product of a small repository, its bytes and its time."""
    return {
        str(file.relative_to(folder)): (file.read_bytes(), file.stat().st_mtime_ns)
        for file in sorted((folder / "figures").rglob("*"))
        if file.is_file()
    }


def write(folder):
    """Everything of it but the package."""
    (folder / "data" / "claims").mkdir(parents=True)
    (folder / "notebooks").mkdir()
    (folder / "data" / "claims" / "tiny.csv").write_text(CLAIMS, encoding="utf-8")
    (folder / "data" / "claims" / "declared.csv").write_text(declared(CLAIMS), encoding="utf-8")
    (folder / "data" / "papers.toml").write_text(PAPERS, encoding="utf-8")
    (folder / "notebooks" / "01_tiny.ipynb").write_text(notebook(CELLS), encoding="utf-8")
    for name in ("CITATION.cff", "environment.txt", "pyproject.toml"):
        shutil.copy(ROOT / name, folder / name)
    marks = "".join(f"<!-- {name} -->\n<!-- /{name} -->\n" for name in ("papers", "scorecard"))
    (folder / "README.md").write_text(marks, encoding="utf-8")


def declared(text):
    """The declarations of the rules and printed values of a claims file `tiny`."""
    rows = [claims.Claim(*row) for row in list(csv.reader(io.StringIO(text)))[1:]]
    lines = [f"tiny,{row.id},{claims.rule_digest(row.rule)},{row.value}\n" for row in rows]
    return f"{','.join(changes.Declared._fields)}\n{''.join(lines)}"


def here(folder, monkeypatch):
    """The small repository as that of this process.

    Returns a function that runs its notebook's cells with given parameters.
    """
    write(folder)
    monkeypatch.setenv("TBDCORE_REPOSITORY", str(folder))
    monkeypatch.delenv("TBDCORE_FIGURES", raising=False)
    monkeypatch.chdir(folder)

    def execute(**given):
        namespace = {}
        for name, source in CELLS.items():
            exec(source, namespace)
            namespace.update(given if name == "parameters" else {})

    return execute


def command(*words):
    return [sys.executable, "-m", "tbdcore", *words]


def environment(folder):
    """The environment in which a folder is the repository, and its copy of the package, if it has
    one, is found before the installed one.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("TBDCORE_")}
    return kept | {"PYTHONPATH": str(folder), "TBDCORE_REPOSITORY": str(folder)}
