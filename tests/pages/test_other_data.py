"""Data that are not the papers': borders, gaps, targets that leave or vanish, other noise."""

import itertools
from contextlib import nullcontext

import numpy as np
import pytest

import tbdcore
from tbdcore import motion, recording
from tbdcore.recording import misfit

SEEDS = range(4)
LOUD = 1.4  # times the noise that the page is told


# 01: blocks of eight frames


@pytest.fixture(scope="module")
def dp():
    """Tracks of a block above the threshold of blocks with the same gaps."""
    page, rng = tbdcore.page("dp_tbd"), np.random.default_rng(0)
    p = page.Scenario(K=8, grid=(40, 64), M=2)
    noise = rng.standard_normal((200, 8, 40, 64))

    def find(z, name="tonissen"):
        algorithm = getattr(page, name)
        peaks = page.noise_maxima(noise, p, algorithm, like=z)
        return page.detect(z, p, recording.threshold(peaks, 0.05).value, algorithm)

    return find


def block(seed, *targets, noise=1.0, missing=None):
    """Eight frames; a target is (i, j, speed, amplitude).  Returns them and the targets' paths."""
    k, z = np.arange(8), noise * np.random.default_rng(seed).standard_normal((8, 40, 64))
    known = []
    for i, j, speed, amplitude in targets:
        path = np.array([i + speed * k, j + k]).T
        inside = path[:, 0] < 40
        z[k[inside], *path[inside].T] += amplitude
        known.append(path)
    if missing is not None:
        z[missing] = np.nan
    return z, known


def misses(track, path):
    """The distance of a track from a path in cells, frame by frame."""
    return np.abs(track.cells - path).max(axis=1)


@pytest.mark.parametrize("seed", SEEDS)
def test_01_finds_a_target_along_the_border(dp, seed):
    z, (path,) = block(seed, (0, 20, 0, 4.0))
    assert misses(dp(z)[0], path).max() <= 3


def test_01_mostly_stays_at_the_border_where_a_target_leaves(dp):
    """A path of constant velocity cannot; but it is declared in the blocks before."""
    runs = [block(seed, (30, 20, 2, 4.0)) for seed in SEEDS]
    paths = [(dp(z, "conventional")[0], path) for z, (path,) in runs]
    assert np.median([misses(track, path)[:5] for track, path in paths]) <= 1
    assert np.median([track.cells[-1, 0] for track, _ in paths]) >= 35


def test_01_follows_a_target_that_vanishes_as_long_as_it_is_there(dp):
    far = []
    for seed in SEEDS:
        z, (path,) = block(seed, (5, 20, 1, 4.0))
        z[6:] = np.random.default_rng(100 + seed).standard_normal((2, 40, 64))
        far.append(misses(dp(z)[0], path)[:6])
    assert np.median(far) <= 1
    assert np.mean(np.array(far) <= 3) > 0.9


@pytest.mark.parametrize("seed", SEEDS)
def test_01_finds_two_targets_the_stronger_one_first(dp, seed):
    z, targets = block(seed, (5, 10, 1, 6.0), (30, 40, 0, 4.0))
    found = dp(z)
    assert len(found) == 2
    assert all(misses(*pair).max() <= 2 for pair in zip(found, targets, strict=True))


def test_01_declares_power_without_a_target_as_often_as_was_allowed():
    """The threshold is that of the same power; a warning says that power is not normal."""
    page, rng = tbdcore.page("dp_tbd"), np.random.default_rng(0)
    p, power = page.Scenario(K=8, grid=(20, 20), M=2, mean=1.0), (300, 8, 20, 20)
    blocks = rng.standard_exponential(power)
    V_T = recording.threshold(page.noise_maxima(blocks[:200], p), 0.05).value
    with pytest.warns(misfit.Misfit, match="tail"):
        declared = [bool(page.detect(z, p, V_T)) for z in blocks[200:]]
    assert np.mean(declared) <= 0.12, "0.05 asked; three errors of 0.022"


@pytest.mark.slow
def test_01_declares_nothing_in_noise_but_what_was_allowed(dp):
    declared = sum(bool(dp(block(seed)[0])) for seed in range(40))
    assert declared <= 6, "two expected of 40 at 5 %, three errors of 1.4"


