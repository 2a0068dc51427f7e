"""Monte Carlo: the same bits whoever computes them, and errors that say which trial."""

import contextlib
import itertools
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest
import tiny

from tbdcore import detection
from tbdcore.repro import cli, trials

GONE = "def sources(code, words):\n    os._exit(1)\n\n\ndef rest():"
DETECTS = (
    tiny.CELLS["algorithm"]
    + """

from tbdcore import detection

power = detection.from_db(3.0)"""
)
N = 37  # a prime: chunks of every executor end unevenly


class Result(NamedTuple):
    mean: float
    walk: np.ndarray


def walk(seed, i):
    """A trial with an array, a scalar, and all three streams."""
    truth, noise, draws = (
        trials.generator(seed, "toy", "walk", i, purpose)
        for purpose in ("truth", "noise", "filter")
    )
    steps = truth.normal(size=5).cumsum() + noise.normal(size=5)
    return Result(steps.mean() + draws.random(), steps)


def detects():
    """A trial that is pickled with its code, as one of a notebook is."""
    return lambda seed, i: float(detection.from_db(float(i)))


def fails_at(which, seed, i):
    if i == which:
        raise ZeroDivisionError("no luck")
    return float(i)


def same_bits(ours, theirs):
    return all(
        a.tobytes() == b.tobytes() and a.shape == b.shape for a, b in zip(ours, theirs, strict=True)
    )


@pytest.fixture(scope="module")
def reference():
    return trials.run(walk, N, seed=3, workers=1)


def first_draws(names):
    seed, paper, experiment, trial, purpose = names
    return tuple(
        trials.generator(seed, paper, experiment, trial, purpose).integers(0, 2**63, size=2)
    )


def test_streams_depend_on_each_part_of_their_key_and_on_nothing_else():
    keys = list(itertools.product((0, 1), ("a", "b"), ("fig1", "fig2"), (0, 1), trials.PURPOSES))
    forwards = [first_draws(key) for key in keys]
    backwards = [first_draws(key) for key in reversed(keys)]
    assert forwards == backwards[::-1]
    assert len(set(forwards)) == len(keys)


@pytest.mark.parametrize("trial", [0, 5, np.int64(7), 2**32 - 1, 2**32, 2**70])
@pytest.mark.parametrize("seed", [0, 20, np.int64(3), 2**32 - 1, 2**32, 2**128 - 1, 2**128])
def test_the_key_of_a_stream_is_what_the_docstring_says(seed, trial):
    """A change of key, hash or bit generator would silently change every figure."""
    key = (1728423790, 57506358, trial, 1)  # CRC-32 of "toy" and "fig1", the trial, noise
    expected = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))
    ours = trials.generator(seed, "toy", "fig1", trial, "noise")
    assert ours.bit_generator.state == expected.bit_generator.state


@pytest.mark.parametrize(
    "bad",
    [
        (-1, "a", "b", 0, "noise"),
        (0, "a", "b", -1, "noise"),
        (0, "a", "b", 0, "luck"),
        (1.5, "a", "b", 0, "noise"),
        (0, "a", "b", "0", "noise"),
        (0, "a", "b", 0, ["noise"]),
    ],
)
def test_bad_keys_are_refused(bad):
    with pytest.raises(ValueError, match=r"trials\.generator: [^\n]*$"):
        trials.generator(*bad)


def test_results_are_stacked_in_trial_order(reference):
    assert isinstance(reference, Result)
    assert reference.mean.shape == (N,)
    assert reference.walk.shape == (N, 5)
    for i in (0, 17, N - 1):  # any trial can be run again alone
        alone = walk(3, i)
        assert alone.mean == reference.mean[i]
        assert alone.walk.tobytes() == reference.walk[i].tobytes()


@pytest.mark.parametrize("n", [1, 2, 99, 100, 101, 250])
def test_every_trial_runs_once(n):
    np.testing.assert_array_equal(
        trials.run(partial(fails_at, -1), n, seed=0, workers=1), np.arange(n)
    )


@pytest.mark.parametrize("workers", [2, 5])
def test_workers_do_not_change_a_bit(reference, workers):
    assert same_bits(trials.run(walk, N, seed=3, workers=workers), reference)


def test_functions_that_no_module_holds_reach_the_workers(reference):
    """As those of a notebook's cells."""
    shift = 1.0
    ours = trials.run(lambda seed, i: walk(seed, i).mean + shift, N, seed=3, workers=2)
    np.testing.assert_array_equal(ours, reference.mean + shift)


