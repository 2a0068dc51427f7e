"""Data association: gating, exact joint marginals, and approximations without joint events.

A track t of T exists with probability P^t and is detected inside its gate with probability
D^t = P_D P_W.  It causes one plot z_m of M or none; a plot has at most one track; the rest is
Poisson clutter of density lambda.  What a tracker needs is the array ``log_ratio`` (T, M),

    l[t, m] = ln p^t(z_m) - ln lambda        -inf where plot m is outside the gate of track t

and every associator here has the same form, (log_ratio, existence, detect) -> (beta, existence):

    beta[t, 0]     probability that no plot is the one of track t, given that the target exists
    beta[t, m]     probability that plot m - 1 is; each row sums to one
    existence[t]   probability that the target exists, given the scan

``ipda``       each track alone, as if all other plots were clutter (Musicki, Evans and Stankovic
               1994); exact for one track
``jipda``      exact marginals over all joint events (Musicki and Evans 2004), O(M T 2^T)
``clustered_jipda``  the same for each cluster of tracks that share plots
``ljipda``     each track alone, plots discounted by their *visibility* (Zhang et al.), O(M T)
LM-IPDA        ``ipda`` of ``modulated_log_ratio``, each track alone, the other tracks added to the
               clutter density (Musicki and La Scala 2008), O(M T)

Zhang et al. is Zhang, Wang and Niu, "A linear tracking method of sea radar based on the amplitude
information".

``jipda`` lists no events.  It is dynamic programming over subsets (Held and Karp 1962), forwards
and backwards like the forward-backward algorithm (Rabiner 1989): the plots are the steps, the set
of tracks that have been used is the state.  For a subset A of tracks, F_m(A) is the summed weight
of all ways in which the first m plots use exactly these: F_m(A) = F_{m-1}(A) + sum_{t in A} w[t, m]
F_{m-1}(A - t).  B_m(A), the same backwards, completes the scan when A is used up, and the marginal
of (t, m) is w[t, m] sum_{A without t} F_{m-1}(A) B_m(A + t) / B_0(empty).  Weights stay logarithms
until the dual variables of the best single assignment have been added; then every factor is at most
one, the best joint event weighs exactly one, and nothing overflows.  The assignment is found by the
Hungarian method with shortest augmenting paths (Jonker and Volgenant 1987).

Valid are existence and detect in [0, 1] and log ratios of at most 1e9, or -inf; anything else, NaN
too, is a ValueError, and so is a certain track (both 1) without a plot.  Zero tracks and zero plots
are valid.  A track impossible after the scan gets existence 0 and beta[t, 0] = 1.

``predict_tracks``, ``gate_tracks`` and ``update_mixture`` take several tracks through a scan whose
plots carry association weights.  Their plots are in metres, linear measurements of the position.
``amplitude_ratio`` says how much more a plot looks like the target than like a false alarm.

Do plots agree with what a tracker is told: start states, errors, clutter?  ``look`` keeps what the
gates of one scan hold, and ``contradiction`` names, in one line, what exceeds its tolerance with
99 % certainty.
"""

import itertools
import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from tbdcore import kalman
from tbdcore.checks import Array, ArrayLike, Covariance, Integers, Number, Numbers, checked
from tbdcore.jit import kernel
from tbdcore.kalman import (
    Positive,
    Track,
    TrackCovariances,
    Tracks,
    _finite,
    polar,
    polar_noise,
    predict,
)

__all__ = [
    "MAX_TRACKS",
    "Flags",
    "Seen",
    "amplitude_ratio",
    "clustered_jipda",
    "contradiction",
    "gate",
    "gate_tracks",
    "ipda",
    "jipda",
    "kept_rmse",
    "ljipda",
    "look",
    "modulated_log_ratio",
    "other_order",
    "position_bound",
    "predict_tracks",
    "prior_odds",
    "update_mixture",
    "visibility",
]


def amplitude_ratio_spec(excess, snr):
    """Log of the ratio of the two exponential densities."""
    density = [-np.asarray(excess) / (1 + S) - np.log(1 + S) for S in snr]
    return np.array(density).reshape(len(snr), len(excess)) + np.asarray(excess)


@checked
@kernel
def amplitude_ratio(
    excess: Annotated[ArrayLike, Numbers("M", low=0.0)],
    snr: Annotated[ArrayLike, Numbers("T", low=0.0)],
) -> Array:
    """ln of p(excess | target) / p(excess | noise), S / (1 + S) excess - ln(1 + S), shape (T, M).

    ``excess`` (M,) is lambda - eta >= 0 of each plot, for a Rayleigh amplitude a with parameter 1
    and threshold tau (a**2 - tau**2) / 2; ``snr`` S (T,) the mean linear ratio of each target.
    """
    out = np.empty((snr.size, excess.size))
    for t in range(snr.size):
        gain, level = snr[t] / (1.0 + snr[t]), math.log(1.0 + snr[t])
        for m in range(excess.size):
            out[t, m] = gain * excess[m] - level
    return out


MAX_TRACKS = 16  # tracks in one joint association: 2^16 subsets per plot, 0.5 MB a plot
LogRatio = Annotated[ArrayLike, Numbers("T", "M", low=-math.inf, high=1e9)]
Existence = Annotated[ArrayLike, Numbers("T", low=0.0, high=1.0 + 1e-9)]
Detection = Annotated[ArrayLike, Numbers("T", low=0.0, high=1.0)]
TINY = np.finfo(float).tiny
Result = tuple[Array, Array]


