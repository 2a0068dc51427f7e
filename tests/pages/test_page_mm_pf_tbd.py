"""The page of mm_pf_tbd as a module: exact answers, invariances, one line for each bad input."""

import os
import subprocess
import sys
import textwrap
from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from benchmarks import mm_pf_tbd_methods as study
from tbdcore.kernels import mm_pf_tbd
from tbdcore.recording import misfit
from tbdcore.repro import paths, studies
from tbdcore.state import load, save


@pytest.fixture(scope="module")
def page():
    return tbdcore.page("mm_pf_tbd")


@pytest.fixture(scope="module")
def scene_frames(page):
    return page.simulate(page.Scene(), np.random.default_rng(1))


def test_an_empty_scene_is_the_noise_of_its_generator(page):
    s = page.Scene()
    empty = page.simulate(s, np.random.default_rng(1), fade=0.0)
    noise = np.random.default_rng(1).normal(0.0, s.noise, empty.shape)
    np.testing.assert_array_equal(empty, noise)


def test_the_target_is_scaled_up_to_a_limit(page):
    s, rng = page.Scene(frames=8), np.random.default_rng(1)
    for fade in (1e9, -1e9):
        assert np.isfinite(page.simulate(s, rng, fade)).all()
        with pytest.raises(ValueError, match="fade"):
            page.simulate(s, rng, np.nextafter(fade, 2 * fade))


def test_the_regimes_of_the_path_are_its_legs(page):
    regimes = page.path(page.Scene())[1]
    legs = [0] * 6 + [1] * 15 + [2] * 6 + [1] * 10 + [2] * 6 + [1] * 12 + [0] * 5
    assert regimes.tolist() == legs


def classic(page, **change):
    return replace(page.Scenario(M_new=0, M=400), **change)


STATES = tuple((x, vx, y, 0.25, 0.5) for x in (2.0, 4.0) for y in (2.0, 3.0) for vx in (-0.5, 0.5))


def enumerate_bayes(page, z, p, mix):
    """Existence by a recursion over whole histories: (birth state, birth frame, word over CV and
    CT), one dictionary per frame.

    Nothing is shared with the page: motion by the rotation of the velocity along the arc,
    likelihood by a double loop.
    """
    Pi, s, omega = p.prior.Pi, p.scene, p.prior.left[0]
    births = {
        (tuple(state[:4]), r): q / len(STATES)
        for state in STATES
        for r, q in ((1, p.prior.cv), (2, p.prior.ct))
    }

    def moved(state, r):
        x, vx, y, vy = state
        if r == 1:
            return (x + vx, vx, y + vy, vy)
        v, heading = np.hypot(vx, vy), np.arctan2(vy, vx)
        chord, half = v * np.sin(omega / 2) / (omega / 2), heading + omega / 2
        return (
            x + chord * np.cos(half),
            v * np.cos(heading + omega),
            y + chord * np.sin(half),
            v * np.sin(heading + omega),
        )

    def ratio(frame, state):
        total = 0.0
        for i in range(1, s.nx + 1):
            for j in range(1, s.ny + 1):
                h = (
                    s.amplitude
                    / (2 * np.pi * s.blur**2)
                    * np.exp(-((i - state[0]) ** 2 + (j - state[2]) ** 2) / (2 * s.blur**2))
                )
                total += h * (2 * frame[i - 1, j - 1] - h) / (2 * s.noise**2)
        return np.exp(total)

    alive, dead, out = dict(births), p.prior.absent, []
    for frame in z:
        before = {key: (1 - mix) * w for key, w in alive.items()}
        for key, w in births.items():
            before[key] = before.get(key, 0.0) + mix * w
        dead, alive = (1 - mix) * dead + mix * p.prior.absent, {}
        for (state, r), w in before.items():
            for after in (1, 2):
                key = (moved(state, after), after)
                alive[key] = alive.get(key, 0.0) + w * Pi[r][after]
        for state in STATES:
            for after in (1, 2):
                key = (tuple(state[:4]), after)
                alive[key] = alive.get(key, 0.0) + dead * Pi[0][after] / len(STATES)
        dead = dead * Pi[0][0] + sum(w * Pi[r][0] for (_, r), w in before.items())
        alive = {key: w * ratio(frame, key[0]) for key, w in alive.items()}
        total = dead + sum(alive.values())
        dead, alive = dead / total, {key: w / total for key, w in alive.items()}
        out.append(1 - dead)
    return np.array(out)


@pytest.fixture(scope="module")
def small(page):
    """A 5 by 4 image, four frames, all three regimes at work."""
    short = page.Scene(
        nx=5,
        ny=4,
        amplitude=7.0,
        x=2.0,
        y=2.0,
        speed=0.5,
        appear=2,
        frames=4,
        legs=((2, 2), (3, 4), (9, 8), (9, 8), (9, 8)),
        turns=(0.5, 0.0),
    )
    prior = page.Prior(accel=0.0, left=(0.5, 0.5), right=(0.5, 0.5))
    p = page.Scenario(scene=short, prior=prior, gate="never")
    return p, page.simulate(short, np.random.default_rng(2))


@pytest.fixture
def lattice(page, small, monkeypatch):
    """The same with eight birth states instead of a law."""
    states = np.array(STATES)
    monkeypatch.setattr(page, "draw_states", lambda n, _, rng: states[rng.integers(8, size=n)])
    return small


@pytest.mark.parametrize(("new", "mix"), [(0, 0.0), (1, 0.5)])
def test_particles_converge_to_exact_bayes(page, lattice, new, mix):
    """Mean of 60 runs within 4 standard errors (and the O(1/M) bias) of the enumeration; the
    improved filter at the mixed prior.
    """
    p, z = lattice
    exact = enumerate_bayes(page, z, p, mix)
    runs = np.array(
        [
            page.recursion(
                z, replace(p, M=4000, M_new=4000 * new), np.random.default_rng([3, i])
            ).existence
            for i in range(60)
        ]
    )
    assert (np.abs(runs.mean(axis=0) - exact) < 4 * runs.std(axis=0) / np.sqrt(60) + 2 / 4000).all()


def test_the_error_falls_with_the_square_root_of_the_particles(page, lattice):
    p, z = lattice
    exact = enumerate_bayes(page, z, p, 0.0)

    def error(M):
        runs = [
            page.recursion(z, replace(p, M=M, M_new=0), np.random.default_rng([4, i])).existence
            for i in range(40)
        ]
        return np.sqrt(np.mean((np.array(runs) - exact) ** 2))

    assert error(200) / error(12_800) == pytest.approx(8, rel=0.4)


