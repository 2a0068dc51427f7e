"""OSPA, proportions, crossings: any input stays in its bounds, or gives a one-line ValueError."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from one_line import public, result

from tbdcore import score
from tbdcore.kernels import ljipda_ai, mda_tbd

SETTINGS = settings(derandomize=True, deadline=None, max_examples=200)
ANY = st.one_of(st.floats(0, 1), st.floats(-100, 100), st.floats())


@SETTINGS
@given(*[arrays(float, (3, 2), elements=ANY)] * 2, arrays(float, 3, elements=ANY), ANY)
def test_ospa_of_at_most_one_target(x, truth, existence, c):
    d = result(mda_tbd.ospa_bernoulli, x, existence, truth, c)
    assert d is None or ((d >= 0) & (d <= c)).all()


@SETTINGS
@given(ANY, ANY)
def test_a_share_lies_between_0_and_1(k, n):
    found = result(score.proportion, k, n)
    if found and n > 0:
        assert 0 <= found[0] <= 1
        assert 0 <= found[1] <= 0.51 / np.sqrt(n)


@SETTINGS
@given(st.lists(ANY, max_size=6), st.data(), ANY)
def test_crossings_lie_on_the_axis(x, data, level):
    curves = data.draw(arrays(float, (2, len(x)), elements=ANY))
    found = result(score.crossings, x, curves, level)
    if found is not None:
        low, high = min(x, default=0), max(x, default=0)
        slack = 1e-9 * (abs(low) + abs(high))
        inside = (found >= low - slack) & (found <= high + slack)
        assert (np.isnan(found) | inside).all()


ONE = np.zeros((1, 2))


@pytest.mark.parametrize(
    ("function", "args", "words"),
    [
        ("ospa_bernoulli", (ONE, [1.0], ONE[0], 1.0), r"truth \(2,\)"),
        ("ospa_bernoulli", (ONE * np.nan, [1.0], ONE, 1.0), "declared x or its target has a NaN"),
        ("ospa_bernoulli", (ONE, [1.0], ONE, -1.0), "c: -1"),
        ("proportion", (3, 2), "0 <= k <= n"),
        ("proportion", (-1, 2), "k: -1"),
        ("proportion", (0, 5e-324), "whole number"),
        ("proportion", (1, 2.5), "whole number"),
        ("crossings", ([0, 0], [[1.0, 0.0]], 0.5), "monotone"),
        ("crossings", ([0, 1], [[[1.0, 0.0]]], 0.5), "more than two axes"),
        ("loss_onsets", (np.zeros((3, 1, 2)), 1.0, 0), "scans"),
        ("loss_onsets", (np.zeros((3, 1, 2)), 0.0, 1), "distance"),
        ("kept_rmse", (np.zeros((0, 2, 1, 2)), np.ones((0, 1), bool)), "no trial"),
        ("column_test", ([1.0], [2.0], [[0.0]], 1.0), "covariance is singular"),
        ("column_test", ([1.0], [2.0], [[1.0]], -1.0), "ratio"),
    ],
)
def test_nonsense_is_refused_in_one_line(function, args, words):
    with pytest.raises(ValueError, match=words) as caught:
        public(function, score, mda_tbd, ljipda_ai)(*args)
    assert "\n" not in str(caught.value)
