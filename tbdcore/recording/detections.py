"""Plots from cells, plots of one ship made one, and start states from three scans.

``frames`` (K, nx, ny) are in their order of time; **a gap is NaN**, a cell or a frame.
"""

import math
import warnings
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from tbdcore.checks import Array, ArrayLike, Flag, Number, Numbers, checked, numbers
from tbdcore.noise import Frames, Law
from tbdcore.recording.levels import Misfit

__all__ = ["Unit", "merge_plots", "noise_unit", "plots", "starts"]


MOST_OFF = 1.3  # a unit that is off by more is said
BOUND = 1.5 * math.sqrt(2 / math.pi)
Positive = Annotated[float, Number(1e-100, 1e100)]
Pair = Annotated[ArrayLike, Numbers(2)]


# Plots from cells
@checked
def plots(
    frames: Frames,
    eta: Annotated[float, Number(-1e50, 1e50)],
    law: Law = "gaussian",
    origin: Pair = (0.0, 0.0),
    cell: Pair = (1.0, 1.0),
    level: Annotated[bool, Flag()] = False,
) -> list:
    """Plots of each frame: a list of (n, 5), place on both axes, strength, accuracy on both axes.

    Cells above ``eta`` that touch, also at a corner, are one plot (Rosenfeld and Pfaltz 1966); a
    missing frame gives None.  Place is the centroid weighted by what is above the mean, strength
    the largest value.  Accuracy is the standard deviation of the place: 1.5 times the bound for a
    blurred point in white noise, sqrt(2 / pi) cells over the amplitude in units of the noise
    (Winick 1986), and the rounding to cells, 1 / sqrt(12) of a cell for one row, less for more.

    frames, eta : normalised; threshold in the same unit, above the noise's mean
    origin, cell : place of the centre of cell (0, 0), and size of a cell, on each axis.  With
        range (m) and azimuth (rad) the columns are those of chapter 04; chapter 05 takes x, y and
        amplitude, [r cos(a), r sin(a), sqrt(2 strength)].
    level : the largest of m joined cells does not have the law of one cell above ``eta``; True
        gives, instead of it, the value that one such cell exceeds with the same probability in
        white noise.  A strong plot loses ln m of its power.  Take it for chapter 04.
    """
    mean = float(law == "exponential")
    if eta <= mean:
        raise ValueError(f"recording.plots: eta: {eta:g} is not above the noise's mean, {mean:g}")
    rule = partial(_as_one_cell, eta=eta, law=law) if level else None
    return [_plots(z, eta, mean, origin, cell, rule) if (z == z).any() else None for z in frames]


def _as_one_cell(strength, cells, eta, law):
    """Strengths (n, 1), each the largest of m cells above eta, with the law of one such cell.

    Of m the largest lies below it with probability (1 - s)**m, s = sf(strength) / sf(eta).
    """
    log_sf, inverse = (log_ndtr, ndtri_exp) if law == "gaussian" else (np.positive, np.positive)
    log_s = log_sf(-strength) - log_sf(-eta)
    with np.errstate(divide="ignore"):  # a strength of eta itself
        log_one = np.log(-np.expm1(cells * np.log1p(-np.exp(log_s))))
    far = log_s < -30  # 1 - (1 - s)**m is m s, which rounds
    log_one = np.where(far, np.log(cells) + log_s, log_one)
    return -inverse(log_one + log_sf(-eta))


def _plots(frame, eta, mean, origin, cell, rule):
    """The table of :func:`plots` of one frame."""
    from scipy import ndimage

    label, n = ndimage.label(frame > eta, np.ones((3, 3)))
    if not n:
        return np.empty((0, 5))
    number = np.arange(1, n + 1)
    place = np.array(ndimage.center_of_mass(frame - mean, label, number))
    strength = np.array(ndimage.maximum(frame, label, number))[:, None]
    noise = BOUND / (np.sqrt(2 * strength) if mean else strength)
    boxes = ndimage.find_objects(label)
    rows = np.array([[side.stop - side.start for side in box] for box in boxes])
    if rule:
        strength = rule(strength, np.bincount(label.ravel())[1:, None])
    accuracy = abs(cell) * np.sqrt(noise**2 + 1 / (12 * rows**3))
    return np.hstack([origin + cell * place, strength, accuracy])


