"""Any input to the log-ratio of the blob: finite ratios where a target can be, or one line."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from one_line import result

from tbdcore.kernels import mm_pf_tbd

same = settings(derandomize=True, deadline=None, max_examples=150)
ANY = st.floats(allow_nan=True, allow_infinity=True, width=64)


CELLS = st.floats(0.0, 20.0) | st.sampled_from([1e40, 0.0]) | ANY
PLACES = st.floats(-1.0, 8.0) | ANY
POSITIVE = st.floats(1e-4, 30.0) | ANY
SHAPES = st.sampled_from([(5, 4), (1, 1), (3, 7), (0, 2)])
usual = st.sampled_from([True, True, True, False])


def draw_frame(data, shape, typical):
    one = st.floats(0.0, 20.0) if typical else CELLS
    values = data.draw(st.lists(one, min_size=4, max_size=4))
    return np.resize(np.array(values), shape)


@same
@given(st.data(), SHAPES, usual)
def test_blob_ratio(data, shape, typical):
    z = draw_frame(data, shape, typical)
    real = st.floats(1e-3, 30.0) if typical else POSITIVE
    S = np.zeros((3, 5))
    S[:, 0], S[:, 2] = data.draw(st.tuples(*[st.tuples(PLACES, PLACES, PLACES)] * 2))
    r, peak, blur, noise = np.array([0, 1, 2]), *data.draw(st.tuples(real, real, real))
    out = result(mm_pf_tbd.blob_log_ratio, z, S, r, peak, blur, noise)
    if out is None:
        sound = np.isfinite(z).all() and np.isfinite(S).all() and typical
        assert not sound
    else:
        assert np.isfinite(out).all()
        assert out[0] == 0