def test_any_executor_will_do_and_is_left_open(reference):
    with ThreadPoolExecutor(3) as pool:
        assert same_bits(trials.run(walk, N, seed=3, executor=pool), reference)
        assert pool.submit(int, "7").result() == 7


def test_loky_as_an_executor(reference):
    from loky import get_reusable_executor

    assert same_bits(trials.run(walk, N, seed=3, executor=get_reusable_executor(2)), reference)


def test_a_dask_cluster_gives_the_same_bits_and_all_its_threads_work(reference, monkeypatch):
    """Its threads outnumber the cores of this machine, by which its shares must not go."""
    distributed = pytest.importorskip("distributed")
    asked, shares = [], trials._shares
    monkeypatch.setattr(trials, "cores", lambda: 1)
    monkeypatch.setattr(trials, "_shares", lambda n, count: asked.append(count) or shares(n, count))
    # one interface: on all of them a free port would have to be free on each
    where = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=3, processes=False, **where
    ) as cluster:
        address = cluster.scheduler_address
        assert trials.cluster(address) == (2, 6)
        assert same_bits(trials.run(walk, N, seed=3, scheduler=address), reference)
        with distributed.Client(address) as client, client.get_executor() as pool:
            assert same_bits(trials.run(walk, N, seed=3, executor=pool), reference)
    assert asked == [6, 6]


def test_fewer_cores_when_the_environment_says_so(monkeypatch):
    assert trials.cores() >= 1
    monkeypatch.setenv("LOKY_MAX_CPU_COUNT", "1")
    assert trials.cores() == 1


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "no-such-scheme://here"])
def test_an_unreachable_scheduler_is_one_line(monkeypatch, address):
    pytest.importorskip("distributed")
    monkeypatch.setattr(trials, "CONNECT_TIMEOUT", 0.5)
    with pytest.raises(ConnectionError) as caught:
        trials.run(walk, 1, seed=0, scheduler=address)
    assert repr(address) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "empty for this machine" in str(caught.value)


