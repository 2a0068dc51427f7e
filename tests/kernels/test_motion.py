"""Motion against geometry, and against the matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from tbdcore import motion


@pytest.mark.parametrize("omega", [0.3, -0.2, 1e-3, 1e-8, 0.0, 3.0, -7.0])
@pytest.mark.parametrize("T", [1.0, 0.25])
def test_turn_is_the_exponential_of_its_differential_equation(omega, T):
    """x' = vx, vx' = -omega vy, y' = vy, vy' = omega vx."""
    A = np.array([[0, 1, 0, 0], [0, 0, 0, -omega], [0, 0, 0, 1], [0, omega, 0, 0]], float)
    assert np.allclose(motion.coordinated_turn(omega, T), expm(A * T), rtol=1e-12, atol=1e-14)


def test_noise_of_a_white_acceleration_is_the_integral_of_its_differential_equation():
    """Van Loan (1978): one matrix exponential holds the transition and the covariance."""
    A, L, T, q = np.zeros((4, 4)), np.zeros((4, 4)), 2.5, 0.7
    A[0, 1] = A[2, 3] = 1.0
    L[1, 1] = L[3, 3] = q
    M = expm(np.block([[-A, L], [np.zeros((4, 4)), A.T]]) * T)
    F = M[4:, 4:].T
    assert np.allclose(motion.cv(T), F, rtol=1e-13, atol=0)
    assert np.allclose(motion.white_acceleration(T, q), F @ M[:4, 4:], rtol=1e-13, atol=1e-15)


def test_noise_of_a_constant_acceleration_is_its_displacement_squared():
    """An acceleration of 1 during 2 s moves by 2 and adds 2 to the velocity."""
    G = np.array([[2.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 2.0]])
    assert np.allclose(motion.step_acceleration(2.0, 3.0), 9.0 * G @ G.T, rtol=1e-15)


def test_straight_line_is_the_exact_limit():
    F = np.array([[1, 2.0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2.0], [0, 0, 0, 1]])
    assert (motion.coordinated_turn(0.0, 2.0) == F).all()
    assert np.allclose(motion.coordinated_turn(1e-12, 2.0), F, rtol=0, atol=5e-12)


def test_turn_keeps_the_speed_and_closes_the_circle():
    s = np.array([3.0, 0.6, -1.0, 0.2])
    F = motion.coordinated_turn(2 * np.pi / 16, 1.0)
    t = np.linalg.matrix_power(F, 5) @ s
    assert np.hypot(t[1], t[3]) == pytest.approx(np.hypot(s[1], s[3]), rel=1e-13)
    assert np.allclose(np.linalg.matrix_power(F, 16) @ s, s, rtol=0, atol=1e-13)
