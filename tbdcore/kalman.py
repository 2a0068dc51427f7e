"""Kalman filtering of range-azimuth plots.

A track is a mean ``x`` (4,) = [x, vx, y, vy] in m and m/s and its covariance ``P`` (4, 4); a plot
is ``z`` = [range in m, azimuth in rad], azimuth positive from +x towards +y, from a radar at the
origin.  One scan is

    x, P = predict(x, P, F, Q)                        time
    zhat, H = polar(x), polar_jacobian(x)             predicted plot, and its derivative
    D = H P H' + R                                    ``innovation_covariance``
    x, P = update(x, P, z - zhat, H, R)               after ``residual`` has wrapped the azimuth

and these five functions take one track or any stack of tracks on leading axes, as do the gates:
``gate_half_widths`` and ``gate_volume`` of a rectangle, ``mahalanobis`` of an ellipse.

``two_point``, ``predict_cv``, ``gate_polar`` and ``update_polar`` are the same step compiled: for
one track, in place, with the zeros of F and H left out.

``predict_tracks``, ``gate_tracks`` and ``update_mixture`` take several tracks through a scan whose
plots carry association weights.  Their plots are in metres, linear measurements of the position.

All functions raise ValueError for NaN and infinity, in arguments and results, for a negative
variance, for an innovation covariance that is not positive definite, and for a target at the radar,
where azimuth has no meaning; a track that is changed in place is then as before.

The covariance mixes metres, metres per second and ellipses a thousand times longer than wide:
``update`` uses Joseph's form, the compiled one symmetrises by construction.  Start a track from two
plots (``two_point``): after one the prediction may be kilometres off across the line of sight, and
an error e there makes the linearisation err in range by e**2 / 2 r.
"""

import functools
import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, ArrayLike, Number, Numbers, checked
from tbdcore.jit import kernel

__all__ = ["cartesian", "gate_half_widths", "gate_polar", "gate_tracks", "gate_volume"]
__all__ += ["innovation_covariance", "mahalanobis", "polar", "polar_jacobian", "polar_noise"]
__all__ += ["position_bound", "predict", "predict_cv", "predict_tracks", "residual", "two_point"]
__all__ += ["update", "update_mixture", "update_polar"]


class Covariance(Numbers):
    """Rule: covariance matrices on the last two axes, no variance negative."""

    def limit(self, name, a):
        super().limit(name, a)
        if not (a.diagonal(0, -2, -1) >= 0).all():
            raise ValueError(f"{name}: a variance is negative; correct it")


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


@kernel
def _finite_tracks(mean, cov):
    """The tracks; ValueError where one has a NaN or an infinity."""
    wrong = 0
    for part in (mean.ravel(), cov.ravel()):
        for value in part:
            wrong += not math.isfinite(value)
    if wrong > 0:
        raise ValueError("kalman: an argument or the result is NaN or infinite; is r = 0?")
    return mean, cov


def _in_place(compiled):
    """A kernel that changes a track in place, checked: one that it refuses stays as it was."""

    @functools.wraps(compiled.py_func)
    def step(x, P, *args):
        x[...], P[...] = _finite(step.__name__, *compiled(x.copy(), P.copy(), *args))
        return x, P

    return checked(step, inside=compiled)


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


def predict_tracks_spec(x, P, F, Q):
    """:func:`predict`, whose arguments may be stacks."""
    return predict(x, P, F, Q)


@checked
@kernel
def predict_tracks(
    x: Tracks,
    P: TrackCovariances,
    F: Annotated[ArrayLike, Numbers("T", 4, 4)],
    Q: Annotated[ArrayLike, Covariance(4, 4)],
) -> Track:
    """Means (T, 4), covariances (T, 4, 4) one scan later, F (T, 4, 4) by track, Q (4, 4) common."""
    T = len(x)
    mean, cov, FP = np.zeros((T, 4)), np.empty((T, 4, 4)), np.empty((4, 4))
    for t in range(T):
        for i in range(4):
            for j in range(4):
                mean[t, i] += F[t, i, j] * x[t, j]
                FP[i, j] = 0.0
                for l in range(4):
                    FP[i, j] += F[t, i, l] * P[t, l, j]
        for i in range(4):
            for j in range(4):
                cov[t, i, j] = Q[i, j]
                for l in range(4):
                    cov[t, i, j] += FP[i, l] * F[t, j, l]
    return _finite_tracks(mean, cov)


def gate_tracks_spec(x, P, var_r, var_a):
    """:func:`gate_tracks` by :func:`polar_noise`."""
    R = [polar_noise(z, np.diag([var_r, var_a])) for z in polar(x)]
    R = np.array(R).reshape(len(x), 2, 2)
    return x[:, ::2].copy(), R, P[:, ::2, ::2] + R