@checked
@kernel
def gate(
    z: Annotated[ArrayLike, Numbers("M", 2, low=-math.inf, high=math.inf)],
    zhat: Annotated[ArrayLike, Numbers("T", 2)],
    S: Annotated[ArrayLike, Numbers("T", 2, 2)],
    gamma: Annotated[float, Number(TINY)],
    p_gate: Annotated[float, Number(TINY, 1.0)],
) -> Result:
    """The plots inside at least one gate, and the log density of each track at these plots.

    ``z`` (M, 2) plots in m, ``zhat`` (T, 2) predicted, ``S`` (T, 2, 2) innovation covariances in
    m^2, ``gamma`` the gate on the squared Mahalanobis distance, ``p_gate`` its probability.  A plot
    at infinity is outside.  Gives ``picked`` (C,), increasing indices into ``z``, and
    ``log_density`` (T, C), ln of N(z; zhat, S) / p_gate, eq. (21) of Zhang et al., -inf outside the
    track's own gate.
    """
    M, T = len(z), len(zhat)
    for t in range(T):
        det = S[t, 0, 0] * S[t, 1, 1] - S[t, 0, 1] * S[t, 1, 0]
        trace, skew = S[t, 0, 0] + S[t, 1, 1], S[t, 0, 1] - S[t, 1, 0]
        if not (0.0 < p_gate * det < np.inf and trace > 0.0 and abs(skew) <= 1e-9 * trace):
            raise ValueError("ljipda_ai.gate: a covariance S is not positive definite")
    picked, log_p, count = np.empty(M, np.int64), np.empty((T, M)), 0
    for m in range(M):
        hit = False
        for t in range(T):
            dx, dy = z[m, 0] - zhat[t, 0], z[m, 1] - zhat[t, 1]
            log_p[t, count] = -np.inf
            if dx * dx > gamma * S[t, 0, 0] or dy * dy > gamma * S[t, 1, 1]:
                continue  # outside the box around the ellipse
            det = S[t, 0, 0] * S[t, 1, 1] - S[t, 0, 1] * S[t, 1, 0]
            d2 = (S[t, 1, 1] * dx * dx - 2.0 * S[t, 0, 1] * dx * dy + S[t, 0, 0] * dy * dy) / det
            if d2 <= gamma:
                log_p[t, count] = -0.5 * d2 - math.log(2.0 * math.pi * p_gate * math.sqrt(det))
                hit = True
            elif not d2 > gamma:
                raise ValueError("ljipda_ai.gate: a plot or a prediction is NaN; remove it")
        if hit:
            picked[count] = m
            count += 1
    return picked[:count].copy(), log_p[:, :count].copy()


def gate_spec(z, zhat, S, gamma, p_gate):
    """All Mahalanobis forms at once."""
    nu = z[None, :, :] - zhat[:, None, :]
    d2 = np.einsum("tmi,tij,tmj->tm", nu, np.linalg.inv(S), nu)
    log_p = -0.5 * d2 - np.log(2 * np.pi * p_gate) - 0.5 * np.linalg.slogdet(S)[1][:, None]
    log_p = np.where(d2 <= gamma, log_p, -np.inf)
    picked = np.flatnonzero(np.isfinite(log_p).any(axis=0))
    return picked, log_p[:, picked]


@checked
@kernel
def ipda(log_ratio: LogRatio, existence: Existence, detect: Detection) -> Result:
    """Integrated PDA of each track alone (Musicki, Evans and Stankovic 1994).

    Eqs. (18) and (22) to (24) of Zhang et al. with every visibility one.

    ``log_ratio`` (T, M), ``existence`` (T,) predicted probabilities, ``detect`` (T,) = P_D P_W.
    Returns beta (T, M + 1) and the posterior existence (T,).
    """
    T, M = log_ratio.shape
    beta, posterior = np.empty((T, M + 1)), np.empty(T)
    for t in range(T):
        miss, hit = math.log(1.0 - detect[t]), math.log(detect[t])
        top = miss
        for m in range(M):
            top = max(top, hit + log_ratio[t, m])
        if top == -np.inf:  # impossible: nothing is its plot
            if existence[t] >= 1.0:
                raise ValueError("ljipda_ai.ipda: a certain track has no plot; lower existence")
            beta[t], beta[t, 0], posterior[t] = 0.0, 1.0, 0.0
            continue
        beta[t, 0] = math.exp(miss - top)
        total = beta[t, 0]
        for m in range(M):
            l = log_ratio[t, m]
            beta[t, m + 1] = 0.0 if l == -np.inf else math.exp(hit + l - top)
            total += beta[t, m + 1]
        if not total < np.inf:
            raise ValueError("ljipda_ai.ipda: log_ratio is NaN or infinite; correct it")
        for m in range(M + 1):
            beta[t, m] /= total
        dead = max(1.0 - existence[t], 0.0) * math.exp(min(-top, 700.0))
        alive = existence[t] * total
        posterior[t] = alive / (alive + dead) if alive > 0.0 else 0.0
    return beta, posterior


def ipda_spec(log_ratio, existence, detect):
    """Eqs. (18), (22), (23), (24) of Zhang et al. as printed, with P_V = 1."""
    L = np.exp(log_ratio)
    delta = detect * (1 - L.sum(axis=1))
    posterior = (1 - delta) * existence / (1 - delta * existence)
    beta = np.column_stack([1 - detect, detect[:, None] * L])
    beta[:, 0] += beta.sum(axis=1) == 0  # an impossible track: nothing is its plot
    return beta / beta.sum(axis=1, keepdims=True), posterior


@checked
@kernel
def prior_odds(log_ratio: LogRatio, existence: Existence, detect: Detection) -> Array:
    """Odds P_m^t / (1 - P_m^t) (T, M) of the prior (12) of Zhang et al., zero outside the gate.

    The prior shares D^t P^t among the plots of the gate in proportion to their densities.  Raises
    ValueError where a certain track has a single plot, whose odds are infinite.
    """
    T, M = log_ratio.shape
    odds = np.zeros((T, M))
    for t in range(T):
        top, total = -np.inf, 0.0
        for m in range(M):
            top = max(top, log_ratio[t, m])
        for m in range(M):
            if log_ratio[t, m] > -np.inf:
                odds[t, m] = math.exp(log_ratio[t, m] - top)
                total += odds[t, m]
        if detect[t] * existence[t] >= total > 0.0:
            raise ValueError("ljipda_ai: the prior of a plot is 1; lower existence")
        for m in range(M):
            if odds[t, m] > 0.0:
                prior = detect[t] * existence[t] * odds[t, m] / total
                odds[t, m] = prior / (1.0 - prior)
    return odds


