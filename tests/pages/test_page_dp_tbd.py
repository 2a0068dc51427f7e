"""The algorithm of the dp_tbd notebook on your own frames: certain cases, closed forms, and what it
refuses.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from tbdcore import dynprog, motion, sensor
from tbdcore.repro import pages


@pytest.fixture(scope="module")
def page():
    return tbdcore.page("dp_tbd")


@pytest.fixture(scope="module")
def p(page):
    return page.Params()


def test_a_strong_straight_target_is_followed_by_all_three(page, p):
    cells = page.truth(0.0, np.array([351_550.0, 350_350.0, 170.0, 190.0]), p, None)[1]
    z = sensor.point_frames(np.random.default_rng(0).normal(size=(p.K, *p.grid)), cells, 12.0)
    for track in page.run(z, p):
        np.testing.assert_array_equal(track.cells, cells)
    assert page.run(z, p).tonissen.value == pytest.approx(
        z[np.arange(p.K), *cells.T].sum(), rel=1e-12
    )


def test_a_strong_turning_target_is_lost_by_tonissen_alone(page, p):
    cells = page.truth(0.4, np.array([351_550.0, 350_350.0, 170.0, 190.0]), p, None)[1]
    z = sensor.point_frames(np.zeros((p.K, *p.grid)), cells, 12.0)
    tracks = page.run(z, p)
    far = [np.abs(track.cells - cells).max() for track in tracks]
    assert far[0] == far[2] == 0
    assert far[1] > 2


def test_tonissen_has_no_path_near_a_strong_turn_by_propagating_sets(p, page):
    """The theorem of section 6 without the core: plain sets of states, for many starts."""
    rng, speeds = np.random.default_rng(4), range(1 - p.M, p.M + 1)
    for _ in range(40):
        cells = page.truth(0.4, page.start(p, rng), p, rng)[1]
        for axis in (1,):
            near = {(v, y) for v in speeds for y in range(cells[0, axis] - 2, cells[0, axis] + 3)}
            for k in range(1, p.K):
                steps = {(v, y + v - m) for v, y in near for m in (0, 1)}
                near = {(v, y) for v, y in steps if abs(y - cells[k, axis]) <= 2}
            assert not near


def test_targets_stay_in_the_region_for_every_turn_rate_and_noise_that_may_be_given(page, p):
    known, rng = pages.parameters("dp_tbd"), np.random.default_rng(6)
    corners = itertools.product(
        *((1e3 * lo, 1e3 * hi - 1e-3) for lo, hi in (p.x0, p.y0)), p.v0, p.v0
    )
    for omega, x1 in itertools.product(
        np.linspace(known["turn_rates"].low, known["turn_rates"].high, 12), map(np.array, corners)
    ):
        cells = page.truth(omega, x1, p, None)[1]
        assert cells.min() >= 0
        assert cells.max() < 50
        sensor.point_frames(np.zeros((p.K, *p.grid), np.float32), cells, 1.0)
    noisy = replace(p, process_noise=known["process_noise"].high)
    cells = np.array(
        [
            page.truth(omega, page.start(p, rng), noisy, rng)[1]
            for omega in p.turn_rates
            for _ in range(10)
        ]
    )
    assert cells.min() >= 0
    assert cells.max() < 50


def test_targets_stay_in_the_region_and_within_the_conventional_window(page, p):
    rng = np.random.default_rng(5)
    for omega in p.turn_rates:
        tracks = np.array([page.truth(omega, page.start(p, rng), p, rng)[1] for _ in range(200)])
        assert (tracks[:, 0] == [15, 3]).all()
        assert tracks.min() >= 0
        assert tracks.max() < 50
        assert np.abs(np.diff(tracks, axis=1)).max() <= p.M


def test_turn_is_the_printed_matrix_and_its_limit(page):
    w, T = 0.3, 2.0
    s, c = np.sin(w * T), np.cos(w * T)
    printed = [[1, 0, s / w, -(1 - c) / w], [0, 1, (1 - c) / w, s / w], [0, 0, c, -s], [0, 0, s, c]]
    np.testing.assert_allclose(page.turn(w, T), printed, rtol=1e-13)
    np.testing.assert_allclose(page.turn(1e-9, T), page.turn(0.0, T), atol=1e-8)
    order = [0, 2, 1, 3]
    np.testing.assert_array_equal(
        page.turn(w, T)[np.ix_(order, order)], motion.coordinated_turn(w, T)
    )


def test_process_noise_is_an_acceleration_constant_during_a_scan(page, p):
    noisy, rng = replace(p, process_noise=5.0), np.random.default_rng(6)
    x = page.truth(0.0, np.array([351_550.0, 350_350.0, 170.0, 190.0]), noisy, rng)[0]
    change = x[1:] - x[:-1] @ page.turn(0.0, p.T).T
    np.testing.assert_allclose(change[:, :2], change[:, 2:] * p.T / 2, atol=1e-7)
    assert change[:, 2:].std() == pytest.approx(5.0, rel=0.5)


def test_no_weight_and_both_readings_are_the_extended_set(page, p):
    z = np.random.default_rng(7).normal(size=(4, *p.grid))
    one, two = (
        page.run(z, replace(p, a=1.0, reading=reading)).weighted for reading in ("m", "m-r")
    )
    assert one.value == two.value
    np.testing.assert_array_equal(one.cells, two.cells)


def test_square_law_squares(page, p):
    z = np.random.default_rng(8).normal(size=(3, *p.grid))
    assert (
        page.run(z, replace(p, square_law=True)).weighted.value == page.run(z**2, p).weighted.value
    )


def test_following_implies_finding(page, p):
    """P_D <= P_d in every metric: the last frame is one of all frames."""
    d = np.random.default_rng(9).integers(-3, 4, size=(500, p.K, 2))
    for metric in page.METRICS.values():
        close = metric(d) <= p.tolerance
        assert not (close.all(axis=1) & ~close[:, -1]).any()


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"reading": "r"}, "reading"),
        ({"metric": "taxi"}, "metric"),
        ({"tolerance": -1}, "tolerance"),
        ({"a": 0.0}, "a"),
        ({"a": 1.5}, "a"),
        ({"snr_db": (3, 5, 4)}, "snr_db"),
        ({"snr_db": ()}, "snr_db"),
        ({"turn_rates": ()}, "turn_rates"),
        ({"turn_rates": (0.2, 0.2)}, "turn_rates"),
    ],
)
def test_a_scenario_that_cannot_be_meant_is_refused_in_one_line(p, change, word):
    with pytest.raises(ValueError, match=f"^{word}: ") as error:
        replace(p, **change)
    assert "\n" not in str(error.value)


def test_frames_that_do_not_fit_are_refused_in_one_line(page, p):
    for z, word in (
        (np.zeros((3, 50, 49)), "fit the grid"),
        (np.full((2, 50, 50), np.nan), "nan in frame 0"),
    ):
        with pytest.raises(ValueError, match=word) as error:
            page.run(z, p)
        assert "\n" not in str(error.value)


def test_an_even_window_is_refused_in_one_line(page, p):
    with pytest.raises(ValueError, match="even window"):
        page.keeping(np.ones(4), 1, 0, p, float)


def test_a_target_that_leaves_the_region_is_refused_and_not_clipped(page, p):
    cells = page.truth(-0.4, np.array([351_550.0, 350_350.0, 170.0, 190.0]), p, None)[1]
    with pytest.raises(ValueError, match="outside"):
        sensor.point_frames(np.zeros((p.K, *p.grid)), cells, 1.0)


def test_the_margin_is_as_wide_as_the_longest_step(page, p):
    assert page.reach(p) == p.M + p.slack_pos
    assert (
        page.prepare(np.zeros((1, *p.grid)), p).shape
        == dynprog.margin(np.zeros((1, *p.grid)), 4).shape
    )
