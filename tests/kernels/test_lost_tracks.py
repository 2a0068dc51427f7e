"""The loss rule on hand-made errors; RMSE of kept runs and its influence against a bootstrap."""

import math

import numpy as np
import pytest

from tbdcore import score
from tbdcore.kernels import ljipda_ai


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


def test_kept_rmse_and_its_error():
    rng = np.random.default_rng(1)
    e, kept = rng.normal(size=(4000, 3, 2, 2)) * [1.0, 3.0], rng.random((4000, 2)) < 0.7
    rmse, influence = ljipda_ai.kept_rmse(e, kept)
    np.testing.assert_allclose(
        rmse[:, 1], np.sqrt((e[kept[:, 1], :, 1] ** 2).mean(axis=0)), rtol=1e-12
    )
    np.testing.assert_allclose(influence.mean(axis=0), 0.0, atol=1e-12)
    resampled = [
        ljipda_ai.kept_rmse(e[i], kept[i])[0] for i in rng.integers(4000, size=(200, 4000))
    ]
    error = np.std(influence, axis=0) / math.sqrt(len(influence))
    np.testing.assert_allclose(error, np.std(resampled, axis=0), rtol=0.25)  # 200: 5 %, 5 sigma


def test_the_influence_of_each_trial_is_a_derivative():
    """That of trial i: n times the change of the RMSE by the share of i, with the others kept."""
    rng, step = np.random.default_rng(2), 1e-6
    e, kept = rng.normal(size=(5, 1, 1, 2)), np.array([[True], [True], [False], [True], [False]])
    rmse, influence = ljipda_ai.kept_rmse(e, kept)
    for i in range(5):
        share = np.full(5, (1 - step) / 5)
        share[i] += step
        share = share[:, None] * kept[:, 0, None]
        more = np.sqrt((share * e[:, 0, 0] ** 2).sum(axis=0) / share.sum(axis=0))
        np.testing.assert_allclose(influence[i, 0, 0], (more - rmse[0, 0]) / step, atol=1e-5)


def test_no_kept_trial_is_nan():
    rmse, _ = ljipda_ai.kept_rmse(np.ones((3, 2, 1, 2)), np.zeros((3, 1), bool))
    assert np.isnan(rmse).all()
