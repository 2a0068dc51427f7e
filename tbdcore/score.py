"""Scores: how good an estimate is, and how far a Monte Carlo number can be trusted.

Nothing here knows what was estimated, so a peer library can be judged by the same functions.

**Proportions.**  k successes in n trials: ``proportion`` gives the estimate and its standard error,
``wilson`` the interval to draw, which stays inside [0, 1] and does not collapse to a point at k = 0
or n.

**Crossings.**  Papers quote the abscissa at which a curve passes a level: "the SNR for a detection
probability of 0.5".  ``crossing`` finds it by linear interpolation between the two abscissas around
the *last downward* passage (a noisy curve may touch the level earlier), and ``crossing_error``
gives the delta-method standard error

    se(x*) = sqrt( ((1 - w) s1)**2 + (w s2)**2 + 2 w (1 - w) c12 ) / |slope|,

w the weight of the second point, s1 and s2 the standard errors and c12 the covariance of the two
curve values, which are correlated when the same trials make both.  ``crossings`` does the same for
many curves at once, one per row, as the replicas of a bootstrap or of the paper's own number of
trials need it.

**Lost tracks.**  ``loss_onsets`` says when a track was lost under a stated rule, ``kept_rmse`` what
the error of the others is, with the influence of each trial on it, from which paired differences
get their errors.

**Errors.**  ``rmse`` is the root mean square over trials of a Euclidean error; ``ospa`` the
distance between two finite sets.
"""

import math

import numpy as np

Z99 = 2.5758293035489004  # half width of a 99 % normal interval


def proportion(k, n):
    """Estimate k / n and its standard error; NaN where n is 0.  Scalars or arrays."""
    k, n = np.asarray(k, float), np.asarray(n, float)
    with np.errstate(invalid="ignore", divide="ignore"):
        p = np.where(n > 0, k / n, np.nan)
        return p, np.sqrt(p * (1 - p) / n)


def wilson(k, n, z=Z99):
    """Wilson's interval (low, high) of a proportion; (0, 1) where n is 0.  Scalars or arrays."""
    k, n = np.asarray(k, float), np.asarray(n, float)
    centre, half = (
        k + z * z / 2,
        z * np.sqrt(np.maximum(k * (n - k), 0) / np.maximum(n, 1) + z * z / 4),
    )
    return (centre - half) / (n + z * z), (centre + half) / (n + z * z)


def crossing(x, y, level):
    """Abscissa of the last downward passage of a curve through a level; NaN when there is none.

    `x` (m,) monotone, `y` (m,) the curve; NaNs in `y` never cross.
    """
    i, w = _last_passage(np.asarray(y, float), level)
    return math.nan if i is None else float(x[i] + w * (x[i + 1] - x[i]))


def crossing_error(x, y, level, se, correlation=0.0):
    """Standard error of :func:`crossing` from those of the curve, `se` (m,), and the correlation of
    neighbouring values.
    """
    y, se = np.asarray(y, float), np.asarray(se, float)
    i, w = _last_passage(y, level)
    if i is None:
        return math.nan
    a, b = (1 - w) * se[i], w * se[i + 1]
    slope = (y[i + 1] - y[i]) / (x[i + 1] - x[i])
    return float(math.sqrt(a * a + b * b + 2 * correlation * a * b) / abs(slope))


def crossings(x, curves, level):
    """:func:`crossing` of every row of `curves` (n, m); shape (n,)."""
    return np.array([crossing(x, curve, level) for curve in np.atleast_2d(curves)])


def _last_passage(y, level):
    """Index i and weight w of the last i with y[i] >= level > y[i + 1]."""
    down = np.flatnonzero((y[:-1] >= level) & (y[1:] < level))
    if not down.size:
        return None, math.nan
    i = int(down[-1])
    return i, float((y[i] - level) / (y[i] - y[i + 1]))


