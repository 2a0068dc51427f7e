"""OSPA against its definition, enumerated."""

import itertools

import numpy as np
import pytest

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
        assert ours[k] == pytest.approx(brute_force_ospa(X, Y, 200.0, 1 + k % 2), rel=1e-12)
    assert ours.shape == (60,)
