"""Any input to the likelihood ratios: finite ratios where a target can be, or one line."""

import numpy as np
import pytest
from draws import PLACES, POSITIVE, SHAPES, draw_frame, same, usual
from hypothesis import given
from hypothesis import strategies as st
from one_line import result

from tbdcore.kernels import mda_tbd


@pytest.mark.slow
@same
@given(st.data(), SHAPES, usual)
def test_power_ratios(data, shape, typical):
    z = draw_frame(data, shape, typical)
    real = st.floats(1e-3, 900.0) if typical else POSITIVE
    rho, alpha = (np.array(data.draw(st.tuples(PLACES, PLACES))) for _ in range(2))
    snr = np.array(data.draw(st.tuples(real, real)))
    half = st.integers(0, 6) if typical else st.integers(-1, 6)
    spread = mda_tbd.Spread(*data.draw(st.tuples(real, real, half, half)))
    on = (rho >= 0.5) & (rho < shape[0] + 0.5) & (alpha >= 0.5) & (alpha < shape[1] + 0.5)
    for ratio in (mda_tbd.power_log_ratio, mda_tbd.coherent_log_ratio):
        out = result(ratio, z, rho, alpha, snr, spread)
        assert out is not None or not typical
        if out is not None:
            assert np.isfinite(out[on]).all()
            assert (out[~on] == -np.inf).all()
    fit = result(mda_tbd.patch_fit, z, rho, alpha, spread)
    assert fit is None or (np.isfinite(fit).all() and (fit[1] >= 0).all())
