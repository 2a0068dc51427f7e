"""The page of mm_pf_tbd as a module: exact answers, invariances, and one line for every bad input."""

from dataclasses import replace

import numpy as np
import pytest

import tbdcore


@pytest.fixture(scope="module")
def page():
    return tbdcore.page("mm_pf_tbd")


@pytest.fixture(scope="module")
def scene_frames(page):
    return page.simulate(page.Scene(), np.random.default_rng(1))


def classic(page, **change):
    return replace(page.Params(M_new=0, M=400), **change)


def enumerate_bayes(page, z, p, mix):
    """Existence by a recursion over whole histories: (birth state, birth frame, word over CV and
    CT), one dictionary per frame.

    Nothing is shared with the page: motion by the rotation of the velocity along the arc,
    likelihood by a double loop.
    """
    Pi, s, omega = p.prior.Pi, p.scene, p.prior.left[0]
    births = {
        (tuple(state[:4]), r): q / len(p.prior.lattice)
        for state in p.prior.lattice
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
        for state in p.prior.lattice:
            for after in (1, 2):
                key = (tuple(state[:4]), after)
                alive[key] = alive.get(key, 0.0) + dead * Pi[0][after] / len(p.prior.lattice)
        dead = dead * Pi[0][0] + sum(w * Pi[r][0] for (_, r), w in before.items())
        alive = {key: w * ratio(frame, key[0]) for key, w in alive.items()}
        total = dead + sum(alive.values())
        dead, alive = dead / total, {key: w / total for key, w in alive.items()}
        out.append(1 - dead)
    return np.array(out)


@pytest.fixture(scope="module")
def lattice(page):
    """A 5 by 4 image, four frames, eight birth states, all three regimes at work."""
    states = tuple(
        (x, vx, y, 0.25, 0.5) for x in (2.0, 4.0) for y in (2.0, 3.0) for vx in (-0.5, 0.5)
    )
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
    prior = page.Prior(accel=0.0, lattice=states, left=(0.5, 0.5), right=(0.5, 0.5))
    p = page.Params(scene=short, prior=prior, gate="never")
    return p, page.simulate(short, np.random.default_rng(2))


@pytest.mark.parametrize(("new", "mix"), [(0, 0.0), (1, 0.5)])
def test_particles_converge_to_exact_bayes(page, lattice, new, mix):
    """Mean of 60 runs within 4 standard errors (and the O(1/M) bias) of the enumeration; the
    improved filter at the mixed prior.
    """
    p, z = lattice
    exact = enumerate_bayes(page, z, p, mix)
    runs = np.array(
        [
            page.run(
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
            page.run(z, replace(p, M=M, M_new=0), np.random.default_rng([4, i])).existence
            for i in range(40)
        ]
        return np.sqrt(np.mean((np.array(runs) - exact) ** 2))

    assert error(200) / error(12_800) == pytest.approx(8, rel=0.4)


@pytest.mark.parametrize("mix", [0.0, 0.5])
def test_the_notebooks_own_enumeration_agrees(page, lattice, mix):
    p, z = lattice
    assert np.allclose(page.exact(z, p, mix), enumerate_bayes(page, z, p, mix), rtol=1e-10)


@pytest.mark.parametrize(
    ("new", "limit", "first"), [(0, 0.5, (0.18, 0.244)), (1, 7 / 30, (0.18, 0.212))]
)
def test_without_signal_the_filter_is_its_prior(page, new, limit, first):
    """Chain to 1/2, mixed with new particles to 7/30; 40 000 particles, neighbours dependent."""
    blind = page.Scene(amplitude=0.0)
    p = page.Params(M=40_000, M_new=40_000 * new, scene=blind)
    r = page.run(np.zeros((40, 30, 20)), p, np.random.default_rng(5))
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
    p = page.Params(M=4000, M_new=1000, scene=strong)
    r = page.bernoulli(z, p, np.random.default_rng(9))
    truth = page.path(strong)[0]
    assert r.declared[7:55].all()
    assert not r.declared[57:].any()
    assert np.nanmax(np.hypot(r.s[8:55, 0] - truth[8:55, 0], r.s[8:55, 2] - truth[8:55, 2])) < 1.0


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
def test_the_walk_that_is_checked_is_the_path_that_is_flown(page, change):
    """The complex plane against the paper's matrices."""
    scene = page.Scene(**change)
    states = page.path(scene)[0][scene.appear - 1 : min(scene.t_f, scene.frames)]
    walk = page.walk(scene)
    assert np.allclose(np.column_stack([walk.real, walk.imag]), states[:, [0, 2]], rtol=1e-12)


@pytest.mark.parametrize(
    ("M", "alive", "says"), [(2000, 1300, True), (2000, 1299, False), (20, 13, True)]
)
def test_the_threshold_counts_whole_particles(page, M, alive, says):
    rows = [(np.array([M - alive, alive, 0]), np.zeros(5), False, 1.0, 1)]
    assert page.collect(rows, page.Params(M=M)).declared[0] == says


BAD = {
    "zero particles": lambda page: page.Params(M=0),
    "negative new particles": lambda page: page.Params(M_new=-1),
    "eta of one": lambda page: page.Params(eta=1.0),
    "gamma of zero": lambda page: page.Params(gamma=0.0),
    "empty window": lambda page: page.Params(N=0),
    "unknown gate": lambda page: page.Params(gate="ajar"),
    "unknown births": lambda page: page.Params(births="resurrect"),
    "rows of Pi": lambda page: page.Prior(Pi=((0.9, 0.05, 0.06), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8))),
    "initial probabilities": lambda page: page.Prior(absent=0.8),
    "start outside": lambda page: page.Scene(x=31.0),
    "path leaves the image": lambda page: page.Scene(speed=2.0),
    "start flies out": lambda page: page.Scene(heading=np.pi),
    "negative amplitude": lambda page: page.Scene(amplitude=-1),
    "no noise": lambda page: page.Scene(noise=0.0),
    "wide blob": lambda page: page.Scene(blur=2.0),
    "frames of another image": lambda page: page.run(
        np.zeros((3, 20, 30)), page.Params(), np.random.default_rng(0)
    ),
    "a NaN cell": lambda page: page.run(
        np.full((3, 30, 20), np.nan), page.Params(), np.random.default_rng(0)
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_refused_in_one_line(page, what):
    with pytest.raises(ValueError, match=r"\w+: .+") as error:
        BAD[what](page)
    assert "\n" not in str(error.value)
