"""Monte Carlo whose digits do not depend on who computes them.

A trial is a function ``trial(seed, i)`` of two plain integers.  It makes its own generators from
them, ``rng = generator(seed, "track_cfar", "fig05", i, "noise")``, one for each *purpose*:
``truth`` (what the world does), ``noise`` (what the radar adds), ``filter`` (what the algorithm
draws).  Nothing else is random.  So trial 17 can be run again alone, ``trial(seed, 17)``; two
algorithms see the same scenes; one worker and a hundred give the same bits.
"""

import contextlib
import os
import re
from functools import cached_property, partial
from itertools import pairwise
from zlib import crc32

import cloudpickle
import numpy as np
from loky import ProcessPoolExecutor, cpu_count, get_reusable_executor
from tqdm import tqdm

from tbdcore.repro import reach
from tbdcore.repro.processes import end_with_parent

PURPOSES = {"truth": 0, "noise": 1, "filter": 2}
SHARES = 3  # a chunk is this part of a worker's share of the trials that are left
CONNECT_TIMEOUT = 5  # seconds that a scheduler may take to answer
WORKER_TIMEOUT = 10  # seconds that a scheduler without a worker may take to get one
IDLE_TIMEOUT = 86400  # seconds, a day; loky prints a warning when one leaves as work arrives


def generator(seed, paper, experiment, trial, purpose):
    """Random generator of one purpose in one trial: ``SeedSequence(seed, spawn_key=(paper,
    experiment, trial, purpose))``, with the names as CRC-32, the same on every machine.

    `seed` and `trial` are integers >= 0, `purpose` one of PURPOSES; anything else is a ValueError.
    """
    if purpose not in tuple(PURPOSES):
        raise ValueError(f"trials.generator: purpose {purpose!r} is none of {', '.join(PURPOSES)}")
    if not all(isinstance(it, int | np.integer) and it >= 0 for it in (seed, trial)):
        reason = "must be integers and must not be negative"
        raise ValueError(f"trials.generator: seed {seed!r} and trial {trial!r} {reason}")
    key = (crc32(paper.encode()), crc32(experiment.encode()), int(trial), PURPOSES[purpose])
    words = _words(int(seed), 4) + b"".join(map(_words, key))  # as SeedSequence joins them itself
    sequence = np.random.SeedSequence(np.frombuffer(words, "<u4"))  # three times as fast
    return np.random.Generator(np.random.PCG64(sequence))


