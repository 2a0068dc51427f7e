"""The page of the constant-track-false-alarm paper, run as the page shows it, against oracles of
its own.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from tbdcore import detection, score
from tbdcore.repro import trials


@pytest.fixture(scope="module")
def page():
    return tbdcore.page("track_cfar")


@pytest.fixture(scope="module")
def p(page):
    return page.Scenario()


def flights(page, p, z, d, n, seed):
    """Flights of the page, one after the other: when they died, which frames hit, and the design's
    eta.
    """

    def trial(seed, i):
        return page.fly(
            page.simulate(z, p, trials.generator(seed, "track_cfar", "test", i, "noise")), z, d
        )

    return trials.run(trial, n, seed=seed, workers=1)


def test_frame_false_alarm_probability(page, p):
    assert math.isclose(page.frame_pfa(p), 0.034511, abs_tol=5e-7)


def test_traditional_chain_is_the_known_one(page, p):
    """The parameter-free oracle: 14.106 dB joint, 286.69 km entering, 281.69 km after the decision."""
    life, z = page.chain(p, p.cell_pfa), page.truth(p)
    S, R = detection.to_db(page.snr(z[2:, 0], p)), z[2:, 0] / 1e3
    assert round(score.crossing(S, life.detected, 0.5), 3) == 14.106
    assert round(score.crossing(R, life.entering, 0.5), 2) == 286.69
    assert round(score.crossing(R, life.after, 0.5), 2) == 281.69


def test_chain_equals_the_tree_of_miss_histories(page, p):
    """With a target that is detected with known probabilities, every history of the first frames
    enumerated.
    """
    short = replace(p, frames=7)
    z, P_f = page.truth(short), 1e-6
    P_d = P_f ** (1 / (1 + page.snr(z[2:, 0], replace(short, snr0_db=14.0))))
    life = page.chain(replace(short, snr0_db=14.0), P_f)
    alive = np.zeros(8)
    for history in itertools.product((0, 1), repeat=7):
        weight = math.prod(d if plot else 1 - d for plot, d in zip(history, P_d, strict=True))
        runs = [len(run) for run in "".join(map(str, history)).split("1")]
        deaths = [k for k in range(3, 8) if history[k - 3 : k] == (0, 0, 0)]
        assert bool(deaths) == (max(runs) >= 3)
        alive[: deaths[0] if deaths else 8] += weight
    np.testing.assert_allclose(
        life.after, alive[1:], atol=1e-4
    )  # false plots: 1e-6 in each of some tens of cells


def test_flights_follow_the_chain(page, p):
    z, d = page.truth(p), page.design(p, p.cell_pfa)
    died, hit, _ = flights(page, p, z, d, 3000, seed=1)
    life = page.chain(p, p.cell_pfa)
    k = np.flatnonzero((life.entering > 0.02) & (life.entering < 0.98))
    q = life.entering[k]
    gap = ((died[:, None] >= k).mean(axis=0) - q) / np.sqrt(q * (1 - q) / 3000)
    assert np.abs(gap).max() < 4.5
    q = life.detected[k]
    assert np.abs((hit[:, k].mean(axis=0) - q) / np.sqrt(q * (1 - q) / 3000)).max() < 4.5


def test_vanished_target_leaves_the_design_probability(page, p):
    short = replace(p, frames=13)
    z, d = page.truth(short), page.design(short, vanish=10)
    died, _, _ = flights(page, short, z, d, 4000, seed=2)
    assert abs((died > 12).mean() - 0.1) < 4 * math.sqrt(0.1 * 0.9 / 4000)


def test_compiled_flight_equals_run(page, p):
    """The page's own comparison, with other scenes."""
    z = page.truth(p)
    scene = page.simulate(z, p, trials.generator(9, "track_cfar", "test", 0, "noise"))._replace(
        u=np.ones(p.frames)
    )
    plots = z + np.sqrt(page.variances(z[:, 0], p)) * scene.e
    scans = [
        np.array([[*plot, lam]])
        for plot, lam in zip(plots, [np.inf, np.inf, *scene.lam], strict=True)
    ]
    slow = [track.eta for track in page.run(scans, p)]
    died, _, eta = page.fly(scene, z, page.design(p))
    assert len(slow) == min(died + 1, p.frames)
    np.testing.assert_allclose(slow, eta[: len(slow)], rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "capped"),
    [
        ({"snr0_db": 60.0}, True),
        ({"gate_g": 0.01}, True),
        ({"track_pfa": 0.999, "miss_limit": 1}, True),
        ({"miss_limit": 10}, False),
    ],
)
def test_compiled_flight_equals_run_at_the_ends_of_the_ranges(page, p, change, capped):
    """Where the cap on eq. (13) acts from the first frame on, and where the counter has one state
    or ten.
    """
    p = replace(p, **change)
    z = page.truth(p)
    scene = page.simulate(z, p, trials.generator(9, "track_cfar", "test", 0, "noise"))._replace(
        u=np.ones(p.frames)
    )
    plots = z + np.sqrt(page.variances(z[:, 0], p)) * scene.e
    scans = [
        np.array([[*plot, lam]])
        for plot, lam in zip(plots, [np.inf, np.inf, *scene.lam], strict=True)
    ]
    slow = page.run(scans, p)
    died, _, eta = page.fly(scene, z, page.design(p))
    assert len(slow) == min(died + 1, p.frames)
    np.testing.assert_allclose(
        [track.eta for track in slow], eta[: len(slow)], rtol=1e-9, atol=1e-12
    )
    assert (eta[0] == 0) == capped


