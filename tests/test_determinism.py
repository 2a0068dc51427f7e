"""The same digits from one worker and from five, from a dask cluster, from a second run, and from another kind of CPU.

Trials of all five papers by the algorithm cells of their notebooks, and all data, tables and verdicts of one whole notebook.
The processes of the other CPU compile every kernel anew; they start first and work beside the rest.
"""

import os
import subprocess
import sys
from pathlib import Path

import notebook_cells
import numpy as np
import page_trials
import pytest

from tbdcore import trials

PAPER = "track_cfar"
FEW = {"n_trials": 60}
HERE = Path(__file__).parent


def features():
    """What NumPy would use of this machine beyond the least that it was built for: AVX2, AVX-512 where there is one."""
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]


@pytest.fixture(scope="module", autouse=True)
def elsewhere(tmp_path_factory):
    """Two processes for the least processor there is: Numba's kernels, NumPy's loops, and BLAS products; and their folder.

    One runs the whole notebook, then trials; each has a compiler's cache of its own, so that this machine's stays as it is.
    """
    folder = tmp_path_factory.mktemp("elsewhere")
    least = {"NUMBA_CPU_NAME": "generic", "NPY_DISABLE_CPU_FEATURES": " ".join(features()), "OPENBLAS_CORETYPE": "Prescott"}
    words = [PAPER, "workers=1", f"out={folder / 'out'}", *(f"{name}={value}" for name, value in FEW.items())]
    first = [[HERE / "notebook_cells.py", *words], [HERE / "page_trials.py", PAPER, "dp_tbd", "mm_pf_tbd"]]
    second = [[HERE / "page_trials.py", "ljipda_ai", "mda_tbd"]]
    running = []
    for name, scripts in (("first", first), ("second", second)):
        line = " && ".join(subprocess.list2cmdline([sys.executable, *map(str, words)]) for words in scripts)
        with (folder / name).open("w") as out:
            env = os.environ | least | {"NUMBA_CACHE_DIR": str(folder / f"{name}.cache")}
            running.append(subprocess.Popen(line, shell=True, env=env, stdout=out, stderr=subprocess.PIPE, text=True))
    yield folder, running
    for process in running:
        process.kill()


def arrived(elsewhere):
    """The folder of the other CPU, when its processes have ended well."""
    folder, running = elsewhere
    for process in running:
        complaint = process.communicate(timeout=600)[1] if not process.stderr.closed else ""
        assert process.returncode == 0, complaint
    return folder


# Trials of every paper -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def few():
    """Results of five trials of each paper, in this process."""
    return {paper: page_trials.results(paper, 5, workers=1) for paper in page_trials.TRIALS}


def unequal(one, other):
    """Positions of the fields whose bits differ."""
    return [i for i, (a, b) in enumerate(zip(one, other, strict=True)) if a.shape != b.shape or a.tobytes() != b.tobytes()]


@pytest.mark.parametrize("workers", [2, 5])
def test_workers_change_no_bit_of_any_paper(few, workers):
    for paper, alone in few.items():
        assert unequal(alone, page_trials.results(paper, 5, workers=workers)) == [], paper


def test_a_single_trial_run_again_alone_has_the_same_bits(few):
    for paper, trial in page_trials.TRIALS.items():
        again = [np.asarray(field) for field in trial(page_trials.SEED, 3)]
        assert unequal([field[3] for field in few[paper]], again) == [], paper


def test_a_dask_cluster_changes_no_bit_of_any_paper(few):
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "protocol": "tcp", "host": "127.0.0.1"}
    with distributed.LocalCluster(**options, dashboard_address=None) as cluster:
        for paper, alone in few.items():
            assert unequal(alone, page_trials.results(paper, 5, scheduler=cluster.scheduler_address)) == [], paper


# A whole notebook ------------------------------------------------------------------------------------------------------


def files(folder, *kinds):
    """Content of the products in a folder by name, of some kinds or all."""
    found = sorted((folder / PAPER).iterdir())
    return {file.name: file.read_bytes() for file in found if not kinds or file.suffix[1:] in kinds}


@pytest.fixture(scope="module")
def crowd(tmp_path_factory):
    """The products of five processes; the other CPU's are those of one."""
    folder = tmp_path_factory.mktemp("crowd")
    notebook_cells.run(PAPER, out=str(folder), workers=5, **FEW)
    assert len(files(folder, "csv")) > 10
    return folder


def same(one, other):
    """The names of the files that differ."""
    assert set(one) == set(other)
    return [name for name in one if one[name] != other[name]]


# Another kind of CPU ---------------------------------------------------------------------------------------------------


def test_another_kind_of_cpu_changes_no_written_digit_of_any_paper(few, elsewhere):
    folder = arrived(elsewhere)
    words = [line.split() for name in ("first", "second") for line in (folder / name).read_text().splitlines()]
    other = {line[0]: line[1:] for line in words if line and line[0] in few}
    assert set(other) == set(few)
    for paper, result in few.items():
        here = page_trials.written(field[:2] for field in result).split()
        assert [(a, b) for a, b in zip(here, other[paper], strict=True) if a != b] == [], paper


def test_one_worker_on_another_kind_of_cpu_changes_no_data_no_table_and_no_verdict(crowd, elsewhere):
    folder = arrived(elsewhere)
    assert list((folder / "first.cache").rglob("*.nbi")), "the kernels were compiled for this setting"
    assert same(files(crowd, "csv", "md", "tex"), files(folder / "out", "csv", "md", "tex")) == []


def test_a_stream_is_the_same_on_every_machine():
    """NumPy promises these bits for ever."""
    first = trials.generator(20, "doctor", "self-test", 0, "noise").bit_generator.random_raw()
    assert first == np.uint64(0x052D27BA31D1AF10)