@pytest.mark.parametrize(
    ("new", "limit", "first"), [(0, 0.5, (0.18, 0.244)), (1, 7 / 30, (0.18, 0.212))]
)
def test_without_signal_the_filter_is_its_prior(page, new, limit, first):
    """Chain to 1/2, mixed with new particles to 7/30; 40 000 particles, neighbours dependent."""
    blind = page.Scene(amplitude=0.0)
    p = page.Scenario(M=40_000, M_new=40_000 * new, scene=blind)
    r = page.recursion(np.zeros((40, 30, 20)), p, np.random.default_rng(5))
    assert np.allclose(r.existence[:2], first, atol=0.008)
    assert r.existence[-1] == pytest.approx(limit, abs=0.02)
    assert not r.followed.any()


def test_no_new_particles_is_the_classic_filter_bit_for_bit(page, scene_frames):
    runs = [
        page.run(scene_frames, classic(page, gate=g, eta=e, N=N), np.random.default_rng(6))
        for g, e, N in (("absence", 0.43, 3), ("always", 0.9, 1), ("never", 0.1, 9))
    ]
    for r in runs[1:]:
        assert (r.existence == runs[0].existence).all()


def test_scaling_the_image_and_its_parameters_changes_nothing(page, scene_frames):
    s = page.Scene()
    loud = replace(s, amplitude=4 * s.amplitude, noise=4 * s.noise)
    a = page.run(scene_frames, classic(page), np.random.default_rng(7))
    b = page.run(4 * scene_frames, classic(page, scene=loud), np.random.default_rng(7))
    assert (a.existence == b.existence).all()


def test_a_strong_target_is_found_at_once_and_held(page):
    strong = page.Scene(amplitude=60.0)
    z = page.simulate(strong, np.random.default_rng(8))
    p = page.Scenario(M=4000, M_new=1000, scene=strong)
    r = page.bernoulli(z, p, np.random.default_rng(9))
    truth = page.path(strong)[0]
    assert r.declared[7:55].all()
    assert not r.declared[57:].any()
    assert 0.2 < r.turning[8:55].mean() < 0.8
    assert np.nanmax(np.hypot(r.s[8:55, 0] - truth[8:55, 0], r.s[8:55, 2] - truth[8:55, 2])) < 1.0


def test_a_target_that_never_vanishes_from_a_turn_is_taken(page, scene_frames):
    chain = ((0.9, 0.05, 0.05), (0.1, 0.8, 0.1), (0.0, 1.0, 0.0))
    p = page.Scenario(M=200, M_new=50, prior=replace(page.Prior(), Pi=chain))
    found = page.bernoulli(scene_frames, p, np.random.default_rng(10))
    assert np.isfinite(found.existence).all()