@pytest.mark.parametrize("seed", SEEDS)
def test_01_declares_noise_that_is_louder_than_told(dp, seed):
    with pytest.warns(misfit.Misfit, match="spread"):
        assert dp(block(seed, noise=LOUD)[0])


@pytest.mark.parametrize("seed", SEEDS)
def test_01_bridges_a_missing_frame(dp, seed):
    z, (path,) = block(seed, (5, 20, 1, 4.0), missing=4)
    assert misses(dp(z)[0], path).max() <= 3


# 02: forty frames, a target from the eleventh on


def blobs(page, seed, case):
    rng, t = np.random.default_rng(seed), np.arange(40)
    z = 2.3 * (LOUD if case == "loud" else 1.0) * rng.standard_normal((40, 40, 30))
    paths = {"border": (1 + 0 * t, 5 + 0.4 * t), "leaves": (23 + 0.8 * t, 8 + 0.3 * t)}
    x, y = paths.get(case, (8 + 0.5 * t, 8 + 0.3 * t))
    X, Y = np.meshgrid(np.arange(1, 41), np.arange(1, 31), indexing="ij")

    def put(k, x, y):
        z[k] += 18 / (2 * np.pi * 0.36) * np.exp(-((X - x) ** 2 + (Y - y) ** 2) / 0.72)

    last = 25 if case == "vanishes" else 40
    for k in range(10, last) if case not in ("none", "loud") else ():
        put(k, x[k], y[k])
        if case == "two":
            put(k, 35 - 0.2 * k, 25.0)
    if case == "gap":
        z[25] = np.nan
    scene = page.Scene(nx=40, ny=30, blur=0.6, noise=2.3, amplitude=18.0)
    with pytest.warns(misfit.Misfit) if case == "loud" else nullcontext():
        result = page.run(z, page.Scenario(M=3200, M_new=3200, scene=scene), rng)
    return result, np.hypot(result.s[:, 0] - x, result.s[:, 2] - y)


@pytest.mark.parametrize("case", ["border", "leaves", "vanishes", "two", "none", "loud", "gap"])
def test_02(case):
    page = tbdcore.page("mm_pf_tbd")
    runs = [blobs(page, seed, case) for seed in SEEDS]
    share = np.mean([result.declared[10:].mean() for result, _ in runs])
    ends = np.array([distance[-1] for _, distance in runs])
    if case == "border":
        assert share > 0.4
        assert np.median(ends) < 1.5
    elif case in ("leaves", "vanishes"):
        assert not any(result.declared[30:].any() for result, _ in runs)
    elif case == "two":
        other = np.hypot(35 - 0.2 * 39 - 27.5, 25 - 19.7)
        assert share > 0.7
        assert ((ends < 2) | (np.abs(ends - other) < 2)).all()
    elif case == "none":
        assert share < 0.05
    elif case == "loud":
        assert share > 0.5
    else:
        held = [result.declared[25:29].mean() for result, _ in runs if result.declared[24]]
        assert len(held) > 2
        assert np.mean(held) > 0.8


# 03: forty frames of power, an echo from the eleventh on


def echo(page, seed, case):
    rng = np.random.default_rng(seed)
    z = (LOUD if case == "loud" else 1.0) * rng.standard_exponential((40, 64, 48))
    i, j = (0, 0) if case == "border" else (31, 22)
    if case not in ("none", "loud"):
        z[10 : 25 if case == "leaves" else 40, i : i + 3, j : j + 4] *= 6.0
    if case == "two":
        z[10:, 5:8, 5:9] *= 6.0
    if case == "gap":
        z[25] = np.nan
    shape = {"nr": 64, "na": 48, "dr": 5.0, "da": 0.01, "r_min": 2000.0}
    p = page.scenario(**shape, sd_r=1.0, sd_a=1.5, noise=1.0)
    with pytest.warns(misfit.Misfit, match="level") if case == "loud" else nullcontext():
        track = page.run(z, p, rng)

    def distance(i, j):
        r, a = 2000 + 5.0 * (i + 1.5), 0.01 * (j + 2)
        return np.hypot(track.x[20:, 0] - r * np.cos(a), track.x[20:, 2] - r * np.sin(a))

    return track.existence, np.median(distance(i, j)), np.median(distance(5, 5))


