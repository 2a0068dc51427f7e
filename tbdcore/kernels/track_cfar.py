"""Constant track false alarm rate: one track, its gate, false plots, and the level of the noise.

``predict_cv``, ``gate_polar`` and ``update_polar`` are the Kalman step of :mod:`tbdcore.kalman`
compiled: for one track, in place, with the zeros of F and H left out.  ``false_plot`` draws the
false alarms of a gate that cuts through cells, from one uniform number.  ``radar_equation`` is the
signal-to-noise ratio by range, ``noise_level`` reads the level of the noise off plots.
"""

import functools
import itertools
import math
from typing import Annotated

import numpy as np

from tbdcore import detection
from tbdcore.checks import Array, ArrayLike, Covariance, Integer, Number, Numbers, checked, numbers
from tbdcore.detection import TINY
from tbdcore.jit import kernel
from tbdcore.kalman import (
    Positive,
    Real,
    Spread,
    State,
    Track,
    _finite,
    innovation_covariance,
    polar,
    polar_jacobian,
    predict,
    update,
)

__all__ = [
    "GOLDEN",
    "false_plot",
    "gate_polar",
    "noise_level",
    "predict_cv",
    "radar_equation",
    "update_polar",
]

GOLDEN = 0.6180339887498949
LAST = 1.0 - 2.0**-53  # the largest number below 1
Pair = Annotated[ArrayLike, Numbers(2)]


@checked
def radar_equation(
    r: Annotated[ArrayLike, Numbers(...)],
    snr0: Annotated[float, Number(0.0, 1e100)],
    r0: Annotated[float, Number(1e-100, 1e100)],
) -> Array:
    """SNR at range r of a target that has snr0 at r0 (same unit): the fourth-power law."""
    numbers("track_cfar.radar_equation: r", r, ..., low=1e-50 * r0, high=1e50 * r0)
    return snr0 * (r0 / r) ** 4


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
            raise ValueError("track_cfar.false_plot: the gate is 1e15 cells away; is it in m, rad?")
        cells *= 2.0 * half[n] / cell[n] + 2.0
    if cells > 1e8:
        raise ValueError("track_cfar.false_plot: over 1e8 cells in a gate; enlarge the cells")
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


def _in_place(compiled):
    """A kernel that changes a track in place, checked: one that it refuses stays as it was."""

    @functools.wraps(getattr(compiled, "py_func", compiled))
    def step(x, P, *args):
        x[...], P[...] = _finite(step.__name__, *compiled(x.copy(), P.copy(), *args))
        return x, P

    return checked(step, inside=compiled)


def predict_cv_spec(x, P, T, q):
    """:func:`predict_cv` with matrices, not in place."""
    F = np.kron(np.eye(2), np.array([[1, T], [0, 1]]))
    Q = q * np.kron(np.eye(2), np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]))
    return predict(x, P, F, Q)


@_in_place
@kernel
def predict_cv(x: State, P: Spread, T: Positive, q: Positive) -> Track:
    """Constant-velocity prediction in place: x (4,), P (4, 4), T seconds.

    q >= 0 is the power density of the white acceleration on each axis, in m^2/s^3.
    """
    x[0] += T * x[1]
    x[2] += T * x[3]
    for a in range(0, 4, 2):
        for b in range(a, 4, 2):  # block (a, b) of F P F': [[1, T], [0, 1]] p [[1, 0], [T, 1]]
            p01 = P[a, b + 1] + T * P[a + 1, b + 1]
            p10 = P[a + 1, b] + T * P[a + 1, b + 1]
            p00 = P[a, b] + T * (P[a + 1, b] + p01)
            P[a, b], P[a, b + 1], P[a + 1, b] = p00, p01, p10
        P[a, a] += q * T**3 / 3
        P[a, a + 1] += q * T**2 / 2
        P[a + 1, a] = P[a, a + 1]
        P[a + 1, a + 1] += q * T
    for i in range(2):
        for j in range(2):
            P[2 + i, j] = P[j, 2 + i]
    return x, P


def gate_polar_spec(x, P, var_r, var_a):
    """:func:`gate_polar` with matrices."""
    D = innovation_covariance(P, polar_jacobian(x), np.diag([var_r, var_a]))
    return (*polar(x), D[0, 0], D[0, 1], D[1, 1])


