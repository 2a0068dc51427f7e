"""Thresholds from few blocks, windows of the same frames, and what is said beside a result."""

import functools

import numpy as np
import pytest
from scipy import stats

from tbdcore import noise, recording
from tbdcore.recording.misfit import Misfit

LAWS = [stats.gumbel_r(5.0, 2.0), stats.norm(), stats.expon()]


def rng(seed=1):
    return np.random.default_rng(seed)


def largest(blocks):
    return blocks.reshape(len(blocks), -1).max(axis=1)


def test_thirteen_blocks_are_enough_for_one_in_fourteen():
    found = recording.threshold(rng().standard_cauchy((13, 20_000)), 1 / 14)
    assert stats.cauchy.sf(found.value).mean() == pytest.approx(1 / 14, rel=0.03)
    assert (found.low, found.high) == pytest.approx(stats.beta(1, 13).interval(0.95))
    with pytest.raises(ValueError, match='give 19 blocks, a larger p_false, or tail="gumbel"'):
        recording.threshold(rng().standard_normal(13), 0.05)


@pytest.mark.parametrize("n", [13, 40])
@pytest.mark.parametrize("p", [0.02, 0.002])
def test_the_law_of_gumbel_delivers_its_rate_and_interval(n, p):
    law = LAWS[0]
    found = recording.threshold(law.rvs((n, 20_000), random_state=rng()), p, tail="gumbel")
    shares = law.sf(found.value)
    assert 0.4 * p < shares.mean() < 1.1 * p  # as the docstring says
    inside = ((shares > found.low) & (shares < found.high)).mean()
    assert inside == pytest.approx(0.95, abs=0.035)


@pytest.mark.parametrize("law", LAWS[1:], ids=["normal", "exponential"])
def test_largest_values_of_noise_follow_the_law_of_gumbel(law):
    """Of 2,000 cells; 20 blocks, one false declaration in 200."""
    blocks = law.isf(-np.expm1(np.log(rng().random((20, 20_000))) / 2000))
    found = recording.threshold(blocks, 0.005, tail="gumbel")
    delivered = -np.expm1(2000 * np.log1p(-law.sf(found.value)))
    assert 0.4 * 0.005 < delivered.mean() < 1.1 * 0.005


def test_windows_cover_the_frames_and_do_not_overlap():
    z = np.arange(21 * 13 * 9.0).reshape(21, 13, 9)
    cut = recording.windows(z, 5, (4, 3))
    assert cut.blocks.shape == (4 * 3 * 3, 5, 4, 3)
    assert len(np.unique(cut.blocks)) == cut.blocks.size
    for block, (k, i, j) in zip(cut.blocks, cut.corner, strict=True):
        assert (block == z[k : k + 5, i : i + 4, j : j + 3]).all()
    assert cut.control.sum() == 18
    for axis in range(3):  # neighbours are in different parts
        part = cut.control.reshape(4, 3, 3)
        assert (np.diff(part.astype(int), axis=axis) != 0).all()


def test_windows_stay_away_from_the_target():
    z, path = np.zeros((20, 20, 20)), np.full((20, 2), np.nan)
    path[:10] = [4.0, 4.0]
    z[:10, 4, 4] = 1.0
    cut = recording.windows(z, 5, (5, 5), away=path, margin=2.0)
    assert not cut.blocks.any()
    assert len(cut.blocks) == 64 - 2 * 4  # two times, four windows near the corner (4, 4)
    assert len(recording.windows(z, 5, (5, 5), away=(12, 12), margin=1.0).blocks) == 4 * 15
    for bad in (np.ones(3), np.ones((19, 2)), "here"):
        with pytest.raises(ValueError, match="recording.windows: away"):
            recording.windows(z, 5, (5, 5), away=bad)
    for K, side in ((21, (5, 5)), (5, (30, 5)), (20, (20, 20))):
        with pytest.raises(ValueError, match="recording.windows: frames: .* give smaller windows"):
            recording.windows(z, K, side)


def test_blocks_that_hold_a_target_are_named():
    white = largest(noise.gaussian((60, 5, 20, 20), rng()))
    peaks = largest(noise.gaussian((40, 5, 20, 20), rng(2)))
    assert recording.suspects(peaks, white).tolist() == []
    peaks[[3, 17]] += 4.0
    assert recording.suspects(peaks, white).tolist() == [3, 17]
    with pytest.raises(ValueError, match="recording.suspects: white"):
        recording.suspects(peaks, white[:9])


def test_noise_seldom_seems_to_hold_a_target():
    named = 0
    for seed in range(200):
        z = largest(noise.gaussian((100, 3, 15, 15), rng(seed)))
        named += len(recording.suspects(z[:50], z[50:])) > 0
    assert named <= 8  # one in a hundred, more by the error of the law


