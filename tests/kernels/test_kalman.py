"""Oracles for the Kalman steps: least squares over a whole track, high-order differences, sampled
plots, closed forms of gates.
"""

import numpy as np
import pytest
from scipy import stats

from tbdcore import kalman, motion
from tbdcore.kernels import track_cfar

T, Q = 10.0, 0.01


def stacked_least_squares(plots, C, q):
    """Mean and covariance of the last state given all position plots (n, 2), each with covariance
    C: one dense solve, no recursion.

    Unknowns are the states of all times; the equations are the plots and x_k - F x_{k-1} = v.
    """
    n, F = len(plots), motion.cv(T)
    W, V = np.linalg.inv(C), np.linalg.inv(motion.white_acceleration(T, q))
    H = np.eye(4)[::2]
    A, b = np.zeros((4 * n, 4 * n)), np.zeros(4 * n)
    for k, plot in enumerate(plots):
        at = slice(4 * k, 4 * k + 4)
        A[at, at] += H.T @ W @ H
        b[at] += H.T @ W @ plot
        if k:
            step = np.hstack([-F, np.eye(4)])
            both = slice(4 * k - 4, 4 * k + 4)
            A[both, both] += step.T @ V @ step
    P = np.linalg.inv(A)
    return (P @ b)[-4:], P[-4:, -4:]


def test_filter_equals_least_squares_over_the_whole_track():
    rng = np.random.default_rng(3)
    C = np.array([[90.0, 20.0], [20.0, 60.0]])
    plots = np.cumsum(rng.normal([4000, 3000], 30, (7, 2)), axis=0)
    x, P = np.zeros(4), np.diag([1e9, 1e7, 1e9, 1e7])  # a prior that says nothing
    H = np.eye(4)[::2]
    for k, plot in enumerate(plots):
        if k:
            x, P = kalman.predict(x, P, motion.cv(T), motion.white_acceleration(T, Q))
        x, P = kalman.update(x, P, plot - H @ x, H, C)
    x_ref, P_ref = stacked_least_squares(plots, C, Q)
    np.testing.assert_allclose(x, x_ref, rtol=1e-5)  # the prior weighs 1e-7 of a plot
    np.testing.assert_allclose(P, P_ref, rtol=1e-4, atol=1e-6)


def test_extended_filter_equals_least_squares_in_its_linear_limit():
    """Far away and precise, range and azimuth are linear: the compiled steps must find the
    least-squares track.
    """
    rng, r, q = np.random.default_rng(4), 3e7, 1e-6
    truth = r + 500 * T * np.arange(8)
    z = np.stack([truth + rng.normal(0, 5, 8), rng.normal(0, 10 / truth)], axis=1)
    var = (25.0, (10 / r) ** 2)
    x, P = kalman.two_point(z[0], z[1], var, var, T)
    for plot in z[2:]:
        track_cfar.predict_cv(x, P, T, q)
        rhat, ahat, *_ = track_cfar.gate_polar(x, P, *var)
        track_cfar.update_polar(x, P, plot[0] - rhat, plot[1] - ahat, *var)
    x_ref, P_ref = stacked_least_squares(kalman.cartesian(z), np.diag([25.0, 100.0]), q)
    # what is left: two_point knows no process noise between its plots, and 10 m across 30000 km is
    # not quite straight
    assert (np.abs(x - x_ref) < 0.1 * np.sqrt(np.diag(P_ref))).all()
    np.testing.assert_allclose(np.sqrt(np.diag(P)), np.sqrt(np.diag(P_ref)), rtol=0.01)


@pytest.mark.parametrize(
    "x", [[7e4, 350.0, 7.1e4, 355.0], [-2e5, -1.0, 3.0, 500.0], [0.0, 1.0, -1e5, 2.0]]
)
def test_jacobian_against_fourth_order_differences(x):
    x, h = np.array(x), 1.0
    columns = []
    for e in np.eye(4):
        f = [kalman.residual(kalman.polar(x + c * h * e), kalman.polar(x)) for c in (-2, -1, 1, 2)]
        columns.append((f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * h))
    np.testing.assert_allclose(
        np.transpose(columns), kalman.polar_jacobian(x), atol=1e-10
    )  # rounding of 1e5 over 1 m


def test_noise_of_a_plot_in_metres_against_samples():
    rng, z, R = np.random.default_rng(5), np.array([1e5, 0.7]), np.diag([25.0, 1e-7])
    samples = kalman.cartesian(z + rng.standard_normal((400_000, 2)) * np.sqrt(np.diag(R)))
    np.testing.assert_allclose(
        np.cov(samples.T), kalman.polar_noise(z, R), rtol=0.01, atol=10
    )  # 4 standard errors of a covariance


def test_residual_wraps_the_azimuth():
    y = kalman.residual([[1.0, np.pi - 0.1]], [[0.0, -np.pi + 0.1]])
    np.testing.assert_allclose(y, [[1.0, -0.2]])


def test_gate_probability_of_the_noisy_plot():
    """A plot is inside the rectangle of g standard deviations with probability Pr(chi2_1 <= g^2)^2,
    correlation zero.
    """
    rng, g = np.random.default_rng(6), 2.0
    D = np.diag([9.0, 4e-6])
    y = rng.standard_normal((200_000, 2)) * np.sqrt(np.diag(D))
    inside = (np.abs(y) <= kalman.gate_half_widths(g, D)).all(axis=1).mean()
    p = stats.chi2.cdf(g * g, 1) ** 2
    assert abs(inside - p) < 4 * np.sqrt(p * (1 - p) / 200_000)


def test_gate_volumes():
    D = np.array([[4.0, 1.0], [1.0, 9.0]])
    assert np.isclose(kalman.gate_volume(2.0, D), (2 * 2 * 2) * (2 * 2 * 3))
    rng = np.random.default_rng(7)
    points = rng.uniform(-10, 10, (400_000, 2))
    area = 400 * (kalman.mahalanobis(points, np.broadcast_to(D, (400_000, 2, 2))) <= 4.0).mean()
    ellipse = 4.0 * np.pi * np.sqrt(np.linalg.det(D))
    assert np.isclose(ellipse, area, rtol=0.02)  # 4 standard errors of the count


def test_converged_filter_sees_only_the_plot_noise():
    """No process noise and many plots: the track's own variance vanishes and D tends to R."""
    x, P = kalman.two_point(
        np.array([1e5, 0.3]), np.array([1.05e5, 0.3]), (9.0, 1e-7), (9.0, 1e-7), T
    )
    for _ in range(3000):
        track_cfar.predict_cv(x, P, T, 0.0)
        _, _, D11, _, D22 = track_cfar.gate_polar(x, P, 9.0, 1e-7)
        track_cfar.update_polar(x, P, 0.0, 0.0, 9.0, 1e-7)
    assert 9.0 < D11 < 9.0 * 1.01
    assert 1e-7 < D22 < 1.01e-7


def test_azimuth_is_immaterial():
    """The same flight at two azimuths has the same gate in range and azimuth."""
    sizes = []
    for a in (0.0, 2.3):
        x, P = kalman.two_point(
            np.array([1e5, a]), np.array([1.05e5, a]), (9.0, 1e-7), (9.5, 1e-7), T
        )
        track_cfar.predict_cv(x, P, T, Q)
        _, _, D11, _, D22 = track_cfar.gate_polar(x, P, 9.0, 1e-7)
        sizes.append((D11, D22))
    np.testing.assert_allclose(sizes[0], sizes[1], rtol=1e-9)