@kernel
def _gate_polar(x, P, var_r, var_a):
    r = math.sqrt(x[0] * x[0] + x[2] * x[2])
    c, s = x[0] / r, x[2] / r
    D11 = c * c * P[0, 0] + 2 * c * s * P[0, 2] + s * s * P[2, 2] + var_r
    D12 = (c * s * (P[2, 2] - P[0, 0]) + (c * c - s * s) * P[0, 2]) / r
    D22 = (s * s * P[0, 0] - 2 * c * s * P[0, 2] + c * c * P[2, 2]) / (r * r) + var_a
    return r, math.atan2(x[2], x[0]), D11, D12, D22


@checked(inside=_gate_polar)
def gate_polar(
    x: Annotated[ArrayLike, Numbers(4)],
    P: Annotated[ArrayLike, Covariance(4, 4)],
    var_r: Positive,
    var_a: Positive,
) -> tuple[float, float, float, float, float]:
    """(range, azimuth, D_11, D_12, D_22) of x (4,), P (4, 4), var_r in m^2 and var_a in rad^2."""
    return _finite("gate_polar", *_gate_polar(x, P, var_r, var_a))


def update_polar_spec(x, P, y_r, y_a, var_r, var_a):
    """:func:`update_polar` with matrices, not in place."""
    return update(x, P, np.array([y_r, y_a]), polar_jacobian(x), np.diag([var_r, var_a]))


@_in_place
@kernel
def update_polar(
    x: State, P: Spread, y_r: Real, y_a: Real, var_r: Positive, var_a: Positive
) -> Track:
    """Update x (4,), P (4, 4) in place by the residual (y_r, y_a) of a plot, in m and rad.

    Errors are independent, with variances var_r and var_a: two scalar updates, no matrix inverse.
    """
    r = math.sqrt(x[0] * x[0] + x[2] * x[2])
    c, s = x[0] / r, x[2] / r
    moved = 0.0  # what the range has already moved the predicted azimuth
    for j in range(2):
        hx, hy = (c, s) if j == 0 else (-s / r, c / r)
        g0, g1 = hx * P[0, 0] + hy * P[0, 2], hx * P[1, 0] + hy * P[1, 2]
        g2, g3 = hx * P[2, 0] + hy * P[2, 2], hx * P[3, 0] + hy * P[3, 2]
        D = hx * g0 + hy * g2 + (var_r if j == 0 else var_a)
        e = (y_r if j == 0 else y_a - moved) / D
        if j == 0:
            moved = (-s * g0 + c * g2) / r * e
        x[0] += g0 * e
        x[1] += g1 * e
        x[2] += g2 * e
        x[3] += g3 * e
        G = (g0, g1, g2, g3)
        for a in range(4):
            for b in range(a, 4):
                P[a, b] -= G[a] * G[b] / D
                P[b, a] = P[a, b]
    return x, P


def noise_level(scans):
    """Level of exponential noise from the strengths of plots, which lie above some threshold.

    scans : arrays (n, d) with the strength in column 2, over the mean power told; or None

    Returns the lowest strength but for a tenth of the plots, the level in dB of what is above it,
    which has the mean of the noise, and its error, infinite with fewer than 1,000 plots.
    """
    if not isinstance(scans, (list, tuple)):
        raise ValueError("track_cfar.noise_level: scans: give a list of arrays (n, d), or None")
    name = "track_cfar.noise_level: scans"
    tables = [numbers(f"{name}[{k}]", z, "n", "d") for k, z in enumerate(scans) if z is not None]
    if any(table.shape[1] < 3 for table in tables):
        raise ValueError(f"{name}: fewer than three columns; the strength is in column 2")
    lam = np.sort(np.concatenate([[], *(table[:, 2] for table in tables)]))
    lam = lam[len(lam) // 10 : np.searchsorted(lam, np.inf)]
    if len(lam) < 2:
        return 0.0, 0.0, np.inf
    level = detection.to_db(max(np.median(lam - lam[0]), 1e-300) / math.log(2))
    return lam[0], float(level), 6.5 / math.sqrt(len(lam)) if len(lam) > 899 else np.inf
