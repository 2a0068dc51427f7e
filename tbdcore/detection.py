"""Detection of a fluctuating echo in one cell: thresholds, probabilities, likelihood ratios.

A receiver that knows the noise power looks at lambda = |x|**2 / sigma_n**2.  Under noise alone (H0)
lambda is exponential with mean 1; when the cell also holds a Swerling 1 target of mean
signal-to-noise ratio S (H1), signal and noise are both complex normal and lambda is exponential
with mean 1 + S.  One cell, one scan, one decision lambda > eta:

    P_f = exp(-eta)                    ``false_alarm(eta)``      eta = -ln P_f                         ``threshold(P_f)``
    P_d = exp(-eta / (1 + S))          ``detection(eta, S)``     S = eta / ln(1 / P_d) - 1             ``required_snr(P_d, P_f)``
        = P_f ** (1 / (1 + S))

The amplitude |x| / sigma_n itself is then Rayleigh, with second moment 1 and 1 + S.

What remains of the power above the threshold, lambda - eta, is exponential again, with mean 1 under
noise and 1 + S with a target.  It says how much more a plot looks like the target than like a false
alarm, ``amplitude_ratio``, whatever the threshold and the false-alarm probability were.

Signal-to-noise ratios are linear power ratios here; ``db`` and ``linear`` convert.  The echo
weakens with the fourth power of the range, ``radar_equation``.  All of these take scalars or
arrays.

A tracker looks at the cells inside a gate only, and a gate cuts through cells.  ``false_plot``
draws the false alarms of such a gate, cell by cell and from one uniform number; where the gate is,
is ``kalman``'s business.
"""

import itertools
import math

import numpy as np

from tbdcore import kernel

GOLDEN = 0.6180339887498949


def db(ratio):
    """Power ratio in decibels."""
    return 10 * np.log10(ratio)


def linear(decibels):
    """Decibels as a power ratio."""
    return 10 ** (np.asarray(decibels, float) / 10)


def threshold(p_false):
    """Threshold eta on lambda = |x|**2 / sigma_n**2 for a false-alarm probability per cell in (0,
    1].

    Raises ValueError outside that interval.
    """
    p_false = np.asarray(p_false, float)
    if not ((p_false > 0) & (p_false <= 1)).all():
        raise ValueError(
            f"detection.threshold: false-alarm probability {p_false.tolist()} is not in (0, 1]"
        )
    return -np.log(p_false)


def false_alarm(eta):
    """Probability that noise alone exceeds eta in one cell."""
    return np.exp(-np.asarray(eta, float))


def detection(eta, snr):
    """Probability that a cell with a Swerling 1 target of mean linear `snr` exceeds eta."""
    return np.exp(-np.asarray(eta, float) / (1 + np.asarray(snr, float)))


def required_snr(p_detect, p_false):
    """Mean linear signal-to-noise ratio that a Swerling 1 target needs for p_detect at p_false,
    both in (0, 1).
    """
    return np.log(p_false) / np.log(p_detect) - 1


def radar_equation(r, snr0, r0):
    """Signal-to-noise ratio at range r of a target that has snr0 at r0 (same unit): the
    fourth-power law.
    """
    return snr0 * (r0 / np.asarray(r, float)) ** 4


def amplitude_ratio_spec(excess, snr):
    """Log of the ratio of the two exponential densities."""
    density = [-np.asarray(excess) / (1 + S) - np.log(1 + S) for S in snr]
    return np.array(density).reshape(len(snr), len(excess)) + np.asarray(excess)


@kernel
def amplitude_ratio(excess, snr):
    """ln of the amplitude likelihood ratio p(excess | target) / p(excess | noise), shape (T, M).

    ``excess`` (M,) is lambda - eta >= 0 of each plot, which for a Rayleigh amplitude a with
    parameter 1 and its threshold tau is (a**2 - tau**2) / 2; ``snr`` (T,) the mean linear ratio of
    each track's target.  With S = snr the result is S / (1 + S) excess - ln(1 + S): zero, exactly,
    for S = 0.  Its exponential has mean one under noise, but no variance as soon as S >= 1, and
    overflows for strong echoes: add the logarithm.
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
        edges.append(
            list(zip(np.maximum(c - h, i * w), np.minimum(c + h, (i + 1) * w), strict=True))
        )
    fired = []
    for r, a in itertools.product(*edges):
        q = p_false * (r[1] - r[0]) * (a[1] - a[0]) / (cell[0] * cell[1])
        u, fires = (u / q, True) if u < q else ((u - q) / (1 - q), False)
        fired += [(r, a)] if fires else []
    if nth >= len(fired):
        return False, 0.0, 0.0
    turned = (np.asarray(v) + nth * GOLDEN) % 1.0
    return True, *(
        low + (high - low) * t - c
        for (low, high), t, c in zip(fired[nth], turned, centre, strict=True)
    )


@kernel
def false_plot(u, v, centre, half, cell, p_false, nth):
    """The nth false plot inside a rectangular gate that lies over a grid of cells: (found, residual
    on axis 0, on axis 1).

    Cell i fires with probability beta_i p_false, beta_i the share of the cell inside the gate,
    independently of the others; all of this from one uniform number: if u < q the cell fires and u
    / q is uniform again, otherwise (u - q) / (1 - q) is.

    u : float in [0, 1); v : pair of floats in [0, 1), the place inside the cell (turned by the
        golden section from one false plot to the next). centre, half, cell : pairs, centre and half
        width of the gate and width of a cell, in m and rad.
    """
    found = 0
    for i in range(
        math.floor((centre[0] - half[0]) / cell[0]), math.ceil((centre[0] + half[0]) / cell[0])
    ):
        r0, r1 = max(centre[0] - half[0], i * cell[0]), min(centre[0] + half[0], (i + 1) * cell[0])
        for j in range(
            math.floor((centre[1] - half[1]) / cell[1]), math.ceil((centre[1] + half[1]) / cell[1])
        ):
            a0, a1 = (
                max(centre[1] - half[1], j * cell[1]),
                min(centre[1] + half[1], (j + 1) * cell[1]),
            )
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