def of(z, seed=3, p=0.1, law="gaussian"):
    """The outcome of the largest cell of windows."""
    cut = recording.windows(z, 5, (20, 20))
    peaks = largest(cut.blocks)
    make = noise.gaussian if law == "gaussian" else noise.exponential
    white = largest(make(cut.blocks.shape, rng(seed)))
    level = recording.threshold(peaks[~cut.control], p)
    return recording.outcome(z, level, peaks[~cut.control], white, peaks[cut.control], law)


@pytest.mark.parametrize("law", ["gaussian", "exponential"])
def test_an_outcome_is_a_line(law):
    make = noise.gaussian if law == "gaussian" else noise.exponential
    z = make((50, 60, 60), rng())
    z[:, :6] = np.nan
    found = of(z[:, 6:], law=law)
    assert (found.holds, found.faults) == ([], [])
    assert found.threshold == pytest.approx(found.white, rel=0.1)
    assert found.promised == pytest.approx(0.1 * found.blocks)
    assert found.chance > 0.01
    assert "\n" not in str(found)
    assert f"{found.declared} of {found.blocks} declared" in str(found)
    z = recording.windows(z, 5, (20, 20)).blocks[0]
    assert of(make((50, 60, 60), rng()), law=law).used == 1.0
    assert np.isnan(z).mean() == pytest.approx(0.3)


def test_the_chance_of_a_control_is_that_of_both_halves():
    """Under the law of the noise it is uniform, but for steps: below 5 % in 5 %."""
    chances = [of(noise.gaussian((50, 60, 60), rng(seed)), seed + 1).chance for seed in range(60)]
    assert np.mean(np.array(chances) < 0.05) <= 0.12


def delivered(choose, p=0.1):
    """Share of the blocks of the control declared, of 80 recordings, and its error.

    The level of the noise differs from place to place; choose(own, white) are the blocks of the
    threshold.
    """
    white, shares = largest(noise.gaussian((200, 5, 10, 10), rng())), []
    for seed in range(80):
        level = np.exp(0.4 * rng(seed).standard_normal((6, 6))).repeat(10, 0).repeat(10, 1)
        cut = recording.windows(level * noise.gaussian((20, 60, 60), rng(seed)), 5, (10, 10))
        peaks = largest(cut.blocks)
        own, control = peaks[~cut.control], peaks[cut.control]
        shares.append((control > recording.threshold(choose(own, white), p).value).mean())
    return np.mean(shares), np.std(shares) / len(shares) ** 0.5


def test_a_control_declares_what_is_promised_where_the_level_differs_between_blocks():
    share, error = delivered(lambda own, white: own)
    assert error < 0.01
    assert share == pytest.approx(0.1, abs=3 * error)


def test_blocks_left_out_of_the_threshold_alone_break_its_promise():
    share, error = delivered(lambda own, white: np.delete(own, recording.suspects(own, white)))
    assert share > 0.1 + 5 * error


def test_a_control_that_exceeds_its_promise_is_said():
    z, peaks = noise.gaussian((10, 20, 20), rng()), np.linspace(3.0, 4.0, 40)
    level = recording.threshold(peaks, 0.1)
    more, few = (recording.outcome(z, level, peaks, peaks, peaks[-n:]) for n in (4, 40))
    assert more.chance < 0.01 < few.chance
    assert (more.exceeds, few.exceeds) == (True, False)
    assert ["more than promised" in str(found) for found in (more, few)] == [True, False]


def beyond(z, seed=3, times=10):
    """The outcome at a rate so many times below what the blocks show, by the law of the tail."""
    cut = recording.windows(z, 5, (10, 8))
    peaks, white = largest(cut.blocks), largest(noise.gaussian((200, 5, 10, 8), rng(seed)))
    own = peaks[~cut.control]
    level = recording.threshold(own, 1 / times / (len(own) + 1), tail="gumbel")
    return recording.outcome(z, level, own, white, peaks[cut.control])


def bright(share):
    """Frames of white noise with a target of 8 standard deviations in a share of the windows."""
    z = noise.gaussian((20, 40, 32), rng(1))
    z[2::5, 5::10, 4::8] += 8.0 * (rng(2).random((4, 4, 4)) < share)
    return z


HEAVY = [
    (lambda: rng().standard_t(5, (20, 40, 32)) * 0.6**0.5, "the noise does not fit: .*tail_1e3"),
    (lambda: bright(0.2), "blocks that seem to hold a target: [0-9]"),
]


