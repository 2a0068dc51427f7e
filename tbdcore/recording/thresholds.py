"""Thresholds from blocks of the recording that have no target, and what a control delivers.

``frames`` (K, nx, ny) are in their order of time; **a gap is NaN**, a cell or a frame.
"""

import math
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from scipy.special import betaincinv, ndtri

from tbdcore.checks import Array, ArrayLike, Integer, Number, Numbers, checked
from tbdcore.noise import Frames, Law
from tbdcore.recording.misfit import fit

__all__ = ["Outcome", "Threshold", "Windows", "blocks", "outcome", "suspects", "threshold"]
__all__ += ["windows"]

LEAST_TAIL = 10  # largest values to which a law is fitted
EULER = 0.5772156649015329
SURE = 0.01  # what has a smaller chance is said
DARK = 6.0  # standard deviations below the mean
DARK_FRAMES = 3
ANYWHERE = Numbers(..., low=-1e9, high=1e9, nan=True)
Peaks = Annotated[ArrayLike, Numbers("n")]


# Blocks
@checked
def blocks(
    frames: Frames, K: Annotated[int, Integer(1)], step: Annotated[int, Integer(0)] = 0
) -> Array:
    """Blocks (n, K, nx, ny) of K successive frames in their order of time; a read-only view.

    step : from the start of a block to that of the next; 0: K, so that no two overlap.  Gaps stay
        where they are: a block with a gap stands for a search with a gap.
    """
    step = step or K
    if len(frames) < K:
        words = f"{len(frames)} are no block of {K}; give more frames or a smaller K"
        raise ValueError(f"recording.blocks: frames: {words}")
    views = np.lib.stride_tricks.sliding_window_view(frames, K, axis=0)[::step]
    return np.moveaxis(views, -1, 1)


class Windows(NamedTuple):
    """Blocks (n, K, h, w) of a recording, the first frame, row and column of each (n, 3), and
    which of them are for a control (n,), the others for a threshold.
    """

    blocks: Array
    corner: Array
    control: Array


@checked
def windows(
    frames: Frames,
    K: Annotated[int, Integer(1)],
    side: Annotated[ArrayLike, Numbers(2, low=1.0)],
    away: Any = None,
    margin: Annotated[float, Number(0.0, 1e6)] = 5.0,
) -> Windows:
    """Blocks of K frames and ``side`` cells, for a threshold and, others, for a control.

    They do not overlap; neighbours in time and place go to different parts, so that both have the
    places and times of the whole recording.

    side : rows and columns of a window; what is left over at the borders is not used
    away : (len(frames), 2) where a target is or may be, NaN where there is none, or (2,) for all
        frames: windows that come within ``margin`` cells of it in a frame of theirs are left out
    """
    size = np.array([K, *side.astype(int)])
    counts = np.array(frames.shape) // size
    index = np.indices(counts).reshape(3, -1).T
    if away is not None:
        index = index[~_near(index * size, size, away, len(frames), margin)]
    if len(index) < 2:
        words = f"{len(index)} blocks of {K} x {size[1]} x {size[2]} without a target"
        advice = "give smaller windows, fewer frames a block, or more frames"
        raise ValueError(f"recording.windows: frames: {frames.shape} has {words}; {advice}")
    cut = np.lib.stride_tricks.sliding_window_view(frames, tuple(size))
    corner = index * size
    return Windows(cut[tuple(corner.T)], corner, index.sum(axis=1) % 2 == 1)


def _near(corner, size, away, K, margin):
    """Whether windows (n,) come within the margin of places in one of their frames."""
    place = ANYWHERE("recording.windows: away", away, {})
    if place.shape not in ((2,), (K, 2)):
        words = f"shape {place.shape}; give one place, or one for each of {K} frames"
        raise ValueError(f"recording.windows: away: {words}")
    frame = corner[:, :1] + np.arange(size[0])
    at = np.broadcast_to(place, (K, 2))[frame]  # (n, K, 2)
    low = corner[:, None, 1:] - margin
    high = corner[:, None, 1:] + np.array(size[1:]) - 1 + margin
    return ((at >= low) & (at <= high)).all(axis=2).any(axis=1)


# Thresholds
class Threshold(NamedTuple):
    """A threshold, the interval of 95 % in which the delivered probability lies, the set one."""

    value: Any
    low: float
    high: float
    p_false: float = math.nan


