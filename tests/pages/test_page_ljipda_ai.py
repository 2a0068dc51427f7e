"""The page of LJIPDA-AI against answers that do not need it."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from tbdcore.repro import pages

page = tbdcore.page("ljipda_ai")
CALM = page.Scenario(clutter=1e-9)


def rng(*key):
    return np.random.default_rng([5, *key])


def states(p, method, i=0, plots=None):
    z = page.simulate(p, rng(i, 0)) if plots is None else plots
    return page.run(z, p, rng(i, 1), method)


def test_targets_meet_in_the_repaired_scenario_only():
    X = page.course(page.Scenario())[0][page.MEETING - 1, :, ::2]
    np.testing.assert_allclose(X, X[[0, 0, 0]], atol=1e-6)
    printed = page.course(page.Scenario(scenario="print"))[0]
    np.testing.assert_array_equal(np.abs(printed[0, :, ::2]), [[29e3, 35e3]] * 3)
    assert np.ptp(printed[page.MEETING - 1, :, ::2], axis=0).max() > 5e3


def test_turns_keep_the_speed_and_take_the_printed_angle():
    X = page.course(page.Scenario())[0]
    np.testing.assert_allclose(
        np.hypot(X[..., 1], X[..., 3]),
        np.hypot(X[:1, :, 1], X[:1, :, 3]) * np.ones((100, 1)),
        rtol=1e-12,
    )
    heading = np.unwrap(np.arctan2(X[..., 3], X[..., 1]), axis=0)
    np.testing.assert_allclose(
        heading[-1] - heading[0], np.array([1, 1, -1]) * (30 * 0.035 - 29 * 0.025), rtol=1e-9
    )


def test_clutter_of_the_union_has_its_density():
    """About 230 plots a scan where the squares are apart, fewer where they overlap, the same
    density everywhere.
    """
    p = page.Scenario(p_detect=1e-9)
    counts = np.mean([np.diff(page.simulate(p, rng(i)).first) for i in range(40)], axis=0)
    apart = 3 * 1600.0**2 * p.clutter
    assert counts[:60].mean() == pytest.approx(apart, abs=4 * math.sqrt(apart / 2400))
    area = 1600.0**2 * p.clutter  # all three squares stand on one point, turned alike
    assert counts[page.MEETING - 1] == pytest.approx(area, abs=4 * math.sqrt(area / 40))


def test_amplitudes_follow_their_laws():
    p = page.Scenario(p_detect=1 - 1e-12, clutter=1e-12)
    u = np.concatenate([page.simulate(p, rng(i)).u for i in range(30)])
    assert u.mean() == pytest.approx(11.0, abs=4 * 11 / math.sqrt(u.size))
    noise = page.simulate(page.Scenario(p_detect=1e-12), rng(1)).u
    assert noise.mean() == pytest.approx(1.0, abs=4 / math.sqrt(noise.size))


def test_zero_level_is_the_tracker_without_amplitude_bit_for_bit():
    p = page.Scenario(assumed_db=-math.inf)
    z = page.simulate(p, rng(2))
    for with_amplitude, without in (("LJIPDA-AI", "LJIPDA"), ("JIPDA-AI", "JIPDA")):
        for ours, theirs in zip(
            states(p, with_amplitude, 2, z), states(p, without, 2, z), strict=True
        ):
            np.testing.assert_array_equal(ours, theirs)


def test_without_clutter_the_error_reaches_the_bound():
    """No clutter, q = 0: a Kalman filter with the noise at the predicted position; the bound is
    slightly below.
    """
    from tbdcore import kalman

    p = replace(CALM, q=0.0, init_position=50.0)
    X, F = page.course(p)
    error = np.array([states(p, "LJIPDA", i)[0][-1] - X[-1] for i in range(300)])[..., ::2]
    var = np.diag([p.sigma_r**2, math.radians(p.sigma_theta_deg) ** 2])
    R = np.array([[kalman.polar_noise(w, var) for w in scan] for scan in kalman.polar(X)])
    bound = kalman.position_bound(F, R, page.start_covariance(p), p.p_detect)[-1]
    trace = np.array(
        [
            np.linalg.solve(b[::2, ::2], e.T @ e).trace() / 600
            for b, e in zip(bound, error.transpose(1, 0, 2), strict=True)
        ]
    )
    assert (trace > 1 - 4 * math.sqrt(1 / 300)).all()
    assert (trace < 1.35).all()


def test_methods_are_one_where_nothing_is_shared():
    p = page.Scenario(clutter=1e-5, scenario="print")
    z = page.simulate(p, rng(3))
    alone = states(p, "IPDA", 3, z)[0]
    for method in ("JIPDA", "LJIPDA"):
        np.testing.assert_allclose(states(p, method, 3, z)[0], alone, rtol=1e-8)


def test_empty_radar_kills_the_tracks():
    p = page.Scenario(p_detect=1e-12, clutter=1e-15)
    z = page.simulate(p, rng(4))
    assert len(z.z) == 0
    found, alive = page.run(z, replace(p, p_detect=0.95), rng(4), "LJIPDA-AI")
    D, P = 0.95 * p.p_gate, p.p_start
    for k in range(1, 6):
        P = p.p11 * P
        P = (1 - D) * P / (1 - D * P)
        np.testing.assert_allclose(alive[k], P, rtol=1e-12)
    assert np.isfinite(found).all()


def test_a_dead_target_comes_back_with_the_second_row_of_the_matrix():
    """No plots: existence by (11) with both rows, then a miss; by the whole matrix, whose rows sum
    to one.
    """
    p = page.Scenario(p_detect=1e-12, clutter=1e-15)
    z = page.simulate(p, rng(4))
    p = replace(p, p_detect=0.95, p11=0.9, p21=0.2)
    alive, matrix = page.run(z, p, rng(4), "LJIPDA")[1], np.array([[0.9, 0.1], [0.2, 0.8]])
    D, belief = 0.95 * p.p_gate, np.array([p.p_start, 1 - p.p_start])
    for k in range(1, 30):
        belief = belief @ matrix * (1 - D, 1)
        belief /= belief.sum()
        np.testing.assert_allclose(alive[k], belief[0], rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"clutter": -1e-5}, "^clutter: -1e-05 in the scenario; give a positive, finite number$"),
        ({"clutter": math.nan}, "^clutter: nan .* positive, finite"),
        (
            {"p_detect": 1.2, "p_gate": 0.8},
            r"^p_detect: 1.2 in the scenario; give a probability inside \(0, 1\)$",
        ),
        ({"p_detect": 0.8, "p_gate": 1.2}, "^p_gate: 1.2 "),
        ({"p_start": 0.0}, "^p_start: 0.0 "),
        ({"p11": 1.5}, r"^p11: 1.5 in the scenario; give a probability in \[0, 1\]$"),
        ({"p21": -0.1}, "^p21: -0.1 "),
        ({"init_position": 0.0}, "^init_position: 0.0 "),
        ({"init_speed": math.inf}, "^init_speed: inf "),
        ({"sigma_r": 0}, "^sigma_r: 0 "),
        ({"sigma_r": "100"}, "^sigma_r: '100' "),
        (
            {"sigma_theta_deg": 0.0},
            r"^sigma_theta_deg: 0.0 in the scenario; give an angle inside \(0, 90\) degrees$",
        ),
        ({"gamma": -1}, "^gamma: -1 "),
        ({"T": 0.0}, "^T: 0.0 "),
        ({"half": -800.0}, "^half: -800.0 "),
        ({"q": -1}, "^q: -1 in the scenario; give a finite number, not negative$"),
        ({"snr_db": math.nan}, "^snr_db: nan in the scenario; give a level below 100 dB$"),
        ({"assumed_db": 4000.0}, "^assumed_db: 4000.0 "),
        ({"scenario": "x"}, "^scenario: 'x' is unknown; choose one of cross, print$"),
        (
            {"frames": 60},
            "^frames: 60 in the scenario; give a whole number, at least 75 scans for cross$",
        ),
        ({"frames": 1, "scenario": "print"}, "at least 2 scans for print$"),
    ],
)
def test_bad_scenarios_are_refused_in_one_line(change, words):
    with pytest.raises(ValueError, match=words) as caught:
        page.Scenario(**change)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0, 1e100])
def test_amplitudes_that_no_radar_gives_are_refused(bad):
    p = page.Scenario()
    z = page.simulate(p, rng(5))
    z.u[7] = bad
    with pytest.raises(
        ValueError,
        match=f"^plots: .* u of plot 7 is {re.escape(str(bad))}; give a number from 0 to 1e12$",
    ):
        page.run(z, p, rng(6))


def test_plots_that_do_not_go_together_and_unknown_methods_are_refused():
    p = page.Scenario()
    z = page.simulate(p, rng(5))
    for odd in (
        z._replace(first=z.first[:-1]),
        z._replace(first=z.first[::-1].copy()),
        z._replace(first=1.0 * z.first),
    ):
        with pytest.raises(
            ValueError,
            match="^plots: first does not divide .* into 100 scans; give 101 indices from 0 to ",
        ):
            page.run(odd, p, rng(6))
    with pytest.raises(
        ValueError, match="^plots: .* powers u of shape .*; give one excess power for each plot$"
    ):
        page.run(z._replace(u=z.u[:-1]), p, rng(6))
    with pytest.raises(
        ValueError, match="^method: 'foo' is unknown; choose one of JIPDA, LJIPDA, "
    ):
        page.run(z, p, rng(6), "foo")


def test_plots_that_are_not_finite_are_refused():
    p = page.Scenario()
    z = page.simulate(p, rng(7))
    z.z[3, 1] = np.nan
    with pytest.raises(ValueError, match="plot 3 is .* not finite"):
        page.run(z, p, rng(7))


def cells_of_the_page(*openings):
    """What some cells of the notebook define, on top of its algorithm."""
    names = {"np": np, "math": math, **vars(page)}
    for opening in openings:
        (source,) = [cell for cell in pages.cells("ljipda_ai") if cell.startswith(opening)]
        exec(source, names)
    return names


def test_more_false_plots_than_memory_are_refused_before_they_are_drawn():
    with pytest.raises(
        ValueError, match=r"^simulate: 8e\+08 false plots in a trial, over 1e7; lower .*errors$"
    ):
        page.simulate(page.Scenario(clutter=1e-2, sigma_r=1000.0), rng(8))


def test_prior_of_an_empty_gate_is_zero():
    prior = cells_of_the_page("def prior(")["prior"]
    found = prior(
        np.array([[0.0, 0.0], [3e-5, 1e-5]]), np.array([0.9, 0.8]), np.array([0.95, 0.95])
    )
    np.testing.assert_allclose(found, [[0.0, 0.0], [0.57, 0.19]], rtol=1e-12)


@pytest.mark.parametrize("snr_db", [-20.0, -11.0, 0.0, 25.0, 40.0])
def test_ratio_has_the_mean_one_over_false_plots_at_any_level(snr_db):
    names = {
        "d": 10 ** (snr_db / 10),
        "p": CALM,
        "integrate": page.integrate,
        "math": math,
        "np": np,
        "pd": page.pd,
    }
    (source,) = [
        cell for cell in pages.cells("ljipda_ai") if cell.startswith("mean = integrate.quad")
    ]
    exec(source, names)
    assert names["mean"] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize(
    "change", [{}, {"snr_db": 40.0}, {"p_detect": 1e-6, "clutter": 1e-12}, {"gamma": 0.1}]
)
def test_scan_by_hand_holds_for_loud_plots_and_for_empty_gates(change):
    p = page.Scenario(**change)
    names = cells_of_the_page(
        "def predict_existence",
        "def prior(",
        "def source(",
        "def indicator(",
        "def weights(",
        "def mixture(",
        "def scan_by_hand",
    )
    names |= {
        "p": replace(p, assumed_db=p.snr_db),
        "d": 10 ** (p.snr_db / 10),
        "TRACKS": ["1", "2"],
        "page": lambda: page,
    }
    names |= {"stream": lambda i, purpose: rng(9, len(purpose)), "plots": page.simulate(p, rng(9))}
    (source,) = [cell for cell in pages.cells("ljipda_ai") if cell.startswith("plain = plots")]
    exec(source, names)
    assert np.isfinite(names["hand"]).all()