def prior_odds_spec(log_ratio, existence, detect):
    """Eq. (12) of Zhang et al. as printed."""
    p = np.exp(log_ratio)
    share = np.divide(p, p.sum(axis=1, keepdims=True), out=np.zeros_like(p), where=p > 0)
    prior = (detect * existence)[:, None] * share
    return prior / (1 - prior)


@checked
@kernel
def visibility(log_ratio: LogRatio, existence: Existence, detect: Detection) -> Array:
    """Probability (T, M) that plot m does not come from a track other than t.

    Eqs. (12) to (16) of Zhang et al.; (14) and (15) condition the independent priors (12) on at
    most one track per plot.
    """
    odds = prior_odds(log_ratio, existence, detect)
    visible = np.empty(odds.shape)
    for m in range(odds.shape[1]):
        total = 1.0
        for t in range(len(odds)):
            total += odds[t, m]
        for t in range(len(odds)):
            visible[t, m] = (1.0 + odds[t, m]) / total
    return visible


def visibility_spec(log_ratio, existence, detect):
    """Eqs. (14) and (16) of Zhang et al. as printed, on the prior (12)."""
    odds = prior_odds_spec(log_ratio, existence, detect)
    source = odds / (1 + odds.sum(axis=0))  # (14)
    return 1 - (source.sum(axis=0) - source)  # (16)


@checked
@kernel
def modulated_log_ratio(log_ratio: LogRatio, existence: Existence, detect: Detection) -> Array:
    """ln p^t - ln Omega^t (T, M), Omega^t(z) = lambda + sum_{j != t} p^j(z) P_m^j / (1 - P_m^j).

    Eq. (16) of Musicki and La Scala (2008), with the prior (12) of Zhang et al.  ``ipda`` of it is
    LM-IPDA.
    """
    odds = prior_odds(log_ratio, existence, detect)
    T, M = odds.shape
    out, extra = np.empty((T, M)), np.empty(T)
    for m in range(M):
        best = 0
        for t in range(T):
            extra[t] = log_ratio[t, m] + math.log(odds[t, m]) if odds[t, m] > 0.0 else -np.inf
            best = t if extra[t] > extra[best] else best
        omega, others = _log_density_sum(extra, -1), _log_density_sum(extra, best)
        for t in range(T):
            if t == best:
                out[t, m] = log_ratio[t, m] - others
            else:  # the largest term stays in the sum, so nothing cancels
                out[t, m] = log_ratio[t, m] - omega - math.log1p(-math.exp(extra[t] - omega))
    return out


@kernel
def _log_density_sum(extra, without):
    """ln(1 + sum of exp(extra) over all entries but one)."""
    top, total = 0.0, 0.0
    for t in range(extra.size):
        top = max(top, extra[t]) if t != without else top
    for t in range(extra.size):
        if t != without and extra[t] > -np.inf:
            total += math.exp(extra[t] - top)
    return top + math.log(total + math.exp(-top))


def modulated_log_ratio_spec(log_ratio, existence, detect):
    """The density Omega / lambda, dense."""
    others = np.exp(log_ratio) * prior_odds_spec(log_ratio, existence, detect)
    omega = [1 + np.delete(others, t, axis=0).sum(axis=0) for t in range(len(others))]
    return log_ratio - np.log(np.reshape(omega, log_ratio.shape))


@checked
@kernel
def ljipda(
    log_ratio: LogRatio,
    log_amplitude: Annotated[ArrayLike, Numbers("T", "M")],
    existence: Existence,
    detect: Detection,
) -> Result:
    """LJIPDA-AI, eqs. (12) to (24) of Zhang et al.; with ``log_amplitude`` zero it is LJIPDA.

    ``log_ratio`` (T, M) = ln p - ln lambda is kinematic and alone sets the visibility;
    ``log_amplitude`` (T, M) = ln Lambda multiplies the density afterwards, in (18) and (23) only.
    Returns beta (T, M + 1) and the posterior existence (T,).
    """
    visible = visibility(log_ratio, existence, detect)
    T, M = visible.shape
    for t in range(T):
        for m in range(M):
            visible[t, m] = log_ratio[t, m] + math.log(visible[t, m]) + log_amplitude[t, m]
    return ipda(visible, existence, detect)


def ljipda_spec(log_ratio, log_amplitude, existence, detect):
    """Eqs. (18), (19), (22) to (24) of Zhang et al. as printed, on the visibility of (16)."""
    visible = visibility_spec(log_ratio, existence, detect)
    p_hat = np.exp(log_ratio) * np.exp(log_amplitude)  # (19), in units of lambda = n_hat / V
    delta = detect * (1 - (visible * p_hat).sum(axis=1))  # (18)
    posterior = (1 - delta) * existence / (1 - delta * existence)  # (22)
    beta = detect[:, None] * visible * p_hat / (1 - delta)[:, None]  # (23)
    return np.column_stack([(1 - detect) / (1 - delta), beta]), posterior  # (24)


