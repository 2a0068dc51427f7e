"""Scores: how good an estimate is, and how far a Monte Carlo number can be trusted.

**Proportions.**  k successes in n trials: ``proportion`` gives the estimate and its standard error.
**Crossings.**  The abscissa at which a curve passes a level: ``crossing`` interpolates linearly
around the *last downward* passage (a noisy curve may touch the level earlier), ``crossings`` for
each of many curves.  **Lost tracks.**  ``loss_onsets`` says when a track was lost under a stated
rule.

All raise ValueError for shapes that do not fit and for values out of range; NaN is valid only where
it is said.
"""

import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, ArrayLike, Integer, Number, Numbers, checked

__all__ = ["Z99", "crossing", "crossings", "loss_onsets", "proportion"]


Count = Annotated[ArrayLike, Numbers(..., low=0.0)]
Abscissas = Annotated[ArrayLike, Numbers("m", low=-1e300, high=1e300)]
Level = Annotated[float, Number(-1e300, 1e300)]
Positive = Annotated[float, Number(np.finfo(float).tiny)]
Z99 = 2.5758293035489004  # half width of a 99 % normal interval


@checked
def proportion(k: Count, n: Count) -> tuple[Array, Array]:
    """Estimate k / n and its standard error; NaN where n is 0.  Scalars or arrays.

    The error is that of the share (k + 1/2) / (n + 1), which is never 0 or 1.
    """
    if not ((k <= n) & (n == np.floor(n))).all():
        raise ValueError("score.proportion: give k of n, 0 <= k <= n, n a whole number")
    share = (k + 0.5) / (n + 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(n > 0, k / n, np.nan), np.sqrt(share * (1 - share) / n)


@checked
def crossing(
    x: Abscissas,
    y: Annotated[ArrayLike, Numbers("m", low=-1e300, high=1e300, nan=True)],
    level: Level,
) -> float:
    """Abscissa x (m,) where a curve y (m,) last passes a level downwards; NaN if it never does.

    A NaN in y is a gap in the curve.
    """
    return float(crossings(x, y, level)[0])


@checked
def crossings(
    x: Abscissas,
    curves: Annotated[ArrayLike, Numbers(..., "m", low=-1e300, high=1e300, nan=True)],
    level: Level,
) -> Array:
    """:func:`crossing` of every row of `curves` (n, m), NaN in a gap; shape (n,)."""
    if not ((np.diff(x) > 0).all() or (np.diff(x) < 0).all()):
        raise ValueError("score.crossings: the abscissas x must be monotone; sort them")
    if curves.ndim > 2:
        raise ValueError("score.crossings: curves of more than two axes; give (n, m)")
    return np.array([_last_passage(x, y, level) for y in np.atleast_2d(curves)])


def _last_passage(x, y, level):
    """Abscissa between the last i with y[i] >= level > y[i + 1] and the next, or NaN."""
    down = np.flatnonzero((y[:-1] >= level) & (y[1:] < level))
    if not down.size:
        return math.nan
    i = int(down[-1])
    w = (y[i] - level) / (y[i] - y[i + 1])
    return x[i] + w * (x[i + 1] - x[i])


@checked
def loss_onsets(
    error: Annotated[ArrayLike, Numbers(..., "K", "T", 2, low=-np.inf, high=np.inf)],
    distance: Positive,
    scans: Annotated[int, Integer(1)],
    after: Annotated[int, Integer(0)] = 0,
) -> Array:
    """Scan index at which a track is lost, shape (..., T); the number of scans K where it never is.

    `error` (..., K, T, 2), no NaN.  Lost: farther than `distance` in `scans` scans running, none of
    them before index `after`; the onset is the first of them.  A track that comes back is lost too.
    """
    far: Array = np.hypot(error[..., 0], error[..., 1]) > distance
    far[..., :after, :] = False
    if far.shape[-2] < scans:
        return np.full((*far.shape[:-2], far.shape[-1]), far.shape[-2])
    running = np.all(np.lib.stride_tricks.sliding_window_view(far, scans, axis=-2), axis=-1)
    return np.where(running.any(axis=-2), running.argmax(axis=-2), far.shape[-2])
