"""The plain alternatives to tracking before detection: single frames, and recursions over cells.

The largest values of frames without a target give a threshold (``recording.threshold``).  Frames
have the shape (K, nx, ny), declarations (..., K) are Boolean.  NaN cells are gaps: they are left
out of a sum, and a frame of NaN exceeds nothing.
"""

import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, ArrayLike, Integer, Number, Numbers, Rule, array, checked
from tbdcore.noise import Frames, Law

__all__ = ["brightest", "delay", "grid_filter", "masked_rmse", "matched_filter", "mean_se"]
__all__ += ["recursive_maximum"]


class FlagsRule(Rule):
    """Rule: an array of True and False, or 1 and 0, of one axis or more, none of length 0."""

    any_axes = True

    def __call__(self, name, values, sizes):
        flags = array(name, values)
        whole = flags.dtype.kind in "biu" and ((flags == 0) | (flags == 1)).all()
        if not (whole and flags.ndim * flags.size):
            raise ValueError(f"{name}: {flags.dtype} of shape {flags.shape}; give True and False")
        return flags.astype(bool)


Flags = Annotated[ArrayLike, FlagsRule()]
Blur = Annotated[ArrayLike, Numbers(..., low=1e-3, high=100.0)]
Start = Annotated[int, Integer(0)]
Probability = Annotated[float, Number(0.0, 1.0)]
MOST_RATIO = 700.0  # log-ratios are cut at +-700: their exponentials are finite


@checked
def matched_filter(frames: Frames, blur: Blur, law: Law = "gaussian") -> Array:
    """Matched filter output (K, nx, ny), of mean 0 and variance 1 in white noise.

    frames : (K, nx, ny), noise of mean 0 and variance 1 ("gaussian") or power of mean 1
        ("exponential").
    blur : standard deviation of the target's amplitude image h in cells, one or a pair (x, y).

        gaussian:     sum h z / sqrt(sum h**2)               (Kay 1998, eq. 4.3)
        exponential:  sum h**2 (z - 1) / sqrt(sum h**4), the locally best one for a weak target

    Sums are over the known cells; NaN where these have less than a tenth of the energy.
    """
    from scipy.ndimage import correlate1d

    if blur.shape not in ((), (2,)):
        raise ValueError(f"baseline.matched_filter: blur: shape {blur.shape}; give a number or two")
    blur = np.broadcast_to(blur, 2)
    known = ~np.isnan(frames)
    match = np.where(known, frames - (law == "exponential"), 0.0)
    energy, whole = known.astype(float), 1.0
    for axis, b in ((1, blur[0]), (2, blur[1])):
        d = np.arange(-math.ceil(4 * b), math.ceil(4 * b) + 1)
        h = np.exp(-(d**2) / (2 * b * b)) ** (1 + (law == "exponential"))
        match = correlate1d(match, h, axis, mode="constant")
        energy, whole = correlate1d(energy, h * h, axis, mode="constant"), whole * (h @ h)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(energy > 0.1 * whole, match / np.sqrt(energy), np.nan)


@checked
def brightest(frames: Frames) -> tuple[Array, Array]:
    """Cell (K, 2), counted from 0, and value (K,) of the largest cell of each frame.

    The cell is (-1, -1) and the value -inf where a frame is all NaN.
    """
    flat = np.where(np.isnan(frames), -np.inf, frames).reshape(len(frames), -1)
    value = flat.max(axis=1)
    cells = np.stack(np.divmod(flat.argmax(axis=1), frames.shape[2]), axis=-1)
    return np.where(value[:, None] > -np.inf, cells, -1), value


