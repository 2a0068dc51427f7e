"""Any input to the log-ratio of the blob: finite ratios where a target can be, or one line."""

import numpy as np
from draws import PLACES, POSITIVE, SHAPES, draw_frame, same, usual
from hypothesis import given
from hypothesis import strategies as st
from one_line import result

from tbdcore.kernels import mm_pf_tbd


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
