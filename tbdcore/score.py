"""Scores: how good an estimate is, and how far a Monte Carlo number can be trusted.

**Proportions.**  k successes in n trials: ``proportion`` gives the estimate and its standard error.
**Crossings.**  The abscissa at which a curve passes a level: ``crossing`` interpolates linearly
around the *last downward* passage (a noisy curve may touch the level earlier), ``crossings`` for
each of many curves.  **Lost tracks.**  ``loss_onsets`` says when a track was lost under a stated
rule, ``kept_rmse`` what the error of the others is, with the influence of each trial on it, from
which paired differences get their errors.  **Sets.**  ``ospa`` is the distance between two finite
sets.  **Columns.**  ``column_test`` compares a table's column.

All raise ValueError for shapes that do not fit and for values out of range; NaN is valid only where
it is said.
"""

import math
from typing import Annotated

import numpy as np
from scipy.special import chdtrc

from tbdcore.checks import Array, ArrayLike, Integer, Number, Numbers, checked

__all__ = ["Z99", "column_test", "crossing", "crossings", "kept_rmse", "loss_onsets", "ospa"]
__all__ += ["ospa_bernoulli", "proportion"]


class Flags(Numbers):
    """Rule: an array of True and False."""

    dtype, kinds, wanted = np.dtype(bool), "b", "True or False"


Count = Annotated[ArrayLike, Numbers(..., low=0.0)]
Abscissas = Annotated[ArrayLike, Numbers("m", low=-1e300, high=1e300)]
Level = Annotated[float, Number(-1e300, 1e300)]
Points = Annotated[ArrayLike, Numbers(...)]
Maybe = Annotated[ArrayLike, Numbers(..., "d", low=None)]
Positive = Annotated[float, Number(np.finfo(float).tiny)]
Column = Annotated[ArrayLike, Numbers("r")]
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
def ospa(X: Points, Y: Points, c: Positive, p: Annotated[float, Number(1.0)]) -> float:
    """Optimal subpattern assignment distance of two finite sets (Schuhmacher, Vo and Vo 2008).

    X : (m, d), Y : (n, d), either may be empty; c > 0 the price of a point too many; p >= 1.

        ( (min over assignments sum min(c, distance)**p + c**p |m - n|) / max(m, n) )**(1/p)
    """
    from scipy.optimize import linear_sum_assignment  # takes half a second, needed only here

    X, Y = np.atleast_2d(X), np.atleast_2d(Y)
    m, n = (0 if A.size == 0 else len(A) for A in (X, Y))
    if not abs(p * math.log(c)) < 600:
        raise ValueError(f"score.ospa: c = {c} and p = {p}; c**p must be finite and above 0")
    if X.ndim != 2 or Y.ndim != 2 or (m and n and X.shape[1] != Y.shape[1]):
        raise ValueError(f"score.ospa: X {X.shape} and Y {Y.shape}; give (m, d) and (n, d)")
    if min(m, n) == 0:
        return 0.0 if max(m, n) == 0 else float(c)
    with np.errstate(over="ignore"):
        cost = np.minimum(np.linalg.norm(X[:, None] - Y[None], axis=-1), c) ** p
    total = cost[linear_sum_assignment(cost)].sum() + c**p * abs(m - n)
    return float((total / max(m, n)) ** (1 / p))


@checked
def ospa_bernoulli(
    x: Maybe,
    existence: Annotated[ArrayLike, Numbers(...)],
    truth: Maybe,
    c: Positive,
    threshold: Annotated[float, Number()] = 0.5,
) -> Array:
    """OSPA (...,) of at most one estimate and one target; every order p gives the same number.

    x : (..., d) estimates, none (or NaN) where existence (...,) is at or below the threshold
    truth : (..., d), NaN for no target
    """
    if x.shape != truth.shape or x.shape[:-1] != existence.shape:
        words = f"x {x.shape}, existence {existence.shape}, truth {truth.shape}"
        raise ValueError(f"score.ospa_bernoulli: {words}; give (..., d), (...,), (..., d)")
    declared, present = existence > threshold, ~np.isnan(truth[..., 0])
    with np.errstate(over="ignore", invalid="ignore"):
        distance = np.minimum(np.sqrt(np.sum(np.square(x - truth), axis=-1)), c)
    if np.isnan(distance[declared & present]).any():
        raise ValueError("score.ospa_bernoulli: a declared x or its target has a NaN; remove it")
    return np.where(declared & present, distance, np.where(declared | present, float(c), 0.0))


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


@checked
def kept_rmse(
    error: Annotated[ArrayLike, Numbers("n", "K", "T", 2, low=None)],
    kept: Annotated[ArrayLike, Flags("n", "T", low=None)],
) -> tuple[Array, Array]:
    """RMSE (K, T, 2) over the trials that kept a track, NaN without one, and its influences.

    `error` (n, K, T, 2), NaN where lost; `kept` (n, T) bool.  The influence (n, K, T, 2) is that of
    each trial: its standard deviation over sqrt(n) is the standard error, also of means and paired
    differences.
    """
    if not len(kept):
        raise ValueError("score.kept_rmse: error and kept have no trial; give one at least")
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = (kept / kept.mean(axis=0))[:, None, :, None]
        square = np.where(kept[:, None, :, None], weight * np.square(error), 0.0)
        mean = np.where(kept.any(axis=0)[:, None], square.mean(axis=0), np.nan)
        return np.sqrt(mean), (square - weight * mean) / (2 * np.sqrt(mean))


@checked
def column_test(
    measured: Column,
    printed: Column,
    covariance: Annotated[ArrayLike, Numbers("r", "r")],
    ratio: Annotated[float, Number(0.0)],
    half: Annotated[float, Number(0.0)] = 0.0,
) -> tuple[float, float, float, float]:
    """Whether a table's column agrees with ours as a whole: mean difference, its error, z, and p.

    measured, printed : (r,); covariance : (r, r) of our values; ratio : our number of trials over
    the paper's; half : half of the last printed digit.  The mean difference tests for a common
    shift; p is that of d' C**-1 d, chi-square with r degrees of freedom.
    """
    d = measured - printed
    C = covariance * (1.0 + ratio) + np.eye(d.size) * half**2 / 3.0
    try:
        p = float(chdtrc(d.size, d @ np.linalg.solve(C, d)))
    except np.linalg.LinAlgError:
        raise ValueError("score.column_test: covariance is singular; leave a row out") from None
    shift, se = float(d.mean()), float(np.sqrt(C.sum())) / d.size
    return shift, se, shift / se, p
