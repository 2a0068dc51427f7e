"""Particles: weights on the log scale, resampling, moments, and the existence of a target that may
not be there.

A filter of this repository carries ``N`` particles: states ``S`` of shape (N, d), one row each, and
one weight each.  What the data say about particle n arrives as a log-weight ``lw[n]``, because one
frame can be worth a factor e**30 and forty frames in a row overflow a float.  What is ever needed
of weights:

=======================  ==============================================================================================
``normalise(lw)``        the weights ``W``, which sum to one, and the log of the mean un-normalised weight
``effective_size(W)``    1 / sum W**2: how many equal weights would be worth as much, from 1 (degenerate) to N
``moments(S, W)``        weighted mean (d,) and covariance (d, d)
``select(lw, M, u)``     the first two and the resampling below, in one pass
``copies(r, S, n)``      the resampled particles, their number in each regime, and the mean state of the living
=======================  ==============================================================================================

The mean un-normalised weight is the useful one of them: if a particle cloud stands for "the target
is present" and its un-normalised weights are likelihood ratios against "nothing is there", then
their mean is the likelihood ratio of the two hypotheses, and the probability of existence follows
by two lines of algebra, the Bernoulli recursion

    predict   P' = p_birth (1 - P) + p_survive P                    ``existence_predict``
    update    P  = P' L / (1 - P' + P' L),   L = mean ratio         ``existence_update``

``systematic`` resampling turns weighted particles into M equal ones.  The weights are laid end to
end on a line of length one, M arrows fall on it at a spacing of 1/M with one common random offset
``u``, and ``ancestors[m]`` is the particle that arrow m hits.  Particle n gets floor(M W[n]) or
floor(M W[n]) + 1 copies, M W[n] on average, and none if its weight is zero.  The sum of W need not
be one to the last bit: the arrows are spread over the sum as it was accumulated, and one that
rounding would carry past the end hits the last particle of positive weight.

The offset is an argument, so the kernel is a function of numbers: one draw ``rng.random()`` by the
caller belongs to one frame of one trial.  Not here: what a state means (``motion``), what a cell
says (``sensor``), when to resample (the notebooks).
"""

import math

import numpy as np

from tbdcore import kernel


def normalise(lw):
    """Weights and evidence from log-weights.

    lw : (N,) log un-normalised weights, -inf allowed, NaN or +inf not.
    Returns W (N,), summing to one, and log_mean = log(sum exp(lw) / N).
    """
    lw = np.asarray(lw, float)
    top = lw.max(initial=-np.inf)
    if not np.isfinite(top):
        raise ValueError(
            f"log-weights: largest of {lw.size} is {top}; "
            f"at least one must be finite and none NaN or inf"
        )
    W = lw - top
    np.exp(W, out=W)
    total = W.sum()
    W /= total
    return W, float(top + np.log(total / lw.size))


def effective_size(W):
    """Kish's effective number of particles, 1 / sum W**2, for weights (N,) that sum to one."""
    return float(1.0 / np.dot(W, W))


def moments(S, W):
    """Weighted mean (d,) and covariance (d, d) of the states S (N, d) under weights W (N,) that sum
    to one.
    """
    mean = W @ S
    D = S - mean
    return mean, (W[:, None] * D).T @ D


def existence_predict(P, p_birth, p_survive):
    """Probability of existence one frame ahead: a two-state Markov chain."""
    return p_birth * (1.0 - P) + p_survive * P


def existence_update(P, log_ratio):
    """Probability of existence after a frame whose log-likelihood ratio, present against absent, is
    log_ratio.

    In odds: P / (1 - P) is multiplied by exp(log_ratio); written so that no exponential can
    overflow.
    """
    if log_ratio > 0.0:
        return P / (P + (1.0 - P) * np.exp(-log_ratio))
    ratio = np.exp(log_ratio)
    return P * ratio / (1.0 - P + P * ratio)


def systematic_spec(W, M, u):
    """Specification of :func:`systematic`: invert the cumulative sum at M evenly spaced arrows."""
    C = np.cumsum(W)
    last = np.flatnonzero(W)[-1]
    return np.minimum(np.searchsorted(C, (np.arange(M) + u) * (C[-1] / M), side="right"), last)


@kernel
def systematic(W, M, u):
    """Systematic resampling: the ancestors (M,), in ascending order.

    W : (N,) weights, non-negative, at least one positive; their sum is taken as it comes.
    M : number of copies wanted.
    u : offset in [0, 1), one draw.

    Particle n is an ancestor until its end, the cumulative sum, has passed the arrow.  So the ends
    are counted between the arrows, and the ancestor of an arrow is the number of ends before it: no
    branch depends on where the weight is.
    """
    total = 0.0
    for w in W:
        total += w
    return _arrows(W, total, M, u)


