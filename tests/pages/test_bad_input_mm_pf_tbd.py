"""What the chapter of multiple-model particle filters refuses, each in one line."""

from dataclasses import replace

import numpy as np
import pytest

import tbdcore
from tbdcore.recording import misfit

page = tbdcore.page("mm_pf_tbd")
P = page.Scenario(M=50, M_new=50)
Z = page.simulate(page.Scene(frames=5), np.random.default_rng(50))
START = page.start(P, np.random.default_rng(1))


def rng():
    return np.random.default_rng(55)


def run(z=Z, p=P, rng=rng, **given):
    return lambda: page.run(z, p, rng() if callable(rng) else rng, **given)


def step(frame=Z[0], state=START, p=P, **given):
    return lambda: page.step(state, frame, p, rng(), **given)


def bernoulli(z=Z, **prior):
    return lambda: page.bernoulli(z, replace(P, prior=page.Prior(**prior)), rng())


def scenario(**change):
    return lambda: page.Scenario(**change)


def prior(**change):
    return lambda: page.Prior(**change)


def scene(**change):
    return lambda: page.Scene(**change)


def sky(s=None, rng=rng, **given):
    s = page.Scene() if s is None else s
    return lambda: page.simulate(s, rng() if callable(rng) else rng, **given)


def last(**change):
    return START._replace(**change)


def spoiled(value, at=(3, 4, 5)):
    z = Z.copy()
    z[at] = value
    return z


def ratios(f):
    return run(likelihood=lambda frame, r, S, p: f(r))


