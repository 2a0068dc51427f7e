"""Kalman filtering of range-azimuth plots.

A track is a mean ``x`` (4,) = [x, vx, y, vy] in m and m/s and its covariance ``P`` (4, 4); a plot
is ``z`` = [range in m, azimuth in rad], azimuth positive from +x towards +y, from a radar at the
origin.  One scan is

    x, P = predict(x, P, F, Q)                        time
    zhat, H = polar(x), polar_jacobian(x)             predicted plot, and its derivative
    D = H P H' + R                                    ``innovation_covariance``
    x, P = update(x, P, z - zhat, H, R)               after ``residual`` has wrapped the azimuth

and these five functions take one track or any stack of tracks on leading axes, as do the gates:
``gate_half_widths`` and ``gate_volume`` of a rectangle, ``mahalanobis`` of an ellipse.  A stack of
n states takes one matrix of each kind, or n.

``two_point`` starts a track from two plots.

All functions raise ValueError for NaN and infinity, in arguments and results, for a negative
variance, for a covariance that is not symmetric or has a negative eigenvalue, for an innovation
covariance that is not positive definite, and for a target at the radar, where azimuth has no
meaning.

The covariance mixes metres, metres per second and ellipses a thousand times longer than wide:
``update`` uses Joseph's form.  Start a track from two
plots (``two_point``): after one the prediction may be kilometres off across the line of sight, and
an error e there makes the linearisation err in range by e**2 / 2 r.
"""

import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, ArrayLike, Covariance, Number, Numbers, checked
from tbdcore.jit import kernel

__all__ = [
    "cartesian",
    "gate_half_widths",
    "gate_volume",
    "innovation_covariance",
    "mahalanobis",
    "polar",
    "polar_jacobian",
    "polar_noise",
    "predict",
    "residual",
    "two_point",
    "update",
]


States = Annotated[ArrayLike, Numbers(..., 4)]
Covariances = Annotated[ArrayLike, Covariance(..., 4, 4)]
Matrices = Annotated[ArrayLike, Numbers(..., 4, 4)]
Plots = Annotated[ArrayLike, Numbers(..., 2)]
Residuals = Annotated[ArrayLike, Numbers(..., "n")]
Derivatives = Annotated[ArrayLike, Numbers(..., "n", 4)]
Errors = Annotated[ArrayLike, Covariance(..., "n", "n")]
Pair = Annotated[ArrayLike, Numbers(2)]
Variances = Annotated[ArrayLike, Numbers(2, low=0.0)]
State = Annotated[Array, Numbers(4, in_place=True)]  # of one track, which is changed
Spread = Annotated[Array, Covariance(4, 4, in_place=True)]
Real = Annotated[float, Number()]
Positive = Annotated[float, Number(0.0)]
Duration = Annotated[float, Number(np.finfo(float).tiny)]
Tracks = Annotated[ArrayLike, Numbers("T", 4)]
TrackCovariances = Annotated[ArrayLike, Covariance("T", 4, 4)]
Track = tuple[Array, Array]


def _finite(where, *results):
    """The results; ValueError where one has a NaN or an infinity."""
    if not all(np.isfinite(a).all() for a in results):
        raise ValueError(f"kalman.{where}: the result is NaN or infinite; is a target at r = 0?")
    return results


def _positive(where, D):
    """The stack of matrices; ValueError unless they are finite and positive definite."""
    _finite(where, D)
    try:
        np.linalg.cholesky(0.5 * D + 0.5 * np.swapaxes(D, -1, -2))
    except np.linalg.LinAlgError:
        words = "the innovation covariance is not positive definite; give positive plot variances"
        raise ValueError(f"kalman.{where}: {words}") from None
    return D


@checked
def predict(x: States, P: Covariances, F: Matrices, Q: Covariances) -> Track:
    """Mean (..., 4) and covariance (..., 4, 4) one scan later."""
    with np.errstate(over="ignore", invalid="ignore"):
        mean, cov = (F @ x[..., None])[..., 0], F @ P @ np.swapaxes(F, -1, -2) + Q
    return _finite("predict", mean, cov)


@checked
def polar(x: States) -> Array:
    """Range (m) and azimuth (rad) of states (..., 4), shape (..., 2)."""
    return np.stack([np.hypot(x[..., 0], x[..., 2]), np.arctan2(x[..., 2], x[..., 0])], axis=-1)


@checked
def polar_jacobian(x: States) -> Array:
    """Derivative of :func:`polar` with respect to the state, shape (..., 2, 4)."""
    r = np.hypot(x[..., 0], x[..., 2])
    if not (r > 1e-9).all():
        raise ValueError("kalman.polar_jacobian: a target at the radar has no azimuth; move it")
    c, s = x[..., 0] / r, x[..., 2] / r
    H = np.zeros((*x.shape[:-1], 2, 4))
    H[..., 0, 0], H[..., 0, 2], H[..., 1, 0], H[..., 1, 2] = c, s, -s / r, c / r
    return H


@checked
def cartesian(z: Plots) -> Array:
    """Position (..., 2) in m of plots (..., 2) in range and azimuth."""
    return z[..., :1] * np.stack([np.cos(z[..., 1]), np.sin(z[..., 1])], axis=-1)


