"""What every benchmark needs: a row of the table, and the best of several timings."""

import time
from typing import NamedTuple

from numba import njit

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
