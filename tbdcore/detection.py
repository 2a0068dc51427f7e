"""Detection of a fluctuating echo in one cell: thresholds, probabilities, likelihood ratios.

A receiver that knows the noise power looks at lambda = |x|**2 / sigma_n**2.  Under noise alone (H0) lambda is
exponential with mean 1; when the cell also holds a Swerling 1 target of mean signal-to-noise ratio S (H1), signal and
noise are both complex normal and lambda is exponential with mean 1 + S.  One cell, one scan, one decision lambda >
eta:

    P_f = exp(-eta)                    ``false_alarm(eta)``      eta = -ln P_f                         ``threshold(P_f)``
    P_d = exp(-eta / (1 + S))          ``detection(eta, S)``     S = eta / ln(1 / P_d) - 1             ``required_snr(P_d, P_f)``
        = P_f ** (1 / (1 + S))

The amplitude |x| / sigma_n itself is then Rayleigh, with second moment 1 and 1 + S.

What remains of the power above the threshold, lambda - eta, is exponential again, with mean 1 under noise and 1 + S with a
target.  It says how much more a plot looks like the target than like a false alarm, ``amplitude_ratio``, whatever the
threshold and the false-alarm probability were.

Signal-to-noise ratios are linear power ratios here; ``db`` and ``linear`` convert.  The echo weakens with the fourth
power of the range, ``radar_equation``.  All functions take scalars or arrays.  Nothing here knows where a target may
be: gates are ``kalman``'s.
"""

import math

import numpy as np

from tbdcore import kernel


def db(ratio):
    """Power ratio in decibels."""
    return 10 * np.log10(ratio)


def linear(decibels):
    """Decibels as a power ratio."""
    return 10 ** (np.asarray(decibels, float) / 10)


def threshold(p_false):
    """Threshold eta on lambda = |x|**2 / sigma_n**2 for a false-alarm probability per cell in (0, 1].

    Raises ValueError outside that interval.
    """
    p_false = np.asarray(p_false, float)
    if not ((p_false > 0) & (p_false <= 1)).all():
        raise ValueError(f"detection.threshold: false-alarm probability {p_false.tolist()} is not in (0, 1]")
    return -np.log(p_false)


def false_alarm(eta):
    """Probability that noise alone exceeds eta in one cell."""
    return np.exp(-np.asarray(eta, float))


def detection(eta, snr):
    """Probability that a cell with a Swerling 1 target of mean linear `snr` exceeds eta."""
    return np.exp(-np.asarray(eta, float) / (1 + np.asarray(snr, float)))


def required_snr(p_detect, p_false):
    """Mean linear signal-to-noise ratio that a Swerling 1 target needs for p_detect at p_false, both in (0, 1)."""
    return np.log(p_false) / np.log(p_detect) - 1


def radar_equation(r, snr0, r0):
    """Signal-to-noise ratio at range r of a target that has snr0 at r0 (same unit): the fourth-power law."""
    return snr0 * (r0 / np.asarray(r, float)) ** 4


def amplitude_ratio_spec(excess, snr):
    """Log of the ratio of the two exponential densities."""
    density = [-np.asarray(excess) / (1 + S) - np.log(1 + S) for S in snr]
    return np.array(density).reshape(len(snr), len(excess)) + np.asarray(excess)


@kernel
def amplitude_ratio(excess, snr):
    """ln of the amplitude likelihood ratio p(excess | target) / p(excess | noise), shape (T, M).

    ``excess`` (M,) is lambda - eta >= 0 of each plot, which for a Rayleigh amplitude a with parameter 1 and its threshold
    tau is (a**2 - tau**2) / 2; ``snr`` (T,) the mean linear ratio of each track's target.  With S = snr the result is
    S / (1 + S) excess - ln(1 + S): zero, exactly, for S = 0.  Its exponential has mean one under noise, but no variance as
    soon as S >= 1, and overflows for strong echoes: add the logarithm.
    """
    out = np.empty((snr.size, excess.size))
    for t in range(snr.size):
        gain, level = snr[t] / (1.0 + snr[t]), math.log(1.0 + snr[t])
        for m in range(excess.size):
            out[t, m] = gain * excess[m] - level
    return out
