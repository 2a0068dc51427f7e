"""What the chapter of accumulated measurements refuses, each in one line that says what to give."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tbdcore

page = tbdcore.page("mda_tbd")
OWN = {"nr": 24, "na": 14, "dr": 4.0, "da": 0.02, "r_min": 800.0, "sd_r": 1.2, "sd_a": 1.4}
P = page.scenario(**OWN, N=30, B=20, window=3, noise=40.0)
SMALL = page.Scenario(N=30, B=20, scans=20)
Z = 40.0 * np.random.default_rng(50).standard_exponential((5, 24, 14))
START = page.start(P, np.random.default_rng(1))
DB = 10 * np.log10(Z)


def rng():
    return np.random.default_rng(55)


def run(z=Z, p=P, rng=rng, **given):
    return lambda: page.run(z, p, rng() if callable(rng) else rng, **given)


def step(frame=Z[0], state=START, p=P, **given):
    return lambda: page.step(state, frame, p, rng(), **given)


def scenario(**change):
    return lambda: page.Scenario(**change)


def own(**change):
    return lambda: page.scenario(**(OWN | change))


def without(name):
    return lambda: page.scenario(**{key: OWN[key] for key in OWN if key != name})


def told(**change):
    return replace(P, **change)


def last(**change):
    return START._replace(**change)


def spoiled(value, at=(3, 4, 5)):
    z = Z.copy()
    z[at] = value
    return z


def sky(**change):
    return lambda: page.simulate(replace(SMALL, **change), rng(), rng())


def moved(S):
    return last(S=S)


CASES = [
    # frames
    (
        run(Z.transpose(0, 2, 1)),
        r"^frames: \(14, 24\) cells, but the grid has \(24, 14\); transposed; give range first$",
    ),
    (run(Z[:, :12]), r"^frames: \(12, 14\) cells, but the grid has \(24, 14\); change nr, na"),
    (run(Z[0]), r"^frames: shape \(24, 14\) is not \(K, nx, ny\)"),
    (run(Z[:0]), r"^frames: shape \(0, 24, 14\) has no cells"),
    (run([]), r"^frames: shape \(0,\) is not"),
    (run(Z[:2]), r"^frames: 2 are fewer than window = 3; shorten the window$"),
    (run(1j * Z), r"^frames: values of type complex128; give real numbers"),
    (run(-Z), r"^frames\[0, 0, 0\]: -[\d.]+ is not in \[0, 1e\+50\]"),
    (run(spoiled(np.inf)), r"^frames\[3, 4, 5\]: inf is not finite"),
    (run(spoiled(1e60)), r"^frames\[3, 4, 5\]: 1e\+60 is not in"),
    (run(np.ma.masked_greater(Z, 100.0)), r"^frames: a masked array; fill it"),
    (run([np.ma.masked_greater(z, 100.0) for z in Z]), r"^frames: a masked array; fill it"),
    (run(Z > 1), r"^frames: values of type bool; give real numbers"),
    (run("power"), r"^frames: values of type <U5; give real numbers"),
    (run(None), r"^frames: values of type object; give"),
    (run(frame for frame in Z), r"^frames: values of type object; give"),
    (run(["one", "two", "three"]), r"^frames: values of type <U5; give real numbers"),
    (run([Z[0], Z[1][:5], Z[2]]), r"^frames: rows of several lengths"),
    (run(Z + 1e4), r"^frames: the level of frame 0 is \d+ times noise = 40; give power"),
    (
        run(Z / 40.0),
        r"^frames: the level of frame 0 is 0.02\d* times noise = 40; give power, not",
    ),
    (run(np.sqrt(Z)), r"^frames: the level of frame 0 is 0.1\d* times noise = 40"),
    (run(np.maximum(DB - 20, 0)), r"^frames: the level of frame 0 is 0 times noise = 40"),
    (run(spoiled(0.0, 2)), r"^frames: the level of frame 2 is 0 times noise = 40"),
    (
        run(spoiled(1e5), told(source="state")),
        r"^frames: a cell of 2.5e\+03 noise powers contra",
    ),
    (
        run(spoiled(np.nan), told(likelihood="coherent")),
        r'^frames: has NaN, but likelihood="coh',
    ),
    (
        run(spoiled(np.nan), told(reading="least-squares")),
        r"^frames: has NaN, but .*\"least-sq",
    ),
    # what else a run takes
    (run(p={"nr": 24}), r"^p: give scenario\(...\) or Scenario\(...\)$"),
    (run(rng=None), r"^rng: give np.random.default_rng\(seed\)$"),
    (run(rng=0), r"^rng: give"),
    (run(rng=np.random.RandomState(0)), r"^rng: give"),
    (run(T=2.0), r"^T: shape \(\) is not \(5,\)"),
    (run(T=[1.0, 2.0]), r"^T: shape \(2,\) is not \(5,\)"),
    (run(T=[1.0, 1.0, 0.0, 1.0, 1.0]), r"^T\[2\]: 0 is not in \[1e-06, 1e\+06\]"),
    (run(T=[1.0, 1.0, np.nan, 1.0, 1.0]), r"^T\[2\]: nan is not in"),
    # a step and its state
    (
        step(Z[0].T),
        r"^frame: \(14, 24\) cells, but the grid has \(24, 14\); transposed; give range",
    ),
    (
        step(Z[0] / 40.0),
        r"^frame: the level of frame 0 is 0.02\d* times noise = 40; give power, not",
    ),
    (step(Z), r"^frame: shape \(1, 5, 24, 14\) is not \(K, nx, ny\)"),
    (step(DB[0]), r"^frame(\[0, \d+, \d+\]: -[\d.]+ is not in|: the level of)"),
    (step(np.zeros((24, 14))), r"^frame: the level of frame 0 is 0 times noise = 40"),
    (step(1j * Z[0]), r"^frame: values of type complex128; give real numbers"),
    (step(np.full((24, 14), 40.0).astype(str)), r"^frame: values of type <U32; give real numbers$"),
    (step(p=SMALL), r"^frame: \(24, 14\) cells, but the grid has \(500, 90\)"),
    (step(p=None), r"^p: give scenario"),
    (step(T=0.0), r"^T: 0.0 is no number in"),
    (step(T="1 s"), r"^T: '1 s' is no number in"),
    (step(T=[1.0]), r"^T: \[1.0\] is no number in"),
    (step(state=None), r"^state: give start\(p, rng\), or the state of a result$"),
    (step(state=START.S), r"^state: give start"),
    (step(state=last(memory=None)), r"^state: give start"),
    (step(state=moved(START.S[:, :9])), r"^state.S: shape \(4, 9\) is not \(4, 30\)"),
    (step(state=moved(START.S.T)), r"^state.S: shape \(30, 4\) is not"),
    (step(state=moved(np.nan * START.S)), r"^state.S\[0, 0\]: nan is not in"),
    (
        step(state=moved(START.S / 1000)),
        r"^state.S: far outside the grid; give x, v_x, y, v_y in m",
    ),
    (step(state=moved(-START.S)), r"^state.S: far outside the grid"),
    (step(state=moved(START.S[[2, 3, 0, 1]])), r"^state.S: far outside the grid"),
    (step(state=last(existence=1.5)), r"^state.existence: 1.5 is no number in \[0, 1\]"),
    (step(state=last(existence=math.nan)), r"^state.existence: nan is no number"),
    (step(state=last(k=-1)), r"^state.k: -1 is no integer of at least 0"),
    (step(p=told(window=5)), r"^state.memory\[0\]: shape \(3, 1, 50\) is not \(5, 1, 50\)"),
    (run(state=START, p=told(N=31)), r"^state.S: shape \(4, 30\) is not \(4, 31\)"),
    # a scenario
    (scenario(window=0), r"window: 0; give an integer in \[1, 1e\+08\]"),
    (scenario(window=2.5), "window: 2.5; give an integer"),
    (scenario(R_T=226.0), r"R_T: 226.0; give a number in \[-20, 20\]"),
    (scenario(R_T=math.nan), "R_T: nan"),
    (scenario(p_birth=-1), "p_birth: -1; give a number"),
    (scenario(p_birth=0.0), "p_birth: 0.0; give a number"),
    (scenario(p_survive=1.1), r"p_survive: 1.1; give a number in \[0, 1\]"),
    (scenario(p_initial=2), "p_initial: 2;"),
    (scenario(noise=0.0), "noise: 0.0;"),
    (scenario(noise=math.inf), "noise: inf;"),
    (scenario(noise=None), "noise: None; give a number"),
    (scenario(N=0), "N: 0; give an integer"),
    (scenario(N="6000"), "N: '6000'; give an integer"),
    (scenario(B=True), "B: True; give an integer"),
    (scenario(T=0.0), "T: 0.0;"),
    (scenario(x0=math.nan), "x0: nan; give a number"),
    (scenario(accel=-1.0), r"accel: -1.0; give a number in \[0, "),
    (scenario(half_a=-1), "half_a: -1;"),
    (scenario(P_max=0.0), "P_max: 0.0;"),
    (scenario(r_min=-5.0), r"r_min: -5.0; give a number in \[0, inf\)"),
    (scenario(common="yes"), "common: 'yes'; give True or False"),
    (scenario(a_max=8.0, da=0.1, a_min=0.0), "azimuth: 0 to 8 rad; give radians, at most a"),
    (scenario(a_max=46.0, da=0.1, a_min=45.0), "azimuth: 45 to 46 rad; give radians"),
    (scenario(source="histroy"), "source: 'histroy' is unknown; the nearest is 'history'"),
    (scenario(reading="owncell"), "reading: 'owncell' is unknown; the nearest is 'own-cell'"),
    (scenario(likelihood="coherrent"), "likelihood: .*; the nearest is 'coherent'"),
    (scenario(births="pwer"), "births: 'pwer' is unknown; the nearest is 'power'"),
    (scenario(L_r=36.0, L_a=14600.0), "covers 0.25 cells"),
    (scenario(dr=3.0), "range: the region has 333.333 cells"),
    (own(birth_sped=3.0), "no setting 'birth_sped'; the nearest is 'birth_speed'"),
    (own(source="known"), r'^scenario: source="known" needs R, the target over the noise in dB'),
    (own(sd_r=0.0), "sd_r: 0.0; give a number in"),
    (own(sd_a="1"), "sd_a: '1'; give a number in"),
    (own(dr=-1.0), "dr: -1.0; give a number in"),
    (own(da=None), "da: None; give a number in"),
    (own(nr=24.5), "nr: 24.5; give an integer in"),
    (own(na=0), "na: 0; give an integer in"),
    (own(a_min="north"), "a_min: 'north'; give a number in"),
    (own(r_min=math.nan), "r_min: nan; give a number in"),
    (own(da=1.0), "azimuth: 0 to 14 rad; give radians"),
    (own(sd_r=0.1, sd_a=0.1), "covers 0.031 cells; give at least one"),
    (own(noise="40"), "noise: '40'; give a number in"),
    # a start outside the grid
    (sky(x0=9500.0), r"^target at cell .* is outside \(500, 90\); move it$"),
    (sky(y0=-8500.0), "is outside"),
    (sky(vx=1e3), "is outside"),
]


@pytest.mark.parametrize("case", range(len(CASES)))
def test_bad_input_is_refused_in_one_line(case):
    call, message = CASES[case]
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


def test_a_missing_field_is_named():
    for name in ("nr", "dr", "r_min"):
        with pytest.raises(TypeError, match=f"argument: '{name}'") as error:
            without(name)()
        assert "\n" not in str(error.value)


def test_what_the_cases_change_is_good():
    assert page.run(Z, P, rng()).existence.shape == (5,)
    assert page.step(START, Z[0], P, rng())[0].k == 1
    assert page.run([*Z[:2], None, *Z[2:]], P, rng()).existence.shape == (6,)
    assert page.run(Z[:1], P, rng(), START).existence.shape == (1,)
    tiny = page.scenario(2, 3, 4.0, 0.02, 800.0, N=5, B=5, window=2)
    few = rng().standard_exponential((40, 2, 3))
    assert page.run(few, tiny, rng()).existence.shape == (40,)
