"""False plots of a gate, and the level of the noise, against counts and closed forms."""

import math

import numpy as np
import pytest

from tbdcore.kernels import track_cfar


@pytest.mark.slow
def test_false_plots_fire_as_independent_cells():
    """Counts over many draws: P(at least one), the mean number, and where in the gate."""
    rng, n, p = np.random.default_rng(2), 60_000, 0.3
    centre, half, cell = (1030.0, 0.05), (70.0, 0.03), (100.0, 0.04)
    low, high = np.array(centre) - half, np.array(centre) + half
    edges = [
        np.arange(np.floor(a / w), np.ceil(b / w) + 1) * w
        for a, b, w in zip(low, high, cell, strict=True)
    ]
    shares = [
        np.diff(np.clip(e, a, b)) / w for e, a, b, w in zip(edges, low, high, cell, strict=True)
    ]
    beta = np.outer(*shares).ravel()
    counts, places = np.zeros(n, int), []
    for m, (u, v0, v1) in enumerate(rng.random((n, 3))):
        while (plot := track_cfar.false_plot(u, (v0, v1), centre, half, cell, p, counts[m]))[0]:
            counts[m] += 1
            places.append(plot[1:])
    none = np.prod(1 - beta * p)
    assert abs((counts == 0).mean() - none) < 4 * np.sqrt(none * (1 - none) / n)
    assert abs(counts.mean() - (beta * p).sum()) < 4 * np.sqrt(
        (beta * p * (1 - beta * p)).sum() / n
    )
    places = np.array(places)
    assert (np.abs(places) <= half).all()
    np.testing.assert_allclose(
        places.mean(axis=0) / half, 0, atol=4 / np.sqrt(3 * len(places)) * 1.2
    )  # uniform in the gate


def test_the_noise_level_is_that_above_the_lowest_tenth():
    lam = 3.0 + np.random.default_rng(2).standard_exponential(2000)
    low, level, error = track_cfar.noise_level([np.column_stack([lam, lam, lam])])
    above = np.sort(lam)[200:]
    assert low == above[0]
    assert level == pytest.approx(10 * math.log10(np.median(above - low) / math.log(2)))
    assert error == pytest.approx(6.5 / math.sqrt(1800))
    assert track_cfar.noise_level([None, np.empty((0, 3))]) == (0.0, 0.0, np.inf)
    assert track_cfar.noise_level([np.ones((998, 3))])[2] == np.inf
