"""Do frames agree with what a filter is told?  ``fit`` measures it, ``warn_misfit`` says it.

Chapters 01 and 02 are told white normal noise ("gaussian"), chapter 03 white exponential noise
("exponential").  Places that may be targets are left out: the brightest place of each window and
all cells that the law itself would hardly show, with five cells around them.  So a target of up to
20 dB is no misfit.  Gaps, NaN cells and frames, are left out as well.
"""

import math
import warnings
from typing import Annotated, NamedTuple

import numpy as np
from scipy.special import ndtri

from tbdcore.checks import Number, checked
from tbdcore.noise import Frames, Law
from tbdcore.recording.levels import Misfit, clipped

__all__ = ["Misfit", "fit", "warn_misfit"]

CELLS, LEAST, SIDE, AROUND = 20_000, 1000, 50, 5
SMALL = 1e-30
CERTAIN = 2.5758  # standard errors, 99 %
STEPS = 0.6180339887498949, 0.7548776662466927  # of the windows' places: spread evenly over a frame
MEAN_SIZE = 0.797  # of a standard normal value that is clipped at +-3
TO_SLOPE = 0.9033  # mean change of a normal score when ln(exponential power) changes by one

# The size of a condition at which false alarms double: the smaller of chapters 01 and 02 for
# "gaussian", that of chapter 03 for "exponential" (benchmarks/misfit.py).
TOLERANCE = {
    "level": {"gaussian": 0.05, "exponential": 0.1},  # standard deviations; dB
    "spread": {"gaussian": 0.2, "exponential": 0.5},  # dB
    "slope_x": {"gaussian": 0.25, "exponential": 0.1},  # standard deviations; share of the level
    "slope_y": {"gaussian": 0.25, "exponential": 0.1},
    "tail_1e2": {"gaussian": 1.2, "exponential": 1.1},  # times the number of cells of the law
    "tail_1e3": {"gaussian": 1.8, "exponential": 1.5},
    "next_x": {"gaussian": 0.06, "exponential": 0.05},  # correlation
    "next_y": {"gaussian": 0.06, "exponential": 0.05},
    "next_frame": {"gaussian": 0.2, "exponential": 0.1},
}
LEVEL = "normalise(frames, clipped(frames))"
MENDS = {
    "level": LEVEL,
    "spread": LEVEL,
    "slope": "normalise(frames, clipped(frames, size=...))",
    "tail": "normal_scores(frames, empirical_law(noise))",
    "next": "blocks(frames, K) give the threshold",
}


class Measure(NamedTuple):
    """A measured value, its standard error, and the tolerance of it."""

    value: float
    se: float
    tolerance: float = math.nan


class Fit(NamedTuple):
    """How frames agree with a law of noise; ``print(fit)`` shows it as a table.

    power : whether the law is "exponential"
    cells : number of cells that were looked at, without those that may be a target's
    level : "gaussian": mean, in standard deviations; "exponential": mean power, in dB
    spread : "gaussian": standard deviation, in dB; "exponential": width of the middle half, in dB
    slope_x, slope_y : change across the frame: "gaussian": of the mean or the standard deviation,
        in standard deviations; "exponential": of the level, as a share of it
    tail_1e2, tail_1e3 : cells in the upper tail, over the number in a tail of 1e-2 and 1e-3
    next_x, next_y, next_frame : correlation to the next cell, and to the cell in the next frame

    A value is NaN where the frames are too few or too small for it.
    """

    power: bool
    cells: int
    level: Measure
    spread: Measure
    slope_x: Measure
    slope_y: Measure
    tail_1e2: Measure
    tail_1e3: Measure
    next_x: Measure
    next_y: Measure
    next_frame: Measure

    def __str__(self):
        few = f"; fewer than {LEAST}: too few to judge" if self.cells < LEAST else ""
        rows, exceeded = [f"{self.cells} cells of noise{few}"], self.exceeded()
        for name in TOLERANCE:
            m, unit = getattr(self, name), _unit(name, self.power)
            row = f"{name:<11}{m.value:9.3f} ± {m.se:.3f} {unit:<13}tolerance {m.tolerance:g}"
            rows.append(row + "  exceeded" * (name in exceeded))
        return "\n".join(rows)

    def exceeded(self):
        """Names of the conditions that exceed their tolerance with 99 % certainty, worst first."""
        excess = {name: _excess(getattr(self, name), name) for name in TOLERANCE}
        enough = [name for name in excess if excess[name] > 0 and self.cells >= LEAST]
        return sorted(enough, key=excess.get, reverse=True)