def test_the_path_is_the_one_of_the_text(page):
    states, r = page.path(page.Scene())
    expected = {
        7: (5.0, 2.0),
        21: (14.10, 2.00),
        27: (16.21, 4.66),
        37: (14.73, 10.99),
        43: (16.06, 14.41),
        55: (22.50, 18.81),
    }
    for k, position in expected.items():
        assert states[k - 1, [0, 2]] == pytest.approx(position, abs=0.005)
    assert [int((r == m).sum()) for m in (0, 1, 2)] == [11, 37, 12]
    assert np.isnan(states[[5, 55]]).all()


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"speed": 0.4, "heading": 0.3},
        {"turns": (0.0, -0.4), "speed": 0.4, "y": 12.0},
        {"frames": 30},
        {"frames": 3},
    ],
)
def test_the_path_is_a_walk_in_the_complex_plane(page, change):
    """A turn multiplies the velocity by a phase; the chord points half a turn further."""
    s = page.Scene(**change)
    at, v, places = complex(s.x, s.y), s.speed * np.exp(1j * s.heading), []
    for (first, last), w in zip(s.legs, (0.0, s.turns[0], 0.0, s.turns[1], 0.0), strict=True):
        half, arc = np.exp(0.5j * w * s.T), s.T * np.sinc(w * s.T / (2 * np.pi))
        for k in range(first, min(last, s.frames) + 1):
            at, v = (at, v) if k == s.appear else (at + arc * half * v, half**2 * v)
            places.append(at)
    states = page.path(s)[0][s.appear - 1 : min(s.t_f, s.frames)]
    walk = np.array(places, complex)
    assert np.allclose(np.column_stack([walk.real, walk.imag]), states[:, [0, 2]], rtol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_path_may_touch_the_border_and_not_cross_it(page, axis):
    ends = {"x": (0.5, 30.5), "y": (0.5, 20.5)}[axis]
    for place, step in zip(ends, (-0.01, 0.01), strict=True):
        s = page.Scene(**{axis: place}, speed=0.0, frames=8)
        assert page.path(s)[0][6, "x y".find(axis)] == place
        with pytest.raises(ValueError, match="frame 7 the target is outside the 30 x 20"):
            page.path(replace(s, **{axis: place + step}))


@pytest.mark.parametrize(
    ("M", "alive", "says"), [(2000, 1300, True), (2000, 1299, False), (20, 13, True)]
)
def test_the_threshold_counts_whole_particles(page, M, alive, says):
    rows = [(np.array([M - alive, alive, 0]), np.zeros(5), False, 1.0, 1, 0.0)]
    assert page.collect(rows, page.Scenario(M=M)).declared[0] == says


def test_a_threshold_of_one_asks_for_every_particle(page):
    rows = [(np.array([20 - n, n, 0]), np.zeros(5), False, 1.0, 1, 0.0) for n in (19, 20)]
    assert page.collect(rows, page.Scenario(M=20, gamma=1)).declared.tolist() == [False, True]


@pytest.mark.parametrize("weight", [1.0, 0.25])
def test_new_particles_mix_the_prior_by_their_weight(page, weight):
    """Eq. (13) with the share of the new particles' weight, gate shut, no signal."""
    p = page.Scenario(M=40_000, M_new=40_000, weight=weight, gate="never")
    p = replace(p, scene=page.Scene(amplitude=0.0))
    share, P = weight / (1 + weight), 0.1
    r = page.recursion(np.zeros((3, 30, 20)), p, np.random.default_rng(5))
    for existence in r.existence:
        P = (1 - share) * (0.1 + 0.8 * P) + share * 0.18
        assert existence == pytest.approx(P, abs=0.012)


def test_a_window_forgets_what_is_older(page):
    history = [0.9, 0.77, 0.30, 0.20]
    for N, gate, answer in ((3, "absence", True), (4, "absence", False), (3, "existence", False)):
        assert page.influenced(history, page.Scenario(N=N, gate=gate)) == answer
    assert page.influenced([0.43] * 3, page.Scenario())  # "at most", whatever rounding does
    assert page.influenced([0.6, 0.7, 0.8], page.Scenario(gate="existence"))
    assert not page.influenced([0.43, 0.43, 0.431], page.Scenario())


@pytest.mark.parametrize("N", [1, 2, 3, 5, 8, 10, 15])
def test_the_gate_opens_when_enough_zeros_are_in_the_window(page, N):
    """Absence 23/30 until the target appears and 0 after: ceil(N (1 - eta / (23/30))) frames."""
    p, absence = page.Scenario(N=N), [23 / 30] * N
    while not page.influenced(absence, p):
        absence.append(0.0)
    assert len(absence) - N == int(np.ceil(N * (1 - 0.43 * 30 / 23) - 1e-9))


# The filter by hand ---------------------------------------------------------------------------


def log_ratio(frame, x, y, s, half=2):
    """Logarithm of eq. (10), cell by cell, over the part of the patch that lies in the frame."""
    total = 0.0
    for i in range(1, s.nx + 1):
        for j in range(1, s.ny + 1):
            if max(abs(i - np.floor(x + 0.5)), abs(j - np.floor(y + 0.5))) <= half:
                d2 = (i - x) ** 2 + (j - y) ** 2
                h = s.amplitude / (2 * np.pi * s.blur**2) * np.exp(-d2 / (2 * s.blur**2))
                total += h * (2 * frame[i - 1, j - 1] - h) / (2 * s.noise**2)
    return total


@pytest.mark.parametrize("size", [(30, 20), (7, 5), (1, 1)])
def test_weights_inside_and_outside_the_frame_are_equation_10(page, size):
    rng = np.random.default_rng(11)
    s = page.Scene(nx=size[0], ny=size[1])
    S = np.zeros((400, 5))
    S[:, 0], S[:, 2] = rng.uniform(-3, size[0] + 4, 400), rng.uniform(-3, size[1] + 4, 400)
    r, frame = rng.integers(0, 3, 400), rng.normal(0, s.noise, size)
    ours = page.log_weights(frame, r, S, page.Scenario(scene=s))
    hand = [log_ratio(frame, S[n, 0], S[n, 2], s) if r[n] else 0.0 for n in range(400)]
    assert np.allclose(ours, hand, rtol=1e-9, atol=1e-9)


def test_distinct_counts_living_ancestors_once(page):
    for copies, r, alive in (
        ([2, 1, 0, 3, 1], [1, 0, 0, 2, 1], 3),
        ([2, 1, 0, 1], [0, 0, 2, 1], 1),
        ([0, 0, 1, 0, 0, 1], [2, 2, 0, 2, 2, 0], 0),
        ([0, 3], [1, 2], 1),
    ):
        args = np.array(r), np.zeros((len(r), 5)), np.array(copies, float), sum(copies), 0.5
        for resample in (page.resample, mm_pf_tbd.resample):
            assert resample(*args).distinct == alive


def test_the_image_of_a_target_is_equation_7(page):
    s, quiet = page.Scene(), page.Scene(noise=1e-4)
    z, (x, _, y, _) = page.simulate(quiet, np.random.default_rng(0)), page.path(s)[0][29]
    i, j = np.mgrid[1:31, 1:21]
    h = 18 / (2 * np.pi * 0.36) * np.exp(-((i - x) ** 2 + (j - y) ** 2) / (2 * 0.36))
    assert np.allclose(z[29], h, atol=1e-3)
    assert abs(z[[0, 5, 55]]).max() < 1e-3


def add_by_hand(page, p, r, S, absences, s, rng):
    """Steps 1 and 2."""
    follow = s is not None and sum(absences[-p.N :]) / p.N <= p.eta
    absent = absences[-1] if follow else 0.9
    new = np.repeat([1, 2, 0], rng.multinomial(p.M_new, [(1 - absent) / 2] * 2 + [absent]))
    n, fresh = np.count_nonzero(new), np.zeros((p.M_new, 5))
    if follow:
        u = rng.random((5, n))
        fresh[:n, :4] = s[:4] + np.sqrt(12) * np.array([0.5, 0.3, 0.5, 0.3]) * (u[:4].T - 0.5)
        fresh[:n, 4] = np.interp(u[4], [0, 0.5, np.nextafter(0.5, 1), 1], [-0.4, -0.2, 0.2, 0.4])
    else:
        fresh[:n] = births_by_hand(n, rng)
    return np.concatenate([r, new]), np.concatenate([S, fresh]), follow


def births_by_hand(n, rng):
    u = rng.random((5, n))
    turns = np.interp(u[4], [0, 0.5, np.nextafter(0.5, 1), 1], [-0.4, -0.2, 0.2, 0.4])
    return np.column_stack([30 * u[0], 4 * u[1] - 2, 25 * u[2], 4 * u[3] - 2, turns])


def move_by_hand(r, S, rng):
    """Step 3: the chain, the rotation of each living particle, the born from the initial law."""
    Pi = np.array([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])
    u, a = rng.random(r.size), 0.1 * np.sqrt(12) * (rng.random((r.size, 2)) - 0.5)
    after = (u[:, None] >= np.cumsum(Pi, axis=1)[r, :-1]).sum(axis=1)
    turning, born = np.flatnonzero((r == 1) & (after == 2)), np.flatnonzero((r == 0) & (after > 0))
    share = (u[turning] - 0.9) / 0.1
    S[turning, 4] = np.interp(share, [0, 0.5, np.nextafter(0.5, 1), 1], [-0.4, -0.2, 0.2, 0.4])
    for n in np.flatnonzero((after > 0) & (r > 0)):
        place, v = complex(S[n, 0], S[n, 2]), complex(S[n, 1], S[n, 3])
        step = np.exp(1j * S[n, 4]) if after[n] == 2 else 1.0
        place += v * (step - 1) / (1j * S[n, 4]) if after[n] == 2 else v
        place, v = place + complex(*a[n]) / 2, v * step + complex(*a[n])
        S[n, :4] = place.real, v.real, place.imag, v.imag
    S[born] = births_by_hand(born.size, rng)
    return after, S


@pytest.mark.parametrize("weight", [1.0, 0.125])
def test_two_frames_by_hand(page, scene_frames, weight):
    """Every step without a kernel, from the same random stream; in the second frame the new
    particles follow the estimate of the first.
    """
    p = page.Scenario(M=200, M_new=100, eta=0.95, N=2, weight=weight)
    rng = np.random.default_rng(12)
    r = np.repeat([1, 2, 0], rng.multinomial(200, [0.05, 0.05, 0.9]))
    S, absences, s, seen = births_by_hand(200, rng), [0.9], None, []
    for frame in scene_frames[9:11]:
        r, S, follow = add_by_hand(page, p, r, S, absences, s, rng)
        r, S = move_by_hand(r, S, rng)
        places = zip(r, S[:, 0], S[:, 2], strict=True)
        lw = np.array([log_ratio(frame, x, y, p.scene) if a else 0.0 for a, x, y in places])
        lw[200:] += np.log(weight)
        weights = np.exp(lw - lw.max())
        arrows = (np.arange(200) + rng.random()) / 200
        keep = np.searchsorted(np.cumsum(weights) / weights.sum(), arrows)
        n_eff = weights.sum() ** 2 / (weights**2).sum()
        different = len({n for n in keep if r[n]})
        r, S = r[keep], S[keep]
        s = S[r > 0].mean(axis=0)
        absences.append(np.mean(r == 0))
        seen.append((np.mean(r > 0), np.sum(r == 2) / np.sum(r > 0), follow, n_eff, different, *s))
    ours = page.recursion(scene_frames[9:11], p, np.random.default_rng(12))
    fields = ours.existence, ours.turning, ours.followed, ours.n_eff, ours.distinct, *ours.s.T
    assert np.allclose(np.transpose(fields), np.array(seen, float), rtol=1e-8)
    assert list(ours.followed) == [False, True]


def test_the_bernoulli_filter_agrees_with_a_classic_one_of_many_particles(page):
    """On a small image with births anywhere; nothing is shared but prior and likelihood."""
    s = page.Scene(
        nx=6, ny=5, amplitude=9.0, x=2.0, y=3.0, speed=0.5, appear=2, frames=5,
        legs=((2, 3), (4, 5), (9, 8), (9, 8), (9, 8)), turns=(0.5, 0.0),
    )  # fmt: skip
    z = page.simulate(s, np.random.default_rng(13))
    q = page.Prior(x=(0, 7), y=(0, 6), vx=(-1, 1), vy=(-1, 1))
    p = page.Scenario(scene=s, prior=q)
    pairs = (
        (page.recursion, replace(p, M=60_000, M_new=0), 5),
        (page.bernoulli_recursion, replace(p, M=1500, M_new=400), 50),
    )
    runs = [
        np.array([f(z, p, np.random.default_rng([14, i])).existence for i in range(n)])
        for f, p, n in pairs
    ]
    gap = abs(runs[0].mean(axis=0) - runs[1].mean(axis=0))
    se = [a.std(axis=0) / np.sqrt(len(a)) for a in runs]
    assert (gap < 5 * np.hypot(*se) + 1e-3).all()


def test_the_chain_of_the_survivors_is_that_of_those_who_stay(page):
    stay, appear, moving = page.conditional(page.Scenario())
    np.testing.assert_allclose(stay, [0.1, 0.9, 0.9])
    np.testing.assert_allclose(appear, [0.05, 0.05])
    chain = [[1, 0, 0], [0, 8 / 9, 1 / 9], [0, 1 / 9, 8 / 9]]
    np.testing.assert_allclose(moving.prior.Pi, chain, atol=1e-15)


def test_births_weigh_prior_over_proposal(page):
    """Nine in ten births by the root of the ratio (10) of their cell, one in ten by the prior."""
    s, q = page.Scene(nx=6, ny=5), page.Prior(x=(0, 7), y=(0.25, 6))
    frame = np.random.default_rng(24).normal(0, s.noise, (6, 5))
    p = page.Scenario(scene=s, prior=q)
    S, over = page.map_births(frame, 4000, page.grid(s), p, np.random.default_rng(25))
    ratio = np.array(
        [[np.exp(log_ratio(frame, i, j, s)) for j in range(1, 6)] for i in range(1, 7)]
    )
    root, box = np.sqrt(ratio) / np.sqrt(ratio).sum(), 1 / (7 * 5.75)
    for x, y, w in zip(S[:, 0], S[:, 2], over, strict=True):
        i, j = int(np.floor(x - 0.5)), int(np.floor(y - 0.5))
        seen = root[i, j] if 0 <= i < 6 and 0 <= j < 5 else 0.0
        allowed = box if y >= 0.25 else 0.0
        assert w == pytest.approx(allowed / (0.9 * seen + 0.1 * allowed))
    cells = np.histogram2d(S[:3600, 0], S[:3600, 2], bins=(np.arange(0.5, 7), np.arange(0.5, 6)))[0]
    assert abs(cells - 3600 * root).max() < 1  # systematic


def test_in_a_frame_of_a_single_cell_births_may_miss_it(page):
    """All births from the map hit the cell; those from the prior have its density outside."""
    s, q = page.Scene(nx=1, ny=1), page.Prior(x=(0, 4), y=(0, 4))
    p, frame = page.Scenario(scene=s, prior=q), np.ones((1, 1))
    S, over = page.map_births(frame, 1000, page.grid(s), p, np.random.default_rng(26))
    inside = (np.abs(S[:, [0, 2]] - 1.0) <= 0.5).all(axis=1)
    assert inside[:900].all()
    assert not inside.all()
    expected = np.where(inside, 1 / 16 / (0.9 + 0.1 / 16), 10.0)
    assert over == pytest.approx(expected)


def test_the_regime_of_a_birth_does_not_know_its_place(page, scene_frames):
    S, over = page.map_births(
        scene_frames[9], 4000, page.grid(page.Scene()), page.Scenario(), np.random.default_rng(15)
    )
    r = page.birth_regimes(4000, np.array([0.05, 0.05]), np.random.default_rng(16))
    assert abs(np.corrcoef(r, S[:, 0])[0, 1]) < 5 / np.sqrt(4000)
    assert over.mean() == pytest.approx(1, abs=0.2)  # weights of a proposal have the mean one


# Recursions on cells, and sentences that compare ----------------------------------------------


def test_the_loop_of_the_page_is_equation_10(page):
    """Against a sum without a loop, in the frame and across its border."""
    rng = np.random.default_rng(70)
    z, i, j = rng.normal(0, 2.3, (9, 7)), *np.mgrid[1:10, 1:8]
    for x, y in rng.uniform(-2, 11, (200, 2)):
        near = (abs(i - np.floor(x + 0.5)) <= 2) & (abs(j - np.floor(y + 0.5)) <= 2)
        h = np.where(near, 8.0 * np.exp(-((i - x) ** 2 + (j - y) ** 2) / 0.72), 0.0)
        direct = (np.sum(h * z) - np.sum(h * h) / 2) / 2.3**2
        ours = page.log_ratio(z, x, y, 8.0, 0.6, 2.3)
        assert ours == pytest.approx(direct, rel=1e-10, abs=1e-12)


def test_the_log_ratio_of_a_cell_is_that_of_a_target_at_its_centre(page, scene_frames):
    s, z = page.Scene(), scene_frames[9]
    L = page.cell_ratios(scene_frames[9:11], page.Scenario())
    assert L.shape == (2, 30, 20)
    for i, j in ((1, 1), (5, 2), (30, 20), (17, 9)):
        assert L[0, i - 1, j - 1] == pytest.approx(log_ratio(z, i, j, s), rel=1e-9)


def test_the_recursions_of_the_study_are_those_of_the_text(page, scene_frames):
    """Two frames by the sums of Section 4, cell by cell."""
    L = page.cell_ratios(scene_frames[7:9], page.Scenario())
    W, V, dead = np.zeros((32, 22)), np.full((32, 22), -np.inf), 1.0
    for ratio in L:
        around = [W[1 + a : 31 + a, 1 + b : 21 + b] for a in (-1, 0, 1) for b in (-1, 0, 1)]
        prior = 0.9 * sum(around) / 9 + 0.1 * dead / 600
        posterior = prior * np.exp(ratio)
        total = 1 - prior.sum() + posterior.sum()
        W[1:31, 1:21], dead = posterior / total, (1 - prior.sum()) / total
        best = [V[1 + a : 31 + a, 1 + b : 21 + b] for a in (-1, 0, 1) for b in (-1, 0, 1)]
        V[1:31, 1:21] = ratio + 0.9 * np.maximum(np.max(best, axis=0), 0.0)
    p, rng = page.Scenario(), np.random.default_rng(1)
    score, place = study.grid_filter(scene_frames[7:9], p, rng)
    assert score[-1] == pytest.approx(1 - dead)
    assert tuple(place[-1]) == np.unravel_index(W.argmax(), W.shape)
    score, place = study.recursive_maximum(scene_frames[7:9], p, rng)
    assert score[-1] == pytest.approx(V.max())
    assert tuple(place[-1]) == np.unravel_index(V.argmax(), V.shape)


I, B, C, E = "improved, 2000 + 2000", "Bernoulli, 1000 + 250", "classic, 2000", "classic, 4000"
G, G2, V = "grid filter, one cell", "grid filter, two cells", "recursive maximum"
X, W = "exact Bayes, speed known", "improved, new ones weigh 1/4"
PRINTED = {"study": "methods", "intensity": "printed"}
HALF = {"study": "methods", "intensity": "half"}


def at_speed(intensity, speed):
    return {"study": "speed", "intensity": intensity, "speed": speed}


LEADS = [  # the first has the larger measure, by the page's sentences
    *[("held", one, I, PRINTED) for one in (G, V, B)],
    *[("delay", I, one, PRINTED) for one in (G, V, B, G2)],
    ("held", I, C, PRINTED),
    ("delay", C, I, PRINTED),
    *[("held", V, one, PRINTED) for one in (B, G)],
    *[("delay", one, other, HALF) for one in (I, B, C, E) for other in (G, V)],
    ("delay", I, G2, HALF),
    *[("held", one, I, HALF) for one in (G, V, E, W)],
    *[("held", V, one, HALF) for one in (B, G, G2, C, I)],
    *[("held", one, G2, HALF) for one in (G, B)],
    *[("held", X, one, HALF) for one in (V, G, B)],
    *[("delay", one, X, HALF) for one in (V, G, B)],
    *[("held", one, two, at_speed(i, 1.4)) for one in (B, I) for two in (G, V)
      for i in ("printed", "half")],
    *[("held", B, G, at_speed(i, 0.9)) for i in ("printed", "half")],
    ("held", V, B, at_speed("printed", 0.9)),
    *[("held", V, B, at_speed(i, 0.4)) for i in ("printed", "half")],
]  # fmt: skip
OPEN = [  # no difference is resolved
    ("held", G2, I, PRINTED),
    ("held", G2, I, HALF),
    ("held", V, B, at_speed("half", 0.9)),
    ("held", W, E, HALF),
    *[(measure, "improved, N = 1", I, where) for measure in ("held", "delay")
      for where in (PRINTED, HALF)],
]  # fmt: skip


@pytest.mark.parametrize(("column", "one", "other", "where"), LEADS)
def test_a_sentence_that_compares_holds_for_five_other_seeds(column, one, other, where):
    gap, error = study.lead(studies.read("mm_pf_tbd_methods"), column, one, other, **where)
    assert gap > 2.6 * error


@pytest.mark.parametrize(("column", "one", "other", "where"), OPEN)
def test_what_is_not_resolved_is_within_its_error(column, one, other, where):
    gap, error = study.lead(studies.read("mm_pf_tbd_methods"), column, one, other, **where)
    assert abs(gap) < 2.6 * error


def test_what_the_page_says_of_its_own_figures_holds_for_five_other_seeds():
    """Not resolved, and not said: how much of the gain is left at equal cost, and whether most of
    the frames are saved that are lost before the target is found.  Not resolved, as the page says:
    a gain at equal cost with noisy motion, a loss of declarations in the turns, and a difference
    of the errors on a weak target at equal shares of declared frames.
    """
    table = studies.read("mm_pf_tbd_seeds")
    z = table["gap"] / table["se"]
    unresolved = (table["other"] == "the gain at equal cost") | (table["what"] == "lost before")
    unresolved |= (table["what"] == "declared, noisy") & (table["other"] == "classic, 4000")
    unresolved |= table["what"].isin(["declared in turns", "weak target: RMSE at equal shares"])
    assert (len(table), unresolved.sum()) == (22, 6)
    assert (z[~unresolved] > 2.6).all()
    assert (z[unresolved].abs() < 2.6).all()
    noisy = table[table["what"] == "declared, noisy"].iloc[0]
    assert abs(noisy["gap"] - 0.05) < 0.005, "the gain that Section 6 names"


def test_the_threshold_of_a_study_and_its_error_enter_the_measures():
    """Scores without a target are 1 to 20000: at most one in a hundred exceeds 19801."""
    rng = np.random.default_rng(71)
    empty = rng.permutation(np.arange(1.0, 20001.0)).reshape(400, 50)
    score = np.full((8, 60), 19802.0)
    score[::2] = 19801.0
    held, held_se, delay, delay_se = study.measures(score, np.zeros((8, 60)), empty)
    assert (held, delay) == (0.5, 24.5)
    assert held_se > np.std([0, 1] * 4, ddof=1) / 8**0.5 * 1.01  # more than the scatter of runs
    assert delay_se > 0
    assert study.measures(score, np.full((8, 60), 3.0), empty)[0] == 0  # too far from the target


def test_a_lead_needs_one_row_of_each(page):
    table = studies.read("mm_pf_tbd_methods")
    with pytest.raises(ValueError, match="no single rows of 'one frame'"):
        study.lead(table, "held", "one frame", I, study="methods")


def test_a_target_that_no_cell_is_near_gives_one_warning(page, scene_frames):
    p = page.Scenario(M=50, M_new=50, scene=page.Scene(amplitude=90.0))
    with pytest.warns(misfit.Misfit, match=r"^Scene.amplitude: 17.3 times the noise") as said:
        page.run(scene_frames, p, np.random.default_rng(1))
    assert len(said) == 1
    assert said[0].filename == __file__
    bright = page.simulate(page.Scene(amplitude=90.0), np.random.default_rng(2))
    page.run(bright, p, np.random.default_rng(1))  # a warning would be an error


def test_times_may_vary_and_may_not_be_stamps(page, scene_frames):
    p, z = page.Scenario(M=50, M_new=50), scene_frames[:8]
    page.run(z, p, np.random.default_rng(1), T=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 7.0])
    page.run(z[:7], p, np.random.default_rng(1), T=np.arange(1.0, 8.0))
    page.run(z, p, np.random.default_rng(1), T=[99.0] * 8)
    for T in (np.arange(1.0, 9.0), [100.0] * 8):
        with pytest.raises(ValueError, match="^T: "):
            page.run(z, p, np.random.default_rng(1), T=T)