@checked
def threshold(
    peaks: Annotated[ArrayLike, Numbers(...)],
    p_false: Annotated[float, Number(1e-9, 0.5)],
    independent: Annotated[int, Integer(0)] = 0,
    tail: Literal["", "gumbel"] = "",
) -> Threshold:
    """Threshold that a search without a target exceeds with probability ``p_false``.

    peaks : (n,) largest value of each of n blocks without a target, or (n, sets)
    independent : number of blocks that do not depend on each other, if these are fewer
    tail : "" refuses a rate below 1 / (n + 1); "gumbel" takes the law of largest values there, for
        noise that fits: otherwise :func:`outcome` refuses it

    The threshold is the order statistic r = p_false (n + 1) from above.  On average it delivers
    p_false for any law of the noise (with r below 2 a tenth less, since r is interpolated, and a
    fifth with very heavy tails); on one recording its probability has the law Beta(r, n + 1 - r)
    (David and Nagaraja 2003, 2.3), whose 95 % interval is returned.

    The law of Gumbel is that of largest values of noise whose tail is exponential or lighter; it is
    fitted by L-moments to ten blocks or more, and the interval is that of the fitted quantile
    (Hosking, Wallis and Wood 1985), normal in -ln(rate).  Ten times beyond the blocks it delivers
    0.4 to 1.1 of the rate, less where noise is normal; a heavier tail delivers more: first
    :func:`normal_scores`.
    """
    n = len(peaks) if peaks.ndim else 0
    used = independent or n
    if not 1 <= used <= n or peaks.ndim > 2:
        words = f"shape {peaks.shape}; give the largest value of each block"
        raise ValueError(f"recording.threshold: peaks: {words}")
    if not _shows(n, p_false):
        return _gumbel(peaks, p_false, used, tail)
    rank = np.clip((1 - p_false) * (n + 1) - 1, 0, n - 1)
    value = np.quantile(peaks, rank / max(n - 1, 1), axis=0)
    r = p_false * (used + 1)
    low, high = betaincinv(r, used + 1 - r, [0.025, 0.975]).tolist()
    return Threshold(value, low, high, p_false)


def _shows(n, p):
    """Whether n blocks show a rate: p >= 1 / (n + 1), for which 1 / 49 may stand, rounded."""
    return p * (n + 1) > 1 - 1e-9


def _gumbel(peaks, p_false, n, tail):
    """A threshold beyond all largest values, by the law of Gumbel."""
    name = f"recording.threshold: p_false: {len(peaks)} blocks cannot show {p_false:g}"
    least = math.ceil(1 / p_false) - 1
    if tail != "gumbel":
        raise ValueError(f'{name}; give {least} blocks, a larger p_false, or tail="gumbel"')
    if n < LEAST_TAIL:
        words = f"give {least} blocks, or {LEAST_TAIL} for the law of Gumbel"
        raise ValueError(f"{name}; {words}")
    place, scale = _gumbel_law(peaks)
    y = target = -math.log(-math.log1p(-p_false))
    for _ in range(20):  # the mean of the rate is p_false: its logarithm has a variance
        variance = (1.1128 + 0.4574 * y + 0.8046 * y * y) / n
        y = target + variance / 2
    error = ndtri(0.975) * math.sqrt(variance)
    low, high = (-math.expm1(-math.exp(-(y + z))) for z in (error, -error))
    return Threshold(place + scale * y, low, high, p_false)


def _gumbel_law(peaks):
    """Place and scale by L-moments, along the first axis."""
    x, n = np.sort(peaks, axis=0), len(peaks)
    weight = np.arange(n).reshape(-1, *[1] * (x.ndim - 1)) / max(n - 1, 1)
    scale = (2 * (weight * x).mean(axis=0) - x.mean(axis=0)) / math.log(2)
    return x.mean(axis=0) - EULER * scale, scale


@checked
def suspects(peaks: Peaks, white: Annotated[ArrayLike, Numbers("m")]) -> Array:
    """Indices of blocks that seem to hold a target, from largest values (n,).

    white : (m,) largest values of ten or more searches in white noise, :func:`tbdcore.noise`; a
        block is named if noise would show such a value in one of n blocks once in a hundred
        recordings, by the law of Gumbel.

    Probabilities of existence do not have that law; take their log-odds.  A threshold from blocks
    of which some were left out is no longer that of the control: leave them out to find targets,
    cut these out, and take all blocks that remain.
    """
    if len(white) < LEAST_TAIL:
        words = f"{len(white)} of them; give {LEAST_TAIL} or more"
        raise ValueError(f"recording.suspects: white: {words}")
    place, scale = _gumbel_law(white)
    limit = place + scale * -math.log(-math.log1p(-SURE / max(len(peaks), 1)))
    return np.flatnonzero(peaks > limit)