@pytest.mark.parametrize(("make", "why"), HEAVY, ids=["tail", "targets"])
def test_a_rate_beyond_the_blocks_is_refused_where_its_law_may_fail(make, why):
    with pytest.raises(ValueError, match=f"32 blocks cannot show 0.003; {why}") as said:
        beyond(make())
    assert "give 329 blocks, or p_false = 0.0304 or more" in str(said.value)
    assert beyond(make(), times=1).chance > 0.01
    assert beyond(noise.gaussian((20, 40, 32), rng())).promised == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize("n", [19, 48, 97, 102])
def test_n_blocks_show_one_in_n_and_one(n):
    """The smallest rate, written as a user does: for some n it is rounded down."""
    level = recording.threshold(np.arange(n) + 1.0, 1 / (n + 1))
    assert level.value == n


def test_a_rate_beyond_the_blocks_that_is_not_refused_is_kept():
    """White noise, and noise whose level differs from place to place by less than is found."""
    promised = declared = refused = 0
    for seed in range(200):
        level = np.exp(0.05 * rng(seed).standard_normal((4, 4))).repeat(10, 0).repeat(8, 1)
        try:
            found = beyond((level if seed % 2 else 1.0) * noise.gaussian((20, 40, 32), rng(seed)))
        except ValueError:
            refused += 1
        else:
            promised, declared = promised + found.promised, declared + found.declared
    assert refused < 20
    assert declared <= promised + 2 * promised**0.5


def test_targets_in_all_blocks_are_named():
    """A target of six standard deviations in each frame of white noise."""
    z = noise.gaussian((50, 60, 60), rng())
    assert len(of(z).holds) == 0
    z[np.arange(50), 10 + np.arange(50) % 40, 30] += 6.0
    found = of(z)
    assert found.faults == []
    cut = recording.windows(z, 5, (20, 20))
    frame, row, column = cut.corner[~cut.control].T
    at = 10 + (frame + 2) % 40  # the target's row in the middle of a block
    inside = (abs(at - row - 9.5) < 7) & (column == 20)
    assert inside.any()
    assert set(np.flatnonzero(inside).tolist()) <= set(found.holds)
    assert "seem to hold a target" in str(found)


def test_a_dark_target_is_named():
    z = noise.gaussian((50, 60, 60), rng())
    z[np.arange(50), 10, 30] -= 9.0
    assert of(z).dark < -8
    assert "-frames" in str(of(z))
    assert np.isnan(of(-z).dark)


def test_cells_that_are_lost_are_said():
    """Thresholded frames: zeros, and 2 % of the cells above the threshold."""
    z = np.where(rng().random((60, 24, 24)) < 0.02, 240.0, 0.0)
    with pytest.raises(ValueError, match="recording.plots"):
        recording.normalise(z, recording.background(z))
    z[:, :2] = noise.gaussian((60, 2, 24), rng())
    with pytest.warns(Misfit, match="no spread.*recording.plots"):
        lost = recording.normalise(z, recording.background(z))
    assert np.isnan(lost).mean() > 0.9
    half = np.maximum(noise.gaussian((20, 24, 24), rng()), -0.5)
    with pytest.warns(Misfit, match="the lowest value, -0.5"):
        recording.normalise(half, recording.clipped(half))


def test_a_target_that_the_background_takes_is_said():
    z = noise.gaussian((60, 30, 20), rng())
    fast = recording.kept(z, 0.5, 8.0, 0.6, recording.background, rng())
    assert fast > 0.85
    with pytest.warns(Misfit, match="keeps"):
        slow = recording.kept(z, 0.0, 8.0, 0.6, recording.background, rng())
    assert slow < 0.2
    power = noise.exponential((60, 30, 20), rng())
    prepare = functools.partial(recording.background, law="exponential")
    with pytest.warns(Misfit, match="keeps"):
        recording.kept(power, 0.0, 60.0, 0.6, prepare, rng(), "exponential")


ETAS = [("gaussian", 1.5), ("gaussian", 3.0), ("exponential", 1.5), ("exponential", 2.3)]


@pytest.mark.parametrize(("law", "eta"), ETAS)
def test_the_strength_of_joined_cells_has_the_law_of_a_cell(law, eta):
    make = noise.gaussian if law == "gaussian" else noise.exponential
    known = stats.norm() if law == "gaussian" else stats.expon()
    z = make((10, 80, 80), rng())
    found = np.concatenate(recording.plots(z, eta, law, level=True))[:, 2]
    p = known.sf(found) / known.sf(eta)
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    strong = np.zeros((1, 9, 9)) + (law == "exponential")
    strong[0, 4, 4:6] = 100.0, 50.0
    (plot,) = recording.plots(strong, eta, law, level=True)
    lost = 100.0 - plot[0, 2]
    assert 0 < lost < 1
    if law == "exponential":
        assert lost == pytest.approx(np.log(2.0))