# Own data --------------------------------------------------------------------------------------


def test_a_scene_needs_no_path_and_births_lie_over_its_frame(page):
    s = page.Scene(nx=64, ny=48)
    p = page.Scenario(scene=s)
    assert (p.prior.x, p.prior.y) == ((0.5, 64.5), (0.5, 48.5))
    S = page.draw_states(4000, p.prior, np.random.default_rng(17))
    assert S[:, 0].max() > 63
    assert S[:, 2].max() > 47
    assert page.Scenario().prior == page.Prior()  # the paper's own, with its y up to 25


def test_what_is_just_within_its_limits_is_taken(page):
    page.Scenario(M=1, M_new=0, N=1, spread=(0.0, 0.0), prior=page.Prior(x=(1, 30), y=(1, 20)))
    page.Scenario(M=1, M_new=1)
    page.Scenario(gamma=1, eta=1)
    page.Prior(absent=0.0, cv=0.0, ct=1.0, accel=0.0, x=(0, 0))
    page.Prior(absent=1.0, cv=0.0, ct=0.0)


def correct_share(page, s, n, k):
    """Share of the frames of presence with a declaration within two cells of the target."""
    p = page.Scenario(M=n, M_new=n, scene=s)
    z = page.simulate(s, np.random.default_rng([18, k]))
    r = page.recursion(z, p, np.random.default_rng([19, k]))
    truth = page.path(s)[0]
    near = np.hypot(r.s[:, 0] - truth[:, 0], r.s[:, 2] - truth[:, 2]) < 2
    return (r.declared & near)[6:55].mean()


