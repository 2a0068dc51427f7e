"""Detection of a fluctuating echo in one cell: thresholds, probabilities, likelihood ratios.

A receiver that knows the noise power looks at lambda = |x|**2 / sigma_n**2.  Under noise alone (H0)
lambda is exponential with mean 1; when the cell also holds a Swerling 1 target of mean
signal-to-noise ratio S (H1), signal and noise are both complex normal and lambda is exponential
with mean 1 + S.  One cell, one scan, one decision lambda > eta:

    P_f = exp(-eta)                 eta = -ln P_f                   ``threshold``
    P_d = exp(-eta / (1 + S))       S = eta / ln(1 / P_d) - 1       ``detection_probability``
        = P_f ** (1 / (1 + S))                                      ``required_snr``

What remains of the power above the threshold, lambda - eta, is exponential again, with mean 1 under
noise and 1 + S with a target, whatever P_f is.

Signal-to-noise ratios are linear power ratios; ``to_db`` and ``from_db`` convert.  All of these
take scalars or arrays; NaN and values outside the range that they name are a ValueError.
"""

import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, ArrayLike, Numbers, checked

__all__ = ["TINY", "detection_probability", "from_db", "required_snr", "threshold", "to_db"]

TINY = float(np.finfo(float).tiny)
FalseAlarm = Annotated[ArrayLike, Numbers(..., low=TINY, high=1.0)]
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
