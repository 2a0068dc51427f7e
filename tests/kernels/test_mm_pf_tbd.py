"""Regimes, motion and births against geometry and probability; the blob's likelihood ratio."""

import math

import numpy as np
import pytest

import tbdcore
from tbdcore import motion
from tbdcore.kernels import mm_pf_tbd

PI = np.array([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])
PEAK, BLUR, NOISE = mm_pf_tbd.blob_peak(18.0, 0.6), 0.6, 2.3


def blob_states(*positions):
    S = np.zeros((len(positions), 5))
    S[:, [0, 2]] = positions
    return S


def blob_ratio(z, *positions, peak=PEAK, noise=NOISE):
    return mm_pf_tbd.blob_log_ratio(
        z, blob_states(*positions), np.ones(len(positions), np.int64), peak, BLUR, noise
    )


@pytest.mark.parametrize("blur", [0.5, 0.0379, 0.0377, 0.03, 0.02, 1e-4, 1e-9])
def test_a_sharp_blob_has_a_finite_ratio(blur):
    """At the centre of a cell all of a sharp blob is in this cell; at a corner, in four."""
    z = np.random.default_rng(3).normal(0, NOISE, (9, 9))
    S = blob_states((4, 5), (4.5, 5.5), (4.3, 5.2), (8.9, 0.6))
    ours = mm_pf_tbd.blob_log_ratio(z, S, np.ones(4, np.int64), 8.0, blur, NOISE)
    theirs = tbdcore.page("mm_pf_tbd").log_ratios(z, S, np.ones(4, int), 8.0, blur, NOISE)
    np.testing.assert_allclose(ours, theirs, rtol=1e-10, atol=1e-30)


@pytest.mark.parametrize(
    ("position", "d2"), [((15, 10), 15.13), ((15.5, 10), 13.49), ((15.5, 10.5), 12.03)]
)
def test_blob_energy_depends_on_where_in_the_cell_it_falls(position, d2):
    """Sum of h**2 / sigma**2, by hand on 5 x 5 cells; the integral I**2 / (4 pi b**2 sigma**2) =
    13.54 lies between.
    """
    h = mm_pf_tbd.blob_image(*position, PEAK, BLUR, (30, 20))
    x, y = position
    hand = sum(
        (PEAK * math.exp(-((i - x) ** 2 + (j - y) ** 2) / (2 * BLUR**2)) / NOISE) ** 2
        for i in range(10, 21)
        for j in range(5, 16)
    )
    assert (h**2).sum() / NOISE**2 == pytest.approx(hand, rel=1e-12)
    assert hand == pytest.approx(d2, abs=0.005)
    assert 18.0**2 / (4 * math.pi * BLUR**2 * NOISE**2) == pytest.approx(13.54, abs=0.005)


def test_blob_log_ratio_without_noise_is_half_the_energy():
    """z = h gives + d**2 / 2, z = 0 gives - d**2 / 2."""
    h = mm_pf_tbd.blob_image(15.2, 9.7, PEAK, BLUR, (30, 20))
    d2 = (h**2).sum() / NOISE**2
    assert blob_ratio(h, (15.2, 9.7))[0] == pytest.approx(d2 / 2, rel=1e-7)
    assert blob_ratio(0 * h, (15.2, 9.7))[0] == pytest.approx(-d2 / 2, rel=1e-7)


def test_blob_mean_log_ratio_under_target():
    rng = np.random.default_rng(8)
    h = mm_pf_tbd.blob_image(7.9, 3.3, PEAK, BLUR, (12, 8))
    d2 = (h**2).sum() / NOISE**2
    values = [blob_ratio(h + rng.normal(0, NOISE, h.shape), (7.9, 3.3))[0] for _ in range(4000)]
    assert np.mean(values) == pytest.approx(d2 / 2, abs=4 * math.sqrt(d2 / 4000))
    assert np.var(values) == pytest.approx(d2, rel=4 * math.sqrt(2 / 4000))


def test_blob_mean_ratio_under_noise_is_one():
    """A likelihood ratio is a density ratio: its mean under noise is 1; at low energy, where the
    mean can be sampled.
    """
    rng = np.random.default_rng(9)
    weak = PEAK / 4  # d**2 about 0.9, so the ratio has a variance of exp(0.9) - 1
    z = rng.normal(0, NOISE, (40_000, 5, 5))
    values = np.array([blob_ratio(frame, (3.2, 2.9), peak=weak)[0] for frame in z])
    d2 = (
        weak**2
        / PEAK**2
        * (mm_pf_tbd.blob_image(3.2, 2.9, PEAK, BLUR, (5, 5)) ** 2).sum()
        / NOISE**2
    )
    assert np.exp(values).mean() == pytest.approx(1.0, abs=4 * math.sqrt(math.expm1(d2) / 40_000))


@pytest.mark.parametrize(
    ("position", "bound"), [((15, 10), 0.393), ((15.4999, 10), 0.352), ((15.4999, 10.4999), 0.289)]
)
def test_blob_curvature_is_the_cramer_rao_bound_of_one_frame(position, bound):
    """Second difference of the mean log-ratio against sum (dh/dx)**2 / sigma**2, in both axes."""
    h = mm_pf_tbd.blob_image(*position, PEAK, BLUR, (30, 20))
    i, j = np.mgrid[1:31, 1:21]
    fisher = [
        (((cell - centre) / BLUR**2 * h / NOISE) ** 2).sum()
        for cell, centre in zip((i, j), position, strict=True)
    ]
    assert math.sqrt(1 / fisher[0] + 1 / fisher[1]) == pytest.approx(bound, abs=0.001)
    e = 1e-4
    x, y = position
    left, middle, right = blob_ratio(h, (x - 2 * e, y), (x - e, y), (x, y))
    assert -(left - 2 * middle + right) / e**2 == pytest.approx(
        fisher[0], rel=0.01
    )  # five columns of a blob between two cells


