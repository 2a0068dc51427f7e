"""What the chapter of LJIPDA-AI refuses, each in one line that names what to change."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from tbdcore.recording import misfit

page = tbdcore.page("ljipda_ai")
F, Q = page.motion.cv(2.0), page.motion.step_acceleration(2.0, 0.05)
X = np.array([[-400.0, 6.0, 2920.0, 1.5], [-400.0, 6.0, 3080.0, -1.5]])
SETUP = page.Setup(X, np.diag([400.0, 9, 400, 9]), F, Q, 8.0, 0.15, 0.9, 1e-5, snr=30.0, tau=2.8)
SCANS = [np.column_stack([X[:, ::2] + 2 * k * X[:, 1::2], [9.0, 9.0]]) for k in range(6)]
BARE = [scan[:, :2] for scan in SCANS]
STATE = page.start(SETUP)
PLOTS = page.simulate(page.Scenario(clutter=1e-9), np.random.default_rng(0))


def spoiled(value, column=2):
    scans = [scan.copy() for scan in SCANS]
    scans[3][1, column] = value
    return scans


def setup(**change):
    return lambda: replace(SETUP, **change)


def run(scans=SCANS, method="LM-AI", given=None, **change):
    return lambda: page.run(scans, replace(SETUP, **change), method=method, **(given or {}))


def step(scan=SCANS[1], state=STATE, **given):
    return lambda: page.step(state, scan, SETUP, "LM-AI", **given)


def scenario(**change):
    return lambda: page.Scenario(**change)


def last(change):
    return STATE._replace(**change)


CASES = [
    # a Setup
    (setup(P=np.zeros((4, 4))), r"^Setup\.P: singular or not positive; give positive variances$"),
    (setup(P=np.diag([1.0, 1, 1, -1])), r"^Setup\.P: singular or not positive"),
    (setup(P=np.eye(4) + np.eye(4, k=1)), r"^Setup\.P: not symmetric; give a covariance$"),
    (setup(P=[np.eye(4), -np.eye(4)]), r"^Setup\.P\[1\]: singular"),
    (setup(P=np.eye(2)), r"^Setup\.P: shape \(2, 2\) is not \(4, 4\)"),
    (setup(P=np.eye(4)[None]), r"^Setup\.P: shape \(1, 4, 4\) is not \(2, 4, 4\)"),
    (setup(Q=-np.eye(4)), r"^Setup\.Q: singular or not positive"),
    (setup(Q=[Q, -Q]), r"^Setup\.Q\[1\]: singular"),
    (setup(Q=1e15 * np.eye(4)), r"^Setup\.Q\[0, 0\]: 1e\+15 is not in \[-1e\+12, 1e\+12\]"),
    (setup(x=X[0]), r"^Setup\.x: shape \(4,\) is not \(T, 4\)"),
    (setup(x=[[0.0, 0, 1]]), r"^Setup\.x: shape \(1, 3\) is not \(T, 4\)"),
    (setup(x=[[0.0, 0, 1, np.nan]]), r"^Setup\.x\[0, 3\]: nan is not in \["),
    (setup(x=[[0.0, 0, 1], [2.0]]), r"^Setup\.x: rows of several lengths"),
    (setup(x=np.empty((0, 4))), r"^Setup\.x: shape \(0, 4\); give at least one"),
    (setup(x="here"), r"^Setup\.x: values of type <U4; give real numbers"),
    (setup(x=X + 1j), r"^Setup\.x: values of type complex128; give real numbers"),
    (setup(x=np.ma.masked_less(X, 0)), r"^Setup\.x: a masked array"),
    (setup(x=X > 0), r"^Setup\.x: values of type bool"),
    (setup(F=np.eye(3)), r"^Setup\.F: shape \(3, 3\) is not \(4, 4\)"),
    (setup(F=np.tile(F, (5, 3, 1, 1))), r"^Setup\.F: shape \(5, 3, 4, 4\) is not \(steps, 2,"),
    (setup(sigma_r=0.0), r"^Setup\.sigma_r: 0.0; give a number in \(0, 1e\+07\]$"),
    (setup(sigma_r=1e300), r"^Setup\.sigma_r: 1e\+300; give a number"),
    (setup(sigma_r=None), r"^Setup\.sigma_r: None; give a number"),
    (setup(sigma_r=[8.0, 9.0]), r"^Setup\.sigma_r: \[8.0, 9.0\]; give a number"),
    (setup(sigma_theta_deg=90.0), r"^Setup\.sigma_theta_deg: 90.0; give a number in \(0, 90\)$"),
    (setup(p_detect=1.0), r"^Setup\.p_detect: 1.0; give a number in \(0, 1\) or"),
    (setup(p_detect=True), r"^Setup\.p_detect: True; give"),
    (setup(p_detect=[0.9, 0.9, 0.9]), r"^Setup\.p_detect: shape \(3,\) is not \(2,\)"),
    (setup(p_gate=1.0), r"^Setup\.p_gate: 1.0;"),
    (setup(p_start=1.1), r"^Setup\.p_start: 1.1; give a number in \[0, 1\]"),
    (setup(p11=1.5), r"^Setup\.p11: 1.5; give a number in \[0, 1\]$"),
    (setup(p21=-0.1), r"^Setup\.p21: "),
    (setup(gamma=-1.0), r"^Setup\.gamma: "),
    (setup(snr=-1.0), r"^Setup\.snr: -1.0; give a number in \[0, 1e\+10\] or"),
    (setup(tau=-1.0), r"^Setup\.tau: -1.0; give a number in \[0, 40000\]$"),
    (setup(clutter=0.0), r"^Setup\.clutter: 0.0; give a number in \[1e-30, 1e\+06\] or one of"),
    (setup(clutter=1e9), r"^Setup\.clutter: 1000000000.0; give"),
    (setup(clutter="estimated"), r"^Setup\.clutter: 'estimated' is unknown; the nearest is 'est"),
    (setup(clutter=math.nan), r"^Setup\.clutter: nan"),
    (setup(law=3.0), r"^Setup\.law: 3.0; give a Callable$"),
    # scans
    (run(spoiled(math.nan, 0)), r"^scans\[3\]\[1, 0\]: nan is not in \[-1e\+12, 1e\+12\]$"),
    (run(spoiled(math.inf)), r"^scans\[3\]\[1, 2\]: inf is not in"),
    (run(spoiled(1e20, 1)), r"^scans\[3\]\[1, 1\]: 1e\+20 is not in"),
    (run(spoiled(2.7)), r"^scans\[3\]\[1\]: amplitude below tau; give it in units of the noise"),
    (run(spoiled(1e6)), r"^scans\[3\]\[1\]: amplitude beyond any level; give it in units of"),
    (run(spoiled(-9.0)), r"^scans\[3\]\[1\]: amplitude below tau"),
    (run(BARE), r'^scans\[0\]: no amplitudes; give \[x, y, amplitude\], or method="JIPDA"$'),
    (run([s.T for s in SCANS]), r"^scans\[0\]: shape \(3, 2\) is not|^scans\[0\]: no amplitudes"),
    (run([np.c_[s, s] for s in SCANS]), r"^scans\[0\]: shape \(2, 6\); give rows \[x, y\] or"),
    (run([s[0] for s in SCANS]), r"^scans\[0\]: shape \(3,\); give rows"),
    (run([s + 1j for s in SCANS]), r"^scans\[0\]: values of type complex128; give real numbers"),
    (run([s > 0 for s in BARE], "JIPDA"), r"^scans\[0\]: values of type bool; give real numbers"),
    (run([[[1.0, 2, 3], [4.0]]] * 3), r"^scans\[0\]: rows of several lengths"),
    (run([["a", "b"]] * 3), r"^scans\[0\]: shape \(2,\); give rows"),
    (run([*SCANS[:3], np.ma.masked_greater(SCANS[3], 3000)]), r"^scans\[3\]: a masked array"),
    (run(SCANS[:1]), "^scans: 1 given; give at least 2, the first starts the tracks$"),
    (run([], given={"state": STATE}), "^scans: 0 given; give at least 1$"),
    (run(None), "^scans: 0 given; give at least 2"),
    (run(5), "^scans: 0 given; give at least 2"),
    # what belongs together
    (run(gamma=9.0), "^p_gate: 0.9997 does not fit gamma = 9; give 0.98889$"),
    (run(x=np.zeros((2, 4))), r"^x: a track is at the radar \(zero range\); start it elsewhere$"),
    (run(tau=None), "^tau: not given; give the threshold that the amplitudes exceed$"),
    (run(snr=None), '^snr: not given, but LM-AI needs it; give it, or method="JIPDA"$'),
    (run(F=np.tile(F, (6, 1, 1))), r"^Setup\.F: 6 for 5 steps; give one, or 5$"),
    (run(Q=np.tile(Q, (6, 1, 1))), r"^Setup\.Q: 6 for 5 steps; give one, or 5$"),
    (run(method="foo"), "^method: 'foo' is unknown; choose one of JIPDA; LJIPDA; "),
    (run(method=["JIPDA"]), r"^method: \['JIPDA'\] is unknown; choose one of"),
    (run(x=np.tile(X, (9, 1)), method="JIPDA-AI"), "^x: 18 tracks, the limit .* is 16; track in"),
    (run(law=lambda a: a[:-1]), r"^Setup\.law: gives shape \(1,\); give one for each amplitude$"),
    (run(law=lambda a: a * math.nan), r"^Setup\.law\[0\]: nan is not in"),
    (run(given={"rng": 5}), r"^rng: 5; give a numpy.random.Generator$"),
    (run(given={"state": 5}), r"^state: give start\(setup\), or the state of a result$"),
    (run(given={"accuracy": [None]}), "^accuracy: give one entry for each of 6 scans, or None$"),
    (run(given={"accuracy": [(8.0, 0.0)] * 6}), r"^accuracy\[1\]: 0 is not in \[1e-09, 1e\+07\]$"),
    (lambda: page.run(SCANS, None), r"^setup: give Setup\(\.\.\.\), or a Scenario and a generat"),
    (lambda: page.run(SCANS, page.Scenario()), "^rng: None; give a numpy.random.Generator$"),
    (lambda: page.run(SCANS, page.Scenario(), 5), "^rng: 5; give a numpy.random.Generator$"),
    (lambda: page.states(SCANS[:1], SETUP, "LM-AI"), "^scans: 1 given; give at least 2"),
    (lambda: page.start(None), r"^setup: give Setup"),
    (lambda: page.averaged([], 2.8), r"^averaged: snr: give at least one level$"),
    (
        run(law=page.averaged([9.0], 20.0)),
        r"^averaged: \(a\*\*2 - tau\*\*2\) / 2\[0\]: -159.5 is not in",
    ),
    # a step
    (step(F=np.eye(3)), r"^Setup\.F: shape \(1, 3, 3\) is not \(steps, 4, 4\)"),
    (step(Q="fast"), r"^Setup\.Q: shape|^Setup\.Q: values of type"),
    (step(accuracy=(8.0,)), r"^accuracy: shape \(1,\) is not \(2,\)"),
    (step(accuracy=np.ones((3, 2))), r"^accuracy: shape \(3, 2\) is not \(2, 2\)"),
    (step("far"), r"^scan: shape \(\); give rows"),
    (step(state=SETUP), r"^state: give start\(setup\), or the state of a result$"),
    (step(state=last({"x": X[:1]})), r"^state\.P: shape \(2, 4, 4\) is not \(1, 4, 4\)"),
    (step(state=last({"existence": np.array([0.5, 1.5])})), r"^state\.existence\[1\]: 1.5 is not"),
    (step(state=last({"P": -STATE.P})), r"^state\.P\[0\]: singular or not positive"),
    (step(state=last({"k": 1.5})), r"^state\.k: 1.5 is no integer"),
    # simulated plots
    (
        lambda: page.step(last({"k": 99}), PLOTS, SETUP, "JIPDA"),
        "^scan: the plots end at scan 99, where the state is; give more$",
    ),
    (lambda: page.run(PLOTS, SETUP, state=last({"k": 99})), "^scans: 0 given; give at least 1$"),
    # a Scenario
    (scenario(clutter=-1e-5), r"^Scenario\.clutter: -1e-05; give a number in \(0, inf\)$"),
    (scenario(clutter=math.nan), r"^Scenario\.clutter: nan;"),
    (scenario(p_detect=1.2, p_gate=0.8), r"^Scenario\.p_detect: 1.2; give a number in \(0, 1\)$"),
    (scenario(p_detect=0.8, p_gate=1.2), r"^Scenario\.p_gate: 1.2;"),
    (scenario(p_start=0.0), r"^Scenario\.p_start: 0.0;"),
    (scenario(p11=1.5), r"^Scenario\.p11: 1.5; give a number in \[0, 1\]$"),
    (scenario(p21=-0.1), r"^Scenario\.p21: -0.1;"),
    (scenario(init_position=0.0), r"^Scenario\.init_position: 0.0;"),
    (scenario(init_speed=math.inf), r"^Scenario\.init_speed: inf;"),
    (scenario(sigma_r=0), r"^Scenario\.sigma_r: 0;"),
    (scenario(sigma_r="100"), r"^Scenario\.sigma_r: '100';"),
    (scenario(sigma_theta_deg=0.0), r"^Scenario\.sigma_theta_deg: 0.0; give a number in \(0, 90"),
    (scenario(gamma=-1), r"^Scenario\.gamma: -1;"),
    (scenario(T=0.0), r"^Scenario\.T: 0.0;"),
    (scenario(half=-800.0), r"^Scenario\.half: -800.0;"),
    (scenario(reach=0.0), r"^Scenario\.reach: 0.0;"),
    (scenario(q=-1), r"^Scenario\.q: -1; give a number in \[0, inf\)$"),
    (scenario(snr_db=math.nan), r"^Scenario\.snr_db: nan; give a number in \[-inf, 100\)$"),
    (scenario(assumed_db=4000.0), r"^Scenario\.assumed_db: 4000.0;"),
    (scenario(scenario="x"), r"^Scenario\.scenario: 'x' is unknown; .* of cross, print, pair, fan"),
    (scenario(frames=60), r"^Scenario\.frames: 60; give at least 75 scans for cross$"),
    (scenario(frames=1, scenario="print"), r"^Scenario\.frames: 1; give an integer in \[2, inf"),
    (
        lambda: page.simulate(page.Scenario(clutter=1e-2, sigma_r=1e3), np.random.default_rng(8)),
        r"^simulate: 8e\+08 false plots in a trial, over 1e7; lower .*errors$",
    ),
]


def test_columns_in_another_order_are_named():
    """[amplitude, x, y] and [y, x, amplitude]: no plot lies in a gate."""
    for order in ([2, 0, 1], [1, 0, 2]):
        odd = [scan[:, order] for scan in SCANS for _ in range(3)]
        words = r"^scans: no plot of 17 scans lies in a gate"
        with pytest.warns(misfit.Misfit, match=words):
            page.run(odd, replace(SETUP, tau=0.0), method="LM-AI")


def test_sixteen_tracks_are_the_limit_of_exact_association_only():
    many = replace(SETUP, x=np.tile(X, (9, 1)))
    for method in set(page.METHODS) - {"JIPDA", "JIPDA-AI"}:
        assert np.isfinite(page.states(SCANS[:3], many, method)[0]).all()
    for method in ("JIPDA", "JIPDA-AI"):
        with pytest.raises(ValueError, match="^x: 18 tracks, the limit of exact association is 16"):
            page.run(SCANS[:3], many, method=method)


@pytest.mark.parametrize(("call", "words"), CASES, ids=[words for _, words in CASES])
def test_bad_input_is_refused_in_one_line(call, words):
    with pytest.raises(ValueError, match=words) as refused:
        call()
    assert "\n" not in str(refused.value)


def test_what_the_cases_change_is_good():
    result = page.run(SCANS, SETUP, method="LM-AI")
    assert result.existence[-1].min() > 0.95
    page.step(STATE, SCANS[1], SETUP, "LM-AI", F, Q, (8.0, 0.15))