def test_without_a_target_the_chain_keeps_its_promise_and_the_cap_makes_it_smaller(page, p):
    strong = replace(p, snr0_db=60.0, frames=p.miss_limit)
    assert math.isclose(
        page.chain(replace(strong, gate_g=1e9), vanish=0).after[-1], p.track_pfa, rel_tol=1e-12
    )
    assert page.chain(strong, vanish=0).after[-1] < 0.5 * p.track_pfa
    assert math.isclose(
        page.chain(replace(strong, snr0_db=0.0), vanish=0).after[-1], p.track_pfa, rel_tol=1e-12
    )


def test_filter_is_consistent_in_the_nominal_scene(page, p):
    """NEES of a filter matched to the straight target (no process noise) has mean 4 and variance 8."""
    p, z, k, n = replace(p, sigma_p=0.0, frames=20), None, 15, 150
    z, nees = page.truth(p), []
    for i in range(n):
        scene = page.simulate(z, p, trials.generator(4, "track_cfar", "test", i, "noise"))
        plots = z + np.sqrt(page.variances(z[:, 0], p)) * scene.e
        track = page.run([np.array([[*plot, np.inf]]) for plot in plots[: k + 3]], p)[k]
        r, a = z[k + 2]
        state = np.array(
            [r * math.cos(a), p.speed * math.cos(a), r * math.sin(a), p.speed * math.sin(a)]
        )
        nees.append((track.x - state) @ np.linalg.solve(track.P, track.x - state))
    assert abs(np.mean(nees) - 4) < 4 * math.sqrt(8 / n)


def test_exact_frame_probability_is_never_below_the_approximation(page, p):
    rng = np.random.default_rng(5)
    for zhat in rng.uniform([1e5, -3], [4e5, 3], (30, 2)):
        half = rng.uniform([10, 0.002], [600, 0.1])
        P_f = float(page.gate_pfa(math.prod(2 * half), p))
        beta = page.effective_volumes(zhat, half, p)
        realised = 1 - np.prod(1 - beta * P_f)
        assert math.isclose(beta.sum() * math.prod(p.cell), math.prod(2 * half), rel_tol=1e-9)
        assert 1 - math.exp(-page.frame_pfa(p)) - 1e-12 <= realised <= page.frame_pfa(p) + 1e-12


def test_threshold_has_its_floor(page, p):
    """D is never smaller than R, so eta >= ln(32 / (P_Z S)) with the default accuracies."""
    z = page.truth(p)
    _, _, eta = page.fly(
        page.simulate(z, p, trials.generator(6, "track_cfar", "test", 0, "noise")),
        z,
        page.design(p),
    )
    alive = np.isfinite(eta)
    floor = np.log(32 / (page.frame_pfa(p) * page.snr(z[2:, 0], p)))
    assert (
        eta[alive] > floor[alive] - 0.2
    ).all()  # S at the predicted range differs a little from S at the true one
