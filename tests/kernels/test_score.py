"""Scores against closed forms and simulation."""

import math

import numpy as np
from scipy import stats

from tbdcore import score


def test_proportion_and_its_error():
    p, se = score.proportion([0, 25, 100], 100)
    np.testing.assert_allclose(p, [0, 0.25, 1])
    np.testing.assert_allclose(se, [0, math.sqrt(0.25 * 0.75 / 100), 0])
    assert np.isnan(score.proportion(0, 0)[0])


def test_wilson_covers():
    low, high = score.wilson(np.arange(41), 40)
    assert low[0] == 0
    assert np.isclose(high[-1], 1)
    for p in (0.05, 0.3, 0.5):
        inside = (low <= p) & (p <= high)
        coverage = stats.binom.pmf(np.arange(41), 40, p)[inside].sum()
        assert 0.97 < coverage < 1  # nominal 0.99; binomial steps at n = 40 are 0.02


def test_crossing_of_a_line_and_of_nothing():
    x = np.array([0.0, 1.0, 2.0, 3.0])
    assert score.crossing(x, [1.0, 0.8, 0.4, 0.0], 0.5) == 1.75
    assert score.crossing(x[::-1], [1.0, 0.8, 0.4, 0.0], 0.5) == 1.25
    assert math.isnan(score.crossing(x, [0.1, 0.2, 0.1, 0.0], 0.5))


def test_crossing_is_the_last_downward_one():
    assert score.crossing(np.arange(6.0), [0.9, 0.4, 0.6, 0.55, 0.45, 0.1], 0.5) == 3.5
    assert score.crossing(np.arange(4.0), [0.9, np.nan, 0.7, 0.3], 0.5) == 2.5


def test_crossing_error_against_simulation():
    rng = np.random.default_rng(8)
    x, p, n = np.linspace(0, 10, 21), 1 / (1 + np.exp(np.linspace(-3, 3, 21))), 4000
    curves = rng.binomial(n, p, (3000, 21)) / n
    spread = np.nanstd(score.crossings(x, curves, 0.41))
    se = score.crossing_error(x, p, 0.41, np.sqrt(p * (1 - p) / n))
    assert np.isclose(
        se, spread, rtol=4 / math.sqrt(2 * 3000)
    )  # 4 standard errors of a standard deviation


def test_rmse_of_known_errors():
    error = np.array([[[3.0, 4.0]], [[0.0, 0.0]], [[np.nan, 1.0]]])
    np.testing.assert_allclose(score.rmse(error), [math.sqrt(12.5)])
