"""Thresholds and false plots: any input gives a probability, or a one-line ValueError."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from one_line import public, result

from tbdcore import detection
from tbdcore.kernels import ljipda_ai, track_cfar

SETTINGS = settings(derandomize=True, deadline=None, max_examples=200)
ANY = st.one_of(st.floats(0, 1), st.floats(-100, 100), st.floats())
FEW = st.one_of(ANY, arrays(float, st.integers(0, 4), elements=ANY))


@pytest.mark.filterwarnings("error")
@SETTINGS
@given(FEW, ANY, ANY)
def test_thresholds_and_probabilities(many, a, b):
    eta = result(detection.threshold, many)
    assert eta is None or ((eta >= 0) & (eta < np.inf)).all()
    back = None if eta is None else detection.detection_probability(eta, 0.0)
    assert back is None or np.allclose(back, many, rtol=1e-9, atol=0)
    p = result(detection.detection_probability, many, a)
    assert p is None or ((p >= 0) & (p <= 1)).all()
    p = result(detection.detection_probability, a, many)
    assert p is None or ((p >= 0) & (p <= 1)).all()
    snr = result(detection.required_snr, many, a)
    assert snr is None or (snr >= 0).all()
    snr = result(track_cfar.radar_equation, many, a, b)
    assert snr is None or ((snr >= 0) & (snr < np.inf)).all()
    level = result(detection.to_db, many)
    assert level is None or not np.isnan(level).any()
    if level is not None and (level < 1000).all():
        assert np.allclose(detection.from_db(level), many, rtol=1e-9, atol=0)
    ratio = result(detection.from_db, many)
    assert ratio is None or ((ratio >= 0) & (ratio < np.inf)).all()


@SETTINGS
@given(arrays(float, st.integers(0, 4), elements=ANY), arrays(float, 2, elements=ANY))
def test_amplitude_ratio(excess, snr):
    found = result(ljipda_ai.amplitude_ratio, excess, snr)
    if found is not None:
        assert found.shape == (2, excess.size)
        assert not np.isnan(found).any()
        assert (found >= -np.log1p(snr)[:, None] - 1e-12).all()


@SETTINGS
@given(arrays(float, 11, elements=ANY), st.integers(-2, 5), st.floats(0, 0.999))
def test_false_plots_lie_in_the_gate(values, nth, draw):
    _, p, *rest = values.tolist()
    v, centre, half, cell = rest[:2], rest[2:4], rest[4:6], rest[6:8]
    v, centre, half, cell = (tuple(pair) for pair in (v, centre, half, cell))
    found = result(track_cfar.false_plot, draw, v, centre, half, cell, p, nth)
    if found and found[0]:
        assert all(abs(y) <= h * (1 + 1e-9) + 1e-9 for y, h in zip(found[1:], half, strict=True))
    elif found:
        assert found == (False, 0.0, 0.0)


GATE = (0.1, (0.5, 0.5), (100.0, 0.1), (50.0, 0.05), (10.0, 0.01), 0.1, 0)


@pytest.mark.parametrize(
    ("function", "args", "words"),
    [
        ("threshold", ([0.1, 1.5],), r"p_false\[1\]: 1.5 is not in"),
        ("detection_probability", (-1.0, 1.0), "eta: -1"),
        ("detection_probability", (1.0, -0.5), "snr: -0.5"),
        ("required_snr", (1.0, 0.1), "p_detect: 1 "),
        ("required_snr", (0.1, 0.5), "below p_false"),
        ("radar_equation", (0.0, 10.0, 1.0), "r: 0 is not in"),
        ("radar_equation", (1.0, -10.0, 1.0), "snr0: -10"),
        ("radar_equation", (1.0, 10.0, 0.0), "r0: 0"),
        ("to_db", (-1.0,), "ratio: -1"),
        ("from_db", (1e4,), "decibels: 10000"),
        ("amplitude_ratio", (np.array([-0.1]), np.ones(1)), "excess"),
        ("amplitude_ratio", (np.ones(1), np.array([-0.5])), "snr"),
        ("false_plot", (*GATE[:4], (0.0, 0.01), 0.1, 0), "cell"),
        ("false_plot", (*GATE[:3], (50.0, -0.05), *GATE[4:]), "half"),
        ("false_plot", (*GATE[:3], (1e9, 0.05), *GATE[4:]), "1e8 cells"),
        ("false_plot", (*GATE[:2], (1e30, 0.05), *GATE[3:]), "1e15 cells away"),
        ("false_plot", (1.0, *GATE[1:]), "u: 1.0 is no number"),
        ("false_plot", (*GATE[:5], 1.1, 0), "p_false"),
    ],
)
def test_nonsense_is_refused_in_one_line(function, args, words):
    with pytest.raises(ValueError, match=words) as caught:
        public(function, detection, track_cfar, ljipda_ai)(*args)
    assert "\n" not in str(caught.value)


def test_zero_power_is_minus_infinity():
    assert detection.to_db(0.0) == -np.inf
    assert detection.from_db(-np.inf) == 0.0
