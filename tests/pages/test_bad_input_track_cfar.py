"""What chapter 04 refuses: each wrong argument is a ValueError of one line that names it."""

import math

import numpy as np
import pytest

import tbdcore

PAIR, M = (10.0, 0.002), 3
STATE, P = np.array([20e3, -120.0, 9e3, 90.0]), np.diag([100.0, 1.0, 100.0, 1.0])
SWAP = [0, 2, 1, 3]  # x, y, vx, vy


@pytest.fixture(scope="module")
def page():
    return tbdcore.page("track_cfar")


def mine(page, **change):
    fields = {"scan": 4.0, "bandwidth": 5.0, "beamwidth": 1.5, "sigma_p": 1.0}
    return page.Scenario(**(fields | change))


def scans(columns=3):
    """Six scans of the target that STATE starts, with two plots from the third on."""
    place = STATE[::2] + np.outer(4.0 * np.arange(1, 7), STATE[1::2])
    plots = np.column_stack([np.hypot(*place.T), np.arctan2(*place.T[::-1]), np.full(6, 30.0)])
    plots = np.column_stack([plots, np.full(6, 10.0), np.full(6, 0.002)])[:, :columns]
    return [plots[k : k + 1][[0] if k < 2 else [0, 0]] for k in range(6)]


def changed(value, column=0, columns=3):
    """Scans with one value changed in plot 1 of scan 4."""
    found = scans(columns)
    found[4][1, column] = value
    return found


def run(given=None, **options):
    """A call of `run` with one argument that is wrong."""
    return lambda page: page.run(
        scans() if given is None else given, mine(page), **({"accuracy": PAIR} | options)
    )


def begun(x=STATE, P=P):
    return run(start=(x, P))


def step(scan=None, **options):
    def call(page):
        track = page.start(mine(page), scans(), accuracy=PAIR)
        page.step(track, scans()[2] if scan is None else scan, mine(page), **options)

    return call


def start(given, **options):
    return lambda page: page.start(mine(page), given, **options)


def field(**change):
    return lambda page: page.Scenario(**change)


def deleted(page):
    page.run(scans(), mine(page), start=page.Track(STATE, P, M))


def test_what_is_changed_below_is_good(page):
    for call in (run(), run(changed(2e4, columns=5)), begun(), step(), start(scans())):
        call(page)
    page.Scenario(track_pfa=1 - 2**-53, cell_pfa=1 - 2**-53, gate_g=1e-100)


