"""Do plots agree with what a tracker is told: start states, errors, clutter, the noise level?

``look`` keeps what the gates of one scan hold, and ``contradiction`` names, in one line, what
exceeds its tolerance with 99 % certainty.  ``noise_level`` reads the level off the strengths.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from tbdcore import detection, kalman

__all__ = ["Seen", "contradiction", "look", "noise_level"]

CERTAIN = 2.6  # standard errors, 99 %
LEAST_SCANS, LEAST_CLAIMS, LAST_SCANS = 5, 20, 10
FACTOR = 3.0  # by which a clutter density may be off
SMALLEST_SHARE = 0.2  # of the errors that were told, within which plots may lie
SAME = 1.0  # squared Mahalanobis distance below which two tracks are one; two targets have 4

DEG = 1.0, math.pi / 180  # of range and azimuth in degrees
READINGS = {  # of plots z and start states x
    "the plots look like kilometres": lambda z, x: (1e3 * z, x),
    "the start states look like kilometres": lambda z, x: (z, 1e3 * x),
    "the plots look like [y, x]": lambda z, x: (z[:, ::-1], x),
    "the plots look like [range, azimuth in rad]": lambda z, x: (kalman.cartesian(z), x),
    "the plots look like [range, azimuth in degrees]": lambda z, x: (kalman.cartesian(z * DEG), x),
    "the start states look like [x, y, vx, vy]": lambda z, x: (z, x[:, [0, 2, 1, 3]]),
}


class Seen(NamedTuple):
    """What the gates of one scan hold."""

    z: Any  # (M, 2) plots of the scan in m
    gated: int  # plots in at least one gate
    expected: float  # detections expected there
    spread: float  # their variance
    area: float  # of all gates in m^2
    largest: float  # area of the largest gate
    claims: float  # sum of the weights of plots over the tracks
    along: float  # the same times squared distance from the prediction, along the line of sight
    across: float  # and across it, each over its variance


def look(z, gated, zhat, S, beta, expected, gamma):
    """What the gates of one scan hold.

    z : (M, 2) plots in m; gated : (C,) indices of those in gates; zhat : (T, 2) predictions;
    S : (T, 2, 2) their covariances; beta : (T, C + 1) weights, first that of no plot;
    expected : (T,) P_D P_G times the predicted existence; gamma : squared size of a gate
    """
    area = math.pi * gamma * np.sqrt(np.linalg.det(S))
    claims = beta[:, 1:]
    sums = [expected.sum(), (expected * (1 - expected)).sum(), area.sum(), area.max(initial=0.0)]
    sums.append(claims.sum())
    sight = zhat / np.hypot(*zhat.T)[:, None]
    for axis in (sight, sight[:, ::-1] * (-1.0, 1.0)):
        off = np.einsum("tmi,ti->tm", z[gated] - zhat[:, None], axis)
        variance = np.einsum("ti,tij,tj->t", axis, S, axis)
        sums.append((claims * off**2 / variance[:, None]).sum())
    return Seen(z, len(gated), *map(float, sums))


def contradiction(seen, x, P, existence, p_detect, clutter):
    """What the plots contradict, in one line, or None.

    seen : a Seen of each scan that was taken; x (K, T, 4), P (K, T, 4, 4), existence (K, T) of the
    tracks; p_detect (T,); clutter in plots per m^2 and scan, or "estimate"
    """
    if not seen or not x.shape[1]:
        return None
    total = Seen(seen[0].z, *np.sum([one[1:] for one in seen], axis=0).tolist())
    return (
        _never_gated(seen, total, x[0], p_detect)
        or _errors_too_large(total)
        or _coincide(x, P, existence)
        or _other_density(total, clutter)
    )


def _never_gated(seen, total, x, p_detect):
    """No plot ever in a gate, and what plots and start states may be instead."""
    seen = [one for one in seen if len(one.z)]
    missed = len(seen) * np.log1p(-p_detect).sum()
    if total.gated or len(seen) < LEAST_SCANS or missed > math.log(0.01):
        return None
    reading = _likely(np.concatenate([one.z for one in seen[:LEAST_SCANS]]), x)
    return f"scans: no plot of {len(seen)} scans lies in a gate; {reading}"


def _likely(z, x):
    """The reading of plots and start states that brings them ten times as near, if one does."""
    near = {words: _apart(*read(z, x)) for words, read in READINGS.items()}
    best = min(near, key=near.get)
    fits = near[best] < min(0.1, _apart(z, x) / 10)
    return best if fits else "check units, origin and start states"


def _apart(z, x):
    """Median over the tracks of the distance to the nearest plot, over the track's range."""
    off = np.hypot(*np.moveaxis(x[:, None, ::2] - z, -1, 0)).min(axis=1)
    return np.median(off / np.hypot(*x[:, ::2].T))


def _errors_too_large(total):
    """Plots much nearer to the predictions than the errors that were told."""
    shares = [math.sqrt(d2 / max(total.claims, 1e-9)) for d2 in (total.along, total.across)]
    if total.claims < LEAST_CLAIMS or min(shares) > SMALLEST_SHARE:
        return None
    words = f"plots lie within {min(shares):.1g} of the errors that were told"
    return f"sigma_r, sigma_theta_deg, P, Q: {words}; give them in the unit of the plots"


def _coincide(x, P, existence):
    """Two tracks that exist and have one state in each of the last scans."""
    x, P, existence = (a[-LAST_SCANS:] for a in (x, P, existence))
    both = (existence > 0.5).all(axis=0) & (len(x) == LAST_SCANS)
    for a, b in np.argwhere(np.triu(both[:, None] & both, 1)):
        off = x[:, a] - x[:, b]
        d2 = (off * np.linalg.solve(P[:, a] + P[:, b], off[..., None])[..., 0]).sum(axis=1)
        if d2.max() < SAME:
            words = f"tracks {a} and {b} coincide in the last {LAST_SCANS} scans"
            return f"x: {words}; take one out: close targets need a plot each to be kept apart"
    return None


def _other_density(total, clutter):
    """False plots in the gates are many more or many fewer than the density says."""
    if clutter == "estimate":
        return None
    false, most, least = total.gated - total.expected, clutter * total.area, clutter * total.largest
    most, least = FACTOR * most, least / FACTOR
    many = false - most > CERTAIN * math.sqrt(most + total.spread) + 3
    few = least - max(false, 0.0) > CERTAIN * math.sqrt(least + total.spread) + 3
    if not many and not few:
        return None
    words = f"{clutter:.2g} told, {max(false, 0.5) / total.area:.1g} per m^2 in the gates"
    return f'clutter: {words}; give clutter="estimate", or the density'


def noise_level(scans):
    """Level of exponential noise from the strengths of plots, which lie above some threshold.

    scans : arrays (n, d) with the strength in column 2, over the mean power told; or None

    Returns the lowest strength but for a tenth of the plots, the level in dB of what is above it,
    which has the mean of the noise, and its error, infinite with fewer than 1,000 plots.
    """
    lam = np.sort(np.concatenate([[], *(cells[:, 2] for cells in scans if cells is not None)]))
    lam = lam[len(lam) // 10 : np.searchsorted(lam, np.inf)]
    if len(lam) < 2:
        return 0.0, 0.0, np.inf
    level = detection.to_db(max(np.median(lam - lam[0]), 1e-300) / math.log(2))
    return lam[0], float(level), 6.5 / math.sqrt(len(lam)) if len(lam) > 899 else np.inf
