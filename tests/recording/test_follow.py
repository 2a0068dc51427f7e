"""Tracks that start and end, with the tracker of chapter 05 and with simple ones."""

from collections import namedtuple

import numpy as np
import pytest

import tbdcore
from tbdcore import recording

SIGMA, FASTEST = 2.0, 8.0
State = namedtuple("State", "x P existence")


def started(x, P):
    return State(x, P, np.full(len(x), 0.5))


def predicted(state, scan, T):
    """A tracker that only predicts."""
    weights = np.zeros((len(state.x), 1 + (0 if scan is None else len(scan))))
    return state._replace(x=state.x + T * np.roll(state.x * [0, 1, 0, 1], -1, axis=1)), weights


def with_05(method="JIPDA", p_detect=0.8):
    """start and step of chapter 05, 14 km away."""
    page, angle = tbdcore.page("ljipda_ai"), np.degrees(SIGMA / (1e4 * 2**0.5))

    def setup(x, P, T=1.0):
        F, Q = page.motion.cv(T), page.motion.white_acceleration(T, 0.1)
        return page.Setup(x, P, F, Q, SIGMA, angle, p_detect=p_detect, p_start=0.5)

    return {
        "start": lambda x, P: page.start(setup(x, P)),
        "step": lambda state, scan, T: page.step(state, scan, setup(state.x, state.P, T), method),
    }


def scene(seed, K=50, clutter=4, last=50):
    """Times, scans and places (K, 2, 2) of two targets; the second is there from scan 15 on."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.9, 1.1, K))
    x = np.stack([np.c_[3 * t, 4 * t - 60], np.c_[250 - 4 * t, 90 - 2 * t]], axis=1)
    x[:15, 1] = np.nan
    x[last:] = np.nan
    scans = []
    for places in x:
        seen = places[(rng.random(2) < 0.9) & ~np.isnan(places[:, 0])]
        false = rng.uniform(-300, 300, (clutter, 2))
        scans.append(np.r_[seen + SIGMA * rng.standard_normal(seen.shape), false] + 1e4)
    return t, scans, x + 1e4


@pytest.mark.parametrize("seed", range(3))
def test_each_target_has_a_track_of_one_name_from_its_start_to_its_end(seed):
    t, scans, x = scene(seed, last=40)
    tracks = recording.follow(scans, t, FASTEST, SIGMA, **with_05())
    assert sorted(set(tracks.track.tolist())) == list(range(tracks.track.max() + 1)), "from 0 on"
    tracks = tracks.declared()
    for target, first in ((0, 4), (1, 24)):  # three plots in a row start a track
        names = []
        for k in range(first, 40):
            d = np.hypot(*(tracks.at(k)[:, ::2] - x[k, target]).T)
            names += tracks.track[tracks.scan == k][d < 15].tolist()[:1]
        assert len(names) > 0.9 * (40 - first)
        assert len(set(names)) == 1
    last = {n: tracks.scan[tracks.track == n].max() for n in set(tracks.track.tolist())}
    assert max(last.values()) < 49, "tracks end when their targets are gone"


def test_without_targets_no_more_tracks_are_declared_than_promised():
    """Of false tracks that start at 0.5 at most one in nine ever has an existence of 0.9."""
    started, above = 0, 0
    for seed in range(20):
        t, scans, _ = scene(seed, clutter=40, last=0)
        tracks = recording.follow(scans, t, FASTEST, SIGMA, **with_05())
        started += len(set(tracks.track.tolist()))
        above += len(set(tracks.declared(scans=1).track.tolist()))
    assert started > 30
    assert above <= started / 9


def test_scans_that_were_not_taken_are_bridged():
    t, scans, x = scene(1, clutter=0)
    scans[25:28] = [None] * 3
    tracks = recording.follow(scans, t, FASTEST, SIGMA, **with_05()).declared()
    before, after = (set(tracks.track[tracks.scan == k].tolist()) for k in (24, 30))
    assert before & after
    assert np.isin([25, 26, 27], tracks.scan).all()


def test_a_twin_ends_and_the_older_track_stays():
    t, line = np.arange(12.0), np.c_[3.0 * np.arange(12), np.full(12, 50.0)]
    scans = [np.repeat(z[None], 2, axis=0) + [[0.0, 0], [0.01, 0]] for z in line]
    tracks = recording.follow(scans, t, FASTEST, SIGMA, started, predicted)
    assert set(tracks.track.tolist()) == {0}


def test_a_low_existence_ends_a_track():
    def fading(state, scan, T):
        state, weights = predicted(state, scan, T)
        return state._replace(existence=0.1 * state.existence), weights

    t, z = np.arange(10.0), np.c_[3.0 * np.arange(10), np.full(10, 50.0)]
    scans = [*z[:3, None], *[np.empty((0, 2))] * 7]
    tracks = recording.follow(scans, t, FASTEST, SIGMA, started, fading, low_scans=3)
    assert tracks.scan.tolist() == [2, 3, 4]  # low in scans 3, 4 and 5


def test_tracks_of_no_plots_are_none():
    tracks = recording.follow([np.empty((0, 2))] * 4, np.arange(4.0), 1.0, 1.0, started, predicted)
    assert [len(field) for field in tracks] == [0] * 5
    assert len(tracks.declared().track) == 0


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"t": np.arange(4.0)}, "scans"),
        ({"t": np.arange(5.0)[::-1]}, "t"),
        ({"t": 1000 * np.arange(5.0)}, "t"),
        ({"scans": None}, "scans"),
        ({"scans": [np.ones((2, 1))] * 5}, "scans"),
        ({"start": lambda x, P: (x, P)}, "start"),
        ({"start": 3}, "start"),
        ({"step": lambda state, scan, T: state}, "step"),
        ({"step": lambda state, scan, T: (state, np.ones((1, 9)))}, "step"),
        ({"step": None}, "step"),
    ],
)
def test_bad_arguments_are_named_in_a_line(change, name):
    good = {"scans": [np.array([[3.0 * k, 100.0]]) for k in range(5)], "t": np.arange(5.0)}
    good |= {"fastest": 4.0, "sigma": 0.5, "start": started, "step": predicted}
    assert len(recording.follow(**good).track) == 3
    with pytest.raises(ValueError, match=rf"recording\.follow: {name}") as refused:
        recording.follow(**(good | change))
    assert "\n" not in str(refused.value)


def test_the_state_of_the_tracker_may_have_more_fields():
    assert State._fields == ("x", "P", "existence")
    assert len(tbdcore.page("ljipda_ai").State._fields) > 3
