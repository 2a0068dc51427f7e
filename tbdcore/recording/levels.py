"""Noise and background: the level of each cell, and frames in units of it.

``frames`` (K, nx, ny) are in their order of time; **a gap is NaN**, a cell or a frame.
"""

import math
import warnings
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from tbdcore.checks import Array, Integer, checked
from tbdcore.noise import Frames, Law

__all__ = ["Level", "background", "bin_cells", "clipped", "normalise"]

LN2 = math.log(2.0)
ROUNDS = 8
CLIP = {"gaussian": 3.0, "exponential": 5.0}  # standard deviations, mean powers
MOST_LOWEST = 0.05  # share of the cells that may have the lowest value
KEPT = {"gaussian": 0.98657, "exponential": 0.96608}  # spread, mean of what is not clipped


class Misfit(UserWarning):
    """The data are not what the filter was told; one line says what, by how much, and a remedy."""


class Level(NamedTuple):
    """Mean and standard deviation of noise: numbers, or arrays that fit the frames."""

    mean: Any
    std: Any


# Noise and background
@checked
def background(frames: Frames, law: Law = "gaussian") -> Level:
    """Level of each cell over time, (nx, ny): what stands still, by medians; ten frames or more.

    "gaussian": median, and median absolute deviation / 0.6745 (Huber and Ronchetti 2009, 5.1);
    "exponential": both are median / ln 2.  A target that stays in a cell for a third of the
    recording becomes background.  NaN where a cell has no value.
    """
    if len(frames) < 10:
        raise ValueError(f"recording.background: frames: {len(frames)} of them; give at least 10")
    return _medians(frames, law, axis=0)


def _medians(z, law, axis):
    """Level by medians along an axis."""
    if not (z == z).any():
        raise ValueError("recording: frames: all cells are NaN; give at least one known cell")
    if law == "exponential" and (z < 0).any():
        raise ValueError("recording: frames: negative power; give abs(z)**2, not decibels")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a cell without values is NaN
        middle = np.nanmedian(z, axis=axis)
        if law == "exponential":
            return Level(middle / LN2, middle / LN2)
        return Level(middle, np.nanmedian(abs(z - middle), axis=axis) / ndtri(0.75))


@checked
def clipped(
    frames: Frames, law: Law = "gaussian", size: Annotated[int, Integer(0, 10**4)] = 0
) -> Level:
    """Level of the noise without bright cells, by repeated clipping (Bertin and Arnouts 1996, 7.1).

    Cells beyond 3 standard deviations ("exponential": above 5 means) are left out, and the mean and
    standard deviation of the others corrected for it, eight times.

    size : 0, one level for the whole recording; else the side of a window in cells: a level for
        each cell of each frame, (K, nx, ny), from the window around it.  Take five widths of a
        target or more.  NaN where less than a quarter of a window is known.
    """
    from scipy.ndimage import uniform_filter

    middle, std = _medians(frames, law, axis=None)
    offset = middle if law == "gaussian" else 0.0
    z = np.asarray(frames, float) - offset
    if not size:
        at = _clip(z, law, np.mean, Level(middle - offset, std))
        return Level(float(at.mean + offset), float(at.std))
    average = partial(uniform_filter, size=size, axes=(1, 2))
    at = _clip(z, law, average, Level(0.0 if law == "gaussian" else np.inf, np.inf))
    known = average((z == z).astype(float)) >= 0.25
    return Level(np.where(known, at.mean + offset, np.nan), np.where(known, at.std, np.nan))


def _clip(z, law, average, at):
    """Level of the averages of what lies near the level ``at``."""
    with np.errstate(invalid="ignore", divide="ignore"):
        for _ in range(ROUNDS):
            distance, scale = (abs(z - at.mean), at.std) if law == "gaussian" else (z, at.mean)
            keep = distance <= CLIP[law] * scale
            share = average(keep.astype(float))
            mean = average(np.where(keep, z, 0.0)) / share
            if law == "exponential":
                at = Level(mean / KEPT[law], mean / KEPT[law])
            else:
                square = average(np.where(keep, (z - mean) ** 2, 0.0)) / share
                at = Level(mean, np.sqrt(np.maximum(square, 0.0)) / KEPT[law])
    return at


@checked
def normalise(frames: Frames, at: Level, law: Law = "gaussian") -> Array:
    """Noise of mean 0 and variance 1, (z - mean) / std; "exponential": power of mean 1, z / mean.

    at : a Level of numbers, or of arrays (nx, ny) or (K, nx, ny).  NaN where its spread is not
        above 0, as that of a cell that always shows the same value; a ``Misfit`` warning says how
        many cells that are, and whether the lowest value is that of many cells.
    """
    try:
        mean, std = (np.broadcast_to(np.asarray(a, float), frames.shape) for a in at)
    except (TypeError, ValueError):
        advice = "numbers, (nx, ny) or (K, nx, ny)"
        raise ValueError(f"recording.normalise: at: give Level(mean, std), {advice}") from None
    scale = std if law == "gaussian" else mean
    if not (scale > 0).any():
        words = "its spread is nowhere above 0; thresholded frames are for recording.plots"
        raise ValueError(f"recording.normalise: at: {words}")
    with np.errstate(invalid="ignore", divide="ignore"):
        z = (frames - mean if law == "gaussian" else frames) / scale
    _warn_lost(frames, scale)
    return np.where(scale > 0, z, np.nan)


def _warn_lost(frames, scale):
    """A warning of cells that a preparation cuts out, and of frames that were thresholded."""
    known = frames == frames
    lost = float((known & ~(scale > 0)).sum() / max(known.sum(), 1))
    lowest = np.min(frames, where=known, initial=np.inf)
    same = float((frames == lowest).sum() / max(known.sum(), 1))
    words = [f"{lost:.2g} of the cells have no spread and become NaN"] * (lost > 0)
    words += [f"{same:.2g} of the cells have the lowest value, {lowest:g}"] * (same > MOST_LOWEST)
    if words:
        advice = "thresholded frames are for recording.plots, dead cells stay NaN"
        line = f"recording.normalise: frames: {'; '.join(words)}; {advice}"
        warnings.warn(line, Misfit, stacklevel=4)


@checked
def bin_cells(frames: Frames, n: Annotated[int, Integer(1, 1000)], law: Law = "gaussian") -> Array:
    """Frames of cells n times as wide, (K, nx // n, ny // n), for a blur above what a filter takes.

    gaussian:     the sum of n x n cells / n: white noise keeps its variance; the blur and a
                  target's summed amplitude are divided by n
    exponential:  the mean of n x n cells, no longer exponential: use :func:`normal_scores`

    A new cell is NaN if one of its cells is; rows and columns that are left over are dropped.
    """
    K, nx, ny = frames.shape
    if min(nx, ny) < n:
        raise ValueError(f"recording.bin_cells: n: {n} is more than {nx} x {ny} cells; lower it")
    z = frames[:, : nx - nx % n, : ny - ny % n].reshape(K, nx // n, n, ny // n, n)
    return z.sum(axis=(2, 4)) / (n if law == "gaussian" else n * n)