@pytest.fixture(scope="module")
def printed_shares(page):
    return [correct_share(page, page.Scene(), 2000, k) for k in range(16)]


@pytest.mark.parametrize(
    ("size", "place"), [((64, 48), (35.0, 22.0)), ((64, 48), (2.0, 2.0)), ((24, 50), (2.0, 28.0))]
)
def test_on_another_frame_it_declares_as_often_as_on_its_own(page, printed_shares, size, place):
    """Births per cell as printed, the path two blur widths from the border or more: at least the
    share on the printed frame less three standard errors of the difference.
    """
    s = page.Scene(nx=size[0], ny=size[1], x=place[0], y=place[1])
    n = round(2000 * size[0] * size[1] / 750)
    ours = [correct_share(page, s, n, k) for k in range(6)]
    pairs = (ours, printed_shares)
    se = np.hypot(*(np.std(a, ddof=1) / np.sqrt(len(a)) for a in pairs))
    assert np.mean(ours) > np.mean(printed_shares) - 3 * se - 0.02


def test_half_the_intensity_told_costs_little_and_twice_costs_all(page):
    def share(told, k):
        z = page.simulate(page.Scene(), np.random.default_rng([20, k]))
        p = page.Scenario(scene=page.Scene(amplitude=told))
        return page.recursion(z, p, np.random.default_rng([21, k])).declared[6:55].mean()

    exact, half, twice = (np.mean([share(a, k) for k in range(10)]) for a in (18.0, 9.0, 36.0))
    assert half > 0.6 * exact
    assert twice < 0.3 * exact


