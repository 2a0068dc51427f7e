"""Motion: any input gives regimes 0 to 2 and finite matrices, or a one-line ValueError."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from one_line import public, result

from tbdcore import motion
from tbdcore.kernels import mm_pf_tbd

SETTINGS = settings(derandomize=True, deadline=None, max_examples=200)
ANY = st.one_of(st.floats(0, 0.999), st.floats(-100, 100), st.floats())
PI = np.array([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.0, 0.0, 1.0]])
TURNS = np.array([[-0.4, 0.2], [0.2, 0.1]])


@pytest.mark.filterwarnings("error")
@SETTINGS
@given(ANY, ANY)
def test_matrices(T, a):
    for function in (motion.white_acceleration, motion.step_acceleration):
        Q = result(function, T, a)
        assert Q is None or (np.isfinite(Q).all() and (Q == Q.T).all() and (np.diag(Q) >= 0).all())
    F = result(motion.coordinated_turn, a, T)
    assert F is None or np.isfinite(F).all()
    F = result(motion.cv, T)
    assert F is None or np.isfinite(F).all()


@pytest.mark.filterwarnings("error")
@SETTINGS
@given(arrays(float, st.tuples(st.integers(0, 3), st.integers(0, 3)), elements=ANY))
def test_transition_matrices(Pi):
    found = result(mm_pf_tbd.check_transitions, Pi)
    if found is not None:
        assert Pi.shape[0] == Pi.shape[1] > 0
        np.testing.assert_allclose(Pi.sum(axis=1), 1.0, rtol=1e-9)


@pytest.mark.parametrize("good", [True, False])
def test_transition(good):
    @SETTINGS
    @given(st.integers(0, 6), st.booleans(), st.data())
    def run(n, redraw, data):
        value, low, high = (st.floats(0, 0.999), 0, 2) if good else (ANY, -1, 3)
        r = data.draw(arrays(np.int64, n, elements=st.integers(low, high)))
        S, a = (data.draw(arrays(float, (n, m), elements=value)) for m in (5, 2))
        u, T = data.draw(arrays(float, n, elements=value)), data.draw(value)
        Pi, turns = PI.copy(), TURNS.copy()
        if not good and data.draw(st.booleans()):
            Pi[1, 1] = data.draw(ANY)
        before = S.copy()
        found = result(mm_pf_tbd.transition, r, S, Pi, T, u, a, turns, redraw)
        assert found is not None or not good
        if found:
            after, born, states = found
            assert ((after >= 0) & (after <= 2)).all()
            expected = np.flatnonzero((r == 0) & (after > 0)) if redraw else []
            np.testing.assert_array_equal(born, expected)
            np.testing.assert_array_equal(states[after == 0], before[after == 0])
            assert np.isfinite(states).all() or not good

    run()


@SETTINGS
@given(arrays(float, (5, 3), elements=ANY), arrays(float, (2, 2), elements=ANY))
def test_box_states(u, turns):
    low, width = np.array([0.0, -2.0, 0.0, -2.0]), np.array([30.0, 4.0, 25.0, 0.0])
    law = np.concatenate([np.column_stack([low, width]), turns])
    S = result(mm_pf_tbd.box_states, u, law)
    if S is None:
        return
    inside = (S[:, :4] >= low) & (S[:, :4] <= low + width)
    assert (inside | ~((u[:4] >= 0) & (u[:4] <= 1)).T).all()


STEP = (np.zeros(1, int), np.zeros((1, 5)), PI, 1.0, np.zeros(1), np.zeros((1, 2)), TURNS, True)


@pytest.mark.parametrize(
    ("at", "value", "words"),
    [
        (0, np.array([3]), r"transition: r\[0\]: -?\d is not in \[0, 2\]"),
        (0, np.array([-1]), r"transition: r\[0\]: -?\d is not in \[0, 2\]"),
        (2, PI + 0.1, "row of Pi"),
        (2, np.array([[2.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "row of Pi"),
        (4, np.ones(1), "u is not in"),
        (4, np.full(1, -0.1), "u is not in"),
        (6, TURNS[:1], r"turns: shape \(1, 2\)"),
        (6, -TURNS, "pair of intervals"),
    ],
)
def test_nonsense_in_a_transition_is_refused(at, value, words):
    args = [a.copy() if isinstance(a, np.ndarray) else a for a in STEP]
    args[at] = value
    with pytest.raises(ValueError, match=words) as caught:
        mm_pf_tbd.transition(*args)
    assert "\n" not in str(caught.value)


def test_a_box_has_two_intervals_of_the_turn_rate():
    with pytest.raises(ValueError, match="pair of intervals"):
        mm_pf_tbd.box_states(np.zeros((5, 1)), np.concatenate([np.ones((4, 2)), -TURNS]))
    with pytest.raises(ValueError, match="infinity in law"):
        mm_pf_tbd.box_states(np.zeros((5, 1)), np.concatenate([np.full((4, 2), np.inf), TURNS]))


@pytest.mark.parametrize(
    ("function", "args"),
    [
        ("white_acceleration", (-1.0, 1.0)),
        ("white_acceleration", (1.0, -1.0)),
        ("step_acceleration", (1.0, -1.0)),
        ("coordinated_turn", (1e60, 1.0)),
    ],
)
def test_nonsense_in_a_matrix_is_refused(function, args):
    with pytest.raises(ValueError, match="is no number in"):
        public(function, motion, mm_pf_tbd)(*args)