CHAIN = (0.9, 0.05, 0.05), (0.1, 0.8, 0.1), (0.1, 0.1, 0.8)
CASES = [
    # frames
    (run(Z.transpose(0, 2, 1)), r"^frames\[0\]: shape \(20, 30\) is not \(nx, ny\) with nx = 30"),
    (run(Z[:, :12]), r"^frames\[0\]: shape \(12, 20\) is not"),
    (run(Z[0]), r"^frames: shape \(30, 20\); give \(K, nx, ny\), one frame as z\[None\]$"),
    (run(Z[:0]), r"^frames: there are none; give at least one$"),
    (run([]), r"^frames: there are none"),
    (run(Z[:2]), r"^frames: 2 are fewer than N = 3; give a smaller N$"),
    (run(1j * Z), r"^frames\[0\]: values of type complex128; give real numbers$"),
    (run(spoiled(np.inf)), r"^frames\[3\]\[4, 5\]: inf is not finite$"),
    (run(spoiled(-np.inf)), r"^frames\[3\]\[4, 5\]: -inf is not finite$"),
    (run(np.ma.masked_greater(Z, 5.0)), r"^frames: a masked array; fill it"),
    (run([np.ma.masked_greater(z, 1.0) for z in Z]), r"^frames\[0\]: a masked array; fill it"),
    (run(Z > 1), r"^frames\[0\]: values of type bool; give real numbers"),
    (run(Z.astype(str)), r"^frames\[0\]: values of type <U32; give real numbers"),
    (run("frames"), r"^frames: shape \(\); give"),
    (run(None), r"^frames: shape \(\); give"),
    (run(3), r"^frames: shape \(\); give"),
    (run(frame for frame in Z), r"^frames: shape \(\); give"),
    (run(["one", "two", "three"]), r"^frames\[0\]: values of type <U3; give real numbers"),
    (run([Z[0], Z[1][:5], Z[2]]), r"^frames\[1\]: shape \(5, 20\) is not"),
    (run([[1.0, [2.0]], Z[1], Z[2]]), r"^frames\[0\]: rows of several lengths"),
    (run(Z + 100.0), r"^frames\[0\]: its median is 43.*; subtract the background"),
    (run(np.round(100 + 20 * Z)), r"^frames\[0\]: its median is .* times the noise; subtract"),
    (
        run(Z * 30.0),
        r"^frames\[0\]: .* its spread [23]\d.* times the noise; .* measure Scene.noise",
    ),
    (run(Z * 10.0), r"^frames\[0\]: .* its spread (9|1\d)[.\d]* times the noise; .* measure"),
    (run(Z / 30.0), r"^frames\[0\]: .* its spread 0.03\d* times the noise"),
    (run(spoiled(0.0, 2)), r"^frames\[2\]: its median is 0, its spread 0 .*; None for a frame"),
    (run(Z.astype(object)), r"^frames\[0\]: values of type object; give real numbers"),
    # what else a run takes
    (run(p={"M": 20}), r"^p: give Scenario\(scene=Scene\(...\)\)$"),
    (run(p=page.Scene()), r"^p: give Scenario"),
    (run(rng=1), r"^rng: give np.random.default_rng\(seed\)$"),
    (run(rng=None), r"^rng: give"),
    (run(rng=np.random.RandomState(1)), r"^rng: give"),
    (run(T=2.0), r"^T: shape \(\) is not \(5,\)"),
    (run(T=[1.0, 2.0]), r"^T: shape \(2,\) is not \(5,\)"),
    (run(T=[1.0, 1.0, 0.0, 1.0, 1.0]), r"^T\[2\]: 0 is not in \[1e-06, 1e\+06\]"),
    (run(T=[1.0, 1.0, np.nan, 1.0, 1.0]), r"^T\[2\]: nan is not in"),
    (run(T=["1 s"] * 5), r"^T: values of type <U3; give real numbers"),
    # a likelihood of the caller
    (run(likelihood=None), r"^likelihood: give a function of \(frame, r, S, p\)$"),
    (run(likelihood=3.0), r"^likelihood: give a function"),
    (run(likelihood="normal"), r"^likelihood: give a function"),
    (ratios(lambda r: None), r"^likelihood: values of type object; give real numbers$|shape"),
    (ratios(lambda r: 1.0), r"^likelihood: shape \(\) is not \(100,\)"),
    (ratios(lambda r: np.zeros(r.size + 1)), r"^likelihood: shape \(101,\) is not \(100,\)"),
    (ratios(lambda r: np.zeros((r.size, 1))), r"^likelihood: shape \(100, 1\) is not"),
    (ratios(lambda r: np.where(r > 0, np.nan, 0.0)), r"^likelihood\[\d+\]: nan is not in"),
    (ratios(lambda r: np.where(r > 0, np.inf, 0.0)), r"^likelihood\[\d+\]: inf is not in"),
    (ratios(lambda r: np.zeros(r.size, complex)), r"^likelihood: values of type complex128"),
    (ratios(lambda r: ["a"] * r.size), r"^likelihood: values of type <U1"),
    (ratios(lambda r: np.ones(r.size)), r"^likelihood: not 0 for an absent particle; give ratios"),
    # a step and its state
    (step(Z), r"^frame: shape \(5, 30, 20\) is not \(nx, ny\)"),
    (step(Z[0].T), r"^frame: shape \(20, 30\) is not"),
    (step(Z[0] + 100.0), r"^frame: its median is 43"),
    (step(T=0.0), r"^T: 0.0 is no number in"),
    (step(T="1 s"), r"^T: '1 s' is no number in"),
    (step(T=[1.0]), r"^T: \[1.0\] is no number in"),
    (step(p=None), r"^p: give Scenario"),
    (step(state=None), r"^state: give start\(p, rng\), or the result of a run$"),
    (step(state=(START.r, START.S)), r"^state: give start"),
    (step(state=START.S), r"^state: give start"),
    (step(state=last(r=START.r + 0.0)), r"^state.r: values of type float64; give integers"),
    (step(state=last(r=START.r + 3)), r"^state.r\[0\]: \d is not in \[0, 2\]"),
    (step(state=last(r=START.r[:10])), r"^state.r: shape \(10,\) is not \(50,\)"),
    (step(state=last(S=START.S[:, :4])), r"^state.S: shape \(50, 4\) is not \(50, 5\)"),
    (step(state=last(S=START.S * np.nan)), r"^state.S\[0, 0\]: nan is not in"),
    (step(state=last(S=START.S + 1e4)), r"^state.S: far outside the frame; give cells$"),
    (step(state=last(r=START.r * 0 + 1, S=START.S + 1e4)), r"^state.S: far outside the frame"),
    (step(state=last(S=np.ma.masked_greater(START.S, 1))), r"^state.S: a masked array"),
    (step(state=last(absence=())), r"^state.absence: empty; give"),
    (step(state=last(absence=(1.5,))), r"^state.absence\[0\]: 1.5 is not in \[0, 1\]"),
    (step(state=last(absence=0.9)), r"^state.absence: shape \(\) is not \(n,\)"),
    (step(state=last(s=np.zeros(4))), r"^state.s: shape \(4,\) is not \(5,\)"),
    (step(p=page.Scenario(M=60)), r"^state.r: shape \(50,\) is not \(60,\)"),
    (run(state=START, p=page.Scenario(M=60)), r"^state.r: shape \(50,\) is not \(60,\)"),
    # the Bernoulli filter
    (bernoulli(Z + 100.0), r"^frames\[0\]: its median is 43"),
    (bernoulli(absent=1.0, cv=0.0, ct=0.0), r"^prior: absent is 1; give a target a chance"),
    (bernoulli(Pi=((1, 0, 0), *CHAIN[1:])), r"^prior: Pi lets no target appear, or none stay$"),
    (bernoulli(Pi=(CHAIN[0], (1, 0, 0), CHAIN[2])), r"^prior: Pi lets no target appear, or none"),
    (lambda: page.bernoulli(Z, replace(P, M_new=0), rng()), r"^p.M_new: 0; .* needs births$"),
    # the filter
    (scenario(M=0), r"^Scenario.M: 0; give an integer in"),
    (scenario(M="2000"), r"^Scenario.M: '2000'; give an integer"),
    (scenario(M=2000.5), r"^Scenario.M: 2000.5; give an integer"),
    (scenario(M=[2000]), r"^Scenario.M: \[2000\]; give an integer"),
    (scenario(M=10**12), r"^Scenario.M: 1000000000000; give an integer in"),
    (scenario(M=np.arange(5000)), r"^Scenario.M: array\(.*\); give an integer"),
    (scenario(M=True), r"^Scenario.M: True; give an integer"),
    (scenario(M_new=-1), r"^Scenario.M_new: -1; give an integer"),
    (scenario(M_new=10**12), r"^Scenario.M_new: 1000000000000; give an integer in"),
    (scenario(eta=1.1), r"^Scenario.eta: 1.1; give a number"),
    (scenario(gamma=1.001), r"^Scenario.gamma: 1.001; give a number"),
    (scenario(gamma=0.0), r"^Scenario.gamma: 0.0; give"),
    (scenario(gamma=np.nan), r"^Scenario.gamma: nan; give"),
    (scenario(weight=0.0), r"^Scenario.weight: 0.0; give"),
    (scenario(N=0), r"^Scenario.N: 0; give"),
    (scenario(N=None), r"^Scenario.N: None; give"),
    (scenario(spread=(-0.5, 0.3)), r"^Scenario.spread: \(-0.5, 0.3\); give 2 numbers in \[0"),
    (scenario(spread=0.5), r"^Scenario.spread: 0.5; give 2 numbers"),
    (scenario(gate="ajar"), r"^Scenario.gate: 'ajar' is unknown; the nearest is"),
    (scenario(births="resurrect"), r"^Scenario.births: 'resurrect' is unknown"),
    (scenario(scene=3), r"^Scenario.scene: 3; give a Scene$"),
    (scenario(prior=page.Scene()), r"^Scenario.prior: Scene\(.*; give a Prior$"),
    (scenario(scene=page.Scene(nx=64, ny=48), prior=page.Prior()), r"does not cover the 64 cells"),
    (scenario(prior=page.Prior(y=(5, 25))), r"^prior: y = \(5, 25\) does not cover the 20 cells"),
    # what it believes
    (prior(Pi=(CHAIN[0], (0.1, 0.8, 0.2), CHAIN[2])), r"Pi\[1\]: .* do not sum to 1"),
    (prior(Pi=((0.9, 0.1), (0.1, 0.9))), r"^Prior.Pi: .*; give 3 x 3 numbers"),
    (prior(Pi=((0.9, 0.1), (0.1, 0.8, 0.1), (1,))), r"^Prior.Pi: .*; give 3 x 3 numbers"),
    (prior(Pi=None), r"^Prior.Pi: None; give 3 x 3 numbers"),
    (prior(Pi=((1.9, -0.9, 0.0), *CHAIN[1:])), r"Pi\[0, 0\]: 1.9 is not in"),
    (prior(absent=0.8), r"^prior: absent \+ cv \+ ct is 0.9; they must sum to 1$"),
    (prior(absent=-0.2, cv=0.6, ct=0.6), r"^Prior.absent: -0.2; give a number in \[0, 1\]"),
    (prior(vx=(2, -2)), r"^prior: vx = \(2, -2\) is no interval; give \(low, high\)$"),
    (prior(x=(0, 10, 30)), r"^Prior.x: \(0, 10, 30\); give 2 numbers"),
    (prior(x=(0, np.inf)), r"^Prior.x: \(0, inf\); give 2 numbers"),
    (prior(accel=-0.1), r"^Prior.accel: -0.1; give a number in \[0"),
    (prior(accel="0.1"), r"^Prior.accel: '0.1'; give a number"),
    # the scene
    (scene(blur=1.3), r"^Scene.blur: 1.3 is above 0.8 cells; bin the frames with recording.bin_"),
    (scene(blur=0.02), r"^Scene.blur: 0.02; give a number in \[0.1, 0.8\]"),
    (scene(blur=[0.6, 0.6]), r"^Scene.blur: \[0.6, 0.6\]; give a number"),
    (scene(blur=np.nan), r"^Scene.blur: nan; give a number"),
    (scene(amplitude=-1), r"^Scene.amplitude: -1; give a number in \[0"),
    (scene(amplitude=1e9), r"^Scene.amplitude: 1e\+09 is above 1e6 times the noise; lower it$"),
    (scene(amplitude=np.inf), r"^Scene.amplitude: inf; give"),
    (scene(noise=0.0), r"^Scene.noise: 0.0; give"),
    (scene(noise=np.nan), r"^Scene.noise: nan; give"),
    (scene(nx=0), r"^Scene.nx: 0; give an integer"),
    (scene(ny=20.5), r"^Scene.ny: 20.5; give an integer"),
    (scene(T=0.0), r"^Scene.T: 0.0; give"),
    (scene(x=np.nan), r"^Scene.x: nan; give a number"),
    (scene(speed=np.inf), r"^Scene.speed: inf; give a number"),
    (scene(turns=(0.3,)), r"^Scene.turns: \(0.3,\); give 2 numbers"),
    (scene(frames=-1), r"^Scene.frames: -1; give an integer"),
    (scene(frames=10**12), r"^Scene.frames: 1000000000000; give an integer"),
    (scene(legs=((7, 21),)), r"^Scene.legs: 1 of them; give 5, straight and turning in turn$"),
    # the simulator
    (sky(page.Scene(x=31.0)), r"^scene: in frame 7 the target is outside the 30 x 20 image"),
    (sky(page.Scene(speed=2.0)), r"^scene: in frame \d+ the target is outside"),
    (sky(page.Scene(heading=np.pi)), r"^scene: in frame \d+ the target is outside"),
    (sky(3), r"^s: give Scene\(...\)$"),
    (sky(rng=1), r"^rng: 1; give a numpy.random.Generator$"),
    (sky(fade="0"), r"^fade: values of type <U1; give real numbers"),
    (sky(fade=[1.0, 0.5]), r"^fade: shape \(2,\); give a number, or one for each of 60 frames"),
    (sky(fade=[1.0, [0.5]]), r"^fade: rows of several lengths"),
    (sky(fade=np.nan), r"^fade: nan is not in|^fade\[0\]: nan is not in"),
]