def test_integers_and_single_precision_are_read(page, scene_frames):
    single, p = scene_frames[:8].astype(np.float32), classic(page)
    a, b = (page.run(z, p, np.random.default_rng(1)) for z in (single, single.astype(float)))
    assert (a.existence == b.existence).all()
    page.run(scene_frames[:4].round().astype(int), p, np.random.default_rng(1))


def test_the_manual_says_what_a_stranger_needs(page):
    known = (
        "[x, vx, y, vy, omega]",
        "counted from 1",
        "(K, nx, ny)",
        "low end",
        "standard deviation",
    )
    for words in (*known, "Leave Scene.delta at 1"):
        assert words in " ".join(page.__doc__.split())


def test_delta_multiplies_the_intensity_by_its_square_and_nothing_else(page, scene_frames):
    """As the manual says; so a filter that is told the cell in metres looks for another target."""
    S, r = np.array([[5.3, 0.6, 2.1, 0.0, 0.3]]), np.array([1])
    wide, loud = (
        page.Scenario(scene=page.Scene(**c)) for c in ({"delta": 3.0}, {"amplitude": 162.0})
    )
    ours, same = (page.log_weights(scene_frames[6], r, S, p) for p in (wide, loud))
    assert np.allclose(ours, same, rtol=1e-12)
    assert "delta**2 only multiplies the amplitude" in " ".join(page.__doc__.split())