# Hungarian method with shortest augmenting paths (Jonker and Volgenant 1987).  Track by track, the
# shortest path to a free column is found; a path enters a column that is not free, and goes on from
# the track that holds it.  Then each track on the path takes the next column of it.
#   holder[j] : track that holds column j, or -1; before[j] : the column before j on the path
#   length[j] : of the path to j, less that to the column that was closed last
@kernel
def _potentials(log_w, log_miss):
    """Dual variables a (T,) of the tracks and v (M,) of the plots, with which jipda scales.

    log_w[t, m] + a[t] + v[m], log_miss[t] + a[t] and v[m] are at most 0, and 0 where they are
    factors of the best joint event.  This event is an assignment of tracks to columns: the M plots
    at cost -log_w, and for each track a private column, its miss, at cost -log_miss.
    """
    T, M = log_w.shape
    root = M + T  # the column where each search begins; the new track stands in it
    track_dual, column_dual = np.zeros(T), np.zeros(M + T + 1)
    holder, before = np.full(M + T + 1, -1), np.empty(M + T + 1, np.int64)
    for t in range(T):
        holder[root] = t
        length, seen = np.full(M + T, np.inf), np.zeros(M + T + 1, np.bool_)
        column = root
        while holder[column] >= 0:
            seen[column] = True
            i, nearest, step = holder[column], -1, np.inf
            for j in range(M + T):
                if seen[j]:
                    continue
                if j < M or j == M + i:
                    cost = (-log_w[i, j] if j < M else -log_miss[i]) - track_dual[i]
                    if cost - column_dual[j] < length[j]:
                        length[j], before[j] = cost - column_dual[j], column
                if length[j] < step:
                    step, nearest = length[j], j
            if nearest < 0:
                raise ValueError("ljipda_ai.jipda: a certain track has no plot; lower existence")
            for j in range(M + T):
                if seen[j]:
                    track_dual[holder[j]] += step
                    column_dual[j] -= step
                else:
                    length[j] -= step
            track_dual[t] += step
            column = nearest
        while column != root:
            holder[column] = holder[before[column]]
            column = before[column]
    # The dual of a private column is at most 0, and 0 unless its track holds it: log_miss needs it,
    # and log_w of a pair in the best event is not changed by it.
    return track_dual + column_dual[M:root], column_dual[:M].copy()


@kernel
def _subset_marginals(w, miss, idle):
    """Marginals (T, M + 1) of all joint events, column 0 the miss; see the head of this module.

    w (T, M), miss (T,), idle (M,) : factors of a pair, a lone track, a lone plot; all at most 1.
    Bit t of the integer A says that the set A of used tracks has track t.  With plots counted from
    0, ``ahead[A]`` is F_m(A), the sum of all ways in which the plots before m use exactly A, and
    ``back[m, A]`` is B_m(A), the sum of all ways to go on from plot m, misses included.
    """
    T, M = w.shape
    full = 1 << T
    back, ahead = np.ones((M + 1, full)), np.zeros(full)
    for A in range(full):
        for t in range(T):
            if not A >> t & 1:
                back[M, A] *= miss[t]
    for m in range(M - 1, -1, -1):
        for A in range(full):
            back[m, A] = idle[m] * back[m + 1, A]
        for t in range(T):
            bit = 1 << t
            if w[t, m] > 0.0:
                for A in range(full):
                    if not A & bit:
                        back[m, A] += w[t, m] * back[m + 1, A | bit]
    out = np.zeros((T, M + 1))
    ahead[0] = 1.0
    for m in range(M):
        for t in range(T):
            bit, total = 1 << t, 0.0
            if w[t, m] > 0.0:
                for A in range(full):
                    if not A & bit:
                        total += ahead[A] * back[m + 1, A | bit]
                out[t, m + 1] = w[t, m] * total / back[0, 0]
        for A in range(full - 1, -1, -1):  # downwards: subsets of A still hold the previous stage
            total = idle[m] * ahead[A]
            for t in range(T):
                if A >> t & 1:
                    total += w[t, m] * ahead[A ^ (1 << t)]
            ahead[A] = total
    for t in range(T):
        for A in range(full):
            if not A >> t & 1:
                out[t, 0] += ahead[A] * back[M, A] / back[0, 0]
    return out


@checked
@kernel
def jipda(log_ratio: LogRatio, existence: Existence, detect: Detection) -> Result:
    """Joint integrated PDA, exact: the marginals over all joint events.  As ``ipda``.

    An event weighs prod_{t missed} (1 - D^t P^t) prod_{(t, m)} D^t P^t exp(l[t, m]); given a miss
    the target exists with probability (1 - D) P / (1 - D P).  The limits are MAX_TRACKS and 1 GB.
    """
    T, M = log_ratio.shape
    if T > MAX_TRACKS or (M + 1) << T > 1 << 27:
        words = "ljipda_ai.jipda: the limit is 16 tracks that share plots, and 1 GB; choose LM-AI"
        raise ValueError(words)
    log_w, log_miss = np.full((T, M), -np.inf), np.empty(T)
    for t in range(T):
        log_miss[t] = math.log(max(1.0 - detect[t] * existence[t], 0.0))
        for m in range(M):
            if not (abs(log_ratio[t, m]) <= 1e9 or log_ratio[t, m] == -np.inf):
                raise ValueError("ljipda_ai.jipda: log_ratio is NaN, above 1e9 or below -1e9")
            if existence[t] > 0.0:
                log_w[t, m] = math.log(detect[t] * existence[t]) + log_ratio[t, m]
    # Every joint event has each track once, with a plot or missed, and each plot once, with a track
    # or alone: exp(a) and exp(v) multiply all events by the same number, and change no marginal.
    # From here on log_w and log_miss hold the scaled factors themselves, not their logarithms.
    a, v = _potentials(log_w, log_miss)
    for t in range(T):
        log_miss[t] = math.exp(log_miss[t] + a[t])
        for m in range(M):
            log_w[t, m] = 0.0 if log_w[t, m] == -np.inf else math.exp(log_w[t, m] + a[t] + v[m])
    beta, posterior = _subset_marginals(log_w, log_miss, np.exp(v)), np.empty(T)
    for t in range(T):
        missed = 1.0 - detect[t] * existence[t]
        beta[t, 0] *= (1.0 - detect[t]) * existence[t] / missed if missed > 0.0 else 0.0
        posterior[t] = beta[t].sum()
        if posterior[t] > 0.0:
            for m in range(M + 1):
                beta[t, m] /= posterior[t]
        else:
            beta[t, 0] = 1.0  # a track that is certainly dead: nothing is its plot
    return beta, posterior


