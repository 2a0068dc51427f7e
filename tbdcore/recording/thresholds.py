"""Thresholds from blocks of the recording that have no target.

``frames`` (K, nx, ny) are in their order of time; **a gap is NaN**, a cell or a frame.
"""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import betaincinv

from tbdcore.checks import Array, ArrayLike, Integer, Number, Numbers, checked
from tbdcore.noise import Frames

__all__ = ["Threshold", "blocks", "threshold"]

LEAST_BLOCKS = 30


# Thresholds from the recording
@checked
def blocks(
    frames: Frames, K: Annotated[int, Integer(1)], step: Annotated[int, Integer(0)] = 0
) -> Array:
    """Blocks (n, K, nx, ny) of K successive frames in their order of time; a read-only view.

    step : from the start of a block to that of the next; 0: K, so that no two overlap.  Gaps stay
        where they are: a block with a gap stands for a search with a gap.
    """
    step = step or K
    n = max(1 + (len(frames) - K) // step, 0)
    if n < LEAST_BLOCKS:
        least = K + (LEAST_BLOCKS - 1) * step
        words = f"{len(frames)} give {n} blocks, fewer than {LEAST_BLOCKS}; give {least} frames"
        raise ValueError(f"recording.blocks: frames: {words}, or a smaller step")
    windows = np.lib.stride_tricks.sliding_window_view(frames, K, axis=0)[::step]
    return np.moveaxis(windows, -1, 1)


class Threshold(NamedTuple):
    """A threshold, and the interval of 95 % in which the delivered probability lies."""

    value: Any
    low: float
    high: float


@checked
def threshold(
    peaks: Annotated[ArrayLike, Numbers(...)],
    p_false: Annotated[float, Number(1e-9, 0.5)],
    independent: Annotated[int, Integer(0)] = 0,
) -> Threshold:
    """Threshold that a search without a target exceeds with probability ``p_false``.

    peaks : (n,) largest value of each of n >= 30 blocks without a target, or (n, sets)
    independent : number of blocks that do not depend on each other, if these are fewer

    The threshold is the order statistic r = p_false (n + 1) from above.  On average it delivers
    p_false for any law of the noise (with r below 2 a tenth less, since r is interpolated, and a
    fifth with very heavy tails); on one recording its probability has the law Beta(r, n + 1 - r)
    (David and Nagaraja 2003, 2.3), whose 95 % interval is returned.
    """
    n = len(peaks) if peaks.ndim else 0
    used = independent or n
    if not LEAST_BLOCKS <= used <= n or peaks.ndim > 2:
        raise ValueError(f"recording.threshold: peaks: shape {peaks.shape}; give 30 or more blocks")
    if p_false * (n + 1) < 1:
        advice = f"give {math.ceil(1 / p_false)} blocks or a larger p_false"
        raise ValueError(f"recording.threshold: p_false: {n} blocks cannot show it; {advice}")
    rank = np.clip((1 - p_false) * (n + 1) - 1, 0, n - 1)
    value = np.quantile(peaks, rank / (n - 1), axis=0)
    r = p_false * (used + 1)
    low, high = betaincinv(r, used + 1 - r, [0.025, 0.975]).tolist()
    return Threshold(value, low, high)