@pytest.mark.parametrize("filtered", ["run", "bernoulli"])
def test_a_missing_frame_is_no_evidence(page, filtered):
    """All particles keep their weights; existence is what the chain predicts."""
    z = page.simulate(page.Scene(amplitude=60.0), np.random.default_rng(30))[6:15]
    p = page.Scenario(M=4000, M_new=0 if filtered == "run" else 1000)
    z[6] = np.nan
    apart = [frame if k != 6 else None for k, frame in enumerate(z)]
    one, two = (
        getattr(page, filtered)(each, p, np.random.default_rng(1)).existence for each in (z, apart)
    )
    assert np.array_equal(one, two)
    stay, appear, _ = page.conditional(p)
    low, high = sorted(one[5] * np.array([stay[1:].min(), stay[1:].max()]))
    born = (1 - one[5]) * appear.sum()
    assert low + born - 0.03 < one[6] < high + born + 0.03


def test_a_cell_without_a_value_has_the_log_ratio_0(page):
    """Equation (10) cell by cell, over the known cells alone; wherever the particle stands."""
    rng, s = np.random.default_rng(31), page.Scene(nx=7, ny=5)
    S = np.column_stack([rng.uniform(-2, 10, 300), *np.zeros((1, 300)), rng.uniform(-2, 8, 300)])
    r, frame = rng.integers(0, 3, 300), rng.normal(0, s.noise, (7, 5))
    unknown = rng.random((7, 5)) < 0.4
    ours = page.log_weights(np.where(unknown, np.nan, frame), r, S, page.Scenario(scene=s))

    def ratio(x, y):
        i, j = np.mgrid[1:8, 1:6]
        h = s.amplitude / (2 * np.pi * s.blur**2)
        h = h * np.exp(-((i - x) ** 2 + (j - y) ** 2) / (2 * s.blur**2))
        near = (abs(i - np.floor(x + 0.5)) <= 2) & (abs(j - np.floor(y + 0.5)) <= 2) & ~unknown
        return (h * (2 * frame - h) / (2 * s.noise**2))[near].sum()

    hand = [ratio(x, y) if alive else 0.0 for (x, _, y), alive in zip(S, r, strict=True)]
    assert np.allclose(ours, hand, rtol=1e-9, atol=1e-9)


def test_cells_that_are_missing_over_the_target_are_no_evidence_against_it(page):
    z = page.simulate(page.Scene(amplitude=40.0), np.random.default_rng(32))
    holes, (x, _, y, _) = z.copy(), page.path(page.Scene())[0].T
    for k in range(25, 28):
        i, j = round(x[k]) - 1, round(y[k]) - 1
        holes[k, i - 2 : i + 3, j - 2 : j + 3] = np.nan
    p = page.Scenario(M=4000, M_new=1000, scene=page.Scene(amplitude=40.0))
    held, lost = (
        page.recursion(each, p, np.random.default_rng(33)).existence[25:28].mean()
        for each in (holes, np.nan_to_num(holes))
    )
    assert held > 0.5 > 0.2 > lost


# Frame by frame, saved, unequal times ---------------------------------------------------------

CASES = [
    {},
    {"M_new": 0},
    {"M_new": 700, "weight": 0.25, "N": 1},
    {"births": "move", "gate": "always"},
    {"births": "keep", "gate": "existence", "N": 5},
]


def recorded(page, i=40):
    """Frames in single precision with gaps, and times between them."""
    z = list(page.simulate(page.Scene(frames=24), np.random.default_rng(i)).astype(np.float32))
    z[3], z[15] = None, np.full((30, 20), np.nan)
    z[12][4:12, 1:4] = np.nan
    return z, np.random.default_rng([i, 1]).uniform(0.5, 1.5, len(z))


def walk(page, z, p, T, rng, now=None):
    """The filter frame by frame: what it says, and the last state."""
    now, said = page.start(p, rng) if now is None else now, []
    for frame, since in zip(z, T, strict=True):
        now, one = page.step(now, frame, p, rng, since)
        said.append(one)
    return said, now


def same(one, other):
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return one is other or np.array_equal(one, other, equal_nan=True)


@pytest.mark.parametrize("options", CASES)
def test_a_run_is_the_loop_over_its_steps(page, options):
    p, (z, T) = page.Scenario(**({"M": 300, "M_new": 200} | options)), recorded(page)
    whole = page.run(z, p, np.random.default_rng(41), T=T)
    said, last = walk(page, z, p, T, np.random.default_rng(41))
    for field in page.Result._fields[:-1]:
        assert same(getattr(whole, field), np.array([getattr(one, field) for one in said])), field
    assert same(whole.state, last)
    assert said[0].state is None


@pytest.mark.parametrize("options", CASES)
def test_a_run_that_is_cut_and_saved_goes_on_bit_by_bit(page, options, tmp_path):
    p, (z, T) = page.Scenario(**({"M": 300, "M_new": 200} | options)), recorded(page)
    whole, rng = page.run(z, p, np.random.default_rng(42), T=T), np.random.default_rng(42)
    first = page.run(z[:9], p, rng, T=T[:9])
    save(tmp_path / "track.npz", first, rng)
    kept, rng = load(tmp_path / "track.npz", page)
    rest = page.run(z[9:], p, rng, kept, T[9:])
    for field in page.Result._fields[:-1]:
        both = np.concatenate([getattr(first, field), getattr(rest, field)])
        assert same(both, getattr(whole, field)), field
    assert same(rest.state, whole.state)