def jipda_spec(log_ratio, existence, detect):
    """Every joint event by name: each track takes a plot or none, no plot twice."""
    T, M = log_ratio.shape
    w = np.column_stack([1 - detect * existence, (detect * existence)[:, None] * np.exp(log_ratio)])
    joint = np.zeros((T, M + 1))
    for event in itertools.product(range(M + 1), repeat=T):
        taken = [m for m in event if m > 0]
        if len(taken) == len(set(taken)):
            joint[range(T), event] += math.prod(w[t, m] for t, m in enumerate(event))
    joint = joint / joint.sum(axis=1, keepdims=True)
    joint[:, 0] *= (1 - detect) * existence / np.maximum(1 - detect * existence, 1e-300)
    posterior = joint.sum(axis=1)
    joint[:, 0] += posterior == 0  # an impossible track: nothing is its plot
    return joint / joint.sum(axis=1, keepdims=True), posterior


@kernel
def _clusters(log_ratio):
    """Label (T,) of each track's cluster: the first of the tracks that it shares plots with,
    directly or through others.
    """
    T, M = log_ratio.shape
    label = np.arange(T)
    for m in range(M):
        first = -1
        for t in range(T):
            if log_ratio[t, m] == -np.inf:
                continue
            first = t if first < 0 else first
            low, high = min(label[t], label[first]), max(label[t], label[first])
            for i in range(T):
                if label[i] == high:
                    label[i] = low
    return label


@kernel
def _plots_of(tracks, log_ratio):
    """Indices of the plots that one of the tracks may take."""
    seen = np.zeros(log_ratio.shape[1], np.bool_)
    for t in tracks:
        for m in range(seen.size):
            seen[m] |= log_ratio[t, m] != -np.inf
    return np.flatnonzero(seen)


@checked
@kernel
def clustered_jipda(log_ratio: LogRatio, existence: Existence, detect: Detection) -> Result:
    """``jipda`` of each cluster of tracks that share plots: the same marginals.

    Arguments and results are those of ``jipda``.  The limit of MAX_TRACKS is that of a cluster.
    """
    T, M = log_ratio.shape
    label = _clusters(log_ratio)
    beta, posterior = np.zeros((T, M + 1)), np.empty(T)
    for first in range(T):
        own = np.flatnonzero(label == first)
        if own.size == 0:
            continue
        if own.size > MAX_TRACKS:
            raise ValueError("x: over 16 tracks share plots, the limit of joint events; use LM-AI")
        plots = _plots_of(own, log_ratio)
        part = np.empty((own.size, plots.size))
        for i, t in enumerate(own):
            for j, m in enumerate(plots):
                part[i, j] = log_ratio[t, m]
        weights, alive = jipda(part, existence[own], detect[own])
        for i, t in enumerate(own):
            posterior[t], beta[t, 0] = alive[i], weights[i, 0]
            for j, m in enumerate(plots):
                beta[t, m + 1] = weights[i, j + 1]
    return beta, posterior


def clustered_jipda_spec(log_ratio, existence, detect):
    """The joint events of all tracks together."""
    return jipda_spec(log_ratio, existence, detect)


@kernel
def _rotated(u, v, n, along, across):
    """As in ``kalman``: Numba's cache of this module does not see a change in another one."""
    xx, yy = along * u * u + across * v * v, along * v * v + across * u * u
    return xx / n, (along - across) * u * v / n, yy / n


@kernel
def _finite_tracks(mean, cov):
    """The tracks; ValueError where one has a NaN or an infinity."""
    wrong = 0
    for part in (mean.ravel(), cov.ravel()):
        for value in part:
            wrong += not math.isfinite(value)
    if wrong > 0:
        raise ValueError("ljipda_ai: an argument or the result is NaN or infinite; is r = 0?")
    return mean, cov


def predict_tracks_spec(x, P, F, Q):
    """:func:`predict`, whose arguments may be stacks."""
    return predict(x, P, F, Q)


@checked
@kernel
def predict_tracks(
    x: Tracks,
    P: TrackCovariances,
    F: Annotated[ArrayLike, Numbers("T", 4, 4)],
    Q: Annotated[ArrayLike, Covariance(4, 4)],
) -> Track:
    """Means (T, 4), covariances (T, 4, 4) one scan later, F (T, 4, 4) by track, Q (4, 4) common."""
    T = len(x)
    mean, cov, FP = np.zeros((T, 4)), np.empty((T, 4, 4)), np.empty((4, 4))
    for t in range(T):
        for i in range(4):
            for j in range(4):
                mean[t, i] += F[t, i, j] * x[t, j]
                FP[i, j] = 0.0
                for l in range(4):
                    FP[i, j] += F[t, i, l] * P[t, l, j]
        for i in range(4):
            for j in range(4):
                cov[t, i, j] = Q[i, j]
                for l in range(4):
                    cov[t, i, j] += FP[i, l] * F[t, j, l]
    return _finite_tracks(mean, cov)


def gate_tracks_spec(x, P, var_r, var_a):
    """:func:`gate_tracks` by :func:`polar_noise`."""
    R = [polar_noise(z, np.diag([var_r, var_a])) for z in polar(x)]
    R = np.array(R).reshape(len(x), 2, 2)
    return x[:, ::2].copy(), R, P[:, ::2, ::2] + R