@checked
def grid_filter(
    log_ratios: Frames,
    walk: Annotated[ArrayLike, Numbers("2a+1", "2b+1", low=0.0, high=1.0)],
    stay: Probability,
    birth: Probability,
) -> Array:
    """Probability W (K, nx, ny) that the target is in each cell, given all frames so far.

    The Bayes filter of one target on a grid with a state of no target: likelihood ratio detection
    and tracking (Stone 2001, A Bayesian Approach to Multiple-Target Tracking, section 10.6).
    Before the first frame there is no target.

        W_ = stay conv(W, walk) + birth (1 - sum W) / cells,   W = L W_ / (1 - sum W_ + sum L W_)

    so that 1 - sum W is the probability of no target.  A target that walks off the frame is gone.

    log_ratios : (K, nx, ny) ln L of each cell, target against noise; NaN is no evidence
    walk : (2a+1, 2b+1) probabilities of the steps between two frames, their sum 1
    stay, birth : probabilities that a target stays, and that one appears where there is none
    """
    from scipy.ndimage import convolve

    if abs(walk.sum() - 1.0) > 1e-9 or not walk.size % 2:
        raise ValueError("baseline.grid_filter: walk: give odd sizes, and probabilities of sum 1")
    K, nx, ny = log_ratios.shape
    ratios = np.exp(np.clip(np.nan_to_num(log_ratios.astype(float)), -MOST_RATIO, MOST_RATIO))
    posterior, W = np.empty((K, nx, ny)), np.zeros((nx, ny))
    for k in range(K):
        prior = stay * convolve(W, walk, mode="constant") + birth * (1.0 - W.sum()) / W.size
        weighted = ratios[k] * prior
        W = weighted / (max(1.0 - prior.sum(), 0.0) + weighted.sum())
        posterior[k] = W
    return posterior


@checked
def recursive_maximum(
    log_ratios: Frames,
    walk: Annotated[int, Integer(0, 1000)],
    memory: Annotated[float, Number(0.0, 1.0)],
) -> Array:
    """Value V (K, nx, ny) of the best path to each cell, with a memory that fades.

        V = ln L + memory max(0, largest V of the last frame within ``walk`` cells on each axis)

    Recursive dynamic programming with a reset at 0.  With memory 1 and walk 0 it is Page's test of
    each cell (Page 1954); this form with a memory below 1 was found in no publication.

    log_ratios : (K, nx, ny) ln L of each cell, target against noise; NaN is no evidence
    """
    from scipy.ndimage import maximum_filter

    values = np.nan_to_num(log_ratios.astype(float))
    for k in range(1, len(values)):
        best = maximum_filter(values[k - 1], 2 * walk + 1, mode="constant", cval=-np.inf)
        values[k] += memory * np.maximum(best, 0.0)
    return values


@checked
def delay(hits: Flags, start: Start = 0) -> Array:
    """Frames from frame ``start`` to the first hit (...), K - start where there is none."""
    hits = hits[..., start:]
    if not hits.shape[-1]:
        raise ValueError(f"baseline: start: {start} is behind the last frame; frames count from 0")
    return np.where(hits.any(axis=-1), hits.argmax(axis=-1), hits.shape[-1])


@checked
def mean_se(x: Annotated[ArrayLike, Numbers(...)]) -> tuple[Array, Array]:
    """Mean over the first axis, the trials, and its standard error; at least two trials."""
    if x.ndim == 0 or len(x) < 2:
        raise ValueError(f"baseline.mean_se: x: shape {x.shape}; give two trials or more on axis 0")
    return x.mean(axis=0), x.std(axis=0, ddof=1) / math.sqrt(len(x))


@checked
def masked_rmse(
    error: Annotated[ArrayLike, Numbers(..., nan=True)], mask: Flags
) -> tuple[float, Array]:
    """Root mean square of error (n, ...) where mask (n, ...) is True, and influences (n,).

    The standard deviation of the influences over sqrt(n) is the standard error, also of paired
    differences.  An error may be NaN where the mask is False; the result is NaN for an empty mask.
    """
    if error.shape != mask.shape:
        shapes = f"shape {mask.shape}, but error has {error.shape}"
        raise ValueError(f"baseline.masked_rmse: mask: {shapes}; give one shape")
    if np.isnan(error[mask]).any():
        raise ValueError("baseline.masked_rmse: error: NaN where mask is True; leave it out")
    axes = tuple(range(1, mask.ndim))
    square = np.where(mask, error, 0.0) ** 2
    total, count = square.sum(axis=axes), mask.sum(axis=axes)
    with np.errstate(invalid="ignore", divide="ignore"):
        rmse = np.sqrt(total.sum() / count.sum())
        return float(rmse), rmse + (total - rmse**2 * count) / (2 * rmse * count.mean())
