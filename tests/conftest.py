"""A throw-away repository for the tests of the harness: one small paper, its claims, its notebook.

Tests in this process use it through ``tbdcore.paths``, which is pointed there; notebooks run in a process of their own, so the
folder also holds a copy of the package, which ``Repository.run`` puts first on the path.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tbdcore import paths

COMMON = """seed: int = 20  # root of every random stream; in [0, inf)
n_trials: int = 400  # Monte Carlo trials; in [1, inf); quick 40
workers: int = 1  # processes, 0 for one per core; in [0, inf)
scheduler: str = ""  # address of a dask scheduler, empty for this machine
out: str = ""  # folder for products, empty for the repository's figures/
level: float = 1.5  # mean of the noise; in (0, 10)
powers: list = [1, 2]  # exponents; in [0, 9]
mode: str = "plain"  # what goes wrong; one of "plain", "raise", "late", "sleep"
loud: bool = False  # nothing depends on it"""

CELLS = [  # (tag, source)
    (
        "algorithm",
        "import time\nfrom dataclasses import dataclass\nfrom pathlib import Path\n\nimport numpy as np\nimport pandas as pd\n\n"
        "import tbdcore\nfrom tbdcore import trials\nfrom tbdcore.claims import given",
    ),
    ("parameters", COMMON),
    ("", 'claims, figures = tbdcore.begin("toy", vars())'),
    (
        "algorithm",
        '@dataclass(frozen=True)\nclass Scenario:\n    level: float = given(1.5, "a", "m", "in.level")\n\n\n'
        'def trial(seed, i):\n    return trials.generator(seed, "toy", "mean", i, "noise").normal(1.5, 0.01)\n\n\n'
        "def slow(seed, i):\n    time.sleep(60)\n    return 0.0",
    ),
    (
        "",
        'if mode == "raise":\n    raise RuntimeError("planted\\nfailure")\nif mode == "sleep":\n    Path("started").touch()\n'
        "    trials.run(slow, 4, seed=seed, workers=2)",
    ),
    (
        "",
        "z = trials.run(trial, n_trials, seed=seed, workers=workers, scheduler=scheduler)\nclaims.inputs(Scenario(level))\n"
        'claims.check("mean", z.mean(), se=z.std() / len(z) ** 0.5, n=len(z), paper_n=100)',
    ),
    (
        "",
        "fig, ax = figures.new()\nfigures.band(ax, [0, 1], [level, z.mean()], [0, 0.1])\n"
        'figures.save(fig, "fig01", caption="A mean.")\n'
        'figures.table(pd.DataFrame({"mean": [z.mean()]}), "table1", caption="The same.")',
    ),
    ("", 'if mode == "late":\n    claims.verdicts.clear()\nfigures.publish(claims)'),
]

CLAIMS = """id,item,quantity,conditions,value,unit,kind,where,cause
in.level,Sec. 1,level,,1.5,m,input,Sec. 1,
mean,Fig. 1,mean of the noise,,1.50,m,number,Sec. 2,
"""


class Repository(NamedTuple):
    root: Path

    def run(self, *words, **more):
        """`tbdcore` with some arguments, in a process of its own that sees this repository only."""
        return subprocess.run(self.command(words), env=self.environment(), cwd=self.root, capture_output=True, text=True, **more)

    def command(self, words):
        return [sys.executable, "-m", "tbdcore.cli", *map(str, words)]

    def environment(self):
        kept = {name: value for name, value in os.environ.items() if name != "TBDCORE_FIGURES"}
        return {**kept, "PYTHONPATH": str(self.root)}

    def figures(self):
        """Every file under figures/, with its bytes."""
        return {path: path.read_bytes() for path in sorted((self.root / "figures").rglob("*")) if path.is_file()}

    def leftovers(self):
        """Files that a broken run must not leave."""
        return [
            path for path in self.root.rglob("*") if path.name.endswith(".part") or ".part." in path.name or ".probe" in path.name
        ]

    def write_notebook(self, cells):
        (self.root / "notebooks" / "01_toy.ipynb").write_text(notebook(cells), encoding="utf-8")


def notebook(cells):
    """A notebook file of (tag, source) code cells."""
    made = [
        {
            "cell_type": "code",
            "id": f"cell{i}",
            "execution_count": None,
            "metadata": {"tags": [tag]} if tag else {},
            "outputs": [],
            "source": source,
        }
        for i, (tag, source) in enumerate(cells)
    ]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return json.dumps({"cells": made, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5})


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """The throw-away repository; `tbdcore.paths` points to it."""
    root = tmp_path / "repository"
    for folder in ("notebooks", "data/claims", "figures"):
        (root / folder).mkdir(parents=True)
    shutil.copytree(paths.PACKAGE, root / "tbdcore", ignore=shutil.ignore_patterns("__pycache__"))
    made = Repository(root)
    made.write_notebook(CELLS)
    (root / "data" / "claims" / "toy.csv").write_text(CLAIMS)
    (root / "data" / "papers.toml").write_text('[toy]\ntopic = "Toys"\nshort = "Nobody (2000)"\nrun_time = "1 s"\n')
    (root / "README.md").write_text("# Toys\n\n<!-- scorecard -->\nold\n<!-- /scorecard -->\n\nThe end.\n")
    places = {"NOTEBOOKS": "notebooks", "DATA": "data", "CLAIMS": "data/claims", "BUILD": "build", "README": "README.md"}
    for name, place in places.items():
        monkeypatch.setattr(paths, name, root / place)
    monkeypatch.setattr(paths, "ROOT", root)
    monkeypatch.setattr(paths, "PACKAGE", root / "tbdcore")
    monkeypatch.delenv("TBDCORE_FIGURES", raising=False)
    return made