@checked
@kernel
def gate_tracks(
    x: Tracks, P: TrackCovariances, var_r: Positive, var_a: Positive
) -> tuple[Array, Array, Array]:
    """Predicted plots zhat (T, 2) in m, plot covariances R and D = H P H' + R (T, 2, 2).

    ``x`` (T, 4), ``P`` (T, 4, 4) predicted, ``var_r`` in m^2, ``var_a`` in rad^2.  R is that of a
    plot at the predicted position: at the plot's own, nearer plots would look more accurate.
    """
    T = x.shape[0]
    zhat, R, D = np.empty((T, 2)), np.empty((T, 2, 2)), np.empty((T, 2, 2))
    for t in range(T):
        zhat[t, 0], zhat[t, 1] = x[t, 0], x[t, 2]
        r2 = x[t, 0] * x[t, 0] + x[t, 2] * x[t, 2]
        R[t, 0, 0], xy, R[t, 1, 1] = _rotated(x[t, 0], x[t, 2], r2, var_r, r2 * var_a)
        R[t, 0, 1] = R[t, 1, 0] = xy
        for i in range(2):
            for j in range(2):
                D[t, i, j] = P[t, 2 * i, 2 * j] + R[t, i, j]
        if not (r2 > 0.0 and 0.0 < D[t, 0, 0] * D[t, 1, 1] - D[t, 0, 1] * D[t, 1, 0] < np.inf):
            raise ValueError("ljipda_ai.gate_tracks: a covariance D is not positive definite")
    return zhat, R, D


def update_mixture_spec(x, P, D, z, beta):
    """Every plot updates the track; then mean and covariance of the mixture with weights beta."""
    mean, cov = np.empty_like(x), np.empty_like(P)
    for t, (b, S) in enumerate(zip(beta, D, strict=True)):
        K = P[t][:, ::2] @ np.linalg.inv(S)
        xs = np.vstack([x[t], x[t] + (z - x[t, ::2]) @ K.T])
        mean[t] = b @ xs
        spread = np.einsum("m,mi,mj->ij", b, xs - mean[t], xs - mean[t])
        cov[t] = P[t] - (1 - b[0]) * K @ S @ K.T + spread
    return mean, cov


@checked
@kernel
def update_mixture(
    x: Tracks,
    P: TrackCovariances,
    D: Annotated[ArrayLike, Covariance("T", 2, 2)],
    z: Annotated[ArrayLike, Numbers("M", 2)],
    beta: Annotated[ArrayLike, Numbers("T", "M+1", low=0.0, high=1.0 + 1e-9)],
) -> Track:
    """Means (T, 4), covariances (T, 4, 4) after a scan whose plots carry association weights.

    ``x``, ``P`` predicted, ``D`` (T, 2, 2) as :func:`gate_tracks` gives it, ``z`` (M, 2) plots in
    m, ``beta`` (T, M + 1) weights that sum to 1, first that of no plot.  The mixture of the updates
    is replaced by its mean and covariance; all plots share one gain.
    """
    T, M, K = len(x), len(z), np.empty((4, 2))
    mean, cov = np.empty((T, 4)), np.empty((T, 4, 4))
    for t in range(T):
        det = D[t, 0, 0] * D[t, 1, 1] - D[t, 0, 1] * D[t, 1, 0]
        if not (det > 0.0 and D[t, 0, 0] > 0.0):
            raise ValueError("ljipda_ai.update_mixture: a covariance D is not positive definite")
        y0, y1, s00, s01, s11 = 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(M):
            b, e0, e1 = beta[t, m + 1], z[m, 0] - x[t, 0], z[m, 1] - x[t, 2]
            y0, y1 = y0 + b * e0, y1 + b * e1
            s00, s01, s11 = s00 + b * e0 * e0, s01 + b * e0 * e1, s11 + b * e1 * e1
        hit = 1.0 - beta[t, 0]
        if not abs(beta[t].sum() - 1.0) <= 1e-6:
            raise ValueError(
                "ljipda_ai.update_mixture: the weights beta of a track do not sum to 1"
            )
        s00 = s00 - y0 * y0 - hit * D[t, 0, 0]
        s01 = s01 - y0 * y1 - hit * D[t, 0, 1]
        s11 = s11 - y1 * y1 - hit * D[t, 1, 1]
        for i in range(4):
            K[i, 0] = (P[t, i, 0] * D[t, 1, 1] - P[t, i, 2] * D[t, 0, 1]) / det
            K[i, 1] = (P[t, i, 2] * D[t, 0, 0] - P[t, i, 0] * D[t, 0, 1]) / det
            mean[t, i] = x[t, i] + K[i, 0] * y0 + K[i, 1] * y1
        for i in range(4):
            g0, g1 = K[i, 0] * s00 + K[i, 1] * s01, K[i, 0] * s01 + K[i, 1] * s11
            for j in range(i, 4):
                cov[t, i, j] = cov[t, j, i] = P[t, i, j] + g0 * K[j, 0] + g1 * K[j, 1]
    return _finite_tracks(mean, cov)


@checked
def position_bound(
    F: Annotated[ArrayLike, Numbers("K-1", "T", 4, 4)],
    R: Annotated[ArrayLike, Covariance("K", "T", 2, 2)],
    P: TrackCovariances,
    p_detect: Annotated[float, Number(0.0, 1.0)],
) -> Array:
    """Posterior Cramer-Rao bound (K, T, 4, 4) of tracks seen with probability p_detect per scan.

    ``F`` (K - 1, T, 4, 4) transitions, ``R`` (K, T, 2, 2) plot covariances at the true positions,
    ``P`` (T, 4, 4) of the first state.  J_k = (F J_{k-1}^-1 F')^-1 + p_detect H' R_k^-1 H.
    """
    bounds = [P]
    try:
        for step, noise in zip(F, R[1:], strict=True):
            J = np.linalg.inv(step @ bounds[-1] @ np.swapaxes(step, -1, -2))
            J[..., ::2, ::2] += p_detect * np.linalg.inv(noise)
            bounds.append(np.linalg.inv(J))
    except np.linalg.LinAlgError:
        raise ValueError(
            "ljipda_ai.position_bound: F, R or P is singular; give variances"
        ) from None
    return _finite("position_bound", np.array(bounds))[0]