@checked
@kernel
def gate_tracks(
    x: Tracks, P: TrackCovariances, var_r: Positive, var_a: Positive
) -> tuple[Array, Array, Array]:
    """Predicted plots zhat (T, 2) in m, plot covariances R and D = H P H' + R (T, 2, 2).

    ``x`` (T, 4), ``P`` (T, 4, 4) predicted, ``var_r`` in m^2, ``var_a`` in rad^2.  R is that of a
    plot at the predicted position: at the plot's own, nearer plots would look more accurate.
    """
    T = x.shape[0]
    zhat, R, D = np.empty((T, 2)), np.empty((T, 2, 2)), np.empty((T, 2, 2))
    for t in range(T):
        zhat[t, 0], zhat[t, 1] = x[t, 0], x[t, 2]
        r2 = x[t, 0] * x[t, 0] + x[t, 2] * x[t, 2]
        R[t, 0, 0], xy, R[t, 1, 1] = _rotated(x[t, 0], x[t, 2], r2, var_r, r2 * var_a)
        R[t, 0, 1] = R[t, 1, 0] = xy
        for i in range(2):
            for j in range(2):
                D[t, i, j] = P[t, 2 * i, 2 * j] + R[t, i, j]
        if not (r2 > 0.0 and 0.0 < D[t, 0, 0] * D[t, 1, 1] - D[t, 0, 1] * D[t, 1, 0] < np.inf):
            raise ValueError("kalman.gate_tracks: a covariance D is not positive definite")
    return zhat, R, D


def update_mixture_spec(x, P, D, z, beta):
    """Every plot updates the track; then mean and covariance of the mixture with weights beta."""
    mean, cov = np.empty_like(x), np.empty_like(P)
    for t, (b, S) in enumerate(zip(beta, D, strict=True)):
        K = P[t][:, ::2] @ np.linalg.inv(S)
        xs = np.vstack([x[t], x[t] + (z - x[t, ::2]) @ K.T])
        mean[t] = b @ xs
        spread = np.einsum("m,mi,mj->ij", b, xs - mean[t], xs - mean[t])
        cov[t] = P[t] - (1 - b[0]) * K @ S @ K.T + spread
    return mean, cov


@checked
@kernel
def update_mixture(
    x: Tracks,
    P: TrackCovariances,
    D: Annotated[ArrayLike, Covariance("T", 2, 2)],
    z: Annotated[ArrayLike, Numbers("M", 2)],
    beta: Annotated[ArrayLike, Numbers("T", "M+1", low=0.0, high=1.0 + 1e-9)],
) -> Track:
    """Means (T, 4), covariances (T, 4, 4) after a scan whose plots carry association weights.

    ``x``, ``P`` predicted, ``D`` (T, 2, 2) as :func:`gate_tracks` gives it, ``z`` (M, 2) plots in
    m, ``beta`` (T, M + 1) weights that sum to 1, first that of no plot.  The mixture of the updates
    is replaced by its mean and covariance; all plots share one gain.
    """
    T, M, K = len(x), len(z), np.empty((4, 2))
    mean, cov = np.empty((T, 4)), np.empty((T, 4, 4))
    for t in range(T):
        det = D[t, 0, 0] * D[t, 1, 1] - D[t, 0, 1] * D[t, 1, 0]
        if not (det > 0.0 and D[t, 0, 0] > 0.0):
            raise ValueError("kalman.update_mixture: a covariance D is not positive definite")
        y0, y1, s00, s01, s11 = 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(M):
            b, e0, e1 = beta[t, m + 1], z[m, 0] - x[t, 0], z[m, 1] - x[t, 2]
            y0, y1 = y0 + b * e0, y1 + b * e1
            s00, s01, s11 = s00 + b * e0 * e0, s01 + b * e0 * e1, s11 + b * e1 * e1
        hit = 1.0 - beta[t, 0]
        if not abs(beta[t].sum() - 1.0) <= 1e-6:
            raise ValueError("kalman.update_mixture: the weights beta of a track do not sum to 1")
        s00 = s00 - y0 * y0 - hit * D[t, 0, 0]
        s01 = s01 - y0 * y1 - hit * D[t, 0, 1]
        s11 = s11 - y1 * y1 - hit * D[t, 1, 1]
        for i in range(4):
            K[i, 0] = (P[t, i, 0] * D[t, 1, 1] - P[t, i, 2] * D[t, 0, 1]) / det
            K[i, 1] = (P[t, i, 2] * D[t, 0, 0] - P[t, i, 0] * D[t, 0, 1]) / det
            mean[t, i] = x[t, i] + K[i, 0] * y0 + K[i, 1] * y1
        for i in range(4):
            g0, g1 = K[i, 0] * s00 + K[i, 1] * s01, K[i, 0] * s01 + K[i, 1] * s11
            for j in range(i, 4):
                cov[t, i, j] = cov[t, j, i] = P[t, i, j] + g0 * K[j, 0] + g1 * K[j, 1]
    return _finite_tracks(mean, cov)


@checked
def position_bound(
    F: Annotated[ArrayLike, Numbers("K-1", "T", 4, 4)],
    R: Annotated[ArrayLike, Covariance("K", "T", 2, 2)],
    P: TrackCovariances,
    p_detect: Annotated[float, Number(0.0, 1.0)],
) -> Array:
    """Posterior Cramer-Rao bound (K, T, 4, 4) of tracks seen with probability p_detect per scan.

    ``F`` (K - 1, T, 4, 4) transitions, ``R`` (K, T, 2, 2) plot covariances at the true positions,
    ``P`` (T, 4, 4) of the first state.  J_k = (F J_{k-1}^-1 F')^-1 + p_detect H' R_k^-1 H.
    """
    bounds = [P]
    try:
        for step, noise in zip(F, R[1:], strict=True):
            J = np.linalg.inv(step @ bounds[-1] @ np.swapaxes(step, -1, -2))
            J[..., ::2, ::2] += p_detect * np.linalg.inv(noise)
            bounds.append(np.linalg.inv(J))
    except np.linalg.LinAlgError:
        raise ValueError("kalman.position_bound: F, R or P is singular; give variances") from None
    return _finite("position_bound", np.array(bounds))[0]
