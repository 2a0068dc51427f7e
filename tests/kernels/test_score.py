"""Scores against closed forms and simulation."""

import math

import numpy as np
import pytest

from tbdcore import score


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


def errors(lengths):
    """Errors (K, 1, 2) of one track with given lengths."""
    return np.stack([np.asarray(lengths, float), np.zeros(len(lengths))], axis=-1)[:, None]


@pytest.mark.parametrize(
    ("lengths", "after", "onset"),
    [
        ([0, 0, 0, 0, 0, 0], 0, 6),
        ([0, 9, 9, 0, 9, 9], 0, 6),  # never three running
        ([0, 9, 9, 9, 0, 0], 0, 1),  # lost, although it comes back
        ([9, 9, 9, 9, 9, 0], 1, 1),
        ([9, 9, 9, 0, 0, 0], 1, 6),
        ([9, 9], 0, 2),  # shorter than the rule
    ],
)
def test_loss_rule(lengths, after, onset):
    assert score.loss_onsets(errors(lengths), 5.0, 3, after).tolist() == [onset]


def test_distance_is_euclidean():
    diagonal = np.full((4, 1, 2), 4.0)
    assert score.loss_onsets(diagonal, 5.0, 2).tolist() == [0]
    assert score.loss_onsets(diagonal, 5.7, 2).tolist() == [4]
