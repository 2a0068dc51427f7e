"""Detection of a fluctuating echo in one cell: thresholds, probabilities, likelihood ratios.

A receiver that knows the noise power looks at lambda = |x|**2 / sigma_n**2.  Under noise alone (H0)
lambda is exponential with mean 1; when the cell also holds a Swerling 1 target of mean
signal-to-noise ratio S (H1), signal and noise are both complex normal and lambda is exponential
with mean 1 + S.  One cell, one scan, one decision lambda > eta:

    P_f = exp(-eta)                 eta = -ln P_f                   ``threshold``
    P_d = exp(-eta / (1 + S))       S = eta / ln(1 / P_d) - 1       ``detection_probability``
        = P_f ** (1 / (1 + S))                                      ``required_snr``

What remains of the power above the threshold, lambda - eta, is exponential again, with mean 1 under
noise and 1 + S with a target, whatever P_f is.  ``amplitude_ratio`` says how much more a plot looks
like the target than like a false alarm.

Signal-to-noise ratios are linear power ratios; ``to_db`` and ``from_db`` convert.  All of these
take scalars or arrays; NaN and values outside the range that they name are a ValueError.
``false_plot`` draws the false alarms of a gate that cuts through cells, from one uniform number.
"""

import itertools
import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, ArrayLike, Integer, Number, Numbers, checked, numbers
from tbdcore.jit import kernel

__all__ = ["GOLDEN", "TINY", "amplitude_ratio", "detection_probability", "false_plot"]
__all__ += ["from_db", "radar_equation", "required_snr", "threshold", "to_db"]

GOLDEN, TINY = 0.6180339887498949, float(np.finfo(float).tiny)
FalseAlarm = Annotated[ArrayLike, Numbers(..., low=TINY, high=1.0)]
LAST = 1.0 - 2.0**-53  # the largest number below 1
Pair = Annotated[ArrayLike, Numbers(2)]


@checked
def to_db(ratio: Annotated[ArrayLike, Numbers(..., low=0.0, high=math.inf)]) -> Array:
    """Power ratio >= 0 in decibels, -inf for 0."""
    with np.errstate(divide="ignore"):
        return 10 * np.log10(ratio)


@checked
def from_db(decibels: Annotated[ArrayLike, Numbers(..., low=-math.inf, high=1000.0)]) -> Array:
    """Decibels, at most 1000, as a power ratio."""
    return 10 ** (decibels / 10)


@checked
def threshold(p_false: FalseAlarm) -> Array:
    """Threshold eta on |x|**2 / sigma_n**2 for a false-alarm probability per cell in (0, 1]."""
    return -np.log(p_false)


@checked
def detection_probability(
    eta: Annotated[ArrayLike, Numbers(..., low=0.0, high=math.inf)],
    snr: Annotated[ArrayLike, Numbers(..., low=0.0, high=1e300)],
) -> Array:
    """Probability that a cell with a Swerling 1 target of mean linear `snr` exceeds eta >= 0."""
    return np.exp(-eta / (1 + snr))


@checked
def required_snr(
    p_detect: Annotated[ArrayLike, Numbers(..., low=TINY, high=1.0 - 1e-15)], p_false: FalseAlarm
) -> Array:
    """Mean linear SNR that a Swerling 1 target needs for p_detect at p_false <= p_detect."""
    if (p_detect < p_false).any():
        raise ValueError("detection.required_snr: p_detect is below p_false; no target is needed")
    return np.log(p_false) / np.log(p_detect) - 1


@checked
def radar_equation(
    r: Annotated[ArrayLike, Numbers(...)],
    snr0: Annotated[float, Number(0.0, 1e100)],
    r0: Annotated[float, Number(1e-100, 1e100)],
) -> Array:
    """SNR at range r of a target that has snr0 at r0 (same unit): the fourth-power law."""
    numbers("detection.radar_equation: r", r, ..., low=1e-50 * r0, high=1e50 * r0)
    return snr0 * (r0 / r) ** 4


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


def false_plot_spec(u, v, centre, half, cell, p_false, nth):
    """:func:`false_plot` by listing the cells of the gate, then walking through the list."""
    edges = []
    for c, h, w in zip(centre, half, cell, strict=True):
        i = np.arange(math.floor((c - h) / w), math.ceil((c + h) / w))
        edges.append(np.column_stack((np.maximum(c - h, i * w), np.minimum(c + h, (i + 1) * w))))
    fired = []
    for r, a in itertools.product(*edges):
        q = p_false * (r[1] - r[0]) * (a[1] - a[0]) / (cell[0] * cell[1])
        u, fires = (u / q, True) if u < q else ((u - q) / (1 - q), False)
        fired += [(r, a)] if fires else []
    if nth >= len(fired):
        return False, 0.0, 0.0
    turned = (np.asarray(v) + nth * GOLDEN) % 1.0
    low, high = np.array(fired[nth]).T
    return True, *(low + (high - low) * turned - centre)


@checked
@kernel
def false_plot(
    u: Annotated[float, Number(0.0, LAST)],
    v: Pair,
    centre: Pair,
    half: Annotated[ArrayLike, Numbers(2, low=0.0)],
    cell: Annotated[ArrayLike, Numbers(2, low=TINY)],
    p_false: Annotated[float, Number(0.0, 1.0)],
    nth: Annotated[int, Integer(0)],
) -> tuple[bool, float, float]:
    """The nth false plot inside a rectangular gate over a grid of cells: (found, residual (2)).

    A cell fires with probability q, p_false times the share of the cell inside the gate.  One draw
    is enough: if u < q the cell fires and u / q is uniform again, otherwise (u - q) / (1 - q) is.

    u : draw in [0, 1); v : pair of draws, the place inside the cell, turned by the golden section
        from one false plot to the next
    centre, half, cell : pairs, centre and half width of the gate, width of a cell, in m and rad
    """
    cells = 1.0
    for n in range(2):
        if not abs(centre[n]) + half[n] < 1e15 * cell[n]:
            raise ValueError("detection.false_plot: the gate is 1e15 cells away; is it in m, rad?")
        cells *= 2.0 * half[n] / cell[n] + 2.0
    if cells > 1e8:
        raise ValueError("detection.false_plot: over 1e8 cells in a gate; enlarge the cells")
    found, w, h = 0, cell[0], cell[1]
    near, far = centre[0] - half[0], centre[0] + half[0]
    right, left = centre[1] - half[1], centre[1] + half[1]
    for i in range(math.floor(near / w), math.ceil(far / w)):
        r0, r1 = max(near, i * w), min(far, (i + 1) * w)
        for j in range(math.floor(right / h), math.ceil(left / h)):
            a0, a1 = max(right, j * h), min(left, (j + 1) * h)
            q = p_false * (r1 - r0) * (a1 - a0) / (cell[0] * cell[1])
            if u >= q:
                u = (u - q) / (1.0 - q)
                continue
            u /= q
            if found == nth:
                t0, t1 = (v[0] + nth * GOLDEN) % 1.0, (v[1] + nth * GOLDEN) % 1.0
                return True, r0 + (r1 - r0) * t0 - centre[0], a0 + (a1 - a0) * t1 - centre[1]
            found += 1
    return False, 0.0, 0.0
