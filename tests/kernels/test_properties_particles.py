"""Any input to resampling and existence: a result with its invariants, or one line."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from one_line import result

from tbdcore import particles
from tbdcore.kernels import mda_tbd, mm_pf_tbd

same = settings(derandomize=True, deadline=None, max_examples=150)
ANY = st.floats(allow_nan=True, allow_infinity=True, width=64)


USUAL = st.floats(0.0, 1.0) | st.just(0.0)
VECTORS = (
    st.lists(USUAL, max_size=8)
    | st.lists(ANY, max_size=8)
    | st.lists(st.floats(-1e3, 1e3) | st.just(-np.inf), max_size=8)
)
COUNTS = st.integers(-1, 20) | st.just(2.5)
OFFSETS = st.floats(0.0, 1.0, exclude_max=True) | ANY


def ancestors_are_valid(ancestors, weights, M):
    assert ancestors.shape == (M,)
    assert (np.diff(ancestors) >= 0).all()
    assert (weights[ancestors] > 0).all()


@same
@given(VECTORS, COUNTS, OFFSETS)
def test_systematic(weights, M, u):
    out = result(particles.systematic, np.array(weights, float), M, u)
    if out is not None:
        W = np.array(weights)
        ancestors_are_valid(out, W, M)
        if M:
            copies = np.bincount(out, minlength=W.size)
            assert (abs(copies - M * (W / W.sum())) < 1 + 1e-6).all()


@same
@given(VECTORS, COUNTS, OFFSETS)
def test_systematic_from_log_weights(lw, M, u):
    out = result(particles.normalise, np.array(lw, float))
    ancestors = result(particles.systematic, out[0], M, u) if out else None
    if ancestors is not None:
        with np.errstate(over="ignore"):
            ancestors_are_valid(ancestors, np.exp(np.array(lw) - max(lw)), M)


@same
@given(VECTORS)
def test_normalise(lw):
    out = result(particles.normalise, np.array(lw, float))
    if out is not None:
        W, log_mean = out
        assert abs(W.sum() - 1) < 1e-12
        assert W.min() >= 0
        assert np.isfinite(log_mean)


@same
@given(USUAL | ANY, USUAL | ANY, USUAL | ANY, ANY)
def test_existence(P, birth, survive, log_ratio):
    predicted = result(particles.existence_predict, P, birth, survive)
    assert predicted is None or 0 <= predicted <= 1
    updated = result(particles.existence_update, P, log_ratio)
    assert (updated is None) == (not 0 <= P <= 1 or np.isnan(log_ratio))
    assert updated is None or 0 <= updated <= 1


@same
@given(
    st.lists(st.tuples(st.integers(0, 2) | st.integers(-9, 9), USUAL | ANY), max_size=6),
    st.integers(-1, 9),
    USUAL | ANY,
)
def test_resample(particles_of, M, u):
    r, W = (np.array([p[i] for p in particles_of], kind) for i, kind in ((0, int), (1, float)))
    S = np.arange(5.0 * len(r)).reshape(-1, 5)
    out = result(mm_pf_tbd.resample, r, S, W, M, u)
    ancestors = result(particles.systematic, W, M, u)
    if ancestors is None:
        assert out is None
    elif ((r >= 0) & (r <= 2)).all():
        assert (out.ancestors == ancestors).all()
        assert out.counts.sum() == M
        assert (S[ancestors] == out.S).all()
    else:
        assert out is None


@same
@given(
    st.lists(st.integers(-2, 5), max_size=6),
    st.integers(0, 6),
    st.integers(-1, 3),
)
def test_histories(ancestors, N, births):
    inside = all(0 <= n < N for n in ancestors)
    H, age = np.ones((2, 1, N)), np.ones(N, int)
    moved = result(mda_tbd.inherit, H, age, np.array(ancestors, int), births)
    if inside and births >= 0:
        assert moved[0].sum() == 2 * len(ancestors)
        assert moved[1].size == len(ancestors) + births
    else:
        assert moved is None


@same
@given(st.sampled_from([[[0.1, 0.2]], "abc", [1j], [[1], [2, 3]], None, {}]))
def test_other_things_are_refused(thing):
    for function, more in (
        (particles.systematic, (3, 0.5)),
        (particles.normalise, ()),
        (particles.existence_update, (0.5,)),
    ):
        assert result(function, thing, *more) is None
