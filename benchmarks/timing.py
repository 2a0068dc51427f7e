"""What every benchmark needs: a row of the table, and the best of several timings.

The CPU time of a trial, for a chapter's table of methods, is a committed study in a module
``benchmarks/<paper>_cost.py`` with one call:

    timing.write_costs("dp_tbd", {"one frame": partial(trial, 1), "weighted": partial(trial, 11)})

A chapter reads it with ``studies.cost``; ``portfolio.methods`` does so itself.
"""

import platform
import time
from pathlib import Path
from typing import NamedTuple

import pandas as pd
from numba import njit

from tbdcore.repro import paths, products

# for loops that call kernels of the core; not cached, since a cached loop would keep the old kernel
loop = njit(error_model="numpy")


class Row(NamedTuple):
    """One kernel: its work, its seconds per call, and those of its specification, its limit and a
    peer (None: does not apply).

    limit_seconds is what the machine needs for the same loads and operations, asked_seconds a
    target that was set for the whole.
    """

    kernel: str
    work: str
    seconds: float
    spec_seconds: float | None = None
    limit_seconds: float | None = None
    peer: str = ""
    peer_seconds: float | None = None
    asked_seconds: float | None = None


def best(function, *args, repeat=5, least=0.02):
    """Best wall seconds per call of function(*args), after a call that may compile; a timing lasts
    at least `least` seconds.
    """
    function(*args)
    calls, start = 1, time.perf_counter()
    function(*args)
    calls = max(1, int(least / max(time.perf_counter() - start, 1e-9)))
    return min(_timed(function, args, calls) for _ in range(repeat))


def _timed(function, args, calls):
    start = time.perf_counter()
    for _ in range(calls):
        function(*args)
    return (time.perf_counter() - start) / calls


def cpu_ms(trials, repeat=5, least=0.02):
    """Least CPU milliseconds of each of the trials, of several timings in this process, after a
    call that may compile; a timing lasts at least `least` seconds.

    Each round times all of them, so that a busy moment of the machine spoils one timing of each.
    """
    calls = []
    for trial in trials:
        trial()
        calls.append(max(1, round(least / max(_cpu(trial, 1), 1e-9))))
    rounds = [
        [_cpu(trial, n) for trial, n in zip(trials, calls, strict=True)] for _ in range(repeat)
    ]
    return [1e3 * min(times) for times in zip(*rounds, strict=True)]


def _cpu(trial, calls):
    start = time.process_time()
    for _ in range(calls):
        trial()
    return (time.process_time() - start) / calls


def write_costs(paper, trials, repeat=5):
    """Time the trials of a paper, functions without arguments by the name of their method, and
    write ``data/<paper>_cost.csv``: ``method,cpu_ms``, three digits, with the machine's name.
    """
    times = [float(f"{it:.3g}") for it in cpu_ms([*trials.values()], repeat)]
    table = pd.DataFrame({"method": [*trials], "cpu_ms": times})
    head = f"# python -m benchmarks.{paper}_cost: one process on {machine()}, least of {repeat}\n"
    folder = paths.claims().parent
    products.write(folder, {f"{paper}_cost.csv": head.encode() + products.csv(table)})
    return table


def machine():
    """The processor's name."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return (names or [platform.processor() or platform.machine()])[0]