def _words(number, least=1):
    """An integer as words of 32 bits, low end first, at least so many of them."""
    return number.to_bytes(4 * max(least, -(-number.bit_length() // 32)), "little")


def run(trial, n, *, seed, workers=0, scheduler="", executor=None, label="trials"):
    """Results of ``trial(seed, 0) ... trial(seed, n - 1)``, stacked along a leading axis of n.

    A trial returns a number, an array, or a (named) tuple of them, always in the same shapes.
    `workers` are processes on this machine; 0: one for each core, 1: none, the loop runs here.
    `scheduler` is the address of a dask scheduler; an `executor` (concurrent.futures.Executor) is
    used instead of both, and left open.  ValueError for a bad count, ConnectionError when no
    scheduler answers, RuntimeError, which names the trial, when one raises.
    """
    for name, value, least in (("n", n, 1), ("workers", workers, 0), ("seed", seed, 0)):
        if not isinstance(value, int | np.integer) or value < least:
            raise ValueError(f"trials.run: {name} is {value!r}; give an integer, {least} or above")
    chunk = _Once(partial(_chunk, trial, seed))
    with _executor(executor, workers, scheduler, chunk) as pool:
        return _by_field(np.concatenate, _parts(pool, chunk, n, label))


def cores():
    """Number of cores this process may use; ``LOKY_MAX_CPU_COUNT`` allows fewer."""
    return cpu_count()


def cluster(scheduler, papers=()):
    """Workers and threads of the dask cluster at an address; ConnectionError like run, and when a
    worker has other sources of some papers' notebooks.
    """
    from tbdcore.repro import pages

    code = "\n".join(map(pages.code, papers))
    with _client(scheduler) as client:
        _same_sources(client, code, ["page", *papers])
        threads = client.nthreads()
    return len(threads), sum(threads.values())


@contextlib.contextmanager
def _executor(executor, workers, scheduler, chunk):
    """The executor to use, or None for a plain loop; one that was opened here is closed."""
    if hasattr(executor, "_client"):  # of a dask cluster
        _same_sources(executor._client, *reach.of_trial(chunk.pickle))
    if executor is None and scheduler:
        with _client(scheduler) as client, client.get_executor() as pool:
            _same_sources(client, *reach.of_trial(chunk.pickle))
            yield pool
    elif executor is not None or (workers or cores()) == 1:
        yield executor
    else:
        # kept between runs, each process with one thread for linear algebra
        one = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        yield get_reusable_executor(workers or cores(), env=one, **_life())


def process():
    """An executor with one process, which the caller shuts down."""
    return ProcessPoolExecutor(1, **_life())


def _life():
    """Options of processes that wait for work for a day and end when this one does."""
    return {"timeout": IDLE_TIMEOUT, "initializer": end_with_parent, "initargs": (os.getpid(),)}


@contextlib.contextmanager
def _client(address):
    """Client of the dask scheduler at an address; ConnectionError when nobody answers or no worker
    comes soon.
    """
    from distributed import Client

    where = f"scheduler {address!r}"
    advice = "write tcp://host:8786, or leave it empty for this machine"
    if not re.fullmatch(r"(\w+://)?[\w.\-\[\]]+:\d+|inproc://\S+", address):
        raise ConnectionError(f"{where}: no address of a dask scheduler; {advice}")
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:  # a timeout among them
        reason = f"no dask scheduler answers there ({type(error).__name__})"
        raise ConnectionError(f"{where}: {reason}; {advice}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
        except TimeoutError:
            advice = f"start one: dask worker {address}"
            raise ConnectionError(f"{where}: it has no worker; {advice}") from None
        yield client


def _same_sources(client, code, words):
    """Raise ConnectionError when a worker of a cluster has other sources of what is to run."""
    ours, others = sources(code, words), []
    answers = client.run(sources, code, words, on_error="return")
    for worker, theirs in sorted(answers.items()):
        if not isinstance(theirs, dict):
            others.append(f"{worker} (no answer: {type(theirs).__name__})")
        elif names := sorted({name for name, _ in ours.items() ^ theirs.items()}):
            others.append(f"{worker} ({', '.join(names)})")
    if others:
        advice = "take the same commit for all, then start these workers again"
        raise ConnectionError(f"other sources on the dask worker {', '.join(others)}; {advice}")


def sources(code, words):
    """Digests of the sources that a trial reaches, by module; see :func:`reach.at_worker`."""
    return reach.at_worker(code, words)


def _shares(n, workers):
    """Half-open ranges that cover 0..n, the long ones first: all workers end together."""
    ends = [0]
    while (left := n - ends[-1]) > 0:
        ends.append(ends[-1] + max(1, left // (SHARES * workers)))
    return list(pairwise(ends))


def _parts(pool, chunk, n, label):
    """Chunks of the loop, in the order of the trials, from an executor or from this process."""
    shown = partial(tqdm, desc=label, disable=None, leave=False)
    if pool is None:
        return [chunk(*ends) for ends in shown(_shares(n, 30))]
    client = getattr(pool, "_client", None)  # of a dask cluster, where each thread is a worker
    workers = sum(client.nthreads().values()) if client else getattr(pool, "_max_workers", 0)
    jobs = [pool.submit(chunk, *ends) for ends in _shares(n, workers or cores())]
    try:
        return [job.result() for job in shown(jobs)]
    finally:
        for job in jobs:  # those that are left when one has failed
            job.cancel()


class _Once:
    """A function that is pickled once for all jobs: a scenario's class takes 50 ms."""

    def __init__(self, function):
        self.function = function

    def __call__(self, *arguments):
        return self.function(*arguments)

    def __reduce__(self):
        return cloudpickle.loads, (self.pickle,)

    @cached_property
    def pickle(self):
        return cloudpickle.dumps(self.function)


def _chunk(trial, seed, first, last):
    """Trials first..last-1, stacked."""
    results = []
    for i in range(first, last):
        try:
            results.append(trial(seed, i))
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise RuntimeError(f"trial {i} of seed {seed}: {reason}") from error
    return _by_field(np.stack, results)


def _by_field(gather, results):
    """Apply a function to the results, or to each field's list when they are (named) tuples."""
    first = results[0]
    if not isinstance(first, tuple):
        return gather(results)
    fields = [gather(field) for field in zip(*results, strict=True)]
    return first._make(fields) if hasattr(first, "_make") else tuple(fields)
