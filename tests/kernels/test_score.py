"""Scores against closed forms and simulation."""

import math

import numpy as np

from tbdcore import score
from tbdcore.kernels import mda_tbd


def test_proportion_and_its_error():
    p, se = score.proportion([0, 25, 100], 100)
    np.testing.assert_allclose(p, [0, 0.25, 1])
    share = np.array([0.5, 25.5, 100.5]) / 101
    np.testing.assert_allclose(se, np.sqrt(share * (1 - share) / 100))
    assert np.isnan(score.proportion(0, 0)[0])


def test_crossing_of_a_line_and_of_nothing():
    x = np.array([0.0, 1.0, 2.0, 3.0])
    assert score.crossing(x, [1.0, 0.8, 0.4, 0.0], 0.5) == 1.75
    assert score.crossing(x[::-1], [1.0, 0.8, 0.4, 0.0], 0.5) == 1.25
    assert math.isnan(score.crossing(x, [0.1, 0.2, 0.1, 0.0], 0.5))


def test_crossing_is_the_last_downward_one():
    assert score.crossing(np.arange(6.0), [0.9, 0.4, 0.6, 0.55, 0.45, 0.1], 0.5) == 3.5
    assert score.crossing(np.arange(4.0), [0.9, np.nan, 0.7, 0.3], 0.5) == 2.5


def test_crossings_are_those_of_the_rows():
    x, rows = np.arange(3.0), [[1.0, 0.5, 0.0], [0.0, 1.0, 0.2], [0.1, 0.2, 0.3]]
    np.testing.assert_array_equal(score.crossings(x, rows, 0.6), [0.8, 1.5, np.nan])


def test_a_column_of_right_numbers_rarely_differs_and_a_shifted_one_does():
    """Rows on the same scenes are correlated: both tests keep their level all the same."""
    rng, r = np.random.default_rng(3), 4
    C = 0.01 * (0.6 + 0.4 * np.eye(r))
    root = np.linalg.cholesky(C)
    found = []
    for _ in range(4000):
        ours, paper = root @ rng.standard_normal(r), 2.0 * root @ rng.standard_normal(r)
        found.append(mda_tbd.column_test(ours, np.round(paper, 1), C, 4.0, half=0.05))
    _, _, z, p = np.array(found).T
    assert abs((np.abs(z) > 1.96).mean() - 0.05) < 4 * math.sqrt(0.05 * 0.95 / 4000)
    assert abs((p < 0.05).mean() - 0.05) < 4 * math.sqrt(0.05 * 0.95 / 4000) + 0.005
    shift, se, _, p = mda_tbd.column_test(np.ones(r), np.zeros(r), C, 4.0)
    assert shift == 1.0
    np.testing.assert_allclose(se, math.sqrt(5 * 0.01 * 0.7))
    assert p < 1e-4


def test_the_rounding_of_a_printed_column_adds_its_uniform_variance():
    """Half h: h**2 / 3, so that a difference of one standard deviation has z = 1, p = 0.317."""
    shift, se, z, p = mda_tbd.column_test([0.2], [0.0], [[0.01]], 0.0, half=0.3)
    np.testing.assert_allclose((shift, se, z), (0.2, 0.2, 1.0))
    np.testing.assert_allclose(p, 0.31731, atol=1e-5)
