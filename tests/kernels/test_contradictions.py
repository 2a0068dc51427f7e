"""What plots in gates say about what a tracker was told, on numbers made by hand."""

import math

import numpy as np
import pytest

from tbdcore.kernels import ljipda_ai


def seen(gated=0, z=((9e3, 9e3),), **change):
    of = {"expected": 0.9, "spread": 0.09, "area": 1e4, "largest": 1e4}
    of |= {"claims": 0.9, "along": 0.9, "across": 0.9, **change}
    return ljipda_ai.Seen(np.array(z), gated, **of)


def says(scans, x=((1000.0, 1.0, 800.0, 1.0),), existence=1.0, p_detect=0.9, clutter="estimate"):
    x = np.tile(x, (10, 1, 1))
    P, alive = np.tile(np.eye(4), (*x.shape[:2], 1, 1)), np.full(x.shape[:2], existence)
    return ljipda_ai.contradiction(scans, x, P, alive, np.full(x.shape[1], p_detect), clutter)


def test_a_look_at_a_scan_is_what_a_count_by_hand_gives():
    """Two tracks on the axes, a plot in both gates, one in none."""
    zhat, S = np.array([[100.0, 0], [0, 50.0]]), np.array([np.diag([4.0, 9.0]), np.diag([1.0, 16])])
    z = np.array([[103.0, 6.0], [1e4, 0.0]])
    beta, expected = np.array([[0.4, 0.6], [0.9, 0.1]]), np.array([0.9, 0.5])
    found = ljipda_ai.look(z, np.array([0]), zhat, S, beta, expected, 16.0)
    assert found.z is z
    along = 0.6 * 9 / 4 + 0.1 * 44**2 / 16
    across = 0.6 * 36 / 9 + 0.1 * 103**2 / 1
    areas = [math.pi * 16 * 6, math.pi * 16 * 4]
    by_hand = [1, 1.4, 0.09 + 0.25, sum(areas), areas[0], 0.7, along, across, 0, 0]
    np.testing.assert_allclose(found[1:], by_hand, rtol=1e-12)


def test_a_look_takes_a_plot_whose_coordinates_are_finite_but_not_their_sum():
    z, no_track = np.array([[1e308, -1e308]]), np.empty((0, 2))
    nothing = np.empty((0, 2, 2)), np.empty((0, 2)), np.empty(0)
    assert ljipda_ai.look(z, np.array([0]), no_track, *nothing, 16.0).gated == 1


@pytest.mark.parametrize(
    ("n", "p_detect", "gated", "named"),
    [
        (5, 0.9, 0, True),
        (4, 0.9, 0, False),
        (5, 0.1, 0, False),
        (44, 0.1, 0, True),
        (9, 0.9, 1, False),
    ],
)
def test_no_plot_in_a_gate_is_named_when_that_is_no_chance(n, p_detect, gated, named):
    scans = [seen(), *[seen(z=np.empty((0, 2)))] * 9, *[seen()] * (n - 1)]
    scans[0] = seen(gated)
    assert bool(says(scans, p_detect=p_detect)) == named


@pytest.mark.parametrize(
    ("z", "words"),
    [((805.0, 1000.0), r"the plots look like [y, x]"), ((840.0, 1000.0), "check units, origin")],
)
def test_a_reading_is_named_when_it_is_ten_times_as_near(z, words):
    assert words in says([seen(z=[z])] * 9)


@pytest.mark.parametrize(
    ("apart", "existence", "named"),
    [(1.3, 1.0, True), (1.5, 1.0, False), (0.0, 0.45, False), (0.0, 0.55, True)],
)
def test_tracks_coincide_within_one_standard_deviation_of_their_difference(apart, existence, named):
    x = [[1000.0, 1, 800, 1], [1000.0 + apart, 1, 800, 1]]
    assert bool(says([seen(1)], x, existence)) == named


@pytest.mark.parametrize(
    ("gated", "clutter", "named"),
    [(2, 1e-4, False), (4, 1e-4, False), (9, 1e-4, True), (1, 1e-4, False), (1, 1e-2, True)],
)
def test_a_density_may_be_off_by_three(gated, clutter, named):
    """The gates of a scan have 1e4 square metres, and 0.9 detections are expected."""
    assert bool(says([seen(gated)] * 50, clutter=clutter)) == named
    assert says([seen(gated)] * 50) is None


@pytest.mark.parametrize(("share", "named"), [(0.15, True), (0.25, False)])
def test_errors_may_be_five_times_as_large_as_the_plots_show(share, named):
    scans = [seen(1, along=0.9 * share**2)] * 30
    assert bool(says(scans)) == named
    assert says(scans[:20]) is None


@pytest.mark.parametrize(
    ("clutter", "gated", "spread", "said"),
    [
        (10, 47, 0, False),
        (10, 48, 0, True),
        (90, 13, 0, False),
        (90, 12, 0, True),
        (10, 61, 90, False),
        (10, 62, 90, True),
        (90, 0, 90, False),
        (90, 0, 60, True),
    ],
)
def test_a_density_is_named_beyond_its_factor_its_chance_and_three_plots(
    clutter, gated, spread, said
):
    """Thirty plots are a third, or three times, of what was told: 2.6 sqrt(30) + 3 = 17.2 away;
    detections that may be ninety more or fewer by chance make it 2.6 sqrt(120) + 3 = 31.5.
    """
    total = ljipda_ai.Seen(None, gated, 0.0, spread, 1.0, 1.0, 0.0, 0.0, 0.0)
    assert (ljipda_ai._other_density(total, clutter) is not None) == said


@pytest.mark.parametrize(
    ("free", "loud", "said"),
    [
        (100, 71, None),
        (100, 73, "73%"),
        (100, 29, None),
        (100, 27, "27%"),
        (59, 59, None),
        (60, 60, "100%"),
    ],
)
def test_a_unit_is_named_with_the_share_of_false_plots_beyond_the_median(free, loud, said):
    words = ljipda_ai._other_unit(seen(free=free, loud=loud))
    assert words is None if said is None else f": {said} of the false plots" in words
