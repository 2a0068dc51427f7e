"""The blur of targets, and a target in one's own frames; **a gap is NaN**, a cell or a frame."""

import math
import warnings
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np

from tbdcore.checks import Array, ArrayLike, Integer, Number, Numbers, checked
from tbdcore.noise import Frames, Generator, Law
from tbdcore.recording.levels import Misfit, normalise

__all__ = ["Blur", "blur_of", "inject", "kept"]

LEAST_KEPT = 0.7


# Blur
class Blur(NamedTuple):
    """Standard deviation of a target's image in cells on both axes, its errors, places used."""

    value: Array
    se: Array
    places: int


@checked
def blur_of(
    frames: Frames,
    law: Law = "gaussian",
    eta: Annotated[float, Number(3.0, 1e9)] = 8.0,
    half: Annotated[int, Integer(1, 100)] = 5,
) -> Blur:
    """Blur from the second moments of bright places, less 1/12 for the cell in which the peak is.

    frames, eta : normalised; least value of a place, the largest cell within 2 ``half`` cells
    half : cells on each side of the peak that a moment reads; three times the blur or more

    The images of the places are added, less the mean of their outermost cells; the moments read 3
    blurs and a cell to each side.  The width of power is the amplitude's over sqrt(2): ``sd_r``,
    ``sd_a`` of chapter 03 are sqrt(2) times it.  Places within ``half`` cells of the border or of a
    gap are not used; with fewer than five the result is NaN, and a ``Misfit`` warning says that the
    blur is not measurable, as of a target of 12 dB at the default ``eta``.
    """
    from scipy.ndimage import maximum_filter

    z = np.where(np.isnan(frames), -np.inf, frames)
    largest = maximum_filter(z, size=4 * half + 1, axes=(1, 2), mode="constant", cval=-np.inf)
    at = np.argwhere((z == largest) & (z > eta))
    inside = ((at[:, 1:] >= half) & (at[:, 1:] < np.array(z.shape[1:]) - half)).all(axis=1)
    around = [z[k, i - half : i + half + 1, j - half : j + half + 1] for k, i, j in at[inside]]
    patches: Array = np.array([patch for patch in around if np.isfinite(patch).all()])
    if len(patches) < 5:
        words = f"{len(patches)} places above eta = {eta:g}; give frames with brighter places"
        line = f"recording.blur_of: frames: the blur is not measurable: {words}"
        warnings.warn(line, Misfit, stacklevel=3)
        return Blur(np.full(2, np.nan), np.full(2, np.nan), len(patches))
    edge: Array = np.ones(patches.shape[1:], bool)
    edge[1:-1, 1:-1] = False
    patches = patches - patches[:, edge].mean()
    for read in range(min(3, half), half + 1):
        inner = slice(half - read, half + read + 1)
        found = _moments(patches[:, inner, inner])
        if read >= 3 * found.value.max() + 1:
            break
    return found


def _moments(patches):
    """Blur from patches (n, m, m) around peaks."""
    d2 = (np.arange(patches.shape[1]) - patches.shape[1] // 2) ** 2
    second = np.stack([patches.sum(axis=2) @ d2, patches.sum(axis=1) @ d2], axis=-1)
    total = patches.sum(axis=(1, 2))
    square = second.sum(axis=0) / total.sum()
    value = np.sqrt(np.maximum(square - 1 / 12, 1e-12))
    error = (second - square * total[:, None]).std(axis=0) / total.mean() / math.sqrt(len(total))
    return Blur(value, error / (2 * value), len(total))


# A target in one's own frames
@checked
def inject(
    frames: Frames,
    path: Annotated[ArrayLike, Numbers("K", 2, nan=True)],
    strength: Annotated[ArrayLike, Numbers(..., low=0.0, high=1e50)],
    blur: Annotated[float, Number(0.0, 100.0)],
    rng: Generator,
    law: Law = "gaussian",
) -> Array:
    """A copy of the frames with a target in them.

    path : (K, 2) place in cells, counted from 0, NaN in frames without the target
    strength : "gaussian": amplitude A of the peak, A h is added; "exponential": power ratio S of
        the peak, |A h + v|**2 with |A|**2 = S and a phase that is uniform in each cell
        (chapter 03, eq. 5); a number or (K,)
    blur : standard deviation of the amplitude's image h in cells; 0: all in the nearest cell
    rng : draws the phases; unused in "gaussian" frames

    The strength does not fluctuate; for Swerling 1 give S * rng.standard_exponential(K).
    """
    K, nx, ny = frames.shape
    if strength.shape not in ((), (K,)):
        raise ValueError(f"recording.inject: strength: give one, or one for each of {K} frames")
    h = _profile(path[:, 0], nx, blur)[:, :, None] * _profile(path[:, 1], ny, blur)[:, None, :]
    strength = np.broadcast_to(strength, K)[:, None, None]
    if law == "gaussian":
        return frames + h * strength
    power = h * h * strength
    phase = np.cos(2 * np.pi * rng.random(frames.shape))
    return frames + power + 2 * np.sqrt(power * np.maximum(frames, 0.0)) * phase


def _profile(place, n, blur):
    """Image (K, n) of the target along one axis, 0 where its place is NaN."""
    d = np.arange(n) - (place[:, None] if blur else np.floor(place[:, None] + 0.5))
    with np.errstate(invalid="ignore"):
        h = np.exp(-(d**2) / (2 * blur * blur)) if blur else (d == 0).astype(float)
    return np.nan_to_num(h, nan=0.0)


@checked
def kept(
    frames: Frames,
    speed: Annotated[float, Number(0.0, 1e6)],
    strength: Annotated[float, Number(1e-100, 1e50)],
    blur: Annotated[float, Number(0.0, 100.0)],
    prepare: Callable,
    rng: Generator,
    law: Law = "gaussian",
) -> float:
    """Share of a target's strength that a preparation leaves, tried by injection.

    The target goes back and forth along the first axis through the middle of the frames, ``speed``
    cells per frame.  Below 0.7 a ``Misfit`` warning says that the preparation takes the target for
    background, or for noise.

    prepare : gives the Level of frames, as ``recording.background``; it must be a function of the
        frames alone, which is called with and without the target
    strength, blur, rng, law : as of :func:`inject`, in the unit of the frames
    """
    K, nx, ny = frames.shape
    last = max(nx - 1, 1)
    place = last - abs((speed * np.arange(K)) % (2 * last) - last)
    path = np.column_stack([place, np.full(K, ny // 2)])
    both = inject(frames, path, strength, blur, rng, law)
    known, told = prepare(frames), prepare(both)
    cells = np.arange(K), np.rint(place).astype(int), np.full(K, ny // 2)
    empty, ideal, real = (
        np.nanmean(normalise(z, at, law)[cells])
        for z, at in ((frames, known), (both, known), (both, told))
    )
    share = float((real - empty) / (ideal - empty))
    if share < LEAST_KEPT:
        words = f"a target of {speed:g} cells per frame keeps {share:.0%} of its strength"
        advice = "clipped(frames, size=...), or a background of other frames"
        warnings.warn(f"recording.kept: speed: {words}; {advice}", Misfit, stacklevel=3)
    return share