@pytest.mark.parametrize("case", range(len(CASES)))
def test_bad_input_is_refused_in_one_line(case):
    call, message = CASES[case]
    with pytest.raises(ValueError, match=message) as error:
        call()
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 200


WRONG = {  # told wrong, in silence until now: frames of unit noise -> what is named first
    "mean": lambda z: z + 0.4,
    "level": lambda z: 3.0 * z,
    "slope": lambda z: z + np.linspace(-0.5, 0.5, 32)[:, None],
    "neighbours": lambda z: (z[:, 1:-1] + 0.5 * z[:, :-2] + 0.5 * z[:, 2:]) / 1.5**0.5,
    "tails": lambda z: np.sign(z) * (np.exp(abs(z)) - 1) / 2.3,
}


@pytest.mark.parametrize("what", WRONG)
def test_noise_that_is_not_what_was_told_gives_one_warning(what):
    z = WRONG[what](np.random.default_rng(60).standard_normal((60, 32, 20)))
    p = page.Scenario(M=50, M_new=50, scene=page.Scene(nx=z.shape[1], ny=20, noise=1.0))
    words = {"mean": "level", "level": "spread", "neighbours": "next", "tails": "tail"}
    with pytest.warns(misfit.Misfit, match=f"{words.get(what, what)}.* of the noise is") as said:
        page.run(z, p, rng())
    assert len(said) == 1
    assert said[0].filename == __file__
    page.step(page.start(p, rng()), z[0], p, rng())  # a warning would be an error


