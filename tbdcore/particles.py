"""Particles: weights on the log scale, resampling, and the probability of existence.

A filter carries ``N`` particles: states ``S`` (N, d) and one log-weight ``lw[n]`` each, because one
frame can be worth a factor e**30 and forty frames in a row overflow a float.

If un-normalised weights are likelihood ratios of "the target is present" against "nothing is
there", their mean is the ratio L of the two hypotheses, and the probability of existence P is

    predict   P' = p_birth (1 - P) + p_survive P                    ``existence_predict``
    update    P  = P' L / (1 - P' + P' L),   L = mean ratio         ``existence_update``

Systematic resampling lays the weights end to end on a line; M arrows fall on it at equal spacing,
with one common random offset ``u``, and ``ancestors[m]`` is the particle that arrow m hits.
Particle n gets floor(M W[n]) or floor(M W[n]) + 1 copies, M W[n] on average, and none if its weight
is zero.  An arrow that rounding would carry past the end hits the last particle of positive weight.

All functions raise ValueError for shapes that do not fit and for indices out of range, and for NaN,
but in states, histories and log-weights of particles: these are copied or refused as they stand.
"""

import math
from typing import Annotated

import numpy as np

from tbdcore.checks import LARGEST, Array, ArrayLike, Integer, Integers, Number, Numbers, checked
from tbdcore.jit import kernel

__all__ = ["existence_predict", "existence_update", "normalise", "systematic"]

Probability = Annotated[float, Number(0.0, 1.0 + 1e-9)]  # sums of probabilities round
Ancestors = Annotated[ArrayLike, Integers("M")]
LEAST, MOST = 1e-200, 1e200  # sum of weights: beyond these the spacing of the arrows is lost


@checked
def normalise(lw: Annotated[ArrayLike, Numbers("N", low=None, single=True)]) -> tuple[Array, float]:
    """Weights W (N,) that sum to one, and log(sum exp(lw) / N), from log-weights lw (N,) < inf.

    A weight may be 0, its logarithm -inf, but not all; NaN is a ValueError.
    """
    top = lw.max(initial=-np.inf)
    if not math.isfinite(top):
        raise ValueError(f"particles.normalise: largest lw of {lw.size} is {top}; give finite ones")
    with np.errstate(over="ignore"):  # beyond 1e308: -inf
        W = lw - top
    np.exp(W, out=W)
    total = W.sum()
    W /= total
    return W, float(top + np.log(total / lw.size))


@checked
def existence_predict(P: Probability, p_birth: Probability, p_survive: Probability) -> float:
    """Probability of existence one frame ahead: a two-state Markov chain."""
    return min(p_birth * (1.0 - P) + p_survive * P, 1.0)


@checked
def existence_update(
    P: Annotated[float, Number(0.0, 1.0)], log_ratio: Annotated[float, Number(-math.inf, math.inf)]
) -> float:
    """Probability of existence after a frame; log_ratio: log-likelihood ratio, present to absent.

    P / (1 - P) is multiplied by exp(log_ratio), 0 at -inf; a certain P, 0 or 1, stays.
    """
    if P in (0.0, 1.0):
        return P
    if log_ratio > 0.0:
        return P / (P + (1.0 - P) * np.exp(-log_ratio))
    ratio = np.exp(log_ratio)
    return P * ratio / (1.0 - P + P * ratio)


def systematic_spec(W, M, u):
    """Specification of :func:`systematic`: invert the cumulative sum at M evenly spaced arrows."""
    C = np.cumsum(W)
    last = np.flatnonzero(W)[-1]
    return np.minimum(np.searchsorted(C, (np.arange(M) + u) * (C[-1] / M), side="right"), last)


@checked
@kernel
def systematic(
    W: Annotated[ArrayLike, Numbers("N", low=None)],
    M: Annotated[int, Integer(0, LARGEST)],
    u: Annotated[float, Number(0.0, 1.0 - 2.0**-53)],
) -> Array:
    """Systematic resampling: the ancestors (M,), ascending; u : offset in [0, 1), one draw.

    W : (N,) weights, finite, none negative, one at least positive; they need not sum to one.
    """
    total, last = 0.0, 0
    for n in range(W.size):
        total += W[n] if W[n] >= 0.0 else np.nan
        if W[n] > 0.0:
            last = n
    if not LEAST <= total <= MOST:
        raise ValueError("particles.systematic: W has a negative weight or NaN, or is all 0")
    step, end = total / M, 0.0
    passed = np.zeros(M + 1, np.int64)  # [m]: particles that end between arrows m - 1 and m
    for n in range(last):
        end += W[n]
        m = min(int(end / step - u + 1.0), M)  # arrows before its end; rounding may add one
        if (m - 1 + u) * step >= end:
            m -= 1
        passed[m] += 1
    return np.cumsum(passed[:M])
