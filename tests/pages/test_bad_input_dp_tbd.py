"""What the chapter of dynamic programming refuses, each in one line that says what to give."""

import math
from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from tbdcore.kernels import dp_tbd

page = tbdcore.page("dp_tbd")
P = page.Scenario(K=5, grid=(9, 14), M=2)
Z = np.random.default_rng(50).standard_normal((9, 9, 14))
NOISE = np.random.default_rng(51).standard_normal((30, 9, 9, 14))
START = page.start(P)


def run(z=Z, V_T=20.0, p=P, **given):
    return lambda: page.run(z, p, V_T, **given)


def detect(z=Z[:5], V_T=20.0, p=P, **given):
    return lambda: page.detect(z, p, V_T, **given)


def step(frame=Z[0], state=START, p=P, V_T=20.0, **given):
    return lambda: page.step(state, frame, p, V_T, **given)


def maxima(searches=NOISE, p=P, **given):
    return lambda: page.noise_maxima(searches, p, **given)


def scenario(**change):
    return lambda: page.Scenario(**change)


def spoiled(value):
    z = Z.copy()
    z[3, 4, 5] = value
    return z


def off_the_frame():
    x = np.array([351_550.0, 350_350.0, 170.0, 190.0])
    cells = page.truth(-0.4, x, page.Scenario(), None)[1]
    return dp_tbd.point_frames(np.zeros((11, 50, 50)), cells, 1.0)


def never_inside():
    p, rng = page.Scenario(x0=(349, 349.1), process_noise=1.0), np.random.default_rng(1)
    return page.truth(0.0, page.first_state(p, rng), p, rng)


GRID = r"does not fit the grid \(9, 14\)"
ALGORITHM = r"^algorithm: give page.tonissen, conventional, weighted or penalised\(0.5\), without q"

