"""Weights, resampling and existence against arithmetic that does not use them."""

import math
from fractions import Fraction

import numpy as np
import pytest

from tbdcore import particles


def test_normalise_survives_what_would_overflow():
    W, log_mean = particles.normalise([1000.0, 1000.0 + math.log(3), -np.inf])
    assert np.allclose(W, [0.25, 0.75, 0.0], rtol=1e-12)
    assert log_mean == pytest.approx(1000.0 + math.log(4 / 3), rel=1e-14)


@pytest.mark.parametrize("lw", [[], [-np.inf, -np.inf], [0.0, np.nan], [0.0, np.inf]])
def test_normalise_refuses_in_one_line(lw):
    with pytest.raises(ValueError, match="largest lw of") as error:
        particles.normalise(lw)
    assert "\n" not in str(error.value)


def test_resampling_is_unbiased():
    """Averaged over the offset, particle n has M W[n] copies: the integral over u, exactly, at all
    its jumps.
    """
    W = np.array([Fraction(k, 24) for k in (1, 5, 0, 7, 3, 8)])
    M = 5
    jumps = sorted({(c * M) % 1 for c in np.cumsum(W)} | {Fraction(0), Fraction(1)})
    copies = np.zeros(6)
    for a, b in zip(jumps[:-1], jumps[1:], strict=True):
        ancestors = particles.systematic(W.astype(float), M, float((a + b) / 2))
        copies += float(b - a) * np.bincount(ancestors, minlength=6)
    assert np.allclose(copies, M * W.astype(float), rtol=1e-12)


@pytest.mark.parametrize("u", [0.0, 0.5, np.nextafter(1.0, 0.0)])
def test_copies_differ_from_their_mean_by_less_than_one(u):
    W = np.random.default_rng(1).random(40) ** 4
    copies = np.bincount(particles.systematic(W, 1000, u), minlength=40)
    assert copies.sum() == 1000
    assert (np.abs(copies - 1000 * W / W.sum()) < 1 + 1e-9).all()


@pytest.mark.parametrize("u", [0.0, 0.25, np.nextafter(1.0, 0.0)])
def test_boundary_weights(u):
    """Weights that sum to less than one, zero weights at both ends, a single survivor."""
    low = np.full(10, 0.1) * (1 - 1e-9)
    assert np.abs(particles.systematic(low, 10, u) - np.arange(10)).max() <= 1
    assert particles.systematic(low, 10, 0.5).tolist() == list(range(10))
    edge = np.array([0.0, 0.0, 1.0, 0.0])
    assert particles.systematic(edge, 7, u).tolist() == [2] * 7
    pair = np.array([0.0, 0.5, 0.5, 0.0, 0.0])
    assert set(particles.systematic(pair, 64, u).tolist()) == {1, 2}


def test_an_offset_is_below_one():
    with pytest.raises(ValueError, match="systematic: u: 1.0 is no number in"):
        particles.systematic(np.ones(3), 3, 1.0)


def test_no_arrow_has_no_ancestor():
    assert particles.systematic(np.ones(3), 0, 0.5).shape == (0,)


def test_equal_weights_are_kept():
    assert particles.systematic(np.full(2000, 1 / 2000), 2000, 0.5).tolist() == list(range(2000))


def test_existence_against_the_joint_distribution():
    """Predict and update equal Bayes' rule on the four joint events of two frames."""
    P, birth, survive, ratio = 0.3, 0.1, 0.8, 5.0
    joint = {
        (a, b): (P if a else 1 - P)
        * ((survive if b else 1 - survive) if a else (birth if b else 1 - birth))
        for a in (0, 1)
        for b in (0, 1)
    }
    present = sum(p for (_, b), p in joint.items() if b) * ratio
    absent = sum(p for (_, b), p in joint.items() if not b)
    predicted = particles.existence_predict(P, birth, survive)
    assert particles.existence_update(predicted, math.log(ratio)) == pytest.approx(
        present / (present + absent), rel=1e-14
    )


def test_existence_at_its_limits():
    assert particles.existence_update(0.4, 0.0) == pytest.approx(0.4)
    assert particles.existence_update(0.4, 800.0) == 1.0
    assert particles.existence_update(0.4, -800.0) == pytest.approx(0.0, abs=1e-300)
    P = 0.0
    for _ in range(500):
        P = particles.existence_predict(P, 0.1, 0.9)
    assert abs(P - 0.5) < 1e-12
