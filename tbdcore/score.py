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

import numpy as np
from scipy.special import chdtrc

Z99 = 2.5758293035489004  # half width of a 99 % normal interval


def proportion(k, n):
    """Estimate k / n and its standard error; NaN where n is 0.  Scalars or arrays.

    The error is that of the share (k + 1/2) / (n + 1), which is never 0 or 1.
    """
    k, n = np.asarray(k, float), np.asarray(n, float)
    if not ((k >= 0) & (k <= n) & (n < np.inf) & (n == np.floor(n))).all():
        raise ValueError("score: give successes 0 <= k <= n of n trials, a whole number")
    share = (k + 0.5) / (n + 1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(n > 0, k / n, np.nan), np.sqrt(share * (1 - share) / n)


def crossing(x, y, level):
    """Abscissa x (m,) where a curve y (m,) last passes a level downwards; NaN if it never does."""
    if np.ndim(y) != 1:
        raise ValueError(f"score.crossing: a curve of shape {np.shape(y)}; give one value per x")
    return float(crossings(x, y, level)[0])


def crossings(x, curves, level):
    """:func:`crossing` of every row of `curves` (n, m); shape (n,)."""
    x, curves = np.asarray(x, float), np.atleast_2d(np.asarray(curves, float))
    if x.ndim != 1 or curves.ndim != 2 or curves.shape[1] != x.size:
        raise ValueError(f"score.crossing: {x.shape} abscissas for {curves.shape} curves")
    if not ((np.diff(x) > 0).all() or (np.diff(x) < 0).all()):
        raise ValueError("score.crossing: the abscissas must be monotone, without NaN; sort them")
    if not (abs(level) <= 1e300 and (abs(x) <= 1e300).all() and not (abs(curves) > 1e300).any()):
        raise ValueError("score.crossing: a value is infinite; NaN marks a gap in a curve")
    return np.array([_last_passage(x, y, level) for y in curves])


def _last_passage(x, y, level):
    """Abscissa between the last i with y[i] >= level > y[i + 1] and the next, or NaN."""
    down = np.flatnonzero((y[:-1] >= level) & (y[1:] < level))
    if not down.size:
        return math.nan
    i = int(down[-1])
    w = (y[i] - level) / (y[i] - y[i + 1])
    return x[i] + w * (x[i + 1] - x[i])


def ospa(X, Y, c, p):
    """Optimal subpattern assignment distance of two finite sets (Schuhmacher, Vo and Vo 2008).

    X : (m, d), Y : (n, d), either may be empty; c > 0 the price of a point too many; p >= 1.

        ( (min over assignments sum min(c, distance)**p + c**p |m - n|) / max(m, n) )**(1/p)
    """
    from scipy.optimize import linear_sum_assignment  # takes half a second, needed only here

    X, Y = np.atleast_2d(np.asarray(X, float)), np.atleast_2d(np.asarray(Y, float))
    m, n = (0 if A.size == 0 else len(A) for A in (X, Y))
    if not c > 0 or not 1 <= p < np.inf or not abs(p * math.log(c)) < 600:
        raise ValueError(f"ospa: cut-off {c} must be positive, order {p} at least 1, c**p finite")
    if X.ndim != 2 or Y.ndim != 2 or (m and n and X.shape[1] != Y.shape[1]):
        raise ValueError(f"ospa: sets of shapes {X.shape} and {Y.shape}; give (m, d) and (n, d)")
    if not (np.isfinite(X).all() and np.isfinite(Y).all()):
        raise ValueError("ospa: a point is NaN or infinite; remove it")
    if min(m, n) == 0:
        return 0.0 if max(m, n) == 0 else float(c)
    with np.errstate(over="ignore"):
        cost = np.minimum(np.linalg.norm(X[:, None] - Y[None], axis=-1), c) ** p
    total = cost[linear_sum_assignment(cost)].sum() + c**p * abs(m - n)
    return float((total / max(m, n)) ** (1 / p))


def ospa_bernoulli(x, existence, truth, c, threshold=0.5):
    """OSPA (...,) of at most one estimate and one target; every order p gives the same number.

    x : (..., d) estimates, none where existence (...,) is at or below the threshold
    truth : (..., d), NaN for no target
    """
    x, existence, truth = (np.asarray(a, float) for a in (x, existence, truth))
    if x.shape != truth.shape or x.shape[:-1] != existence.shape or not x.ndim:
        raise ValueError("ospa_bernoulli: give x (..., d), existence (...,), truth (..., d)")
    if not 0 < c < np.inf or np.isnan(existence).any():
        raise ValueError(f"ospa_bernoulli: cut-off {c} must be positive, and no existence NaN")
    declared, present = existence > threshold, ~np.isnan(truth[..., 0])
    with np.errstate(over="ignore", invalid="ignore"):
        distance = np.minimum(np.sqrt(np.sum(np.square(x - truth), axis=-1)), c)
    if np.isnan(distance[declared & present]).any():
        raise ValueError("ospa_bernoulli: a declared estimate or its target has a NaN; remove it")
    return np.where(declared & present, distance, np.where(declared | present, float(c), 0.0))


def loss_onsets(error, distance, scans, after=0):
    """Scan index at which a track is lost, shape (..., T); the number of scans K where it never is.

    `error` (..., K, T, 2).  Lost: farther than `distance` in `scans` scans running, none of them
    before index `after`; the onset is the first of them.  A track that comes back counts as lost.
    """
    if np.ndim(error) < 3 or error.shape[-1] != 2 or np.isnan(error).any():
        raise ValueError("score.loss_onsets: give errors (..., K, T, 2) without NaN")
    if not (distance > 0 and scans >= 1 and after >= 0):
        raise ValueError("score.loss_onsets: give distance > 0, scans >= 1, after >= 0")
    far = np.hypot(error[..., 0], error[..., 1]) > distance
    far[..., :after, :] = False
    if far.shape[-2] < scans:
        return np.full((*far.shape[:-2], far.shape[-1]), far.shape[-2])
    running = np.lib.stride_tricks.sliding_window_view(far, scans, axis=-2).all(axis=-1)
    return np.where(running.any(axis=-2), running.argmax(axis=-2), far.shape[-2])


def kept_rmse(error, kept):
    """RMSE (K, T, 2) over the trials that kept a track, NaN without one, and its influences.

    `error` (n, K, T, 2), `kept` (n, T) bool.  The influence (n, K, T, 2) is that of each trial: its
    standard deviation over sqrt(n) is the standard error, also of means and paired differences.
    """
    if np.ndim(error) != 4 or kept.shape != (len(error), error.shape[2]) or not len(error):
        raise ValueError("score.kept_rmse: give errors (n, K, T, 2) and kept (n, T)")
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = (kept / kept.mean(axis=0))[:, None, :, None]
        square = np.where(kept[:, None, :, None], weight * np.square(error), 0.0)
        mean = np.where(kept.any(axis=0)[:, None], square.mean(axis=0), np.nan)
        return np.sqrt(mean), (square - weight * mean) / (2 * np.sqrt(mean))


def column_test(measured, printed, covariance, ratio, half=0.0):
    """Whether a table's column agrees with ours as a whole: mean difference, its error, z, and p.

    measured, printed : (r,); covariance : (r, r) of our values; ratio : our number of trials over
    the paper's; half : half of the last printed digit.  The mean difference tests for a common
    shift; p is that of d' C**-1 d, chi-square with r degrees of freedom.
    """
    d = np.asarray(measured, float) - np.asarray(printed, float)
    C = np.asarray(covariance, float) * (1.0 + ratio) + np.eye(d.size) * half**2 / 3.0
    if C.shape != (d.size, d.size) or not np.isfinite(C).all() or ratio < 0:
        raise ValueError("column_test: give (r,) values, a finite (r, r) covariance, a ratio >= 0")
    shift, se = float(d.mean()), float(np.sqrt(C.sum())) / d.size
    return shift, se, shift / se, float(chdtrc(d.size, d @ np.linalg.solve(C, d)))