# What came out
class Outcome(NamedTuple):
    """What stands beside a result; ``print(outcome)`` shows it in a line.

    used : share of the cells that have a value
    threshold, white : the threshold, and that of the same rate in white noise
    declared, blocks : of the blocks of the control
    promised : declarations in the control at the rate that was set
    chance : probability of so many declarations or more at that rate, error of the threshold
        included (beta-binomial)
    holds : indices of the blocks of the threshold that seem to hold a target, where :func:`fit`
        finds no fault in the noise
    faults : what :func:`fit` finds
    dark : the lowest value, where frames have places that are dark and none that are bright; else
        NaN
    """

    used: float
    threshold: float
    white: float
    declared: int
    blocks: int
    promised: float
    chance: float
    holds: list
    faults: list
    dark: float

    @property
    def exceeds(self) -> bool:
        """Whether the control declares more than promised: its chance is below 0.01."""
        return self.chance < SURE

    def __str__(self):
        level = f"threshold {self.threshold:.4g}, in white noise {self.white:.4g}"
        control = f"control: {self.declared} of {self.blocks} declared, "
        control += f"{self.promised:.2g} promised (so many by chance: {self.chance:.2g})"
        control += ": more than promised" * self.exceeds
        parts = [f"{self.used:.0%} of the cells used", level, control]
        parts += _doubts(self.faults, self.holds)
        if self.dark == self.dark:
            parts += [f"dark places, down to {self.dark:.3g}: for dark targets give -frames"]
        return "; ".join(parts)


def _doubts(faults, holds):
    """What speaks against the law of the noise, in words."""
    words = {"the noise does not fit": faults, "blocks that seem to hold a target": holds}
    return [f"{said}: {', '.join(map(str, of))}" for said, of in words.items() if of]


@checked
def outcome(
    frames: Frames,
    level: Threshold,
    peaks: Peaks,
    white: Annotated[ArrayLike, Numbers("m")],
    control: Annotated[ArrayLike, Numbers("k")],
    law: Law = "gaussian",
) -> Outcome:
    """What stands beside a result: cells used, threshold beside white noise's, control.

    frames : normalised
    level : :func:`threshold` of ``peaks`` (n,)
    white : (m,) largest values of the same search in white noise
    control : (k,) largest values of the blocks of the control; all as the law of the frames

    A rate below 1 / (n + 1) rests on the law of largest values.  It is refused where :func:`fit`
    finds a fault in the noise or :func:`suspects` names a block: a heavier tail delivers more.
    What is not found delivers up to 1.6 of the rate: a Student's law of 15 degrees, of which four
    in five recordings are refused.
    """
    from scipy.stats import betabinom

    if not isinstance(level, Threshold) or np.ndim(level.value):
        raise ValueError("recording.outcome: level: give what recording.threshold returns")
    n, p = len(peaks), level.p_false
    declared = int((control > level.value).sum())
    r = p * (n + 1)
    chance = float(betabinom.sf(declared - 1, len(control), r, n + 1 - r))
    faults = fit(frames, law).exceeded()
    holds = [] if faults else suspects(peaks, white).tolist()
    _check_tail(n, p, _doubts(faults, holds))
    in_white = float(threshold(white, p, tail="gumbel").value)
    used, value = float((frames == frames).mean()), float(level.value)
    counts = (declared, len(control), p * len(control), chance)
    return Outcome(used, value, in_white, *counts, holds, faults, _dark(frames, law))


def _check_tail(n, p, doubts):
    """ValueError if a rate is below what n blocks show and the law of largest values may fail."""
    if not _shows(n, p) and doubts:
        least, rate = math.ceil(1 / p) - 1, math.ceil(1e4 / (n + 1)) / 1e4
        words = f"{n} blocks cannot show {p:.2g}; {doubts[0]}; give {least} blocks"
        raise ValueError(f"recording.outcome: level: {words}, or p_false = {rate:g} or more")


def _dark(frames, law):
    """The lowest value, where more frames have dark places than bright ones; else NaN."""
    if law != "gaussian":
        return math.nan
    known = frames[(frames == frames).any(axis=(1, 2))]
    low, high = np.nanmin(known, axis=(1, 2)), np.nanmax(known, axis=(1, 2))
    dark, bright = (low < -DARK).sum(), (high > DARK).sum()
    return float(low.min()) if dark >= max(DARK_FRAMES, 2 * bright) else math.nan
