"""The same digits from one worker and from five, from a dask cluster, and from a second run.

Trials of all five papers by the algorithm cells of their notebooks, to the last bit.  Whole
notebooks are compared in ``quick_products.py``.
"""

import numpy as np
import page_trials
import pytest

from tbdcore.repro import trials


@pytest.fixture(scope="module")
def few():
    """Results of five trials of each paper, in this process."""
    return {paper: page_trials.results(paper, 5, workers=1) for paper in page_trials.TRIALS}


def unequal(one, other):
    """Positions of the fields whose bits differ."""
    return [
        i
        for i, (a, b) in enumerate(zip(one, other, strict=True))
        if a.shape != b.shape or a.tobytes() != b.tobytes()
    ]


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
    options = {
        "n_workers": 2,
        "threads_per_worker": 1,
        "processes": False,
        "protocol": "tcp",
        "host": "127.0.0.1",
        "dashboard_address": "127.0.0.1:0",
    }
    with distributed.LocalCluster(**options) as cluster:
        for paper, alone in few.items():
            assert (
                unequal(alone, page_trials.results(paper, 5, scheduler=cluster.scheduler_address))
                == []
            ), paper


def test_a_stream_is_the_same_on_every_machine():
    """NumPy promises these bits for ever."""
    first = trials.generator(20, "doctor", "self-test", 0, "noise").bit_generator.random_raw()
    assert first == np.uint64(0x052D27BA31D1AF10)