@pytest.mark.slow
def test_another_process_goes_on_bit_by_bit(page, tmp_path):
    p, (z, T) = page.Scenario(M=300, M_new=200), recorded(page)
    whole, rng = page.run(z, p, np.random.default_rng(43), T=T), np.random.default_rng(43)
    save(tmp_path / "track.npz", page.run(z[:9], p, rng, T=T[:9]).state, rng)
    save(tmp_path / "rest.npz", {"z": np.array([np.full((30, 20), np.nan), *z[9:15]]), "T": T})
    code = """
        import tbdcore
        from tbdcore import state
        page = tbdcore.page("mm_pf_tbd")
        now, rng = state.load("track.npz", page)
        rest, _ = state.load("rest.npz")
        p = page.Scenario(M=300, M_new=200)
        found = page.run(rest["z"][1:], p, rng, now, rest["T"][9:15])
        state.save("found.npz", list(found[:-1]))
    """
    environment = os.environ | {"TBDCORE_REPOSITORY": str(paths.root())}
    command = [sys.executable, "-c", textwrap.dedent(code)]
    subprocess.run(command, check=True, cwd=tmp_path, env=environment)
    found, _ = load(tmp_path / "found.npz")
    assert same(tuple(found), tuple(a[9:15] for a in whole[:-1]))


def test_a_step_leaves_the_state_that_it_was_given(page, scene_frames):
    for p in (page.Scenario(M=300, M_new=0), page.Scenario(M=300, M_new=100)):
        now = page.run(scene_frames[:9], p, np.random.default_rng(44)).state
        one, other = (
            page.step(now, scene_frames[9], p, np.random.default_rng(45)) for _ in range(2)
        )
        assert same(one, other)
        assert same(page.run(scene_frames[9:10], p, np.random.default_rng(45), now).state, one[0])


def test_a_state_of_other_types_is_read(page, scene_frames):
    p = page.Scenario(M=300, M_new=100)
    now = page.run(scene_frames[:9], p, np.random.default_rng(44)).state
    S = now.S.astype(np.float32)
    other = page.State(now.r.astype(np.int32), np.asfortranarray(S), list(now.absence), now.s)
    runs = [
        page.run(scene_frames[9:], p, np.random.default_rng(45), one)
        for one in (now._replace(S=S.astype(float)), other)
    ]
    assert same(runs[0].existence, runs[1].existence)


def test_a_pause_moves_the_particles_on(page, scene_frames):
    """Twice the time, twice the way; one step of 2 s is not two of 1 s for the chain."""
    p = page.Scenario(M=300, M_new=0, prior=page.Prior(accel=0.0))
    r, S = np.ones(300, int), np.tile([10.0, 0.5, 8.0, -0.25, 0.3], (300, 1))
    now = page.State(r, S, (0.1,), S[0])
    _, said = page.step(now, None, p, np.random.default_rng(46), T=3.0)
    straight = page.step(now, None, p, np.random.default_rng(46), T=1e-6)[1]
    assert straight.s[:4] == pytest.approx(S[0, :4], abs=0.7)
    assert said.turning == straight.turning
    assert said.s[0] > straight.s[0] + 0.9


def test_the_evidence_of_a_frame_is_the_mean_weight_over_the_prior(page):
    """One living birth state, nothing moves: (0.82 + 0.18 q) / 1 of the classic filter's chain."""
    still = page.Prior(accel=0.0, x=(3, 3), y=(2, 2), vx=(0, 0), vy=(0, 0))
    s = page.Scene(nx=5, ny=4, amplitude=9.0)
    frame = np.random.default_rng(47).normal(0, s.noise, (5, 4))
    for weight, new, prior in ((1.0, 0, 0.18), (0.25, 20_000, 0.18)):
        p = page.Scenario.__new__(page.Scenario)
        given = {"M": 20_000, "M_new": new, "weight": weight, "gate": "never", "scene": s}
        for name, value in (page.Scenario().__dict__ | given | {"prior": still}).items():
            object.__setattr__(p, name, value)
        said = page.recursion([frame, None], p, np.random.default_rng(48))
        q = np.exp(page.log_weights(frame, np.array([1]), np.array([[3.0, 0, 2, 0, 0.3]]), p)[0])
        assert said.log_evidence[0] == pytest.approx(np.log(1 - prior + prior * q), abs=0.05)
        assert said.log_evidence[1] == pytest.approx(0.0, abs=1e-12)


def test_the_evidence_of_the_bernoulli_filter_agrees_with_that_of_a_classic_one(page, small):
    p, z = small
    p = replace(p, prior=page.Prior(x=(0, 6), y=(0, 5), vx=(-1, 1), vy=(-1, 1)))
    pairs = (
        (page.recursion, {"M": 60_000, "M_new": 0}),
        (
            page.bernoulli_recursion,
            {"M": 1500, "M_new": 400},
        ),
    )
    runs = [
        [
            f(z, replace(p, **c), np.random.default_rng([49, i])).log_evidence.sum()
            for i in range(20)
        ]
        for f, c in pairs
    ]
    assert abs(np.mean(runs[0]) - np.mean(runs[1])) < 5 * np.std(runs, axis=1).max() / 20**0.5


def test_the_larger_evidence_has_the_right_intensity(page):
    z = page.simulate(page.Scene(), np.random.default_rng(51))
    told = [page.Scenario(scene=page.Scene(amplitude=a)) for a in (9.0, 18.0, 36.0)]
    runs = [page.recursion(z, p, np.random.default_rng(52)).log_evidence.sum() for p in told]
    assert int(np.argmax(runs)) == 1


def test_the_help_begins_with_one_screen_whose_example_runs(page):
    screen = page.__doc__.split("\n\nFrame by frame")[0].splitlines()
    assert len(screen) <= 24
    assert max(map(len, page.__doc__.splitlines())) <= 100
    names, lines = {}, [line[4:] for line in screen if line.startswith("    ")]
    assert len(lines) <= 10
    exec("\n".join(lines), names)
    result, truth = names["result"], page.path(page.Scene(nx=40, ny=30))[0]
    assert result.declared[12:55].mean() > 0.8
    assert np.hypot(*(result.s[50, [0, 2]] - truth[50, [0, 2]])) < 1.0


@pytest.mark.parametrize("births", ["keep", "move"])
def test_the_dead_keep_their_state_or_go_on_along_their_velocity(page, births):
    p = page.Scenario(births=births, scene=page.Scene(T=2.0), prior=page.Prior(accel=0.0))
    rng, r = np.random.default_rng(22), np.repeat([0, 1], 500)
    S = np.tile([10.0, 0.5, 8.0, -0.25, 0.3], (1000, 1))
    after, moved = page.predict(r, S.copy(), p, rng)
    dead, born = after == 0, (r == 0) & (after == 1)
    step = np.array([1.0, 0.0, -0.5, 0.0, 0.0])
    assert np.allclose(moved[dead], S[0] + (step if births == "move" else 0.0))
    assert np.allclose(moved[born], S[0] + step)  # goes on from the state that it has