@kernel
def _arrows(W, total, M, u):
    """The ancestors of :func:`systematic`, given the sum of the weights."""
    last = W.size - 1
    while last > 0 and W[last] <= 0.0:
        last -= 1
    step, dense = total / M, M / total
    passed = np.zeros(
        M + 1, np.int64
    )  # passed[m]: particles that end between arrow m - 1 and arrow m
    c = 0.0
    for n in range(last):
        c += W[n]
        m = min(int(c * dense - u + 1.0), M)
        while m < M and (m + u) * step < c:
            m += 1
        while m > 0 and (m - 1 + u) * step >= c:
            m -= 1
        passed[m] += 1
    ancestors = np.empty(M, np.int64)
    n = 0
    for m in range(M):
        n += passed[m]
        ancestors[m] = n
    return ancestors


def select_spec(lw, M, u):
    """Specification of :func:`select`: normalise, then resample."""
    W, _ = normalise(lw)
    ancestors = systematic_spec(W, M, u)
    return ancestors, effective_size(W), len(set(ancestors))


@kernel
def select(lw, M, u):
    """Systematic resampling from log-weights lw (N,): ancestors (M,), ascending, effective size,
    number of different ancestors.

    The weights are left un-normalised, which changes neither result.  A log-weight of exactly 0,
    that of every absent particle, has its exponential taken once for all.
    """
    top = lw.max()
    W, zero = np.empty(lw.size), math.exp(-top)
    total = squares = 0.0
    for n in range(lw.size):
        W[n] = w = zero if lw[n] == 0.0 else math.exp(lw[n] - top)
        total += w
        squares += w * w
    if not total > 0.0:
        raise ValueError(
            "log-weights: one is NaN or inf, or none is finite; correct the frame or the particles"
        )
    ancestors = _arrows(W, total, M, u)
    different = 1
    for m in range(1, M):
        different += int(ancestors[m] != ancestors[m - 1])
    return ancestors, total * total / squares, different


def copies_spec(r, S, ancestors):
    """Specification of :func:`copies`: fancy indices, masks and means."""
    r, S = r[ancestors], S[ancestors]
    mean = S[r > 0].mean(axis=0) if r.any() else np.full(S.shape[1], np.nan)
    return r, S, np.bincount(r, minlength=3), mean


@kernel
def copies(r, S, ancestors):
    """The ancestors' (M,) copies of regimes r (N,) and states S (N, d); the copies' number in each
    of the regimes 0 (absent), 1 and 2; and the mean state (d,) of those that live, NaN if none
    does: Miao and Chen's equations (11) and (12).
    """
    M, d = ancestors.size, S.shape[1]
    regimes, states, counts, total = (
        np.empty(M, r.dtype),
        np.empty((M, d)),
        np.zeros(3, np.int64),
        np.zeros(d),
    )
    for m in range(M):
        n = ancestors[m]
        a = regimes[m] = r[n]
        counts[a] += 1
        for i in range(d):
            v = states[m, i] = S[n, i]
            total[i] += v if a > 0 else 0.0
    return regimes, states, counts, total / (M - counts[0])


# Ancestors' history -------------------------------------------------------------------------------
# ---------------------
#
# A particle's state has a past: the states of its ancestors, a candidate track.  What was read
# along that track in the last
# `window` frames is kept in H (window, s, N), s samples a frame, particles last; frame k stands in
# row k mod window, whatever the
# age of the particle, so that a frame is written in one piece and only the particles move in
# resampling.


def record(H, age, k, sample):
    """Enter what every particle read in frame k, in place: sample (s, N) into row k mod window of
    H; age (N,) grows by one.
    """
    H[k % len(H)] = sample
    age += 1


def inherit_spec(H, age, ancestors, births):
    """Specification of :func:`inherit`: fancy indices, and zeros behind them."""
    return tuple(
        np.concatenate((a[..., ancestors], np.zeros((*a.shape[:-1], births), a.dtype)), axis=-1)
        for a in (H, age)
    )


@kernel
def inherit(H, age, ancestors, births):
    """History and age after resampling: those of the `ancestors` (M,), followed by `births`
    particles that have none.

    H : (window, s, N), s samples a frame; age : (N,) frames recorded since birth.
    Returns new arrays, (window, s, M + births) and (M + births,).
    """
    M, size = ancestors.size, ancestors.size + births
    moved, older = np.empty((H.shape[0], H.shape[1], size)), np.zeros(size, age.dtype)
    for i in range(H.shape[0]):
        for j in range(H.shape[1]):
            old, new = H[i, j], moved[i, j]
            for m in range(M):
                new[m] = old[ancestors[m]]
            new[M:] = 0.0
    for m in range(M):
        older[m] = age[ancestors[m]]
    return moved, older


def distinct(labels):
    """Number of different values in a sorted array: of ancestors, or of founders carried along with
    the particles.
    """
    return int(np.count_nonzero(np.diff(labels)) + (len(labels) > 0))
