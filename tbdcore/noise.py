"""Laws of noise and clutter: frames without a target, and what makes them differ from white noise.

Frames have the shape (K, nx, ny); a list of frames will do, and None in it is a missing frame.  A
gap is NaN, a cell or a whole frame: functions that take frames keep it.
"""

import math
from typing import Annotated, Any

import numpy as np
from scipy.special import gammaincinv, gammaln, kve, log_ndtr, ndtr, xlogy

from tbdcore.checks import (
    Array,
    ArrayLike,
    Integer,
    Number,
    Numbers,
    Random,
    Rule,
    checked,
    fits_memory,
)
from tbdcore.jit import kernel

__all__ = ["as_power", "correlated", "exponential", "gaussian", "k_power", "k_survival"]
__all__ += ["louder", "sloped"]

TINY = np.finfo(float).tiny
LAWS = ("gaussian", "exponential")


class FramesRule(Numbers):
    """Rule: frames (K, nx, ny); a missing one of a list, None, becomes NaN."""

    def __init__(self):
        super().__init__("K", "nx", "ny", nan=True, single=True)

    def __call__(self, name, values, sizes):
        if isinstance(values, (list, tuple)) and any(frame is None for frame in values):
            shapes = {np.shape(frame) for frame in values if frame is not None}
            if not shapes:
                raise ValueError(f"{name}: every frame is missing; give at least one")
            gap = np.full(min(shapes), np.nan, np.float32)  # keeps the precision of the others
            values = [gap if z is None else z for z in values]
        z = super().__call__(name, values, sizes)
        if not z.size:
            raise ValueError(f"{name}: shape {z.shape} has no cells; give (K, nx, ny)")
        return z


class LawRule(Rule):
    """Rule: the name of a law of noise."""

    def __call__(self, name, value, sizes):
        if not isinstance(value, str) or value not in LAWS:
            raise ValueError(f"{name}: {value!r} is unknown; give one of {', '.join(LAWS)}")
        return value


class ShapeRule(Rule):
    """Rule: a positive integer, or some of them, the sizes of an array that memory can hold."""

    def __call__(self, name, value, sizes):
        value = value if isinstance(value, (tuple, list)) else (value,)
        shape = tuple(Integer(1)(name, n) for n in value)
        fits_memory(name, *shape)
        return shape


Frames = Annotated[Any, FramesRule()]
Law = Annotated[str, LawRule()]
Shape = Annotated[tuple, ShapeRule()]
Generator = Annotated[np.random.Generator, Random()]
Nu = Annotated[float, Number(1e-3, 100.0)]
Correlation = Annotated[ArrayLike, Numbers("d", low=0.0, high=0.9999)]


@checked
def gaussian(shape: Shape, rng: Generator) -> Array:
    """White normal noise of mean 0 and variance 1."""
    return rng.standard_normal(shape)


@checked
def exponential(shape: Shape, rng: Generator) -> Array:
    """Power of complex normal noise, |v|**2 of mean 1: independent exponential cells."""
    return rng.standard_exponential(shape)


@checked
def k_power(
    shape: Shape, nu: Nu, rng: Generator, correlation: Correlation = (0.0, 0.0, 0.0)
) -> Array:
    """Power of K-distributed clutter, mean 1 (Ward, Tough and Watts 2013, section 4.2).

    Each cell is a gamma texture of shape ``nu`` and mean 1, times exponential speckle: the smaller
    nu, the heavier the tail; the variance is 1 + 2 / nu.  ``correlation`` is that of the normal
    scores of the texture, as in :func:`correlated`; the speckle is white.
    """
    if correlation.any():
        texture = gammaincinv(nu, ndtr(correlated(shape, correlation, rng)))
    else:
        texture = rng.standard_gamma(nu, shape)
    return texture / nu * rng.standard_exponential(shape)


@checked
def k_survival(power: Annotated[ArrayLike, Numbers(..., low=0.0, nan=True)], nu: Nu) -> Array:
    """Probability that K-distributed power of mean 1 exceeds ``power`` (any shape).

    2 / Gamma(nu) (nu power)**(nu / 2) K_nu(2 sqrt(nu power)); NaN stays NaN.
    """
    root = np.sqrt(nu * np.maximum(power, TINY))
    with np.errstate(all="ignore"):  # the Bessel function leaves the range at both ends
        log = math.log(2) - gammaln(nu) + xlogy(nu, root) - 2 * root + np.log(kve(nu, 2 * root))
        return np.exp(np.minimum(log, 0.0))


@checked
def correlated(shape: Shape, correlation: Correlation, rng: Generator) -> Array:
    """Standard normal frames with correlation rho**n between cells n apart, along each axis.

    correlation : rho of (time, x, y), one for each axis of ``shape``, in [0, 1): first-order
        autoregressions, stationary from the first cell on.
    """
    if len(correlation) != len(shape):
        raise ValueError(f"noise.correlated: correlation: give one number for each axis of {shape}")
    z = rng.standard_normal(shape)
    for axis, rho in enumerate(correlation.tolist()):
        line = np.moveaxis(z, axis, 0)
        if rho:
            rows = line.reshape(len(line), math.prod(line.shape[1:]))
            line[...] = _autoregression(rows, rho).reshape(line.shape)
    return z


@kernel
def _autoregression(rows, rho):
    """Row k becomes rho times row k - 1 plus sqrt(1 - rho^2) times itself, in place."""
    fresh = math.sqrt(1 - rho * rho)
    for k in range(1, len(rows)):
        for j in range(rows.shape[1]):
            rows[k, j] = rho * rows[k - 1, j] + fresh * rows[k, j]
    return rows


@checked
def as_power(normal: Annotated[ArrayLike, Numbers(..., nan=True)]) -> Array:
    """Exponential power of mean 1 whose normal scores are the standard normal values ``normal``."""
    return -log_ndtr(-normal)


@checked
def louder(
    frames: Frames, decibels: Annotated[float, Number(-300.0, 300.0)], law: Law = "gaussian"
) -> Array:
    """Frames whose noise level is ``decibels`` higher.

    law : "gaussian" for values of mean 0 (times 10**(decibels / 20)), "exponential" for power
        (times 10**(decibels / 10)).
    """
    return frames * 10.0 ** (decibels / (20 if law == "gaussian" else 10))


@checked
def sloped(
    frames: Frames,
    change: Annotated[float, Number(-2.0, 2.0)],
    axis: Annotated[int, Integer(0, 2)] = 1,
) -> Array:
    """Frames times a factor that grows from 1 - change / 2 to 1 + change / 2 along an axis.

    axis : 0 time, 1 or 2 an axis of the frame.  For power this is the level; for noise of mean 0
    it is the standard deviation.
    """
    place = np.linspace(-0.5, 0.5, frames.shape[axis])
    return frames * (1 + change * np.expand_dims(place, [a for a in range(3) if a != axis]))
