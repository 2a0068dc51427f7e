"""What frames are compared with, and what is said when they do not fit."""

import warnings

import numpy as np
import pytest

from tbdcore import noise, recording
from tbdcore.recording import misfit

LAWS = ("gaussian", "exponential")
NAMES = list(misfit.TOLERANCE)


def rng(seed=1):
    return np.random.default_rng(seed)


def clean(law, shape=(24, 40, 30), seed=1):
    return (noise.gaussian if law == "gaussian" else noise.exponential)(shape, rng(seed))


def with_target(z, law, decibels):
    """Frames with a target that moves by half a cell per frame."""
    path = np.array([8.0, 8.0]) + 0.5 * np.arange(len(z))[:, None]
    strength = 10 ** (decibels / (20 if law == "gaussian" else 10))
    return recording.inject(z, path, strength, 0.8, rng(), law)


def said(frames, law, **told):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        misfit.warn_misfit(frames, law, **told)
    return [str(w.message) for w in caught]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("shape", [(11, 50, 50), (60, 30, 20)])
def test_the_errors_of_clean_frames_are_right(law, shape):
    fits = [misfit.fit(clean(law, shape, seed), law) for seed in range(20)]
    for name in NAMES:
        values, errors = np.array([getattr(fit, name)[:2] for fit in fits]).T
        centre = 1.0 if name.startswith("tail") else 0.0
        bias = name[:4] in ("tail", "spre")  # the largest cell of a small frame is left out
        slope = 1.35 if name.startswith("slope") else 1.0  # the larger of two, of the normal law
        assert abs(np.mean(values) - centre) < 4 * np.mean(errors) / 20**0.5 + 0.04 * bias
        assert 0.5 < np.std(values) / np.mean(errors) < 1.6 * slope
    assert not any(fit.exceeded() for fit in fits)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", ["level", "spread"])
def test_the_errors_of_level_and_spread_are_right_to_a_fifth(law, name):
    fits = [misfit.fit(2.0 * clean(law, (12, 20, 20), seed), law) for seed in range(200)]
    values, errors = np.array([getattr(fit, name)[:2] for fit in fits]).T
    assert np.std(values) / np.mean(errors) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("law", LAWS)
def test_one_frame_has_no_next_one(law):
    fit = misfit.fit(clean(law, (1, 60, 60)), law)
    assert np.isnan(fit.next_frame.value)
    assert fit.exceeded() == []


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("decibels", [11.0, 20.0])
def test_a_target_is_no_misfit(law, decibels):
    for seed in range(4):
        assert said(with_target(clean(law, seed=seed), law, decibels), law) == []


FAULTS = {
    "level": lambda law, z: z + 0.4 if law == "gaussian" else noise.louder(z, 0.5, law),
    "spread": lambda law, z: noise.louder(z, 0.7) if law == "gaussian" else np.sqrt(z),
    "slope_x": lambda law, z: noise.sloped(z, 0.7, 1),
    "slope_y": lambda law, z: noise.sloped(z, 0.7, 2),
    "tail_1e2": lambda law, z: noise.k_power(z.shape, 1.0, rng()),
    "tail_1e3": lambda law, z: noise.k_power(z.shape, 3.0, rng()),
    "next_x": lambda law, z: correlated(law, z, (0.0, 0.3, 0.0)),
    "next_y": lambda law, z: correlated(law, z, (0.0, 0.0, 0.3)),
    "next_frame": lambda law, z: correlated(law, z, (0.3, 0.0, 0.0)),
}


def correlated(law, z, correlation):
    y = noise.correlated(z.shape, correlation, rng())
    return y if law == "gaussian" else noise.as_power(y)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", NAMES)
def test_each_fault_is_named_in_one_line(name, law):
    (line,) = said(FAULTS[name](law, with_target(clean(law), law, 15.0)), law)
    assert "\n" not in line
    assert name in line
    assert "tolerance" in line
    assert "recording." in line


def test_the_tail_beside_a_target_is_that_of_the_noise():
    fits = [
        misfit.fit(with_target(clean("gaussian", (60, 30, 20), s), "gaussian", 20.0))
        for s in range(6)
    ]
    assert np.mean([fit.tail_1e3.value for fit in fits]) == pytest.approx(1.0, abs=0.4)