@checked
def merge_plots(
    scan: Annotated[ArrayLike, Numbers("n", "d")],
    distance: Annotated[float, Number(0.0, 1e12)],
    weights: Any = None,
) -> Array:
    """Plots of one extended target made one: rows (m, d) of x, y and any further columns.

    Plots at most ``distance`` apart, also through others between them, are one (single linkage,
    Sibson 1973); each column is the mean over the group.

    weights : (n,) positive, such as strengths; None: all alike
    """
    from scipy.sparse.csgraph import connected_components

    place = places("recording.merge_plots: scan", scan)
    weights = np.ones(len(scan)) if weights is None else weights
    w = numbers("recording.merge_plots: weights", weights, len(scan), low=1e-300)
    n, group = connected_components(abs(place[:, None] - place) <= distance, directed=False)
    member = (group == np.arange(n)[:, None]) * w
    return member @ scan / member.sum(axis=1, keepdims=True)


class Unit(NamedTuple):
    """The Rayleigh parameter of noise in the unit of the amplitudes, and its standard error."""

    value: float
    se: float


@checked
def noise_unit(
    amplitudes: Annotated[ArrayLike, Numbers("n", low=0.0, high=1e50)],
    tau: Annotated[float, Number(0.0, 1e50)],
    told: Annotated[float, Number(0.0, 1e50)] = 0.0,
) -> Unit:
    """Unit of the noise, from amplitudes (n,) above ``tau`` of plots of which most are false.

    The excess power (a**2 - tau**2) / 2 of noise is exponential; its mean is the median / ln 2,
    the unit squared.  Divide amplitudes and tau by it for chapter 05.

    told : the unit that is used so far; a ``Misfit`` warning says that it is off by 1.3 or more
        with 99 % certainty
    """
    if len(amplitudes) < 30 or (amplitudes < tau).any():
        words = f"{len(amplitudes)}, the least {amplitudes.min(initial=math.inf):g}"
        advice = f"give 30 or more, all above tau = {tau:g}, none in decibels"
        raise ValueError(f"recording.noise_unit: amplitudes: {words}; {advice}")
    excess = np.median(amplitudes**2 - tau**2) / 2 / math.log(2)
    value = math.sqrt(excess)
    error = value / 2 / math.log(2) / math.sqrt(len(amplitudes))
    apart = abs(math.log(max(told, 1e-300) / max(value, 1e-300)))
    if told and apart > math.log(MOST_OFF) + 2.58 * error / max(value, 1e-300):
        words = f"the unit of the noise is {value:.3g} ± {error:.1g}, not {told:g}"
        line = f"recording.noise_unit: amplitudes: {words}; divide amplitudes and tau by it"
        warnings.warn(line, Misfit, stacklevel=3)
    return Unit(value, error)


def places(name, scan):
    """Places (n,) of the plots of a scan as x + iy."""
    scan = numbers(name, scan, "n", "d")
    if scan.shape[1] < 2:
        raise ValueError(f"{name}: shape {scan.shape}; give rows x, y, ...")
    return scan[:, 0] + 1j * scan[:, 1]


@checked
def starts(
    scans: Any, t: Annotated[ArrayLike, Numbers(3)], fastest: Positive, sigma: Positive
) -> tuple[Array, Array]:
    """Start states (n, 4) of [x, vx, y, vy] and covariances (n, 4, 4), from three scans in a row.

    scans : three arrays of rows x, y, further columns are not read; None was not taken
    t : their times; the states are those at the last one
    fastest, sigma : largest speed; standard deviation of a plot's place on each axis

    A start is a plot of the first and one of the last scan with a third one between them, within
    three standard deviations of constant velocity (two-point differencing, Bar-Shalom, Li and
    Kirubarajan 2001, 5.5.3).  The units are those of the plots.
    """
    before, after = np.diff(t).tolist()
    if not isinstance(scans, (list, tuple, np.ndarray)) or len(scans) != 3:
        raise ValueError("recording.starts: scans: give three, arrays of rows x, y or None")
    if min(before, after) <= 0:
        raise ValueError(f"recording.starts: t: {t.tolist()}; give times that rise")
    scans = [np.empty((0, 2)) if scan is None else scan for scan in scans]
    first, middle, last = (places(f"recording.starts: scans[{k}]", scans[k]) for k in range(3))
    rate = 1 / (before + after)
    limit = 3 * sigma * math.hypot(1 / before, 1 / after, 1 / before + 1 / after)
    bend = [(last - m) / after - ((m - first) / before)[:, None] for m in middle]
    straight = (abs(np.reshape(bend, (middle.size, first.size, last.size))) <= limit).any(axis=0)
    v = (last - first[:, None]) * rate
    i, j = np.nonzero(straight & (abs(v) <= fastest))
    x = np.stack([last[j].real, v[i, j].real, last[j].imag, v[i, j].imag], axis=-1)
    P = np.kron(np.eye(2), sigma**2 * np.array([[1, rate], [rate, 2 * rate**2]]))
    return x, np.tile(P, (len(x), 1, 1))