def _excess(m, name):
    """By how many tolerances a measured value is certainly above its tolerance."""
    size = m.value if name.startswith("tail") else abs(m.value)  # a lighter tail is no misfit
    return (size - CERTAIN * m.se) / m.tolerance - 1 if size == size else -1.0


def _unit(name, power):
    kind = name.partition("_")[0]
    unit = {"spread": "dB", "tail": "times", "next": ""}
    unit |= {"level": "dB", "slope": "of the level"} if power else {"level": "std", "slope": "std"}
    return unit[kind]


@checked
def fit(
    frames: Frames,
    law: Law = "gaussian",
    mean: Annotated[float, Number(-1e50, 1e50)] = 0.0,
    std: Annotated[float, Number(1e-50, 1e50)] = 1.0,
) -> Fit:
    """How frames (K, nx, ny) agree with noise of a law, a mean and a standard deviation.

    It looks at 20,000 cells at most, in windows of pairs of frames, evenly spread.

    mean, std : what the filter is told; for "exponential" power 0 and the mean noise power
    """
    x, places = _windows(frames)
    x = (x - mean) / std
    bright, (left, known) = _bright(_scores(x, law, _noise(x, law)))
    x[bright] = np.nan
    n, at = int((x == x).sum()), _noise(x, law)
    y = _scores(x, law, at)
    next_ones = [_correlation(y, axis) for axis in (2, 3, 1)]
    fewer = math.prod((1 - r.value) / (1 + r.value) for r in next_ones if r.value > 0)
    fewer = max(fewer, 1 / max(n, 1))  # one independent cell at least, where frames are repeated
    slopes = [_slope(y, place, law, at.std, fewer) for place in places]
    tails = [_tail(y, q, left, known, fewer) for q in (1e-2, 1e-3)]
    found = [*_level(x, at, law, max(n * fewer, 1.0)), *slopes, *tails, *next_ones]
    limits = [of[law] for of in TOLERANCE.values()]
    found = [m._replace(tolerance=limit) for m, limit in zip(found, limits, strict=True)]
    return Fit(law == "exponential", n, *found)


