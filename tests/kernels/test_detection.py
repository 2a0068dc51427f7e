"""Closed forms of detection against quadrature, inversion and counting."""

import numpy as np
import pytest
from scipy import integrate

from tbdcore import detection
from tbdcore.kernels import track_cfar


def test_threshold_of_one_in_a_million():
    assert np.isclose(detection.threshold(1e-6), 13.815510557964274, rtol=1e-15)


def test_probabilities_are_tails_of_exponentials():
    eta, S = 5.0, 8.0
    noise, _ = integrate.quad(lambda x: np.exp(-x), eta, np.inf)
    target, _ = integrate.quad(lambda x: np.exp(-x / (1 + S)) / (1 + S), eta, np.inf)
    assert np.isclose(detection.detection_probability(eta, 0.0), noise, rtol=1e-8)
    assert np.isclose(detection.detection_probability(eta, S), target, rtol=1e-8)


def test_swerling_1_from_complex_samples():
    rng, S, eta, n = np.random.default_rng(1), 4.0, 3.0, 400_000
    x = np.sqrt(S / 2) * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    x += np.sqrt(1 / 2) * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    p = detection.detection_probability(eta, S)
    assert abs((np.abs(x) ** 2 > eta).mean() - p) < 4 * np.sqrt(p * (1 - p) / n)


def test_required_snr_inverts_detection():
    S = detection.required_snr(0.5, 1e-6)
    assert np.isclose(
        detection.detection_probability(detection.threshold(1e-6), S), 0.5, rtol=1e-14
    )
    assert np.isclose(detection.to_db(S), 12.772, atol=5e-4)


def test_no_target_is_a_false_alarm():
    eta = np.linspace(0, 20, 5)
    np.testing.assert_allclose(detection.detection_probability(eta, 0.0), np.exp(-eta), rtol=1e-15)


def test_fourth_power_law_and_decibels():
    assert np.isclose(
        detection.to_db(track_cfar.radar_equation(200.0, 1000.0, 100.0)), 30 - 40 * np.log10(2)
    )
    assert np.isclose(detection.from_db(detection.to_db(7.3)), 7.3)


def test_no_snr_makes_a_detection_certain():
    with pytest.raises(ValueError, match=r"required_snr: p_detect: 1 is not in"):
        detection.required_snr(1.0, 0.1)


@pytest.mark.parametrize("bad", [0.0, -0.1, 1.1])
def test_bad_false_alarm_probability(bad):
    with pytest.raises(ValueError, match="is not in"):
        detection.threshold(bad)