def test_a_scheduler_without_a_worker_is_one_line(monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(trials, "WORKER_TIMEOUT", 0.5)
    where = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": "127.0.0.1:0"}
    refused = pytest.raises(ConnectionError, match="it has no worker; start one")
    with (
        distributed.LocalCluster(n_workers=0, processes=False, **where) as cluster,
        refused as caught,
    ):
        trials.run(walk, 1, seed=0, scheduler=cluster.scheduler_address)
    assert "\n" not in str(caught.value)


WORKER = """import asyncio, sys
from distributed import Worker

async def work():
    await (await Worker(sys.argv[1], nthreads=1, host="127.0.0.1", dashboard=False)).finished()

asyncio.run(work())
"""


@pytest.fixture
def scheduler():
    """A dask cluster without workers."""
    distributed = pytest.importorskip("distributed")
    where = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(n_workers=0, processes=False, **where) as cluster:
        yield cluster


@contextlib.contextmanager
def workers(cluster, *folders):
    """Worker processes that find the package in these folders."""
    words = [sys.executable, "-c", WORKER, cluster.scheduler_address]
    with contextlib.ExitStack() as stack:
        for folder in folders:
            environment = tiny.environment(folder)
            started = subprocess.Popen(words, env=environment, stderr=subprocess.DEVNULL)
            stack.enter_context(started)
            stack.callback(started.kill)
        while len(cluster.scheduler_info["workers"]) < len(folders):
            time.sleep(0.02)
        yield


def copy_of(repository, name, file, old, new):
    """A copy of the small repository and of the package in which a text is changed."""
    folder = shutil.copytree(repository, repository.with_name(name))
    tiny.copy_package(folder)
    text = (folder / file).read_text(encoding="utf-8")
    assert old in text
    (folder / file).write_text(text.replace(old, new), encoding="utf-8")
    return folder


CHANGED = {
    "core": ("tbdcore/detection.py", "return", "return 1.0 *", "tbdcore.detection"),
    "chapter": ("notebooks/01_tiny.ipynb", "import time", "import time as t", "tbdcore_page_tiny"),
    "harness": ("tbdcore/repro/trials.py", "SHARES = 3", "SHARES = 4", "tbdcore.repro.trials"),
    "before": (
        "tbdcore/repro/trials.py",
        "def sources(code, words):",
        "def other():",
        "no answer: Exception",
    ),
    "vanishes": (
        "tbdcore/repro/trials.py",
        "def sources(code, words):",
        GONE,
        "no answer: CommClosedError",
    ),
}


@pytest.mark.slow
def test_workers_with_other_sources_are_refused_before_anything_starts(
    repository, scheduler, capsys
):
    """One has another core, one another chapter, one another harness, one a version that cannot
    be asked yet, and one vanishes while it is checked.
    """
    distributed = pytest.importorskip("distributed")
    tiny.change(repository, algorithm=DETECTS)
    folders = [copy_of(repository, name, *change[:3]) for name, change in CHANGED.items()]
    with workers(scheduler, *folders):
        assert cli.main(["run", "tiny", "--scheduler", scheduler.scheduler_address]) == 3
        with (
            distributed.Client(scheduler.scheduler_address) as client,
            client.get_executor() as pool,
            pytest.raises(ConnectionError, match=r"tbdcore\.detection"),
        ):
            trials.run(detects(), N, seed=3, executor=pool)
    out, err = capsys.readouterr()
    message = err.splitlines()[-1]
    assert out == ""
    assert message.startswith("tbdcore: other sources on the dask worker tcp://")
    assert message.count("tcp://127.0.0.1:") == len(CHANGED)
    assert all(f"({change[3]}" in message for change in CHANGED.values())


def test_a_worker_with_the_same_sources_in_another_folder_is_used(repository, scheduler):
    same = copy_of(repository, "same", "notebooks/01_tiny.ipynb", "{", "{")
    with workers(scheduler, same):
        assert trials.cluster(scheduler.scheduler_address, ["tiny"]) == (1, 1)


@pytest.mark.slow
def test_a_worker_with_an_unused_function_more_is_used(repository, scheduler):
    more = copy_of(repository, "more", "notebooks/01_tiny.ipynb", "{", "{")
    with (more / "tbdcore" / "detection.py").open("a") as module:
        module.write("\n\ndef spare(x):\n    return x\n")
    with workers(scheduler, more):
        ours = trials.run(detects(), 5, seed=3, scheduler=scheduler.scheduler_address)
    np.testing.assert_array_equal(ours, trials.run(detects(), 5, seed=3, workers=1))


@pytest.mark.parametrize("workers", [1, 2])
def test_a_failing_trial_is_named(workers):
    with pytest.raises(RuntimeError, match=r"^trial 13 of seed 4: ZeroDivisionError: no luck$"):
        trials.run(partial(fails_at, 13), N, seed=4, workers=workers)


def test_the_machine_works_after_a_failing_trial(reference):
    with pytest.raises(RuntimeError, match="trial 0"):
        trials.run(partial(fails_at, 0), N, seed=4, workers=2)
    assert same_bits(trials.run(walk, N, seed=3, workers=2), reference)


@pytest.mark.parametrize(
    ("n", "workers", "seed", "word"),
    [
        (0, 1, 0, "n is 0"),
        (-3, 1, 0, "n is -3"),
        (5, -1, 0, "workers is -1"),
        (5, 1, -1, "seed is -1"),
        (5, 1, 0.5, "seed is 0.5; give an integer"),
        (2.5, 1, 0, "n is 2.5; give an integer"),
        (float("nan"), 1, 0, "n is nan; give an integer"),
    ],
)
def test_bad_counts_are_refused(n, workers, seed, word):
    with pytest.raises(ValueError, match=word):
        trials.run(walk, n, seed=seed, workers=workers)


def test_results_of_other_shapes():
    pair = trials.run(lambda seed, i: (i, np.full(2, i)), 4, seed=0, workers=1)
    assert type(pair) is tuple
    np.testing.assert_array_equal(pair[1], [[0, 0], [1, 1], [2, 2], [3, 3]])


@pytest.mark.parametrize("workers", [1, 2, 5, 64])
@pytest.mark.parametrize("n", [1, 2, 7, 100, 2401])
def test_shares_cover_all_trials_once_and_become_shorter(n, workers):
    ranges = trials._shares(n, workers)
    assert [i for first, last in ranges for i in range(first, last)] == list(range(n))
    lengths = [last - first for first, last in ranges]
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[0] <= max(1, n / (2 * workers))
    assert lengths[-min(n, workers) :] == [1] * min(n, workers)