@pytest.mark.parametrize("case", ["border", "leaves", "two", "none", "loud", "gap"])
def test_03(case):
    page = tbdcore.page("mda_tbd")
    existence, near, other = zip(*(echo(page, seed, case) for seed in range(3)), strict=True)
    existence = np.array(existence)
    if case in ("border", "two"):
        assert existence[:, 20:].min() > 0.5
        assert (np.minimum(near, other) < 30).all()
    elif case == "leaves":
        assert existence[:, 15:25].min() > 0.5
        assert existence[:, 30:].max() < 0.5
    elif case == "none":
        assert existence.max() < 0.5
    elif case == "loud":
        assert (existence[:, 15:] > 0.5).mean() > 0.9
    else:
        assert existence[:, 25] == pytest.approx(0.01 + 0.98 * existence[:, 24])
        assert existence[:, 24:].min() > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("likelihood", ["cells", "averaged"])
def test_03_a_weak_target_that_vanishes(likelihood):
    page = tbdcore.page("mda_tbd")
    shape = {"nr": 64, "na": 48, "dr": 5.0, "da": 0.01, "r_min": 2000.0, "sd_r": 1.0, "sd_a": 1.5}
    late = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        z = rng.standard_exponential((64, 64, 48))
        z[10:24, 31:34, 22:26] *= 3.0
        track = page.run(z, page.scenario(**shape, noise=1.0, likelihood=likelihood), rng)
        late.append((track.existence[34:] > 0.5).mean())
    assert np.mean(late) > 0.3 if likelihood == "cells" else np.mean(late) < 0.05


# 04: one track through twenty scans


def scans_of_one(seed):
    r, a = 20e3 - 400.0 * np.arange(20), 0.5 + 0.002 * np.arange(20)
    power = 30.0 * np.random.default_rng(seed).standard_exponential(20) + 5.0
    return [np.array([[*plot, s]]) for plot, s in zip(np.c_[r, a], power, strict=True)]


@pytest.mark.parametrize("case", ["gap", "untaken", "gone", "two"])
def test_04(case):
    page, scans = tbdcore.page("track_cfar"), scans_of_one(1)
    p = page.Scenario(scan=4.0, bandwidth=5.0, beamwidth=1.5, sigma_p=1.0)
    alone = page.run(scans, p, accuracy=(10.0, 0.002))
    if case == "gap":
        scans[8] = np.empty((0, 3))
    elif case == "untaken":
        scans[8] = None
    elif case == "gone":
        scans[8:] = [np.empty((0, 3))] * 12
    else:
        scans[2:] = [np.r_[scan, [[9e3, 0.1, 60.0]]] for scan in scans[2:]]
    tracks = page.run(scans, p, accuracy=(10.0, 0.002))
    counted = [track.misses for track in tracks]
    if case == "gap":
        assert counted == [0] * 6 + [1] + [0] * 11
    elif case == "untaken":
        assert counted == [0] * 18
    elif case == "gone":
        assert counted == [0] * 6 + list(range(1, p.miss_limit + 1))
    else:
        assert all(np.array_equal(a.x, b.x) for a, b in zip(alone, tracks, strict=True))


# 05: two boats, sixty scans


def boats(case, seed):
    page, rng = tbdcore.page("ljipda_ai"), np.random.default_rng(seed)
    x = np.array([[5000.0, 10, 0, 5], [5000.0, 10, 300, -5]])
    truth = [x[:, ::2] + k * x[:, 1::2] for k in range(60)]
    scans = [t + 20.0 * rng.standard_normal((2, 2)) for t in truth]
    if case == "gap":
        scans[30] = np.empty((0, 2))
    elif case == "untaken":
        scans[30] = None
    elif case == "gone":
        scans = [scan[:1] if k >= 45 else scan for k, scan in enumerate(scans)]
    elif case != "plain":
        area = [4800, -300], [6000, 600]
        scans = [np.r_[scan, rng.uniform(*area, size=(40, 2))] for scan in scans]
    clutter = (
        "estimate" if case == "estimate" else 1e-7
    )  # plots per m^2; there are 4e-5 in two cases
    F, Q = motion.cv(1.0), motion.white_acceleration(1.0, 0.01)
    start = x, np.diag([400.0, 1, 400, 1]), F, Q, 20.0, 0.2
    known = page.Setup(*start, p_detect=0.95, clutter=clutter)
    said = pytest.warns(misfit.Misfit, match="clutter") if case == "little" else nullcontext()
    with said:
        result = page.run(scans, known, method="LJIPDA")
    return result, np.hypot(*(result.x[-1][:, ::2] - truth[-1]).T)