def test_blob_ratio_is_invariant_under_scale_and_whole_cell_shifts():
    rng = np.random.default_rng(10)
    z = rng.normal(0, NOISE, (30, 20))
    usual = blob_ratio(z, (12.25, 8.5))
    assert blob_ratio(4 * z, (12.25, 8.5), peak=4 * PEAK, noise=4 * NOISE) == pytest.approx(
        usual, rel=1e-12
    )
    assert blob_ratio(np.roll(z, (3, -2), (0, 1)), (15.25, 6.5)) == pytest.approx(usual, rel=1e-12)
    assert blob_ratio(z.T.copy(), (8.5, 12.25)) == pytest.approx(usual, rel=1e-12)


def test_a_blob_outside_the_frame_lights_the_cells_that_its_patch_has_in_it():
    """Those of a larger frame in which all other cells are cut away; beyond 2.5 cells, none."""
    z = np.random.default_rng(11).normal(size=(30, 20))
    for x, y in ((0.49, 5), (-1.2, 5), (30.6, 5), (32.4, 7.3), (5, 20.5), (31, 21.9), (0.1, -1)):
        i, j = np.mgrid[1:31, 1:21]
        h = PEAK * np.exp(-((i - x) ** 2 + (j - y) ** 2) / (2 * BLUR**2))
        h *= (abs(i - math.floor(x + 0.5)) <= 2) & (abs(j - math.floor(y + 0.5)) <= 2)
        brute = (h * (2 * z - h)).sum() / (2 * NOISE**2)
        assert blob_ratio(z, (x, y))[0] == pytest.approx(brute, rel=1e-9)
    far = blob_ratio(z, (-1.6, 5), (32.6, 5), (5, 22.6), (5, -1.6), (5, 25), (1e9, 5), (5, -1e300))
    assert (far == 0).all()


def test_blob_image_of_many_positions_and_of_none():
    many = mm_pf_tbd.blob_image(np.array([3.0, np.nan]), np.array([4.0, np.nan]), 2.0, BLUR, (6, 7))
    assert many.shape == (2, 6, 7)
    assert many[0, 2, 3] == 2.0
    assert (many[1] == 0).all()


def test_zero_signal_has_ratio_one():
    z = np.random.default_rng(12).normal(size=(6, 6))
    assert (blob_ratio(z, (3, 3), peak=0.0) == 0).all()


TURNS = np.array([[-0.4, 0.2], [0.2, 0.3]])


def move(S, before, u, a, turns=TURNS, redraw=True, T=1.0):
    S = np.array(S, float)
    return mm_pf_tbd.transition(
        np.array(before), S, PI, T, np.array(u, float), np.array(a, float), turns, redraw
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
                r, S, PI, 1.0, rng.random(r.size), np.zeros((r.size, 2)), TURNS, True
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


@pytest.mark.parametrize("regime", [3, -1])
def test_a_regime_out_of_range_is_refused(regime):
    r, S = np.array([regime, 1]), np.ones((2, 5))
    for W in ([1.0, 0.0], [0.0, 1.0]):  # whether it is kept or not
        with pytest.raises(ValueError, match=r"resample: r\[0\]: -?\d is not in \[0, 2\]"):
            mm_pf_tbd.resample(r, S, np.array(W), 3, 0.5)
    with pytest.raises(ValueError, match=r"blob_log_ratio: r\[0\]: -?\d is not in \[0, 2\]"):
        mm_pf_tbd.blob_log_ratio(np.zeros((4, 4)), S, r, 1.0, 0.6, 1.0)


@pytest.mark.parametrize("W", [[1.0, -0.5], [np.nan, 1.0], [0.0, 0.0], []])
def test_weights_that_are_none_are_refused(W):
    r, S = np.ones(len(W), int), np.ones((len(W), 5))
    with pytest.raises(ValueError, match="systematic: W has a negative weight or NaN"):
        mm_pf_tbd.resample(r, S, np.array(W), 3, 0.5)


def test_an_offset_of_one_is_refused():
    r, S, W = np.ones(2, int), np.ones((2, 5)), np.ones(2)
    with pytest.raises(ValueError, match="resample: u: 1.0 is no number in"):
        mm_pf_tbd.resample(r, S, W, 3, 1.0)
    assert mm_pf_tbd.resample(r, S, W, 0, 0.5).ancestors.shape == (0,)


@pytest.mark.parametrize(
    "Pi",
    [[[0.9, 0.2], [0.5, 0.5]], [[1.1, -0.1], [0.5, 0.5]], [[1.0, 0.0]], np.empty((0, 0))],
)
def test_bad_transitions_are_refused_in_one_line(Pi):
    with pytest.raises(ValueError, match="check_transitions: Pi") as error:
        mm_pf_tbd.check_transitions(Pi)
    assert "\n" not in str(error.value)
