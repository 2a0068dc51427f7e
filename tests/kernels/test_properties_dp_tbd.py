"""Any input to dynamic programming: maps and paths that agree, or one line."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from one_line import result

from tbdcore.kernels import dp_tbd

same = settings(derandomize=True, deadline=None, max_examples=100)
ANY = st.floats(allow_nan=True, allow_infinity=True, width=64)


WEIGHTS = (
    st.just([0.9, 1.0, 0.9])
    | st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3)
    | st.lists(st.floats(0.0, 2.0) | ANY, max_size=4)
)
FAMILIES = st.sampled_from(["box", "weighted", "penalised", "coupled"])
NUMBERS = st.integers(-3, 3)


@same
@given(st.lists(st.floats(-5, 5) | ANY, min_size=1, max_size=6), st.integers(-1, 3))
def test_margin(values, width):
    z = np.resize(np.array(values), (2, 3, 2))
    out = result(dp_tbd.margin, z, width)
    assert (out is None) == (width < 0 or not np.isfinite(z).all())
    if out is not None:
        assert np.isfinite(out).sum() == z.size
        assert np.isneginf(out).sum() == out.size - z.size


def transition(family, position, velocity, lowest, V, width):
    """The transition, or None after a ValueError of one line."""
    position, velocity = np.array(position, float), np.array(velocity, float)
    with np.errstate(over="ignore", invalid="ignore"):
        table = np.outer(position, velocity)
    weights = {"box": (position,), "coupled": (table,)}.get(family, (position, velocity))
    make = getattr(dp_tbd, f"{family}_transition")
    return result(make, *weights, (lowest, lowest + V - 1), width)


@same
@given(st.data(), FAMILIES, WEIGHTS, WEIGHTS, NUMBERS, NUMBERS, st.integers(1, 4))
def test_forward_and_path(data, family, position, velocity, lowest, width, V):
    values = data.draw(st.lists(st.floats(-5, 5), min_size=4, max_size=4))
    z = dp_tbd.margin(np.resize(np.array(values), (3, 4, 3)), max(width, 0))
    way = transition(family, position, velocity, lowest, V, width)
    if way is None:
        return
    I = dp_tbd.forward(z, way)
    assert not np.isnan(I).any()
    assert (I[1:] < np.inf).all()
    state = data.draw(st.tuples(*[st.integers(-1, n) for n in I.shape[1:]]))
    traced = result(dp_tbd.path, I, state, way)
    inside = all(0 <= s < n for s, n in zip(state, I.shape[1:], strict=True))
    assert (traced is not None) == inside
    if inside:
        assert traced[-1].tolist() == list(state)
        reached = np.isfinite(I[-1][state])
        assert ((traced >= 0).all() and reached) or not reached
