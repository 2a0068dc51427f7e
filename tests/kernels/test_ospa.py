"""OSPA against its definition, enumerated."""

import itertools
import math

import numpy as np
import pytest

from tbdcore import score
from tbdcore.kernels import mda_tbd


def brute_force_ospa(X, Y, c, p):
    """The definition: every injection of the smaller set into the larger one."""
    X, Y = sorted((X, Y), key=len)
    if not len(Y):
        return 0.0
    d = (
        np.minimum(np.linalg.norm(X[:, None] - Y[None], axis=-1), c)
        if len(X)
        else np.zeros((0, len(Y)))
    )
    pairings = itertools.permutations(range(len(Y)), len(X))
    best = min(sum(d[i, j] ** p for i, j in enumerate(pairing)) for pairing in pairings)
    return ((best + c**p * (len(Y) - len(X))) / len(Y)) ** (1 / p)


@pytest.mark.parametrize("p", [1, 2])
def test_ospa_equals_brute_force_over_permutations(p):
    rng = np.random.default_rng(12)
    for m, n in itertools.product(range(5), range(6)):
        X, Y = rng.uniform(0, 300, (m, 2)), rng.uniform(0, 300, (n, 2))
        assert score.ospa(X, Y, 200.0, p) == pytest.approx(
            brute_force_ospa(X, Y, 200.0, p), rel=1e-12
        )


def test_ospa_takes_the_power_before_the_assignment():
    """Distances 0 and sqrt(4.25) have the smaller sum, 1 and sqrt(1.25) that of squares."""
    X, Y = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[1.0, 0.0], [2.0, 0.5]])
    assert score.ospa(X, Y, 10.0, 1) == pytest.approx(math.sqrt(4.25) / 2)
    assert score.ospa(X, Y, 10.0, 2) == pytest.approx(
        math.sqrt((1.0 + 1.25) / 2)
    )  # not sqrt((0 + 4.25) / 2)


def test_ospa_of_empty_sets_and_bad_orders():
    none, one = np.zeros((0, 2)), np.zeros((1, 2))
    assert (
        score.ospa(none, none, 200.0, 2),
        score.ospa(none, one, 200.0, 2),
        score.ospa(one, none, 200.0, 1),
    ) == (0, 200, 200)
    for c, p in ((0.0, 2), (200.0, 0.5)):
        with pytest.raises(ValueError, match=r"ospa: [cp]: 0\.\d is no number in"):
            score.ospa(one, one, c, p)


def test_bernoulli_ospa_is_ospa_of_at_most_one_point():
    """An estimate at the declaration threshold is empty; the order p does not matter."""
    rng = np.random.default_rng(13)
    x, truth, existence = rng.uniform(0, 300, (60, 2)), rng.uniform(0, 300, (60, 2)), rng.random(60)
    truth[::3], existence[:6] = np.nan, [0.5, 0.5, 0.5, 0.51, 0.51, 0.51]
    ours = mda_tbd.ospa_bernoulli(x, existence, truth, 200.0)
    for k in range(60):
        X, Y = (
            x[k : k + 1][existence[k : k + 1] > 0.5],
            truth[k : k + 1][~np.isnan(truth[k : k + 1, 0])],
        )
        assert ours[k] == pytest.approx(score.ospa(X, Y, 200.0, 1 + k % 2), rel=1e-12)
    assert ours.shape == (60,)