@pytest.mark.parametrize("size", [(10, 10), (64, 40)])
def test_noise_is_refused_beyond_eight_times_and_four_deviations(size):
    """Spread by quartiles, of every third cell of a long side; below 100 cells nothing is said."""
    z = np.random.default_rng(61).standard_normal(size)
    few = z[:: size[0] // 32 + 1, :: size[1] // 32 + 1]
    low, middle, high = np.quantile(few, (0.25, 0.5, 0.75))
    z = (z - middle) / ((high - low) / 1.349)
    p = page.Scenario(M=9, M_new=0, scene=page.Scene(nx=size[0], ny=size[1], noise=1.0))
    for good in (0.2 * z, 0.9 * z, 7.9 * z, z + 3.9, z - 3.9):
        page.step(page.start(p, rng()), good, p, rng())
    for wrong in (0.1 * z, 8.1 * z, z + 4.1, z - 4.1):
        with pytest.raises(ValueError, match="^frame: its median is"):
            page.step(page.start(p, rng()), wrong, p, rng())
    thin = page.Scenario(M=9, M_new=0, scene=page.Scene(nx=11, ny=9, noise=1.0))
    page.step(page.start(thin, rng()), 9 + np.zeros((11, 9)), thin, rng())  # too few to say


def test_the_time_between_frames_ends_at_its_limits():
    for T in (1e-6, 1e6):
        page.step(START, Z[0], P, rng(), T)
    for T in (0.9999999e-6, 1.0000001e6):
        with pytest.raises(ValueError, match="^T: .* is no number in"):
            page.step(START, Z[0], P, rng(), T)


def test_what_the_cases_change_is_good():
    assert page.run(Z, P, rng()).existence.shape == (5,)
    assert page.step(START, Z[0], P, rng())[1].s.shape == (5,)
    assert page.run(Z[:1], P, rng(), START).existence.shape == (1,)
    assert page.run(list(Z), replace(P, M_new=500), rng()).existence.shape == (5,)  # more births
    assert page.run(Z.astype(np.float32).tolist(), P, rng()).existence.shape == (5,)
    assert page.bernoulli(Z, P, rng()).log_evidence.shape == (5,)
    ratio = page.run(100 + 9 * Z, P, rng(), likelihood=lambda frame, r, S, p: 0.0 * r)
    assert np.isfinite(ratio.log_evidence).all()  # of a likelihood of its own the units are free


@pytest.mark.parametrize(
    "Pi",
    [
        ((0.9, 0.1, 0.0), (0.1, 0.9, 0.0), (0.1, 0.9, 0.0)),  # nothing turns
        ((0.9, 0.0, 0.1), (0.1, 0.0, 0.9), (0.1, 0.0, 0.9)),  # nothing flies straight
        ((0.0, 0.5, 0.5), (0.0, 0.5, 0.5), (0.0, 0.5, 0.5)),  # a target is always there
    ],
)
def test_a_regime_that_no_row_reaches_is_never_said(Pi):
    p = replace(P, M=400, prior=page.Prior(Pi=Pi))
    empty = np.flatnonzero(~np.any(Pi, axis=0))
    for filtered in (page.run, page.bernoulli):
        said = filtered(Z, replace(p, M_new=0 if filtered is page.run else 50), rng())
        shares = np.array([1 - said.existence, said.existence * (1 - said.turning), said.turning])
        assert np.isfinite(said.existence).all()
        assert (np.nan_to_num(shares)[empty, 1:] < 1e-9).all()