def _windows(z):
    """Windows (n, 2, h, w) of pairs of frames, and where their cells are, from -1/2 to 1/2."""
    pairs, size = _pairs(z), z.shape[1:]
    h, w = side = [min(m, SIDE) for m in size]
    room = len(pairs) * (size[0] // h) * (size[1] // w)
    n = max(1, min(CELLS // (2 * h * w), room))
    rows = pairs[np.linspace(0, len(pairs) - 1, n).astype(int)]
    steps = np.arange(n)[:, None] * STEPS
    corner = ((0.5 + steps) % 1 * (np.array(size) - side + 1)).astype(int)
    x = [z[k][:, i : i + h, j : j + w] for k, (i, j) in zip(rows, corner, strict=True)]
    at = [c[:, None] + np.arange(m) for c, m in zip(corner.T, side, strict=True)]
    i, j = (a / max(m - 1, 1) - 0.5 for a, m in zip(at, size, strict=True))
    return np.array(x, float), (i[:, None, :, None], j[:, None, None, :])


def _pairs(z):
    """Pairs (n, 2) of successive known frames, none in two; (n, 1) the known ones without any."""
    known = np.flatnonzero((z == z).any(axis=(1, 2)))
    if not known.size:
        raise ValueError("misfit.fit: frames: all are missing; give at least one")
    pairs, last = [], -1
    for k in known[:-1][np.diff(known) == 1].tolist():
        if k > last:
            pairs.append((k, k + 1))
            last = k + 1
    return np.array(pairs or [(k,) for k in known.tolist()])


def _noise(x, law):
    return clipped(x.reshape(-1, *x.shape[2:]), law)


def _scores(x, law, at):
    """Normal scores of the values, in units of the noise level ``at``, within +-8."""
    with np.errstate(invalid="ignore", divide="ignore"):
        if law == "gaussian":
            return np.clip((x - at.mean) / at.std, -8.0, 8.0)
        return np.clip(-ndtri(np.exp(-np.maximum(x / at.mean, 0.0))), -8.0, 8.0)


def _bright(y):
    """Where targets may be, and how many cells are left in each window of a frame, of how many.

    The largest of a window, and what one window in a hundred would show, with their neighbours.  A
    largest one of the second kind is a target: what is left then is not "all but the largest".
    """
    from scipy.ndimage import maximum_filter

    filled = np.where(np.isnan(y), -np.inf, y)
    largest = filled.max(axis=(2, 3), keepdims=True)
    target = -ndtri(0.01 / (y.shape[2] * y.shape[3]))
    limit = np.minimum(largest, target)
    side = 2 * min(AROUND, min(y.shape[2:]) // 4) + 1
    bright = maximum_filter((filled >= limit).view(np.int8), (1, 1, side, side)) > 0
    bright &= bright.mean() < 0.5  # more than half of the cells are no targets
    known = y == y
    of = np.where(largest[..., 0, 0] > target, 10**9, known.sum(axis=(2, 3)))
    return bright, ((known & ~bright).sum(axis=(2, 3)), of)


def _tail(y, q, left, known, fewer):
    """Cells in the upper tail of probability q, over their expected number.

    Of n independent cells without their largest, each other one lies in the tail with probability
    1 - p**n - n p (1 - p**(n - 1)) / (n - 1), p = 1 - q.
    """
    n, p = np.maximum(known, 3), 1.0 - q
    each = 1 - p**n - n * p * (1 - p ** (n - 1)) / (n - 1)
    expected, count = float((left * each).sum()), int((y > -ndtri(q)).sum())
    if expected < 1.0:
        return Measure(math.nan, math.nan)
    return Measure(count / expected, math.sqrt(max(count, expected) / fewer) / expected)


def _correlation(y, axis):
    """Correlation of clipped scores one cell or frame apart; NaN without such cells."""
    y = np.moveaxis(np.clip(y, -3.0, 3.0), axis, 0)
    a, b = y[:-1], y[1:]
    both = (a == a) & (b == b)
    n = int(both.sum())
    if n < 3:
        return Measure(math.nan, math.nan)
    a, b = a[both], b[both]
    spread = math.sqrt(a.var() * b.var())
    value = ((a - a.mean()) * (b - b.mean())).mean() / spread if spread > 0 else 0.0
    return Measure(float(value), 1 / math.sqrt(n))


def _slope(y, place, law, std, fewer):
    """Change across the frame, by least squares on clipped scores.

    Of the level; in normal noise of the mean or the standard deviation, what is more certain.
    """
    y, u = np.broadcast_arrays(np.clip(y, -3.0, 3.0), place)
    y, u = y[y == y], u[y == y]
    u = u - (u.mean() if u.size else 0.0)
    total = float(u @ u)
    if total < 1e-9:
        return Measure(math.nan, math.nan)
    parts = [(y, std), (abs(y), std / MEAN_SIZE)] if law == "gaussian" else [(y, 1 / TO_SLOPE)]
    found = [(unit * float(u @ v), unit * float(v.std()) * math.sqrt(total)) for v, unit in parts]
    slope, se = max(found, key=lambda pair: abs(pair[0]) / max(pair[1], SMALL))
    return Measure(slope / total, se / total / math.sqrt(fewer))


def _level(x, at, law, n):
    """Level and spread; errors are those of n independent cells of the law."""
    if law == "gaussian":
        level = Measure(at.mean, 1.02 * at.std / math.sqrt(n))
        return level, Measure(_decibels(at.std**2), 8.69 * 0.78 / math.sqrt(n))
    low, middle, high = np.nanquantile(x, (0.25, 0.5, 0.75))
    ratio = (high - low) / math.log(3) / max(middle / math.log(2), SMALL)
    level = Measure(_decibels(at.mean), 4.34 * 1.05 / math.sqrt(n))
    return level, Measure(_decibels(ratio), 4.34 * 1.594 / math.sqrt(n))


def _decibels(ratio):
    return 10 * math.log10(max(ratio, SMALL))


def warn_misfit(
    frames: Frames, law: Law = "gaussian", mean: float = 0.0, std: float = 1.0, stacklevel: int = 2
) -> Fit:
    """One :class:`Misfit` warning of one line if :func:`fit` finds a tolerance exceeded.

    With fewer than 1,000 cells of noise nothing is said; ``stacklevel`` as in ``warnings.warn``.
    """
    found = fit(frames, law, mean, std)
    if names := found.exceeded():
        warnings.warn(_line(found, names), Misfit, stacklevel=stacklevel)
    return found


def _line(found, names):
    """What does not fit, by how much, what it does, and which function mends it."""
    name, m = names[0], getattr(found, names[0])
    size = f"{m.value:.3g} ± {m.se:.1g} {_unit(name, found.power)}".rstrip()
    rises = m.value > 0 or name not in ("level", "spread")
    more = "other" if name in ("next_x", "next_y") else "more"  # fewer in chapter 01
    effect = f"{more} false alarms than promised" if rises else "weak targets are missed"
    also = f"; also {', '.join(names[1:])}" if names[1:] else ""
    mend = MENDS[name.partition("_")[0]]
    noise = f"frames: {name} of the noise is {size} (tolerance {m.tolerance:g})"
    return f"{noise}: {effect}; recording.{mend}{also}"
