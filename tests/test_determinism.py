"""The same digits from one worker and from five, from a dask cluster, from a second run, and from another kind of CPU.

All of it on the cells of a real notebook with few trials: every figure, every table and every verdict of the paper.
"""

import os
import subprocess
import sys
from pathlib import Path

import notebook_cells
import numpy as np
import pytest

PAPER = "track_cfar"
FEW = {"n_trials": 60}


def files(folder, *kinds):
    """Content of the products in a folder by name, of some kinds or all."""
    found = sorted((folder / PAPER).iterdir())
    return {file.name: file.read_bytes() for file in found if not kinds or file.suffix[1:] in kinds}


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The products of one process."""
    folder = tmp_path_factory.mktemp("alone")
    notebook_cells.run(PAPER, out=str(folder), workers=1, **FEW)
    assert len(files(folder, "csv")) > 10
    assert len(files(folder, "pdf")) > 5
    return folder


def same(one, other):
    """The names of the files that differ."""
    assert set(one) == set(other)
    return [name for name in one if one[name] != other[name]]


@pytest.mark.parametrize("workers", [2, 5])
def test_workers_and_a_second_run_change_no_byte(alone, tmp_path, workers):
    """Pictures included: this is a second run."""
    notebook_cells.run(PAPER, out=str(tmp_path), workers=workers, **FEW)
    assert same(files(alone), files(tmp_path)) == []


def test_a_dask_cluster_changes_no_byte(alone, tmp_path):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "protocol": "tcp", "host": "127.0.0.1"}
    with distributed.LocalCluster(**options, dashboard_address=None) as cluster:
        notebook_cells.run(PAPER, out=str(tmp_path), scheduler=cluster.scheduler_address, **FEW)
    assert same(files(alone), files(tmp_path)) == []


def features():
    """What NumPy would use of this machine beyond the least that it was built for: AVX2, AVX-512 where there is one."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]


def test_another_kind_of_cpu_changes_no_data_and_no_verdict(alone, tmp_path):
    """Kernels compiled for the least processor, and NumPy without any of the newer instructions of this machine."""
    other = {
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "NPY_DISABLE_CPU_FEATURES": " ".join(features()),
    }
    script = [sys.executable, str(Path(notebook_cells.__file__)), PAPER, "workers=1", f"out={tmp_path / 'out'}"]
    script += [f"{name}={value}" for name, value in FEW.items()]
    subprocess.run(script, env=os.environ | other, check=True, capture_output=True, timeout=600)
    assert list((tmp_path / "cache").rglob("*.nbi")), "the kernels were compiled for this setting"
    assert same(files(alone, "csv", "md", "tex"), files(tmp_path / "out", "csv", "md", "tex")) == []


def test_a_stream_is_the_same_on_every_machine():
    """NumPy promises these bits for ever."""
    from tbdcore import trials

    first = trials.generator(20, "doctor", "self-test", 0, "noise").bit_generator.random_raw()
    assert first == np.uint64(0x052D27BA31D1AF10)