LAW = "threshold.*: .*give a function that turns false-alarm probabilities into as many thresholds$"
ACCURACY = r"accuracy.*: .*give a positive pair \(m, rad\), or a function of the range"
TABLE = r"scans\[4\]: no table of real numbers; give an \(n, 3\) array$"
START = r"start.*: .*give a Track, or \(x, P\): x \(4,\) = \[x, vx, y, vy\]"
DEVIATIONS = r"scans\[4\]\[1\]: .* needs positive standard deviations in m and rad$"
CASES = [
    (run(3), "scans: give a list"),
    (run("scans"), "scans: give a list"),
    (run({"scan": 1}), "scans: give a list"),
    (run(np.zeros((5, 3))), "scans: give a list"),
    (run([]), "scans: 0; two start the track, give 3, or start="),
    (run(scans()[:2]), "scans: 2; two start the track, give 3, or start="),
    (run([], start=(STATE, P)), "scans: 0"),
    (run(scans()[2:]), r"scans\[0\]: 2 plots; give the one that starts, or start="),
    (run([[], *scans()]), r"scans\[0\]: 0 plots; give the one that starts, or start="),
    (run([scans()[0], None, *scans()]), r"scans\[1\]: 0 plots; give the one that starts"),
    (run([cells[:, :1] for cells in scans()]), r"scans\[0\]: shape .* give a row for each plot"),
    (run([*scans()[:4], np.ones((2, 4))]), r"scans\[4\]: shape .* give a row for each plot"),
    (run([*scans()[:4], np.ones(3)]), r"scans\[4\]: shape .* give a row for each plot"),
    (run([*scans()[:4], 5.0]), r"scans\[4\]: shape .* give a row for each plot"),
    (run([*scans()[:4], [["a", 1, 2]]]), TABLE),
    (run([*scans()[:4], "plots"]), TABLE),
    (run([*scans()[:4], [[1, 2, 3], [4, 5]]]), TABLE),
    (run([*scans()[:4], [[1j, 2, 3]]]), TABLE),
    (run([*scans()[:4], np.ma.masked_less(scans()[4], 1.0)]), r"scans\[4\]: a masked array"),
    (run(np.ma.masked_less(np.ones((5, 1, 3)), 2.0)), r"scans\[0\]: a masked array"),
    # Plots: NaN, kilometres, degrees, decibels, accuracies
    (run(changed(math.nan)), r"scans\[4\]\[1\]: .* is NaN; leave the plot out"),
    (run(changed(math.nan, 2)), r"scans\[4\]\[1\]: .* is NaN; .* inf as its strength"),
    (run(changed(-5.0)), r"scans\[4\]\[1\]: .* has no positive, finite range in m"),
    (run(changed(math.inf)), r"scans\[4\]\[1\]: .* has no positive, finite range in m"),
    (run([cells * [1e-3, 1, 1] for cells in scans()]), r"scans\[0\]\[0\]: .* give metres, no kil"),
    (run(changed(24.0, 1)), r"scans\[4\]\[1\]: .* azimuth beyond 2 pi; give radians of one turn"),
    (run(changed(9.4, 1)), r"scans\[4\]\[1\]: .* azimuth beyond 2 pi; give radians of one turn"),
    (run(changed(100.0, 1)), r"scans\[4\]\[1\]: .* azimuth beyond 2 pi; give radians of one turn"),
    (run(changed(1e300, 1)), r"scans\[4\]\[1\]: .* azimuth beyond 2 pi"),
    (run(changed(-math.inf, 1)), r"scans\[4\]\[1\]: .* azimuth beyond 2 pi"),
    (run(changed(-3.0, 2)), r"scans\[4\]\[1\]: .* negative lambda; give a power ratio, not dB"),
    (run(changed(0.0, 3, 5)), DEVIATIONS),
    (run(changed(math.inf, 3, 5)), DEVIATIONS),
    (run(changed(2.0, 4, 5)), DEVIATIONS),
    # Accuracy, threshold, p_cell, T
    (run(accuracy=10.0), ACCURACY),
    (run(accuracy="10 m"), ACCURACY),
    (run(accuracy=(10.0, -1.0)), ACCURACY),
    (run(accuracy=(10.0, 2.0)), ACCURACY),
    (run(accuracy=(1e7, 0.002)), ACCURACY),
    (run(accuracy=(1e-13, 0.002)), ACCURACY),
    (run(accuracy=lambda r: np.full(3, 0.002)), ACCURACY),
    (run(accuracy=lambda r, p, T: PAIR), ACCURACY),
    (run(accuracy=(10.0, 0.1j)), ACCURACY),
    (run(accuracy=((10.0,), (0.1, 2))), ACCURACY),
    (run(accuracy=np.ma.masked_less([1.0, 1.0], 2.0)), ACCURACY),
    (run(accuracy=lambda r: (math.nan, 1.0)), ACCURACY),
    (run(accuracy=lambda r: np.ones((2, 2))), ACCURACY),
    (run(accuracy=lambda: PAIR), ACCURACY),
    (run(threshold=5.0), LAW),
    (run(threshold=lambda: 5.0), LAW),
    (run(threshold=lambda P_f: math.nan), LAW),
    (run(threshold=lambda P_f: [5.0, 6.0]), LAW),
    (run(threshold=lambda P_f: np.ones((2, 2))), LAW),
    (run(threshold=lambda P_f: "5"), LAW),
    (run(p_cell=2.0), r"p_cell: 2 is .*; give a number in \(0, 1\)"),
    (run(p_cell=1.0), r"p_cell: 1 is .*; give a number in \(0, 1\)"),
    (run(p_cell=math.nan), "p_cell: nan is .*; give"),
    (run(p_cell="1e-6"), "p_cell: .*; give"),
    (run(p_cell=np.array([1e-3, 1e-4])), "p_cell: shape .*; give"),
    (run(p_cell=1e-3j), "p_cell: .* complex.*; give"),
    (run(T=4.0), r"T.*: .*; give 5 positive times in s"),
    (run(T=[4.0] * 6), r"T.*: .*; give 5 positive times in s"),
    (run(T=[4.0, 4.0, 0.0, 4.0, 4.0]), r"T.*: .*; give 5 positive times in s"),
    (run(T=[4.0, 4.0, math.nan, 4.0, 4.0]), r"T.*: .*; give 5 positive times in s"),
    (run(T=["4 s"] * 5), r"T.*: .*; give 5 positive times in s"),
    (run(T=[4.0] * 5, start=(STATE, P)), r"T.*: .*; give 6 positive times in s"),
    # Start: type, order of the state, covariance, a track that has ended
    (run(start=5.0), START),
    (run(start="track"), START),
    (run(start=np.zeros(4)), START),
    (run(start=(1, 2, 3)), START),
    (begun(np.zeros(3)), START),
    (begun("abcd"), START),
    (begun(STATE + 1j), START),
    (begun(np.ma.masked_less(STATE, 0.0)), START),
    (begun(P=math.nan * P), START),
    (begun(P=np.eye(3)), START),
    (begun(P=-P), "start: P is no covariance, or singular; make it positive definite"),
    (begun(P=np.arange(16.0).reshape(4, 4)), "start: P is no covariance, or singular"),
    (begun(P=np.zeros((4, 4))), "start: P is no covariance, or singular"),
    (begun(P=np.diag([100.0, 0.0, 100.0, 1.0])), "start: P is no covariance, or singular"),
    (begun(P=np.outer(STATE, STATE)), "start: P is no covariance, or singular"),
    (begun(STATE[SWAP], P[SWAP][:, SWAP]), "start: fits the plots in the order x, y, vx, vy"),
    (deleted, "start: a track deleted after 3 misses; start another"),
    # start and step
    (start(scans()[:1]), "scans: 1; two start the track"),
    (start(scans()[1:3]), r"scans\[1\]: 2 plots"),
    (start(scans(), accuracy=-1), ACCURACY),
    (start(scans(), T=-4.0), r"T.*: .*; give 1 positive time in s"),
    (step([[20.0, 0.4, 5.0]]), r"scan\[0\]: .* give metres"),
    (step(T="soon"), r"T.*: .*; give 1 positive time in s"),
    (step(p_cell=0.0), "p_cell: 0 is .*; give"),
    (step(threshold=lambda P_f: -1.0), LAW),
    (lambda page: page.step(None, scans()[2], mine(page)), START),
    # Scenario
    (lambda page: page.run(scans(), {"scan": 4.0}), r"p: give Scenario\(\.\.\.\)$"),
    (lambda page: page.run(scans(), mine(page, scan=np.ones(2))), "scan: give one number"),
    (field(bandwidth=5e6), r"Scenario\.bandwidth: .* in \[0.001, 10000\]"),
    (field(bandwidth=1e9), r"Scenario\.bandwidth: .* in \[0.001, 10000\]"),
    (field(bandwidth=0.0), r"Scenario\.bandwidth: "),
    (field(beamwidth=math.inf), r"Scenario\.beamwidth: "),
    (field(beamwidth=400.0), r"Scenario\.beamwidth: "),
    (field(scan=-1.0), r"Scenario\.scan: "),
    (field(scan="4 s"), r"Scenario\.scan: "),
    (field(scan=4.0 + 1j), r"Scenario\.scan: "),
    (field(gate_g=-4.0), r"Scenario\.gate_g: "),
    (field(gate_g=math.nan), r"Scenario\.gate_g: "),
    (field(track_pfa=1.0), r"Scenario\.track_pfa: 1.0; give a number in \[1e-300, 1\)"),
    (field(track_pfa=0.0), r"Scenario\.track_pfa: "),
    (field(cell_pfa=1.0), r"Scenario\.cell_pfa: "),
    (field(range0="far"), r"Scenario\.range0: "),
    (field(range0=1e8), r"Scenario\.range0: "),
    (field(azimuth0=4000.0), r"Scenario\.azimuth0: "),
    (field(speed=math.nan), r"Scenario\.speed: "),
    (field(snr0_db=None), r"Scenario\.snr0_db: "),
    (field(miss_limit=0), r"Scenario\.miss_limit: "),
    (field(miss_limit=2.5), r"Scenario\.miss_limit: "),
    (field(frames=0), r"Scenario\.frames: "),
    (field(sigma_p=-0.1), r"Scenario\.sigma_p: "),
    (field(sigma_p=1e9), r"Scenario\.sigma_p: "),
    (field(range_noise=0.0), r"Scenario\.range_noise: "),
    (field(angle_noise=np.array([1.0, -1.0])), r"Scenario\.angle_noise: "),
    (field(tracker="extended kalman filter"), r"Scenario\.tracker: .* the nearest is 'extended K"),
    (field(fluctuation="Swerling III"), r"Scenario\.fluctuation: "),
    (field(noise="Laplace"), r"Scenario\.noise: "),
]


@pytest.mark.parametrize(("call", "words"), CASES)
def test_a_wrong_argument_is_named_in_a_line(page, call, words):
    with pytest.raises(ValueError, match=f"^{words}") as refused:
        call(page)
    assert "\n" not in str(refused.value)
