"""What a cell says: closed forms, normalisation and invariances of the likelihood ratios."""

import math

import numpy as np
import pytest

from tbdcore import sensor

PEAK, BLUR, NOISE = sensor.blob_peak(18.0, 0.6), 0.6, 2.3


def blob_states(*positions):
    S = np.zeros((len(positions), 5))
    S[:, [0, 2]] = positions
    return S


def blob_ratio(z, *positions, peak=PEAK, noise=NOISE):
    return sensor.blob_log_ratio(z, blob_states(*positions), np.ones(len(positions), np.int64), peak, BLUR, noise)


@pytest.mark.parametrize(("position", "d2"), [((15, 10), 15.13), ((15.5, 10), 13.49), ((15.5, 10.5), 12.03)])
def test_blob_energy_depends_on_where_in_the_cell_it_falls(position, d2):
    """Sum of h**2 / sigma**2, by hand on 5 x 5 cells; the integral I**2 / (4 pi b**2 sigma**2) = 13.54 lies between."""
    h = sensor.blob_image(*position, PEAK, BLUR, (30, 20))
    x, y = position
    hand = sum(
        (PEAK * math.exp(-((i - x) ** 2 + (j - y) ** 2) / (2 * BLUR**2)) / NOISE) ** 2 for i in range(10, 21) for j in range(5, 16)
    )
    assert (h**2).sum() / NOISE**2 == pytest.approx(hand, rel=1e-12)
    assert hand == pytest.approx(d2, abs=0.005)
    assert 18.0**2 / (4 * math.pi * BLUR**2 * NOISE**2) == pytest.approx(13.54, abs=0.005)


def test_blob_log_ratio_without_noise_is_half_the_energy():
    """z = h gives + d**2 / 2, z = 0 gives - d**2 / 2."""
    h = sensor.blob_image(15.2, 9.7, PEAK, BLUR, (30, 20))
    d2 = (h**2).sum() / NOISE**2
    assert blob_ratio(h, (15.2, 9.7))[0] == pytest.approx(d2 / 2, rel=1e-7)
    assert blob_ratio(0 * h, (15.2, 9.7))[0] == pytest.approx(-d2 / 2, rel=1e-7)


def test_blob_mean_log_ratio_under_target():
    rng = np.random.default_rng(8)
    h = sensor.blob_image(7.9, 3.3, PEAK, BLUR, (12, 8))
    d2 = (h**2).sum() / NOISE**2
    values = [blob_ratio(h + rng.normal(0, NOISE, h.shape), (7.9, 3.3))[0] for _ in range(4000)]
    assert np.mean(values) == pytest.approx(d2 / 2, abs=4 * math.sqrt(d2 / 4000))
    assert np.var(values) == pytest.approx(d2, rel=4 * math.sqrt(2 / 4000))


def test_blob_mean_ratio_under_noise_is_one():
    """A likelihood ratio is a density ratio: its mean under noise is 1; at low energy, where the mean can be sampled."""
    rng = np.random.default_rng(9)
    weak = PEAK / 4  # d**2 about 0.9, so the ratio has a variance of exp(0.9) - 1
    z = rng.normal(0, NOISE, (40_000, 5, 5))
    values = np.array([blob_ratio(frame, (3.2, 2.9), peak=weak)[0] for frame in z])
    d2 = weak**2 / PEAK**2 * (sensor.blob_image(3.2, 2.9, PEAK, BLUR, (5, 5)) ** 2).sum() / NOISE**2
    assert np.exp(values).mean() == pytest.approx(1.0, abs=4 * math.sqrt(math.expm1(d2) / 40_000))


def test_blob_ratio_is_invariant_under_scale_and_whole_cell_shifts():
    rng = np.random.default_rng(10)
    z = rng.normal(0, NOISE, (30, 20))
    here = blob_ratio(z, (12.25, 8.5))
    assert blob_ratio(4 * z, (12.25, 8.5), peak=4 * PEAK, noise=4 * NOISE) == pytest.approx(here, rel=1e-12)
    assert blob_ratio(np.roll(z, (3, -2), (0, 1)), (15.25, 6.5)) == pytest.approx(here, rel=1e-12)
    assert blob_ratio(z.T.copy(), (8.5, 12.25)) == pytest.approx(here, rel=1e-12)


def test_blob_outside_the_frame_says_nothing():
    z = np.random.default_rng(11).normal(size=(30, 20))
    outside = blob_ratio(z, (0.49, 5), (30.5, 5), (5, 20.5), (5, 0.49), (5, 25), (np.nan, 5))
    assert (outside == 0).all()
    assert (blob_ratio(z, (0.5, 0.5), (30.49, 20.49)) != 0).all()


def test_blob_image_of_many_positions_and_of_none():
    many = sensor.blob_image(np.array([3.0, np.nan]), np.array([4.0, np.nan]), 2.0, BLUR, (6, 7))
    assert many.shape == (2, 6, 7)
    assert many[0, 2, 3] == 2.0
    assert (many[1] == 0).all()


def test_zero_signal_has_ratio_one():
    z = np.random.default_rng(12).normal(size=(6, 6))
    assert (blob_ratio(z, (3, 3), peak=0.0) == 0).all()
