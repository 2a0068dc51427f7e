"""Gating and association: any input gives weights that sum to one, or a one-line ValueError."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from one_line import result

from tbdcore.kernels import ljipda_ai

SETTINGS = settings(derandomize=True, deadline=None, max_examples=150)
ANY = st.one_of(
    st.floats(-30, 30),
    st.floats(),
    st.sampled_from([0.0, 1.0, -np.inf, np.inf, np.nan, 1e308, -1e308, 1e9, 5e-324]),
)
LOG_RATIO = st.one_of(st.floats(-30, 30), st.floats(-1e9, 1e9), st.just(-np.inf))
CHANCE = st.one_of(st.floats(0, 1), st.sampled_from([0.0, 1.0]))


@st.composite
def scenes(draw, ratio=LOG_RATIO, chance=CHANCE, spare=0):
    T, M = draw(st.integers(0, 4)), draw(st.integers(0, 5))
    shapes = (T, M), (T, M), (T,), (T + draw(st.integers(0, spare)),)
    return [
        draw(arrays(float, s, elements=e))
        for s, e in zip(shapes, (ratio, ratio, chance, chance), strict=True)
    ]


def check_weights(beta, posterior, shape):
    T, M = shape
    assert beta.shape == (T, M + 1)
    assert posterior.shape == (T,)
    assert (beta >= 0).all()
    np.testing.assert_allclose(beta.sum(axis=1), 1.0, rtol=1e-9)
    assert ((posterior >= 0) & (posterior <= 1 + 1e-12)).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("scene", [scenes(), scenes(ANY, ANY, 1)], ids=["mostly valid", "anything"])
def test_weights_sum_to_one(scene):
    @SETTINGS
    @given(scene)
    def run(args):
        log_ratio, amplitude, existence, detect = args
        valid = detect.size == existence.size
        for function in (ljipda_ai.ipda, ljipda_ai.jipda):
            found = result(function, log_ratio, existence, detect)
            if found:
                assert valid
                check_weights(*found, log_ratio.shape)
        found = result(ljipda_ai.ljipda, log_ratio, amplitude, existence, detect)
        if found:
            check_weights(*found, log_ratio.shape)
        seen = result(ljipda_ai.visibility, log_ratio, existence, detect)
        assert seen is None or ((seen > 0) & (seen <= 1 + 1e-12)).all()
        ratio = result(ljipda_ai.modulated_log_ratio, log_ratio, existence, detect)
        if ratio is not None:
            gated = log_ratio > -np.inf
            assert (ratio[~gated] == -np.inf).all()
            assert (ratio[gated] <= log_ratio[gated] + 1e-12).all()

    run()


@SETTINGS
@given(scenes())
def test_uncertain_tracks_are_never_refused(args):
    log_ratio, amplitude, existence, detect = args
    existence, detect = 0.98 * existence, 0.98 * detect
    check_weights(*ljipda_ai.ipda(log_ratio, existence, detect), log_ratio.shape)
    check_weights(*ljipda_ai.jipda(log_ratio, existence, detect), log_ratio.shape)
    bounded = np.clip(amplitude, -1e8, 1e8)
    both = np.clip(log_ratio, -np.inf, 1e8)
    check_weights(*ljipda_ai.ljipda(both, bounded, existence, detect), log_ratio.shape)


@SETTINGS
@given(st.data())
def test_gate_keeps_what_is_inside(data):
    M, T = data.draw(st.integers(0, 5)), data.draw(st.integers(0, 3))
    z, zhat = (data.draw(arrays(float, (n, 2), elements=ANY)) for n in (M, T))
    root = data.draw(arrays(float, (T, 2, 2), elements=st.one_of(st.floats(-9, 9), ANY)))
    gamma, p_gate = data.draw(ANY), data.draw(st.one_of(st.just(1.0), ANY))
    with np.errstate(all="ignore"):
        S = root @ np.swapaxes(root, 1, 2)
    found = result(ljipda_ai.gate, z, zhat, S, gamma, p_gate)
    if found is None:
        return
    picked, log_density = found
    assert (np.diff(picked) > 0).all()
    assert log_density.shape == (T, picked.size)
    assert not np.isnan(log_density).any()
    assert np.isfinite(log_density).any(axis=0).all()
    assert (log_density < np.inf).all()
    assert np.isfinite(z[picked]).all()


@pytest.mark.parametrize(
    ("function", "args", "words"),
    [
        ("jipda", ([[-np.inf]], [1.0], [1.0]), "certain track"),
        ("ipda", ([[-np.inf]], [1.0], [1.0]), "certain track"),
        ("jipda", ([[0.0], [1.0]], [1.0, 1.0], [1.0, 1.0]), "certain track"),
        ("jipda", ([[-1e10]], [0.5], [0.5]), "below -1e9"),
        ("modulated_log_ratio", ([[1.0]], [1.0], [1.0]), "prior"),
        ("jipda", ([[1.0]], [1.1], [0.5]), "existence"),
        ("ipda", ([[1.0]], [0.5], [-0.1]), "detect"),
        ("ipda", ([[1.0]], [0.5, 0.5], [0.5]), r"existence: shape \(2,\) is not \(T,\) with T = 1"),
        ("gate", ([[0.0, np.nan]], [[0.0, 1e9]], [np.eye(2)], 9.0, 1.0), "z"),
        ("gate", ([[0.0, 0.0]], [[0.0, 0.0]], [np.ones((2, 2))], 9.0, 1.0), "positive definite"),
        ("gate", ([[0.0, 0.0]], [[0.0, 0.0]], [[[1.0, 0.5], [0.1, 1.0]]], 9.0, 1.0), "definite"),
        ("gate", ([[0.0, 0.0]], [[0.0, 0.0]], [np.eye(2)], 9.0, 1.5), "p_gate"),
        ("gate", ([[0.0, 0.0]], [[0.0, 0.0]], [np.eye(2)], 0.0, 1.0), "gamma"),
        ("ljipda", ([[1.0]], [[1.0, 2.0]], [0.5], [0.5]), "log_amplitude: shape"),
    ],
)
def test_nonsense_is_refused_in_one_line(function, args, words):
    args = [np.array(a) if isinstance(a, list) else a for a in args]
    with pytest.raises(ValueError, match=words) as caught:
        getattr(ljipda_ai, function)(*args)
    assert "\n" not in str(caught.value)


def test_partial_sums_are_limited():
    with pytest.raises(ValueError, match="1 GB"):
        ljipda_ai.jipda(np.full((16, 5000), -np.inf), np.full(16, 0.5), np.full(16, 0.5))
