"""Whole notebooks with a few trials, by other workers and on another kind of CPU.

The reference is build/quick, which the processes of this machine made, one for each core.  One
notebook is run by one process: its products must have the same bytes.  All notebooks are run by a
dask cluster of five workers on another kind of CPU: the same bytes too, but that in a
PNG one value of ten thousand may be one step of colour off.  The other CPU is the least that there
is (``other_cpu``), with kernels of its own; the last bit of a sum may differ there, and what is
written must not.  `make verify` runs this file by its name after ``tbdcore run --quick``; pytest
does not collect it otherwise.
"""

import csv
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import other_cpu
import pandas as pd
import pytest
from matplotlib import image

from tbdcore.repro import claims, pages, paths

CACHE = paths.build() / "other_cpu"
CLUSTER = """
from distributed import LocalCluster

where = {"protocol": "tcp", "host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}
with LocalCluster(n_workers=5, threads_per_worker=1, processes=False, **where) as cluster:
    print(cluster.scheduler_address, flush=True)
    input()
"""


@pytest.fixture(scope="module")
def elsewhere():
    """Environment of the processes of the other CPU; their compiler's cache outlives the tests, as
    the machine's own does.
    """
    return other_cpu.environment(CACHE)


@pytest.fixture(scope="module")
def scheduler(elsewhere):
    """Address of a cluster in a process of its own."""
    pytest.importorskip("distributed")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(
        [sys.executable, "-c", CLUSTER], text=True, env=elsewhere, **pipes
    ) as process:
        yield process.stdout.readline().strip()
        process.kill()


def alike(one, other):
    """Whether two pictures differ by no more than one step of 8-bit colour, in no more than one
    value of ten thousand.
    """
    one, other = (np.round(255 * image.imread(file)).astype(int) for file in (one, other))
    return (
        one.shape == other.shape
        and np.abs(one - other).max() <= 1
        and np.mean(one != other) <= 1e-4
    )


def contents(folder):
    """Content of all products in a folder by name."""
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_the_number_of_workers_changes_no_byte(tmp_path):
    """Here one; five are in the next test."""
    words = ["run", "track_cfar", "--quick", "--workers", "1", "--out", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "tbdcore", *words], check=True)
    here, there = (
        contents(paths.build() / "quick" / "track_cfar"),
        contents(tmp_path / "track_cfar"),
    )
    assert here.keys() == there.keys()
    assert [name for name in here if here[name] != there[name]] == []


@pytest.mark.parametrize("paper", [name for name in pages.notebooks() if name != "index"])
def test_a_cluster_of_another_cpu_makes_the_same_products(paper, elsewhere, scheduler, tmp_path):
    words = ["run", paper, "--quick", "--scheduler", scheduler, "--out", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "tbdcore", *words], check=True, env=elsewhere)
    here, there = (
        {file.name: file for file in folder.iterdir()}
        for folder in (paths.build() / "quick" / paper, tmp_path / paper)
    )
    assert here.keys() == there.keys()
    assert len([name for name in here if name.endswith(".csv")]) > 5
    assert list(CACHE.rglob("*.nbi")), "no kernel was compiled for the other CPU"
    changed = [name for name in here if here[name].read_bytes() != there[name].read_bytes()]
    assert [
        name for name in changed if not (name.endswith(".png") and alike(here[name], there[name]))
    ] == []


def other_value(claim, rng):
    """A published value that is drawn at random: digits by digits, words by their letters."""
    if claim.kind == "input" or claim.value == "N/A":
        return claim.value
    if claim.kind in ("number", "bound"):
        return re.sub(r"(?<!10\^)[1-9](?!0?\^)", lambda _: str(rng.integers(1, 10)), claim.value)
    return f"x{''.join(rng.permutation(list(claim.value)))}x"


ON_PRINTS = ("t24.same", "f5.power.saving")  # rules that are arithmetic of printed numbers


@pytest.fixture(scope="module")
def blind(tmp_path_factory):
    """A repository in which all published values but the inputs are other ones."""
    folder, rng = tmp_path_factory.mktemp("blind"), np.random.default_rng(20)
    for name in ("notebooks", "data"):
        shutil.copytree(paths.root() / name, folder / name)
    for name in ("README.md", "CITATION.cff", "environment.txt", "pyproject.toml"):
        shutil.copy(paths.root() / name, folder / name)
    (folder / "build").mkdir()
    (folder / "build" / "pages").symlink_to(paths.build() / "pages")  # the compiled kernels
    for paper in pages.papers():
        known = claims.read(paper).values()
        rows = [claim._replace(value=other_value(claim, rng)) for claim in known]
        changed = [a.value != b.value for a, b in zip(rows, known, strict=True) if a.rule]
        assert np.mean(changed) > 0.8
        with open(folder / "data" / "claims" / f"{paper}.csv", "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([claims.Claim._fields, *rows])
    return folder


@pytest.mark.parametrize("paper", pages.papers())
def test_what_a_chapter_measures_does_not_depend_on_what_is_published(paper, blind, tmp_path):
    words = ["run", paper, "--quick", "--out", str(tmp_path)]
    where = os.environ | {"TBDCORE_REPOSITORY": str(blind)}
    subprocess.run([sys.executable, "-m", "tbdcore.repro.cli", *words], check=True, env=where)
    quick, other = (
        pd.read_csv(
            folder / paper / "verdicts.csv", dtype=str, keep_default_na=False, index_col="id"
        )
        for folder in (paths.build() / "quick", tmp_path)
    )
    assert (quick["published"] != other["published"]).mean() > 0.3
    columns = ["measured", "se", "n"]
    differ = (quick[columns] != other[columns]).any(axis=1)
    assert set(differ[differ].index) <= set(ON_PRINTS)