def test_sizes_are_those_of_the_faults():
    z = clean("gaussian", (40, 50, 40))
    fit = misfit.fit(7.0 + 2.0 * (noise.louder(z, 1.0) + 0.3), mean=7.0, std=2.0)
    assert fit.level.value == pytest.approx(0.3, abs=4 * fit.level.se)
    assert fit.spread.value == pytest.approx(1.0, abs=4 * fit.spread.se)
    power = misfit.fit(
        noise.louder(noise.sloped(clean("exponential"), 0.4), 1.0, "exponential"), "exponential"
    )
    assert power.level.value == pytest.approx(1.0, abs=0.15)
    assert power.slope_x.value == pytest.approx(0.4, abs=0.1)
    y = noise.correlated((40, 50, 40), (0.5, 0.2, 0.3), rng())
    found = misfit.fit(y)
    assert [found.next_frame.value, found.next_x.value, found.next_y.value] == pytest.approx(
        [0.5, 0.2, 0.3], abs=0.03
    )
    heavy = misfit.fit(noise.k_power((40, 50, 40), 1.0, rng()), "exponential")
    assert heavy.tail_1e3.value > heavy.tail_1e2.value > 2.0


def test_the_mending_that_is_named_mends():
    z = noise.sloped(20.0 * clean("exponential", (40, 60, 50)), 0.8)
    assert "normalise" in said(z, "exponential")[0]
    flat = recording.normalise(z, recording.clipped(z, "exponential", 25), "exponential")
    assert said(flat, "exponential") == []
    k = noise.k_power((60, 40, 30), 1.0, rng())
    scores = recording.normal_scores(k, recording.empirical_law(k[:30]))
    assert said(scores, "gaussian") == []


def test_few_cells_say_nothing():
    loud = 3.0 * clean("gaussian", (2, 20, 20))
    assert said(loud, "gaussian") == []
    assert "too few" in str(misfit.fit(loud))
    assert len(said(3.0 * clean("gaussian", (4, 40, 20)), "gaussian")) == 1


@pytest.mark.parametrize("law", LAWS)
def test_gaps_are_left_out(law):
    z = clean(law, (60, 40, 30))
    z[::3], z[:, 4:9] = np.nan, np.nan
    fit = misfit.fit(z, law)
    assert fit.exceeded() == []
    assert fit.next_frame.se < 0.05
    apart = clean(law, (60, 40, 30))
    apart[::2] = np.nan
    assert np.isnan(misfit.fit(apart, law).next_frame.value)
    with pytest.raises(ValueError, match="all are missing"):
        misfit.fit(np.full((3, 4, 5), np.nan), law)


def test_a_table_of_the_fit_has_a_row_for_each_condition():
    rows = str(misfit.fit(3.0 * clean("gaussian"))).splitlines()
    assert [row.split()[0] for row in rows[1:]] == NAMES
    assert [row.endswith("exceeded") for row in rows[1:]] == [n == "spread" for n in NAMES]


def test_the_line_of_the_caller_is_named():
    with pytest.warns(misfit.Misfit) as caught:
        misfit.warn_misfit(3.0 * clean("gaussian"))
    assert caught[0].filename == __file__


def test_three_pairs_of_cells_are_the_fewest_for_a_correlation():
    y = np.array([0.1, 0.5, -0.2, 0.3])[:, None, None]
    found = misfit._correlation(y, 0)
    assert found.value == pytest.approx(np.corrcoef(y[:-1, 0, 0], y[1:, 0, 0])[0, 1])
    assert np.isnan(misfit._correlation(y[:3], 0).value)


@pytest.mark.parametrize("law", ["gaussian", "exponential"])
def test_frames_that_are_stored_twice_are_a_correlation(law):
    z = clean(law, (20, 30, 30))
    found = misfit.fit(np.repeat(z, 2, axis=0), law)
    assert found.next_frame.value == pytest.approx(1.0)
    assert found.exceeded() == ["next_frame"]
    assert "next_frame" in str(found)
