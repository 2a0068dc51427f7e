"""Plots from frames, in chapter 04: the level that it checks, and a target that it follows."""

import warnings

import numpy as np
import pytest

import tbdcore
from tbdcore import noise, recording
from tbdcore.recording.misfit import Misfit

K, SHAPE, CELL = 20, (60, 30), (15.0, 0.0131)


def flown(z, eta):
    """Whether chapter 04 warns, and keeps the target of 20 dB, in frames of power."""
    page, path = (
        tbdcore.page("track_cfar"),
        np.c_[12 + 1.6 * np.arange(K), 15 + 0.05 * np.arange(K)],
    )
    z = recording.inject(z, path, 100.0, 0.6, np.random.default_rng(1), "exponential")
    found = recording.plots(z, eta, "exponential", (20e3, 0.5), CELL, level=True)
    true = np.array([20e3, 0.5]) + path * CELL
    first = [
        abs((scan[:, :2] - at) / CELL).sum(axis=1).argmin()
        for scan, at in zip(found[:2], true[:2], strict=True)
    ]
    scans = [found[k][[first[k]], :3] for k in (0, 1)] + [scan[:, :3] for scan in found[2:]]
    p = page.Scenario(scan=4.0, bandwidth=5.0, beamwidth=1.5, sigma_p=1.0)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        tracks = page.run(scans, p, accuracy=(10.0, 0.008))
    kept = len(tracks) == K - 2 and abs(np.hypot(*tracks[-1].x[::2]) - true[-1, 0]) < 60
    return any(issubclass(one.category, Misfit) for one in said), kept


@pytest.mark.parametrize("eta", [1.5, 2.3, 3.0, 4.0])
def test_clean_noise_is_no_misfit_and_a_target_is_kept(eta):
    """Of 300 runs: 1 % warn, 99 % are kept at eta = 3."""
    results = [
        flown(noise.exponential((K, *SHAPE), np.random.default_rng([i, 7])), eta) for i in range(10)
    ]
    warned, kept = np.sum(results, axis=0)
    assert warned <= 1
    assert kept >= 9


def test_k_noise_is_a_misfit():
    """Of 150 runs 90 % warn."""
    results = [
        flown(noise.k_power((K, *SHAPE), 1.0, np.random.default_rng([i, 8])), 3.0)
        for i in range(10)
    ]
    assert np.sum(results, axis=0)[0] >= 8


if __name__ == "__main__":  # the counts that the guide states
    for eta in (1.5, 2.3, 3.0, 4.0):
        clean = [
            flown(noise.exponential((K, *SHAPE), np.random.default_rng([i, 9])), eta)
            for i in range(300)
        ]
        heavy = [
            flown(noise.k_power((K, *SHAPE), 1.0, np.random.default_rng([i, 10])), eta)
            for i in range(150)
        ]
        print(
            eta,
            "clean: warned, kept",
            np.sum(clean, axis=0),
            "K:",
            np.sum(heavy, axis=0),
            flush=True,
        )