CASES = [
    # frames
    (run(Z.transpose(0, 2, 1)), rf"^frames: shape \(9, 14, 9\) {GRID}; transpose the frames$"),
    (run(Z[:, :8]), rf"^frames: shape \(9, 8, 14\) {GRID}; set Scenario\(grid=...\) or cut"),
    (run(Z[0]), r"^frames: shape \(9, 14\) is not \(K, nx, ny\)"),
    (run(Z[:4]), r"^frames: 4 are fewer than K = 5; give more, or lower K$"),
    (run(p=replace(P, K=10)), r"^frames: 9 are fewer than K = 10; give more, or lower K$"),
    (run(Z[:0]), r"^frames: shape \(0, 9, 14\) has no cells"),
    (run([]), r"^frames: shape \(0,\) is not"),
    (run([None] * 9), r"^frames: every frame is missing; give at least one$"),
    (run(1j * Z), r"^frames: values of type complex128; .*; pass abs\(z\)\*\*2, its noise in mean"),
    (run(spoiled(np.inf)), r"^frames\[3, 4, 5\]: inf is not finite"),
    (run(np.ma.masked_greater(Z, 1.0)), r"^frames: a masked array; fill it"),
    (run([np.ma.masked_greater(z, 1.0) for z in Z]), r"^frames: a masked array; fill it"),
    (run(Z > 1), r"^frames: values of type bool; give real numbers"),
    (run("frames"), r"^frames: values of type <U6; give real numbers$"),
    (run(Z.astype(str)), r"^frames: values of type <U\d+; give real numbers"),
    (run(None), r"^frames: values of type object; give real numbers$"),
    (run(frame for frame in Z), r"^frames: values of type object; give real"),
    (run([Z[0], Z[1][:5], Z[2]]), r"^frames: rows of several lengths"),
    (run([[["a"] * 14] * 9] * 9), r"^frames: values of type <U1"),
    (detect(Z), r"^frames: 9 of them, but K = 5; cut them, set K, or use run$"),
    (detect(Z[:4]), r"^frames: 4 of them, but K = 5"),
    (detect(Z[:5, :, :2]), GRID),
    (detect(5), r"^frames: shape \(\) is not"),
    # a step and its state
    (step(Z), r"^frame: shape \(1, 9, 9, 14\) is not"),
    (step(Z[0].T), rf"^frame: shape \(1, 14, 9\) {GRID}; transpose"),
    (step(1j * Z[0]), r"^frame: values of type complex128; .*; pass abs"),
    (step(spoiled(np.inf)[3]), r"^frame\[0, 4, 5\]: inf is not finite"),
    (step(np.ma.masked_greater(Z[0], 1.0)), r"^frame: a masked array"),
    (step("frame"), r"^frame: values of type <U5; give real numbers$"),
    (step(state=None), r"^state: give start\(p\), or the state of step or run$"),
    (step(state=Z[:4]), r"^state: give start"),
    (step(state=page.State(Z)), r"^state.frames: 9 of them, but K = 5; start anew$"),
    (step(state=page.State(Z[:3, :, :9])), rf"^state.frames: shape \(3, 9, 9\) {GRID}"),
    (step(state=page.State(None)), r"^state.frames: values of type object; give"),
    (step(state=page.State(spoiled(np.inf)[:4])), r"^state.frames\[3, 4, 5\]: inf is not"),
    (run(state=0), r"^state: give start"),
    (run(state=page.run(Z, P, 99.0)), r"^state: give start"),
    (lambda: page.start(None), r"^p: give Scenario\(...\)$"),
    # what else they take
    (run(p=None), r"^p: give Scenario\(...\)$"),
    (step(p={"K": 5}), r"^p: give Scenario\(...\)$"),
    (maxima(p=5), r"^p: give Scenario\(...\)$"),
    (run(V_T=np.nan), r"^V_T: nan is no number"),
    (run(V_T=None), r"^V_T: None is no number"),
    (run(V_T="20"), r"^V_T: '20' is no number"),
    (run(V_T=[20.0, 20.0, 20.0]), r"^V_T: \[20.0, 20.0, 20.0\] is no number"),
    (detect(V_T=np.zeros(2)), r"^V_T: array\(\[0., 0.\]\) is no number"),
    (run(algorithm="tonissen"), ALGORITHM),
    (run(algorithm=None), ALGORITHM),
    (step(algorithm=page.penalised), ALGORITHM),
    (maxima(algorithm=lambda p: None), ALGORITHM),
    (detect(algorithm=lambda p, dtype: 5), ALGORITHM),
    (run(most=0), r"^most: 0 is no integer of at least 1"),
    (run(most=2.5), r"^most: 2.5 is no integer"),
    (run(most="all"), r"^most: 'all' is no integer"),
    (detect(most=127), r"^most: 127 paths, but a frame has 126 cells; give fewer$"),
    (lambda: page.penalised(-0.5), r"^price: -0.5 is no number in \[0, 1e\+06\]"),
    (lambda: page.penalised(math.nan), r"^price: nan is no number"),
    (lambda: page.penalised("0.5"), r"^price: '0.5' is no number"),
    (lambda: page.penalised([0.5]), r"^price: \[0.5\] is no number"),
    # searches for a threshold
    (maxima(NOISE[0]), r"^searches\[0\]: shape \(9, 14\) is not"),
    (maxima(NOISE[:, :4]), r"^searches\[0\]: 4 frames; give K = 5 or more$"),
    (maxima(like=Z[:5]), r"^searches\[0\]: 9 frames; give 5, as in like$"),
    (maxima(like=Z.T), r"^like: shape \(14, 9, 9\) does not fit the grid"),
    (maxima(NOISE[:1]), r"^searches: give two or more that differ, with the noise of your frames$"),
    (maxima(np.ones((30, 5, 9, 14))), r"^searches: give two or more that differ"),
    (maxima([]), r"^searches: give two or more that differ"),
    (maxima(30), r"^searches\[0\]: shape \(\) is not"),
    (maxima(lambda rng: NOISE[0]), r"^searches\[0\]: values of type object; give"),
    (maxima(1j * NOISE), r"^searches\[0\]: values of type complex128"),
    (maxima(np.full((3, 5, 9, 14), np.inf)), r"^searches\[0\]\[0, 0, 0\]: inf is not finite"),
    # a scenario
    (scenario(reading="r"), r"reading: 'r' is unknown; the nearest is 'm-r'"),
    (scenario(metric="taxi"), r"metric: 'taxi' is unknown"),
    (scenario(tolerance=-1), r"tolerance: -1; give an integer"),
    (scenario(tolerance=1.5), r"tolerance: 1.5; give an integer"),
    (scenario(M=2.5), r"M: 2.5; give an integer"),
    (scenario(M=0), r"M: 0; give an integer"),
    (scenario(M="3"), r"M: '3'; give an integer"),
    (scenario(M=[3]), r"M: \[3\]; give an integer"),
    (scenario(K=0), r"K: 0; give an integer"),
    (scenario(K=True), r"K: True; give an integer"),
    (scenario(N=0), r"N: 0; give an integer"),
    (scenario(slack_pos=2), "^slack_pos, slack_vel: eq"),
    (scenario(slack_vel=0), "^slack_pos, slack_vel: eq"),
    (scenario(a=0.0), r"a: 0.0; give a number in"),
    (scenario(a=1.5), r"a: 1.5; give a number in"),
    (scenario(T=0.0), r"T: 0.0; give a number in"),
    (scenario(T=math.nan), r"T: nan; give a number in"),
    (scenario(delta=-100.0), r"delta: -100.0; give a number in"),
    (scenario(process_noise=-1.0), r"process_noise: -1.0; give a number in"),
    (scenario(sigma2=0.0), r"sigma2: 0.0; give a number in"),
    (scenario(sigma2=math.inf), r"sigma2: inf; give a number in"),
    (scenario(mean=math.nan), r"mean: nan; give a number in"),
    (scenario(mean="dark"), r"mean: 'dark'; give a number in"),
    (scenario(square_law="yes"), r"square_law: 'yes'; give True or False"),
    (scenario(grid=(50, 6)), r"^grid: \(50, 6\) has no room for steps of 3 cells; lower M or give"),
    (scenario(grid=(1, 1), M=1), r"^grid: \(1, 1\) has no room for steps of 1 cells; lower M or"),
    (scenario(grid=(50, 50, 50)), r"grid: \(50, 50, 50\);"),
    (scenario(grid=(50.5, 50)), r"grid\[0\]: 50.5;|grid: \(50.5, 50\);"),
    (scenario(snr_db=(3, 5, 4)), r"^snr_db: \(3, 5, 4\); give the smallest first"),
    (scenario(snr_db=(3, math.nan)), "snr_db"),
    (scenario(snr_db=()), "snr_db"),
    (scenario(turn_rates=()), "turn_rates"),
    (scenario(turn_rates=(0.2, 0.2)), r"^turn_rates: \(0.2, 0.2\); give the smallest first"),
    # inside the experiments
    (lambda: page.track(Z[:5], page.tonissen(P, float), P), "no margin of -inf; use margin"),
    (lambda: page.keeping(np.ones(4), 1, 0, P, float), r"position: 4 slacks; give an odd number"),
    (off_the_frame, "outside"),
    (never_inside, r"^x0, y0: no track stays in the region; start in it, or lower process_noise$"),
]


@pytest.mark.parametrize("case", range(len(CASES)))
def test_bad_input_is_refused_in_one_line(case):
    call, message = CASES[case]
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


def test_what_the_cases_change_is_good():
    assert len(page.run(Z, P, 20.0).tracks) == 9
    assert page.detect(Z[:5], P, math.inf, page.weighted, most=126) == []
    assert page.step(START, Z[0], P, 20.0)[1] == []
    assert page.noise_maxima(NOISE, P, page.penalised(0)).shape == (30,)
    assert len(page.run(Z[:1], P, 20.0, state=page.run(Z, P, 20.0).state).tracks) == 1
    assert page.run([*Z[:4], None], P, 99.0).tracks == [[]] * 5
    alone = replace(P, K=1)
    assert page.run(Z[:1], alone, -np.inf, most=1).tracks[0][0].value == pytest.approx(Z[0].max())
