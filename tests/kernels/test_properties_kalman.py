"""Kalman steps: any input gives finite means and covariances, or a one-line ValueError."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from one_line import public, result

from tbdcore import kalman, motion
from tbdcore.kernels import ljipda_ai, track_cfar

SETTINGS = settings(derandomize=True, deadline=None, max_examples=150)
ODD = st.sampled_from([0.0, -1.0, np.inf, -np.inf, np.nan, 1e308, 1e-308])
ANY = st.one_of(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(), ODD)


@st.composite
def tracks(draw, n, good):
    """States (n, 4), covariances (n, 4, 4); if not good, a few elements are anything."""
    x = draw(arrays(float, (n, 4), elements=st.floats(-1e4, 1e4)))
    A = draw(arrays(float, (n, 4, 4), elements=st.floats(-100, 100)))
    P = A @ np.swapaxes(A, 1, 2)
    for values in (x, P) if not good else ():
        for place in draw(st.lists(st.integers(0, max(values.size - 1, 0)), max_size=2)):
            if values.size:
                values.flat[place] = draw(ANY)
    return x, P


def check_covariances(P, before=1e-300):
    """Symmetric and positive, but for rounding of the largest element, before or after."""
    assert np.isfinite(P).all()
    scale = np.abs(P).max(axis=(-1, -2), initial=np.abs(before).max())[..., None]
    assert (np.abs(P - np.swapaxes(P, -1, -2)) <= 1e-9 * scale[..., None]).all()
    assert (np.linalg.eigvalsh(P) >= -1e-7 * scale).all()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("good", [True, False])
def test_dense_steps(good):
    @SETTINGS
    @given(tracks(2, good), st.data())
    def run(track, data):
        x, P = track
        value = st.floats(-100, 100) if good else ANY
        y, T = data.draw(arrays(float, (2, 2), elements=value)), data.draw(value)
        R = np.diag(abs(data.draw(arrays(float, 2, elements=st.floats(1e-3, 1e3))))) if good else y
        H, F = result(kalman.polar_jacobian, x), result(motion.cv, T)
        after = result(kalman.predict, x, P, F, np.eye(4)) if F is not None else None
        if after and good:
            check_covariances(after[1])
        after = result(kalman.update, x, P, y, H, R) if H is not None else None
        if after:
            assert np.isfinite(after[0]).all()
            assert np.isfinite(after[1]).all()
            if good:
                check_covariances(after[1], P)
        d2 = result(kalman.mahalanobis, y, R)
        assert d2 is None or (d2 >= 0).all()
        size = kalman.gate_volume(4.0, R) if good else result(kalman.gate_volume, T, R)
        assert size is None or size >= 0
        wrapped = result(kalman.residual, y, y[::-1])
        assert wrapped is None or (abs(wrapped[:, 1]) <= np.pi).all()

    run()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("good", [True, False])
def test_compiled_steps_of_one_track(good):
    @SETTINGS
    @given(tracks(1, good), st.data())
    def run(track, data):
        (x,), (P,) = track
        value = st.floats(1e-2, 100) if good else ANY
        a, b, c, d = data.draw(arrays(float, 4, elements=value))
        for function, numbers in (
            (track_cfar.predict_cv, (a, b)),
            (track_cfar.gate_polar, (a, b)),
            (track_cfar.update_polar, (a, b, c, d)),
        ):
            found = result(function, x.copy(), P.copy(), *numbers)
            if found is not None:
                assert all(np.isfinite(part).all() for part in found)
                if good and len(found) == 2:
                    check_covariances(found[1], P)
        found = result(kalman.two_point, np.array([a, b]), np.array([c, d]), x[:2], x[2:], b)
        if found:
            check_covariances(found[1])

    run()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("good", [True, False])
def test_compiled_steps_of_several_tracks(good):
    @SETTINGS
    @given(st.integers(0, 3).flatmap(lambda n: tracks(n, good)), st.data())
    def run(track, data):
        x, P = track
        M, value = data.draw(st.integers(0, 3)), st.floats(1.0, 100) if good else ANY
        F = data.draw(arrays(float, P.shape, elements=value))
        after = result(ljipda_ai.predict_tracks, x, P, F, np.eye(4))
        if after and good:
            check_covariances(after[1])
        found = result(ljipda_ai.gate_tracks, x, P, data.draw(value), data.draw(value))
        if not found:
            return
        zhat, R, D = found
        assert np.isfinite(zhat).all()
        assert (np.linalg.det(D) > 0).all() or not good
        z = data.draw(arrays(float, (M, 2), elements=value))
        beta = np.full((len(x), M + 1), 1 / (M + 1))
        after = result(ljipda_ai.update_mixture, x, P, D, z, beta)
        if after:
            assert np.isfinite(after[0]).all()
            assert np.isfinite(after[1]).all()

    run()


X, P = np.array([1e4, 10.0, 2e4, 20.0]), np.diag([100.0, 1.0, 100.0, 1.0])
H, ONE = np.eye(4)[::2], np.ones((1, 1))


@pytest.mark.parametrize(
    ("function", "args", "words"),
    [
        ("predict_cv", (X.astype(int), P, 1.0, 0.1), "x: changed in place"),
        ("predict_cv", (list(X), P, 1.0, 0.1), "x: changed in place"),
        ("predict_cv", (X, P, 1.0, -0.1), "q: -0.1"),
        ("predict_cv", (X, -P, 1.0, 0.1), "negative"),
        ("predict_cv", (X * 1e302, P, 1e10, 0.1), "result is NaN or infinite"),
        ("gate_polar", (0 * X, P, 1.0, 1.0), "r = 0"),
        ("gate_polar", (X, P, 1.0, -1.0), "var_a"),
        ("gate_polar", (X, P, -1.0, 1.0), "var_r"),
        ("update_polar", (X, 0 * P, 1.0, 1.0, 0.0, 0.0), "result is NaN"),
        ("update_polar", (X, P, 1.0, 1.0, -1.0, 1.0), "var_r"),
        ("two_point", (X[:2], X[2:], (1.0, 1.0), (1.0, 1.0), 0.0), "T: 0.0"),
        ("two_point", (X[:2], X[2:], (1.0, -1.0), (1.0, 1.0), 1.0), "var1"),
        ("two_point", (X[:2], X[2:], (1.0, 1.0), (1.0, 1.0), 1e-300), "T too short"),
        ("update", (X, P, np.zeros(2), H, np.eye(2) - H @ P @ H.T), "R: a variance is negative"),
        ("update", (X, P, np.zeros(2), H, 200 - 100 * np.eye(2)), "R: a matrix has a negative"),
        ("update", (X, 0 * P, np.zeros(2), H, np.zeros((2, 2))), "positive definite"),
        ("mahalanobis", (np.ones(2), np.ones((2, 2))), "positive definite"),
        ("polar_jacobian", (0 * X,), "radar"),
        ("polar_noise", (X[:2], -np.eye(2)), "R: a variance is negative"),
        ("gate_half_widths", (-1.0, P), "g: -1"),
        ("gate_half_widths", (1.0, -P), "negative"),
        ("residual", (np.array([1.5e308, 0.0]), np.array([-1.5e308, 0.0])), "infinite"),
        ("gate_tracks", (0 * X[None], P[None], 1.0, 1.0), "positive definite"),
        ("gate_tracks", (X[None], P[None] * 0, 0.0, 0.0), "positive definite"),
        ("gate_tracks", (X[None], P[None], -1e-9, 1.0), "var_r"),
        ("predict_tracks", (X[None], P[None], P[None], -P), "Q: a variance is negative"),
        ("update_mixture", (X[None], P[None], P[None, :2, :2], X[None, :2], ONE), "beta"),
        ("update_mixture", (X[None], P[None], P[None, :2, :2], X[None, :2], [[0.5, 1.0]]), "sum"),
        (
            "update_mixture",
            (X[None], P[None], 0 * P[None, :2, :2], X[:0].reshape(0, 2), ONE),
            "positive definite",
        ),
        ("position_bound", (P[None, None], [np.eye(2)[None]] * 2, P[None], 1.5), "p_detect"),
        ("position_bound", (P[None, None], np.zeros((2, 1, 2, 2)), P[None], 1.0), "singular"),
    ],
)
def test_nonsense_is_refused_in_one_line(function, args, words):
    args = [a.copy() if isinstance(a, np.ndarray) else a for a in args]
    with pytest.raises(ValueError, match=words) as caught:
        public(function, kalman, track_cfar, ljipda_ai)(*args)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("axis", range(4))
def test_a_negative_variance_is_refused_and_the_track_left_as_it_is(axis):
    x, C = X.copy(), P.copy()
    C[axis, axis] = -1e-9
    for function in (track_cfar.predict_cv, track_cfar.gate_polar):
        with pytest.raises(ValueError, match="P: a variance is negative"):
            function(x, C, 1.0, 1.0)
    assert (x == X).all()
    assert C[axis, axis] == -1e-9
    C[axis, axis] = P[axis, axis]
    with pytest.raises(ValueError, match="result"):
        track_cfar.predict_cv(x, C, 1e200, 1e200)
    assert (x == X).all()
    assert (C == P).all()