class Flags(Numbers):
    """Rule: an array of True and False."""

    dtype, kinds, wanted = np.dtype(bool), "b", "True or False"


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
        raise ValueError("ljipda_ai.kept_rmse: error and kept have no trial; give one at least")
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = (kept / kept.mean(axis=0))[:, None, :, None]
        square = np.where(kept[:, None, :, None], weight * np.square(error), 0.0)
        mean = np.where(kept.any(axis=0)[:, None], square.mean(axis=0), np.nan)
        return np.sqrt(mean), (square - weight * mean) / (2 * np.sqrt(mean))


CERTAIN = 2.6  # standard errors, 99 %
LEAST_SCANS, LEAST_CLAIMS, LAST_SCANS = 5, 20, 10
FACTOR = 3.0  # by which a clutter density may be off
LEAST_FREE, UNIT_OFF = 60, 0.22  # false plots; share beyond their median, less a half
SMALLEST_SHARE = 0.2  # of the errors that were told, within which plots may lie
SAME = 1.0  # squared Mahalanobis distance below which two tracks are one; two targets have 4
DEG = 1.0, math.pi / 180  # of range and azimuth in degrees
READINGS = {  # of plots z and start states x
    "the plots look like kilometres": lambda z, x: (1e3 * z, x),
    "the start states look like kilometres": lambda z, x: (z, 1e3 * x),
    "the plots look like [y, x]": lambda z, x: (z[:, ::-1], x),
    "the plots look like [range, azimuth in rad]": lambda z, x: (kalman.cartesian(z), x),
    "the plots look like [range, azimuth in degrees]": lambda z, x: (kalman.cartesian(z * DEG), x),
}


class Seen(NamedTuple):
    """What the gates of one scan hold."""

    z: Any  # (M, 2) plots of the scan in m
    gated: int  # plots in at least one gate
    expected: float  # detections expected there
    spread: float  # their variance
    area: float  # of all gates in m^2
    largest: float  # area of the largest gate
    claims: float  # sum of the weights of plots over the tracks
    along: float  # the same times squared distance from the prediction, along the line of sight
    across: float  # and across it, each over its variance
    free: float = 0.0  # plots with an amplitude that no track claims
    loud: float = 0.0  # of these, with more power than half of the noise has


def look_spec(z, gated, zhat, S, beta, expected, gamma):
    """All tracks and plots at once."""
    area = math.pi * gamma * np.sqrt(np.linalg.det(S))
    claims = beta[:, 1:]
    sums = [expected.sum(), (expected * (1 - expected)).sum(), area.sum(), area.max(initial=0.0)]
    sums.append(claims.sum())
    sight = zhat / np.hypot(*zhat.T)[:, None]
    for axis in (sight, sight[:, ::-1] * (-1.0, 1.0)):
        off = np.einsum("tmi,ti->tm", z[gated] - zhat[:, None], axis)
        variance = np.einsum("ti,tij,tj->t", axis, S, axis)
        sums.append((claims * off**2 / variance[:, None]).sum())
    return Seen(z, len(gated), *sums)


@checked
@kernel
def look(
    z: Annotated[ArrayLike, Numbers("M", 2, low=-math.inf, high=math.inf)],
    gated: Annotated[ArrayLike, Integers("C", low=0)],
    zhat: Annotated[ArrayLike, Numbers("T", 2)],
    S: Annotated[ArrayLike, Covariance("T", 2, 2)],
    beta: Annotated[ArrayLike, Numbers("T", "C+1", low=0.0, high=1.0 + 1e-9)],
    expected: Annotated[ArrayLike, Numbers("T", low=0.0, high=1.0 + 1e-9)],
    gamma: Positive,
) -> Seen:
    """What the gates of one scan hold.

    z : (M, 2) plots in m; gated : (C,) indices of those in gates; zhat : (T, 2) predictions;
    S : (T, 2, 2) their covariances; beta : (T, C + 1) weights, first that of no plot;
    expected : (T,) P_D P_G times the predicted existence; gamma : squared size of a gate
    """
    for m in gated:
        if m >= len(z) or not (abs(z[m, 0]) < np.inf and abs(z[m, 1]) < np.inf):
            raise ValueError("ljipda_ai.look: gated: give indices of plots z that are finite")
    spread, area, largest, claims, along, across = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for t in range(len(zhat)):
        spread += expected[t] * (1.0 - expected[t])
        det = S[t, 0, 0] * S[t, 1, 1] - S[t, 0, 1] * S[t, 1, 0]
        own = math.pi * gamma * math.sqrt(max(det, 0.0))  # rounding may leave it negative
        area, largest = area + own, max(largest, own)
        r = math.hypot(zhat[t, 0], zhat[t, 1])
        c, s = zhat[t, 0] / r, zhat[t, 1] / r  # of the line of sight
        both = 2.0 * c * s * S[t, 0, 1]
        var_along = c * c * S[t, 0, 0] + both + s * s * S[t, 1, 1]
        var_across = s * s * S[t, 0, 0] - both + c * c * S[t, 1, 1]
        for m in range(len(gated)):
            dx, dy = z[gated[m], 0] - zhat[t, 0], z[gated[m], 1] - zhat[t, 1]
            claims += beta[t, m + 1]
            along += beta[t, m + 1] * (c * dx + s * dy) ** 2 / var_along
            across += beta[t, m + 1] * (c * dy - s * dx) ** 2 / var_across
    total = expected.sum()
    return Seen(z, len(gated), total, spread, area, largest, claims, along, across, 0.0, 0.0)


