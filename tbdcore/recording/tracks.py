"""Tracks that start and end: a tracker of scans of plots, with starts from three scans."""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np

from tbdcore.checks import Array, ArrayLike, Integer, Numbers, checked
from tbdcore.recording.detections import Positive, places, starts

__all__ = ["Tracks", "follow"]

TAKEN = 0.05  # the first plot of a track, with this weight or more, starts no other one
LOW = 0.1  # a track whose existence stays below ends
TWIN = 1.0  # squared Mahalanobis distance of two tracks that are one


class Tracks(NamedTuple):
    """Tracks, a row for each track and scan, in the order of the scans.

    track (n,) counts from 0 in the order of the starts; scan (n,) is the index of the scan;
    existence (n,); x (n, 4) of [x, vx, y, vy]; P (n, 4, 4)
    """

    track: Array
    scan: Array
    existence: Array
    x: Array
    P: Array

    def declared(self, level: float = 0.9, scans: int = 5) -> "Tracks":
        """All rows of the tracks whose existence is above ``level`` in ``scans`` scans or more."""
        above = np.bincount(self.track, self.existence > level, minlength=1)
        keep = (above >= scans)[self.track]
        return Tracks(*(field[keep] for field in self))

    def at(self, scan: int) -> Array:
        """States (m, 4) of the tracks in a scan."""
        return self.x[self.scan == scan]


@checked
def follow(
    scans: Any,
    t: Annotated[ArrayLike, Numbers("K")],
    fastest: Positive,
    sigma: Positive,
    start: Callable,
    step: Callable,
    low_scans: Annotated[int, Integer(1)] = 5,
) -> Tracks:
    """Tracks that start and end, from K scans of rows x, y at times t; None was not taken.

    fastest, sigma : largest speed; standard deviation of a plot's place on each axis
    start : start(x, P) gives the tracker's state of tracks x (n, 4), P (n, 4, 4): a named tuple
        with x, P and existence (n,), as the ``start`` of chapter 05
    step : step(state, scan, T) gives the next state, T seconds later, and the weights (n, m + 1)
        of no plot and of each plot, as the ``step`` of chapter 05

    Plots that no track prefers to its other plots with a weight of 0.05 or more start new ones
    (:func:`starts`).  A track ends when its existence stays below 0.1 for ``low_scans`` scans,
    and when an older one is within one standard deviation of it (squared Mahalanobis distance of
    the states below 1): a twin.
    """
    for name, function in (("start", start), ("step", step)):
        if not callable(function):
            raise ValueError(f"recording.follow: {name}: {function!r:.40} is no function")
    if not hasattr(scans, "__len__") or len(scans) != len(t) or len(t) < 3:
        raise ValueError(f"recording.follow: scans: give 3 or more, one for each of {len(t)} times")
    if (np.diff(t) <= 0).any():
        raise ValueError("recording.follow: t: times do not rise; recording.scans sorts them")
    _check_steps(scans, t, fastest)
    state: Any = None
    names, low, rows, count = np.empty(0, int), np.empty(0, int), [], 0
    for k in range(2, len(t)):
        free = scans[k]
        if names.size:
            state, beta = _stepped(step, state, scans[k], t[k] - t[k - 1])
            low = np.where(state.existence < LOW, low + 1, 0)
            free = None if free is None else np.asarray(free)[_is_free(beta[:, 1:])]
        x, P = starts([scans[k - 2], scans[k - 1], free], t[k - 2 : k + 1], fastest, sigma)
        if len(x):
            state = _joined(state if names.size else None, start(x, P))
            names = np.append(names, count + np.arange(len(x)))
            low, count = np.append(low, np.zeros(len(x), int)), count + len(x)
        if names.size:
            keep = (low < low_scans) & ~_twins(state.x, state.P)
            state, names, low = _chosen(state, keep), names[keep], low[keep]
            rows.append((names, np.full(names.size, k), state.existence, state.x, state.P))
    empty = (np.empty(0, int), np.empty(0, int), np.empty(0), np.empty((0, 4)), np.empty((0, 4, 4)))
    return Tracks(*map(np.concatenate, zip(empty, *rows, strict=True)))


def _check_steps(scans, t, fastest):
    """ValueError if a target crosses all plots in a step: times are not in seconds."""
    seen = [
        places(f"recording.follow: scans[{k}]", z) for k, z in enumerate(scans) if z is not None
    ]
    z = np.concatenate([np.empty(0, complex), *seen])
    step = float(np.median(np.diff(t)))
    if z.size and fastest * step > 2 * max(np.ptp(z.real), np.ptp(z.imag)) > 0:
        words = f"in a step of {step:g} s a target may cross all plots twice"
        raise ValueError(f"recording.follow: t: {words}; give seconds, not milliseconds")


def _stepped(step, state, scan, T):
    """The next state of a tracker, and weights (n, m + 1)."""
    after = step(state, scan, T)
    shape = (len(state.x), 1 + (0 if scan is None else len(scan)))
    if type(after) is not tuple or len(after) != 2 or np.shape(after[1]) != shape:
        words = f"give (state, weights), these of shape {shape}"
        raise ValueError(f"recording.follow: step: {words}, as chapter 05 does")
    return after


def _is_free(weights):
    """Whether a plot is the first one of no track, (m,), from weights (n, m)."""
    first = weights == weights.max(axis=1, initial=0.0, keepdims=True)
    return ~(first & (weights >= TAKEN)).any(axis=0)


def _joined(state, new):
    """The state with new tracks behind the old ones."""
    if not all(hasattr(new, name) for name in ("x", "P", "existence", "_replace")):
        words = "give a named tuple with x, P and existence"
        raise ValueError(f"recording.follow: start: it returned {type(new).__name__}; {words}")
    if state is None:
        return new
    both = {name: [getattr(one, name) for one in (state, new)] for name in ("x", "P", "existence")}
    return state._replace(**{name: np.concatenate(pair) for name, pair in both.items()})


def _chosen(state, keep):
    """The state of some of its tracks."""
    return state._replace(x=state.x[keep], P=state.P[keep], existence=state.existence[keep])


def _twins(x, P):
    """Whether an older track is at the same state, (n,)."""
    d = x[:, None] - x
    d2 = (d * np.linalg.solve(P[:, None] + P, d[..., None])[..., 0]).sum(axis=-1)
    return np.tril(d2 < TWIN, -1).any(axis=1)
