"""Every notebook again, by a dask cluster of two workers: the bytes that one process left in build/quick.

Run by ``.ci/test`` after ``tbdcore run --quick``, whose products it compares; not collected with the other tests.
"""

import subprocess
import sys

import pytest

from tbdcore import pages, paths

CLUSTER = """
from distributed import LocalCluster

options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "protocol": "tcp", "host": "127.0.0.1"}
with LocalCluster(**options, dashboard_address=None) as cluster:
    print(cluster.scheduler_address, flush=True)
    input()
"""


@pytest.fixture(scope="module")
def scheduler():
    """Address of a cluster in a process of its own."""
    pytest.importorskip("distributed")
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, "-c", CLUSTER], text=True, **pipes) as process:
        yield process.stdout.readline().strip()
        process.kill()


def products(folder):
    """Content of the files in a folder by name."""
    return {file.name: file.read_bytes() for file in sorted(folder.iterdir())}


@pytest.mark.parametrize("paper", pages.papers())
def test_a_cluster_gives_the_bytes_of_one_process(paper, scheduler, tmp_path):
    words = ["run", paper, "--quick", "--scheduler", scheduler, "--out", str(tmp_path)]
    subprocess.run([sys.executable, "-m", "tbdcore.cli", *words], check=True)
    alone, cluster = products(paths.BUILD / "quick" / paper), products(tmp_path / paper)
    assert alone.keys() == cluster.keys()
    assert [name for name in alone if alone[name] != cluster[name]] == []
    assert len([name for name in alone if name.endswith(".csv")]) > 5