@pytest.mark.parametrize("case", ["gap", "untaken", "gone", "little", "estimate"])
def test_05(case):
    for seed in range(3):
        result, distance = boats(case, seed)
        if case == "gap":
            assert (result.existence[30] > 0.6).all()
            assert (result.existence[30] < 0.9).all()
            assert result.existence[-1].min() > 0.95
        elif case == "untaken":  # p11 = 0.99
            assert np.allclose(result.existence[30], 0.99 * result.existence[29])
        elif case == "gone":
            untouched, _ = boats("plain", seed)
            assert result.existence[-1][1] < 0.01
            assert np.allclose(result.x[-1][0], untouched.x[-1][0], atol=10)
        else:
            assert distance.max() < 60
            assert result.existence[-1].min() > 0.85


def pair_of_boats(rng, merged):
    """Eighty scans of two boats 22 m apart, whose plots are merged in a share of them; truth."""
    x = np.array([[800.0, 3, 300, 1], [800.0, 3, 322, 1]])
    truth = np.array([x[:, ::2] + 2.5 * k * x[:, 1::2] for k in range(80)])
    scans = [truth[0]]
    for places in truth[1:]:
        seen = places.mean(axis=0, keepdims=True) if rng.random() < merged else places
        z = seen[rng.random(len(seen)) < 0.9]
        false = places[0] + rng.uniform(-500, 500, (rng.poisson(2.0), 2))
        scans.append(np.r_[z + 6.0 * rng.standard_normal(z.shape), false])
    return x, scans, truth


def test_05_close_targets_without_amplitudes():
    """JIPDA keeps more pairs than LJIPDA; where plots are merged, none keeps many."""
    page, kept = tbdcore.page("ljipda_ai"), {}
    for merged, method in itertools.product((0.0, 0.8), ("JIPDA", "LJIPDA", "IPDA")):
        good = []
        for seed in range(40):
            x, scans, truth = pair_of_boats(np.random.default_rng(seed), merged)
            motions = motion.cv(2.5), motion.white_acceleration(2.5, 0.01)
            setup = page.Setup(x, np.diag([36.0, 1, 36, 1]), *motions, 6.0, 0.3, p_detect=0.9)
            found = page.states(scans, setup, method)[0][-20:, :, ::2]
            good.append((np.hypot(*np.moveaxis(found - truth[-20:], -1, 0)).mean(0) < 11).all())
        kept[merged, method] = np.mean(good)
    assert kept[0.0, "JIPDA"] - kept[0.0, "LJIPDA"] > 0.1, "0.3 in a hundred, less 2 errors"
    assert max(kept[0.8, method] for method in ("JIPDA", "LJIPDA", "IPDA")) < 0.3


def test_04_follows_one_of_two_whose_plots_merge():
    page, rng = tbdcore.page("track_cfar"), np.random.default_rng(1)
    x, scans, truth = pair_of_boats(rng, 0.8)
    polar = [np.c_[np.hypot(*z.T), np.arctan2(z[:, 1], z[:, 0])] for z in scans[1:]]
    p = page.Scenario(scan=2.5, bandwidth=10.0, beamwidth=1.0, sigma_p=0.1)
    tracks = page.run(polar, p, accuracy=(6.0, 0.007), start=(x[0], np.diag([36.0, 1, 36, 1])))
    assert len(tracks) == len(polar)
    off = np.array([np.hypot(*(t.x[::2] - z).T) for t, z in zip(tracks, truth[1:], strict=True)])
    assert np.median(off.min(axis=1)) < 15