class DensityRule(Number):
    """Rule: a density of at least 0, or the word "estimate"."""

    def __call__(self, name, value, sizes=None):
        if isinstance(value, str) and value == "estimate":
            return value
        return super().__call__(name, value, sizes)


@checked
def contradiction(
    seen: Sequence[Seen],
    x: Annotated[ArrayLike, Numbers("K", "T", 4)],
    P: Annotated[ArrayLike, Covariance("K", "T", 4, 4)],
    existence: Annotated[ArrayLike, Numbers("K", "T", low=0.0, high=1.0 + 1e-9)],
    p_detect: Annotated[ArrayLike, Numbers("T", low=0.0, high=1.0)],
    clutter: Annotated[float | str, DensityRule(0.0)],
) -> str | None:
    """What the plots contradict, in one line, or None.

    seen : a Seen of each scan that was taken; x (K, T, 4), P (K, T, 4, 4), existence (K, T) of the
    tracks; p_detect (T,); clutter in plots per m^2 and scan, or "estimate"
    """
    if not all(isinstance(one, Seen) for one in seen):
        raise ValueError("ljipda_ai.contradiction: seen: give what look returned for each scan")
    if not len(seen) or not x.size:
        return None
    total = Seen(seen[0].z, *np.sum([one[1:] for one in seen], axis=0).tolist())
    return (
        _never_gated(seen, total, x[0], p_detect)
        or _errors_too_large(total)
        or _coincide(x, P, existence)
        or _other_density(total, clutter)
        or _other_unit(total)
    )


def _never_gated(seen, total, x, p_detect):
    """No plot ever in a gate, and what plots and start states may be instead."""
    seen = [one for one in seen if len(one.z)]
    missed = len(seen) * np.log1p(-p_detect).sum()
    if total.gated or len(seen) < LEAST_SCANS or missed > math.log(0.01):
        return None
    reading = _likely(np.concatenate([one.z for one in seen[:LEAST_SCANS]]), x)
    return f"scans: no plot of {len(seen)} scans lies in a gate; {reading}"


def _likely(z, x):
    """The reading of plots and start states that brings them ten times as near, if one does."""
    near = {words: _apart(*read(z, x)) for words, read in READINGS.items()}
    best = min(near, key=near.get)
    fits = near[best] < min(0.1, _apart(z, x) / 10)
    return best if fits else "check units, origin and start states"


def _apart(z, x):
    """Median over the tracks of the distance to the nearest plot, over the track's range."""
    off = np.hypot(*np.moveaxis(x[:, None, ::2] - z, -1, 0)).min(axis=1)
    return np.median(off / np.hypot(*x[:, ::2].T))


def _errors_too_large(total):
    """Plots much nearer to the predictions than the errors that were told."""
    shares = [math.sqrt(d2 / max(total.claims, 1e-9)) for d2 in (total.along, total.across)]
    if total.claims < LEAST_CLAIMS or min(shares) > SMALLEST_SHARE:
        return None
    words = f"plots lie within {min(shares):.1g} of the errors that were told"
    return f"sigma_r, sigma_theta_deg, P, Q: {words}; give them in the unit of the plots"


def _coincide(x, P, existence):
    """Two tracks that exist and have one state in each of the last scans."""
    x, P, existence = (a[-LAST_SCANS:] for a in (x, P, existence))
    both = (existence > 0.5).all(axis=0) & (len(x) == LAST_SCANS)
    for a, b in np.argwhere(np.triu(both[:, None] & both, 1)):
        off = x[:, a] - x[:, b]
        d2 = (off * np.linalg.solve(P[:, a] + P[:, b], off[..., None])[..., 0]).sum(axis=1)
        if d2.max() < SAME:
            words = f"tracks {a} and {b} coincide in the last {LAST_SCANS} scans"
            return f"x: {words}; take one out: close targets need a plot each to be kept apart"
    return None


@checked
def other_order(x: Tracks, F: Annotated[ArrayLike, Numbers(4, 4)]) -> bool:
    """Whether start states (T, 4) look like [x, y, vx, vy]: in the step F (4, 4) a track goes
    farther than its range, and with the other order less than a tenth of it.
    """
    told, other = (_step_over_range(each, F) for each in (x, x[:, [0, 2, 1, 3]]))
    return bool(((told > 1) & (other < 0.1)).all())


def _step_over_range(x, step):
    """Length of a step over the range, of each track."""
    moved = np.hypot(*(x @ step.T - x)[:, ::2].T)
    return moved / np.maximum(np.hypot(*x[:, ::2].T), 1e-9)


def _other_unit(total):
    """Amplitudes of false plots that are no Rayleigh noise of parameter 1."""
    if total.free < LEAST_FREE or abs(total.loud / total.free - 0.5) < UNIT_OFF:
        return None
    words = f"{total.loud / total.free:.0%} of the false plots exceed the median of the noise"
    return f"amplitude: {words}; give it, and tau, in units of the noise, no dB; or give a law"


def _other_density(total, clutter):
    """False plots in the gates are many more or many fewer than the density says."""
    if clutter == "estimate":
        return None
    false, most, least = total.gated - total.expected, clutter * total.area, clutter * total.largest
    most, least = FACTOR * most, least / FACTOR
    many = false - most > CERTAIN * math.sqrt(most + total.spread) + 3
    few = least - max(false, 0.0) > CERTAIN * math.sqrt(least + total.spread) + 3
    if not many and not few:
        return None
    words = f"{clutter:.2g} told, {max(false, 0.5) / total.area:.1g} per m^2 in the gates"
    return f'clutter: {words}; give clutter="estimate", or the density'