@checked
def residual(z: Plots, zhat: Plots) -> Array:
    """z - zhat (..., 2) with the azimuth wrapped to [-pi, pi)."""
    with np.errstate(over="ignore"):
        (y,) = _finite("residual", z - zhat)
    y[..., 1] = (y[..., 1] + np.pi) % (2 * np.pi) - np.pi
    return y


@checked
def innovation_covariance(P: Covariances, H: Derivatives, R: Errors) -> Array:
    """H P H' + R, shape (..., n, n)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return _finite("innovation_covariance", H @ P @ np.swapaxes(H, -1, -2) + R)[0]


@checked
def update(x: States, P: Covariances, y: Residuals, H: Derivatives, R: Errors) -> Track:
    """Mean and covariance after a residual y (..., n), in Joseph's form."""
    with np.errstate(over="ignore", invalid="ignore"):
        D = _positive("update", H @ P @ np.swapaxes(H, -1, -2) + R)
        K = np.swapaxes(np.linalg.solve(D, H @ P), -1, -2)
        A = np.eye(x.shape[-1]) - K @ H
        mean = x + (K @ y[..., None])[..., 0]
        cov = A @ P @ np.swapaxes(A, -1, -2) + K @ R @ np.swapaxes(K, -1, -2)
    return _finite("update", mean, cov)


@checked
def mahalanobis(y: Residuals, D: Errors) -> Array:
    """Squared distance y' D**-1 y of residuals (..., n)."""
    _positive("mahalanobis", D)
    with np.errstate(over="ignore"):
        return np.sum(y * np.linalg.solve(D, y[..., None])[..., 0], axis=-1)


@checked
def gate_half_widths(g: Duration, D: Errors) -> Array:
    """Half widths g sqrt(D_jj) of the rectangular gate, shape (..., n)."""
    return g * np.sqrt(np.diagonal(D, axis1=-2, axis2=-1))


@checked
def gate_volume(g: Duration, D: Errors) -> Array:
    """Size of the rectangular gate, prod_j 2 g sqrt(D_jj)."""
    with np.errstate(over="ignore"):
        return _finite("gate_volume", np.prod(2 * gate_half_widths(g, D), axis=-1))[0]


@checked
def polar_noise(z: Pair, R: Annotated[ArrayLike, Covariance(2, 2)]) -> Array:
    """First-order covariance (2, 2) in m^2 of a plot z = (range, azimuth) with that of errors R."""
    c, s = math.cos(z[1]), math.sin(z[1])
    J = np.array([[c, -z[0] * s], [s, z[0] * c]])
    return J @ R @ J.T


@kernel
def _rotated(u, v, n, along, across):
    """(xx, xy, yy) of a covariance with variances along (u, v) and across it; n = u**2 + v**2."""
    xx, yy = along * u * u + across * v * v, along * v * v + across * u * u
    return xx / n, (along - across) * u * v / n, yy / n


def two_point_spec(z1, z2, var1, var2, T):
    """:func:`two_point` with matrices: both plots to Cartesian coordinates, then a difference."""
    p1, p2 = cartesian(z1), cartesian(z2)
    C1, C2 = polar_noise(z1, np.diag(var1)), polar_noise(z2, np.diag(var2))
    A = np.kron(np.eye(2), [[0.0, 1.0], [-1 / T, 1 / T]])  # [p1, p2] -> [position, velocity]
    both = np.zeros((4, 4))
    both[0::2, 0::2], both[1::2, 1::2] = C1, C2
    return A @ np.array([p1[0], p2[0], p1[1], p2[1]]), A @ both @ A.T


@checked
@kernel
def two_point(z1: Pair, z2: Pair, var1: Variances, var2: Variances, T: Duration) -> Track:
    """Track (x (4,), P (4, 4)) at the time of the second of two plots, T > 0 seconds apart.

    The position is that of the second plot, the velocity the difference over T.  Plots z1, z2 and
    variances var1, var2 are pairs (range in m, azimuth in rad; m^2, rad^2).
    """
    x, P = np.empty(4), np.empty((4, 4))
    c1, s1 = math.cos(z1[1]), math.sin(z1[1])
    c2, s2 = math.cos(z2[1]), math.sin(z2[1])
    x[0], x[2] = z2[0] * c2, z2[0] * s2
    x[1], x[3] = (x[0] - z1[0] * c1) / T, (x[2] - z1[0] * s1) / T
    first = _rotated(c1, s1, 1.0, var1[0], z1[0] * z1[0] * var1[1])
    last = _rotated(c2, s2, 1.0, var2[0], z2[0] * z2[0] * var2[1])
    for n, i, j in ((0, 0, 0), (1, 0, 2), (1, 2, 0), (2, 2, 2)):
        P[i, j], P[i + 1, j], P[i, j + 1] = last[n], last[n] / T, last[n] / T
        P[i + 1, j + 1] = (first[n] + last[n]) / T**2
    if not math.isfinite(x[1] + x[3] + P[1, 1] + P[3, 3]):
        raise ValueError("kalman.two_point: the track is not finite; is T too short?")
    return x, P
