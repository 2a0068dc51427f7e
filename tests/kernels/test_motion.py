"""Motion against geometry, and against the matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from tbdcore import motion
from tbdcore.kernels import mm_pf_tbd

PI = np.array([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])


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


OMEGAS = np.array([[-0.4, -0.2], [0.2, 0.5]])


def move(S, before, u, a, omegas=OMEGAS, redraw=True, T=1.0):
    S = np.array(S, float)
    return mm_pf_tbd.transition(
        np.array(before), S, PI, T, np.array(u, float), np.array(a, float), omegas, redraw
    )


def test_regimes_reach_the_stationary_distribution():
    """(1/2, 1/4, 1/4) is the left eigenvector of PI; 4 standard errors of 40 000 independent
    chains.
    """
    rng = np.random.default_rng(5)
    r, S = np.zeros(40_000, np.int64), np.zeros((40_000, 5))
    for _ in range(60):
        before, (r, born, S) = (
            r,
            mm_pf_tbd.transition(
                r, S, PI, 1.0, rng.random(r.size), np.zeros((r.size, 2)), OMEGAS, True
            ),
        )
    share = np.bincount(r, minlength=3) / r.size
    assert (born == np.flatnonzero((before == 0) & (r > 0))).all()
    assert np.allclose(share, [0.5, 0.25, 0.25], rtol=0, atol=4 * 0.5 / 200)
    assert np.allclose(np.sort(np.linalg.eigvals(PI)), [0.7, 0.8, 1.0], rtol=1e-12)


def test_motion_has_the_covariance_of_a_white_acceleration():
    a = 0.3 * np.random.default_rng(6).standard_normal((50_000, 2))
    _, _, S = move(np.zeros((50_000, 5)), [1] * 50_000, [0.5] * 50_000, a, T=2.0)
    G = np.array([2.0, 2.0])  # T**2 / 2 and T
    assert np.allclose(
        np.cov(S[:, 0], S[:, 1]), 0.09 * np.outer(G, G), rtol=4 * np.sqrt(2 / 50_000)
    )
    assert abs(np.corrcoef(S[:, 0], S[:, 2])[0, 1]) < 4 / np.sqrt(50_000)


def test_absent_and_born_particles_are_left_alone():
    S = np.arange(15.0).reshape(3, 5)
    r, born, out = move(S, [2, 0, 1], [0.05, 0.97, 0.5], np.ones((3, 2)))
    assert r.tolist() == [0, 2, 1]
    assert born.tolist() == [1]
    assert (out[:2] == S[:2]).all()
    assert out[2].tolist() == [10 + 11 + 0.5, 12.0, 12 + 13 + 0.5, 14.0, 14.0]


def test_without_a_redraw_the_born_go_on_from_their_state():
    r, born, out = move([[0.0, 1.0, 0.0, 2.0, 0.3]], [0], [0.92], np.zeros((1, 2)), redraw=False)
    assert (r.tolist(), born.size) == ([1], 0)
    assert out[0].tolist() == [1.0, 1.0, 2.0, 2.0, 0.3]


def test_a_turn_rate_is_redrawn_only_when_a_turn_begins():
    S = np.array([[0.0, 1.0, 0.0, 0.0, 0.7]] * 4)
    _, _, out = move(
        S, [1, 1, 2, 2], [0.92, 0.98, 0.95, 0.15], np.zeros((4, 2))
    )  # a fifth and four fifths into "turn"
    assert out[:, 4] == pytest.approx([-0.3, 0.4, 0.7, 0.7], abs=1e-12)
    for row, omega in zip(out, (-0.3, 0.4, 0.7, 0.0), strict=True):
        assert np.allclose(row[:4], motion.coordinated_turn(omega, 1.0) @ S[0, :4], rtol=1e-13)


def test_redrawn_turn_rates_are_uniform_on_their_intervals():
    """The share of left turns is that of the left interval; means of the branches; 4 standard
    errors of 100 000 draws.
    """
    n = 100_000
    r, _, S = move(
        np.zeros((n, 5)), np.ones(n, int), np.random.default_rng(7).random(n), np.zeros((n, 2))
    )
    w = S[r == 2, 4]
    assert np.mean(w < 0) == pytest.approx(0.4, abs=4 * 0.5 / np.sqrt(w.size))
    assert [w[w < 0].mean(), w[w > 0].mean()] == pytest.approx(
        [-0.3, 0.35], abs=4 * 0.087 / np.sqrt(0.4 * w.size)
    )
    assert not ((w > -0.2) & (w < 0.2)).any()


@pytest.mark.parametrize(
    "Pi",
    [[[0.9, 0.2], [0.5, 0.5]], [[1.1, -0.1], [0.5, 0.5]], [[1.0, 0.0]], np.empty((0, 0))],
)
def test_bad_transitions_are_refused_in_one_line(Pi):
    with pytest.raises(ValueError, match="check_transitions: Pi") as error:
        mm_pf_tbd.check_transitions(Pi)
    assert "\n" not in str(error.value)