def rmse(error, axis=0):
    """Root mean square Euclidean length, over `axis`, of errors with components on the last axis;
    NaNs are left out.
    """
    return np.sqrt(np.nanmean(np.sum(np.square(error), axis=-1), axis=axis))


def ospa(X, Y, c, p):
    """Optimal subpattern assignment distance of two finite sets of points, m (Schuhmacher, Vo and
    Vo 2008).

    X : (m, d), Y : (n, d), either may be empty; c > 0 the price of a point too many; p >= 1 the
        order.

        ( (min over assignments sum min(c, distance)**p + c**p |m - n|) / max(m, n) )**(1/p)

    The power stands before the assignment: the cheapest pairing of distances is in general not that
    of their p-th powers.
    """
    from scipy.optimize import (
        linear_sum_assignment,
    )  # half a second, which only this distance is worth

    X, Y = np.atleast_2d(X), np.atleast_2d(Y)
    m, n = (0 if A.size == 0 else len(A) for A in (X, Y))
    if not c > 0 or not p >= 1:
        raise ValueError(
            f"ospa: cut-off {c} and order {p}; the cut-off must be positive and the order at least "
            f"1"
        )
    if min(m, n) == 0:
        return 0.0 if max(m, n) == 0 else float(c)
    cost = np.minimum(np.linalg.norm(X[:, None] - Y[None], axis=-1), c) ** p
    return float(
        ((cost[linear_sum_assignment(cost)].sum() + c**p * abs(m - n)) / max(m, n)) ** (1 / p)
    )


def ospa_bernoulli(x, existence, truth, c, threshold=0.5):
    """OSPA (...,) of at most one estimate and at most one target, where every order p gives the
    same number.

    x : (..., d) estimates, empty sets where existence (...,) is at or below the threshold; truth :
        (..., d), NaN for no target. Both empty: 0.  One empty: c.  Neither: the distance, at most
        c.
    """
    declared, present = np.asarray(existence) > threshold, ~np.isnan(truth[..., 0])
    distance = np.minimum(np.sqrt(np.sum(np.square(x - truth), axis=-1)), c)
    return np.where(declared & present, distance, np.where(declared | present, float(c), 0.0))


# Tracks that may be lost
# -----------------------------------------------------------------------------------------------


def loss_onsets(error, distance, scans, after=0):
    """Scan index at which a track is lost, shape (..., T), and the number of scans K where it never
    is.

    `error` (..., K, T, 2).  Lost: farther than `distance` in `scans` scans running, none of them
    before index `after`; the onset is the first of them.  A track that comes back counts as lost
    all the same.
    """
    far = np.hypot(error[..., 0], error[..., 1]) > distance
    far[..., :after, :] = False
    if far.shape[-2] < scans:
        return np.full((*far.shape[:-2], far.shape[-1]), far.shape[-2])
    running = np.lib.stride_tricks.sliding_window_view(far, scans, axis=-2).all(axis=-1)
    return np.where(running.any(axis=-2), running.argmax(axis=-2), far.shape[-2])


def kept_rmse(error, kept):
    """RMSE by scan, track and axis over the trials in which a track was kept, and what each trial
    contributes to it.

    `error` (n, K, T, 2), `kept` (n, T) bool.  Returns the RMSE (K, T, 2) and its influences (n, K,
    T, 2): their standard deviation over sqrt(n) is the standard error, of the RMSE or, after
    averaging, subtracting or both, of means and paired differences. NaN where no trial is kept.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = (kept / kept.mean(axis=0))[:, None, :, None]
        square = np.where(kept[:, None, :, None], weight * np.square(error), 0.0)
        mean = np.where(kept.any(axis=0)[:, None], square.mean(axis=0), np.nan)
        return np.sqrt(mean), (square - weight * mean) / (2 * np.sqrt(mean))


def influence_error(influence):
    """Standard error over the leading axis of influences (n, ...)."""
    return np.std(influence, axis=0) / math.sqrt(len(influence))
