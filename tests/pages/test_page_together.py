"""Page 06: its scenes, the bound, and that each chapter is a method on them."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.special import i0
from scipy.stats import kstest, norm

import tbdcore
from benchmarks import seeds, together
from tbdcore import baseline, motion, recording
from tbdcore.kernels import dp_tbd
from tbdcore.repro import pages, paths, studies, trials

six = tbdcore.page("together")
p = replace(six.Setup(), N=200, births=100)
LOUD = six.Scene(snr_db=30.0)
TWO = six.Scene(n=64, K=24, enters=0, leaves=24, swerling=True, crossing=math.radians(40))


def stream(kind, name=""):
    return trials.generator(3, "together", "test" + name, 0, kind)


def scene(s, i=0):
    rngs = [trials.generator(i, "together", "test", 0, kind) for kind in ("truth", "noise")]
    return six.simulate(s, *rngs)


def test_noise_is_exponential_with_mean_one():
    _, z = scene(six.Scene())
    assert z.shape == (20, 40, 40)
    assert kstest(z.ravel()[::7], "expon").pvalue > 1e-3


@pytest.mark.parametrize("swerling", [False, True])
def test_the_snr_is_the_power_in_the_middle_of_the_echo(swerling):
    s = six.Scene(snr_db=40.0, swerling=swerling)
    tops = []
    for i in range(30):
        x, z = scene(s, i)
        (here,), there = x, slice(s.enters, s.leaves)
        h = np.exp(-((np.rint(here[:, ::2]) - here[:, ::2]) ** 2).sum(axis=1) / s.blur**2)
        at = np.rint(here[there, ::2]).astype(int) - 1
        tops.append(z[np.arange(s.enters, s.leaves), *at.T] / h[there])
    tops = np.ravel(tops) / 1e4
    if swerling:
        assert kstest(tops, "expon").pvalue > 1e-3
    else:
        assert np.abs(tops - 1).max() < 0.2


def test_the_target_is_there_from_its_entry_to_its_exit_and_inside():
    for turn in (0.0, 0.15):
        (x,), _ = scene(six.Scene(turn=turn, snr_db=0.0))
        there = np.isfinite(x).all(axis=1)
        assert there.tolist() == [3 <= k < 19 for k in range(20)]
        assert x[there][:, ::2].min() >= 1
        assert x[there][:, ::2].max() <= 40
        v = x[there][:, 1::2]
        assert 0.5 <= np.hypot(*v[0]) <= 1.0
        angle = np.diff(np.unwrap(np.arctan2(v[:, 1], v[:, 0])))
        assert np.abs(np.abs(angle) - turn).max() < 1e-9


def test_two_targets_meet_in_the_middle():
    s = six.Scene(K=24, enters=0, leaves=24, crossing=math.radians(40), snr_db=0.0)
    x, _ = scene(s)
    far = np.hypot(*(x[0] - x[1])[:, ::2].T)
    assert far.argmin() == 12
    assert far[12] < 1e-9
    assert far[0] > 5


def test_places_in_metres_come_back():
    x = np.array([[3.0, 0.5, 60.0, -0.5], [32.5, 0, 32.5, 0]])
    assert np.abs(six.to_cells(six.metres(x, 64), 64) - x[:, ::2]).max() < 0.06


def test_a_plot_is_where_the_echo_is():
    (x,), z = scene(LOUD)
    for k, rows in enumerate(six.scans(z, p)):
        assert (rows[:, 2] > six.LOW).all()
        if 3 <= k < 19:
            top = rows[rows[:, 2].argmax()]
            assert np.hypot(*(top[:2] - x[k, ::2])) < 0.5


def test_plots_are_maxima_of_the_filtered_frame_counted_once_with_the_power_of_their_cell():
    z = np.ones((2, 9, 9), np.float32)
    z[0, 0, 0], z[0, 4, 4], z[0, 4, 5], z[1, 8, 2] = 9, 8, 4, 5
    first, second = six.scans(z, p)
    assert np.allclose(first[0], [1 + 2 / 12, 1 + 2 / 12, 9])
    assert np.allclose(first[1:], [[5, 5 + 3 / 19, 8]])
    assert np.allclose(second[:, 2], 5)


@pytest.mark.parametrize(("cells", "declared"), [(1.0, True), (2.0, False)])
def test_plots_start_a_track_only_if_a_target_can_move_that_far(cells, declared):
    """One plot in each frame, some cells farther than the one before; a target moves 1 cell."""
    f = np.zeros((8, 40, 40))
    f[np.arange(8), (10 + cells * np.arange(8)).astype(int), 12] = 50.0
    score, place = six.plots_to_tracks(f, p, "a")
    assert (score > 0).tolist() == 3 * [False] + 5 * [declared]
    if declared:
        assert np.abs(place[3:, 0] - np.arange(14, 19)).max() < 0.1
        assert np.abs(place[3:, 1] - 13).max() < 0.1


def test_a_loud_target_is_held_by_each():
    held = six.Scene(K=15, enters=0, leaves=15, snr_db=20.0)
    x, z = scene(held)
    plots, start = six.scans(z, p), x[:, 0]
    error = stream("filter", "cloud").standard_normal((p.N, 4)) * np.diag(six.KNOWN) ** 0.5
    places = [
        six.hold_bernoulli(z, start + error, p, stream("filter", name), name)
        for name in six.SOURCES
    ]
    places += [six.nearest_plots(plots, start, p)[:, 0], six.track_cfar(plots, start[0], p)]
    places += [*six.ljipda(plots, start, p, ["IPDA-AI", "JIPDA"])[:, 0]]
    assert np.abs(np.array(places) - x[0, :, ::2]).max() < 0.5


def given_to(module, name, monkeypatch, call):
    """Positional arguments of the first call of a chapter's function."""
    seen, function = [], getattr(module, name)

    def kept(*arguments, **options):
        seen.append((arguments, options))
        return function(*arguments, **options)

    monkeypatch.setattr(module, name, kept)
    call()
    return seen[0][0]


def test_chapter_04_is_told_cells_of_one_metre_and_the_motion_of_the_others(monkeypatch):
    x, z = scene(six.Scene(K=8, enters=0, leaves=8, snr_db=20.0))
    plots, cfar = six.scans(z, p), six.page("track_cfar")
    call = lambda: six.track_cfar(plots, x[0, 0], p)  # noqa: E731
    start, rows, q = given_to(cfar, "follow", monkeypatch, call)
    assert np.allclose(q.cell, [1.0, 1 / six.R0])
    assert np.allclose(motion.cv(q.scan), six.LAWS[1])
    assert np.allclose(motion.white_acceleration(q.scan, q.sigma_p**2), six.LAWS[2])
    assert np.allclose(start.P, six.KNOWN)
    assert np.allclose(rows[0][:, 0] - six.R0, plots[1][:, 0])
    assert np.allclose(rows[0][:, 1] * six.R0 + 20.5, plots[1][:, 1])


def test_chapter_05_is_told_the_amplitudes_of_the_plots_and_how_often_there_is_one(monkeypatch):
    """An amplitude a has the mean of a^2 / 2 as its power in units of the noise."""
    x, z = scene(six.Scene(K=8, enters=0, leaves=8, snr_db=20.0))
    plots, lj = six.scans(z, p), six.page("ljipda_ai")
    call = lambda: six.ljipda(plots, x[:, 0], p, ["IPDA-AI"])  # noqa: E731
    rows, s, method = given_to(lj, "states", monkeypatch, call)
    assert method == "IPDA-AI"
    assert s.tau**2 / 2 == pytest.approx(six.TAU)
    assert np.allclose(s.p_detect, np.exp(-six.TAU / (1 + p.snr)))
    strong = [each[each[:, 2] > six.TAU] for each in plots]
    for sent, own in zip(rows, strong, strict=True):
        assert np.allclose(sent[:, 2] ** 2 / 2, own[:, 2])


def test_chapter_02_sees_nothing_outside_the_frame(monkeypatch):
    _, z = scene(LOUD)
    mm, options = six.page("mm_pf_tbd"), {}
    monkeypatch.setattr(mm, "recursion", lambda z, q, rng, likelihood: options.update(f=likelihood))
    with pytest.raises(AttributeError):  # nothing comes back
        six.multiple_model(z, p, stream("filter"))
    S = np.array([[-50.0, 0, 20, 0], [20.0, 0, 20, 0], [20.0, 0, 20, 0]])
    lw = options["f"](z[0].astype(float), np.array([1, 1, 0]), S, None)
    assert lw[0] == lw[2] == 0
    assert lw[1] != 0


def test_chapter_02_is_told_the_level_the_echo_and_the_particles(monkeypatch):
    """The ratio of exponentials of means 1 + s and 1, s = snr h^2, in the 25 cells around."""
    _, z = scene(LOUD)
    mm, told = six.page("mm_pf_tbd"), {}
    monkeypatch.setattr(
        mm, "recursion", lambda z, q, rng, likelihood: told.update(q=q, f=likelihood)
    )
    with pytest.raises(AttributeError):
        six.multiple_model(z, p, stream("filter"))
    assert (told["q"].M, told["q"].M_new) == (2 * p.N, 2 * p.births)
    frame, at = z[9].astype(float), np.array([20.3, 17.8])
    lw = told["f"](frame, np.array([1]), np.array([[at[0], 0, at[1], 0]]), None)
    i, j = (np.rint(at)[:, None] + np.arange(-2, 3)).astype(int)
    s = p.snr * np.exp(-np.add.outer((i - at[0]) ** 2, (j - at[1]) ** 2) / p.blur**2)
    cells = frame[np.ix_(i - 1, j - 1)]
    assert lw[0] == pytest.approx((cells * s / (1 + s) - np.log1p(s)).sum())


def test_a_loud_target_that_stands_still_is_in_the_same_cell_for_all():
    """Once it has been there for a block of dynamic programming."""
    still = replace(LOUD, speed=(0.0, 0.0))
    (x,), _, place = six.search(still, p, streams(0), six.METHODS)
    off = np.abs(place[:, 12:19] - x[12:19, ::2]).max(axis=(1, 2))
    assert (off < 0.8).all(), np.array(six.METHODS)[off >= 0.8]


def test_chapter_03_is_told_the_frame_its_cells_and_their_time():
    q = six.radar(p, "averaged")
    assert (q.T, q.dr, q.da * six.R0) == (1.0, 1.0, 1.0)
    assert np.allclose([q.r_min - six.R0, q.r_max - six.R0], [0.5, p.n + 0.5])
    assert np.allclose([q.a_min * six.R0, q.a_max * six.R0], [-p.n / 2, p.n / 2])
    assert (q.accel * q.T) ** 2 == pytest.approx(six.LAWS[2][1, 1])  # of a velocity in a frame


def one_cell(powers):
    """A scan without plots, then one plot in one place in each scan."""
    return [np.empty((0, 3)), *(np.array([[9.0, 9.0, u]]) for u in powers)]


def test_a_track_of_nearest_plots_ends_after_misses_in_a_row():
    start = np.array([[9.0, 0, 9, 0]])
    place = six.nearest_plots(one_cell([9, 9, 3, 3, 9, 3, 3, 3, 9]), start, p)
    assert place.shape == (10, 1, 2)
    alive = np.isfinite(place[:, 0, 0])
    assert alive.tolist() == [True] * 8 + [False] * 2
    assert np.abs(place[alive] - 9).max() < 1e-9


def test_a_track_takes_the_plot_that_is_nearest_in_all():
    """Two tracks, two plots: the sum of distances counts, and a far plot is left."""
    start = np.array([[10.0, 0, 10, 0], [12.0, 0, 10, 0]])
    plots = [np.empty((0, 3)), np.array([[11.0, 10, 9], [12.9, 10, 9], [40.0, 40, 9]])]
    place = six.nearest_plots(plots, start, p)[1]
    assert 10 < place[0, 0] < 11
    assert 12 < place[1, 0] < 12.9


@pytest.mark.parametrize(("off", "taken"), [(1.70, [0, 1]), (1.75, [0])])
def test_a_plot_is_taken_within_a_squared_distance_of_9_2(off, taken):
    """Its unit is KNOWN + ERROR^2 on each axis, 0.32: 1.716 cells."""
    x, P = np.array([[0.0, 0, 0, 0], [20.0, 0, 20, 0]]), np.tile(six.KNOWN, (2, 1, 1))
    assert six.assign(x, P, np.array([[0.0, 0], [20 + off, 20]])).tolist() == taken


def test_a_kalman_track_has_the_covariance_of_the_textbook():
    x, P = np.array([[0.0, 0, 0, 0], [np.nan] * 4]), np.tile(six.KNOWN, (2, 1, 1))
    taken = six.assign(x, P, np.array([[0.5, -0.5], [30.0, 30.0]]))
    H, R = np.eye(4)[::2], np.eye(2) * six.ERROR**2
    K = six.KNOWN @ H.T @ np.linalg.inv(H @ six.KNOWN @ H.T + R)
    assert np.allclose(x[0], K @ [0.5, -0.5])
    assert np.allclose(P[0], (np.eye(4) - K @ H) @ six.KNOWN)
    assert taken.tolist() == [0]


def streams(i):
    return lambda kind, name="": trials.generator(i, "together", "test" + name, 0, kind)


def test_a_loud_target_is_declared_where_it_is_by_all():
    for i in range(2):
        near = six.scores_near(LOUD, p, streams(i))
        quiet = six.largest_scores(six.Scene(), p, streams(i))
        assert near.shape == quiet.shape == (len(six.METHODS),)
        assert (near > quiet).all(), np.array(six.METHODS)[near <= quiet]


def test_only_scores_near_the_target_count_in_a_scene_with_a_target():
    """A loud point far from a target that nobody sees."""
    methods, silent = [("single frames", "a"), ("Tonissen", "b")], six.Scene(snr_db=-30.0)

    class Spot:
        def standard_normal(self, shape, dtype):
            v = streams(1)("noise").standard_normal(shape, dtype=dtype)
            v[:, :, 38, 38] += 30
            return v

    def stream(kind, name=""):
        return Spot() if kind == "noise" else np.random.default_rng(seed=4)

    (x,), _ = six.simulate(silent, stream("truth"), stream("noise"))
    assert np.nanmin(np.hypot(x[:, 0] - 39, x[:, 2] - 39)) > 4
    empty = six.largest_scores(six.Scene(), p, stream, methods)
    near = six.scores_near(silent, p, stream, methods)
    assert (empty > 50).all()
    assert (near < empty / 2).all()


def test_half_is_where_half_of_the_scores_exceed_the_threshold():
    near = np.array([[0, 0, 0, 0], [1, 1, 0, 0], [1, 1, 1, 1]])[:, :, None] * 1.0
    assert six.half([0, 2, 4], near, np.array([0.5])).tolist() == [2.0]
    assert np.isnan(six.half([0, 2, 4], near, np.array([2.0]))).all()


def test_the_error_of_a_half_contains_that_of_the_threshold():
    """Scores are the SNR plus a normal error: half at the quantile, its error of both samples."""
    rng, snr_db, n0, n = np.random.default_rng(seed=2), np.arange(-3.0, 7.0, 0.5), 1000, 400
    near = snr_db[:, None, None] + rng.standard_normal((n, 1))
    empty = rng.standard_normal((n0, 1))
    V = recording.threshold(empty, 0.05).value
    assert abs(six.half(snr_db, near, V) - 1.645) < 0.3
    found = six.half_error(snr_db, near, empty, 0.05, rng, 400)
    exact = math.hypot(math.sqrt(0.05 * 0.95 / n0) / 0.1031, math.sqrt(math.pi / 2 / n))
    assert 0.75 < found[0] / exact < 1.3
    alone = six.half_error(snr_db, near, np.repeat(V, 1000)[:, None] + 0, 0.05, rng, 400)
    assert alone[0] < 0.8 * found[0]


def test_a_scene_without_a_target_cannot_be_found_in_one_line():
    with pytest.raises(ValueError, match=r"^scene: no target, snr_db is -inf; give") as error:
        six.scores_near(six.Scene(), p, stream)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "level"),
    [("Bernoulli", "b"), ("averaged", "a"), ("plots, IPDA", "c"), ("other", "a")],
)
def test_a_level_that_a_method_cannot_use_is_refused_in_one_line(name, level):
    with pytest.raises(ValueError, match=rf"methods: '{name}' cannot use level '{level}'") as error:
        six.largest_scores(six.Scene(), p, stream, [(name, level)])
    assert "\n" not in str(error.value)


def test_too_few_empty_scenes_for_the_false_share_are_refused_in_one_line():
    with pytest.raises(ValueError, match=r"30 blocks cannot show 0\.01; give 99 blocks"):
        recording.threshold(np.arange(30.0), 0.01)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"snr": 0.0}, "Setup.snr: 0.0; give a number in"),
        ({"blur": 0.3}, "Setup.blur: 0.3; give a number in"),
        ({"N": 2}, "Setup.N: 2; give an integer in"),
    ],
)
def test_a_setup_outside_its_limits_is_refused_in_one_line(change, words):
    with pytest.raises(ValueError, match="Setup") as error:
        six.Setup(**change)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


# Filtered frames, and the bound -----------------------------------------------------------------


def test_tracks_near_a_better_one_and_improbable_ones_are_dropped():
    x = np.array([[10.0, 0, 10, 0], [11.0, 0, 10, 0], [20.0, 0, 10, 0], [30.0, 0, 30, 0]])
    assert six.apart(x, np.array([0.5, 0.9, 0.3, 0.01])) == [1, 2]
    assert six.apart(x, np.array([0.9, 0.5, 0.3, 0.1]), most=3) == [0, 2]
    x[1, 0] = 11.5  # the distance from which on a track stays, and the existence that is too small
    assert six.apart(x, np.array([0.5, 0.9, 0.02, 0.021])) == [1, 0, 3]


@pytest.mark.parametrize("level", "abc")
def test_filtered_noise_has_mean_0_and_variance_1(level):
    f = np.array([six.filtered(scene(six.Scene(), i)[1], p, level)[:, 3:-3, 3:-3] for i in (0, 1)])
    assert abs(f.mean()) < 0.05
    assert abs(f.var() - 1) < 0.05


def test_frames_of_b_are_the_matched_filter_of_the_core():
    _, z = scene(six.Scene(snr_db=9.0))
    core = baseline.matched_filter(z, p.blur, "exponential")[:, 4:-4, 4:-4]
    assert np.abs(six.filtered(z, p, "b")[:, 4:-4, 4:-4] - core).max() < 0.01


def test_frames_of_c_are_the_log_likelihood_ratio_of_independent_cells():
    _, z = scene(six.Scene(snr_db=9.0))
    d = np.arange(-2, 3)
    s = p.snr * np.exp(-np.add.outer(d**2, d**2) / p.blur**2)
    for i, j in ((10, 12), (20, 30)):
        cut = z[7, i - 2 : i + 3, j - 2 : j + 3]
        ratio = (-cut / (1 + s) - np.log1p(s) + cut).sum()
        w = s / (1 + s)
        told = six.filtered(z, p, "c")[7, i, j] * math.sqrt((w * w).sum()) + w.sum()
        assert abs(told - np.log1p(s).sum() - ratio) < 1e-3


def test_the_ratio_of_the_bound_is_that_of_the_textbook():
    """One start: the product of exp(-s h^2) I0(2 sqrt(s z) h) over cells and frames."""
    s = six.Scene(snr_db=3.0)
    (x,), z = scene(s)
    there, snr = slice(3, 19), 10**0.3
    first = np.ceil(s.n / 4 + 0.5 - x[11, ::2])
    table = six.steady_ratios(z[there], s, x[there, ::2], first, snr)
    assert table.shape == (20, 20)
    for o in ((0, 0), (7, 13), (19, 19)):
        exact = 0.0
        for frame, at in zip(z[there], x[there, ::2], strict=True):
            i, j = np.rint(at + first + o).astype(int)
            c = np.stack(np.mgrid[i - 2 : i + 3, j - 2 : j + 3], axis=-1)
            h = np.exp(-((c - at - first - o) ** 2).sum(axis=-1) / (2 * s.blur**2))
            cells = frame[c[..., 0] - 1, c[..., 1] - 1].astype(float)
            exact += (np.log(i0(2 * np.sqrt(snr * cells) * h)) - snr * h * h).sum()
        assert abs(table[o] - exact) < 1e-3 * abs(exact) + 1e-3


@pytest.mark.parametrize("swerling", [False, True])
def test_the_bound_is_the_mean_of_the_ratios_over_starts_and_the_true_one_is_among_them(swerling):
    s = six.Scene(snr_db=9.0, swerling=swerling)
    ratios = six.fading_ratios if swerling else six.steady_ratios
    for i in range(12 if swerling else 40):
        (x,), z = scene(s, i)
        first = np.ceil(s.n / 4 + 0.5 - x[11, ::2])
        table = ratios(z[3:19], s, x[3:19, ::2], first, 10**0.9).ravel().astype(float)
        top = table.max()
        mean = top + math.log(np.exp(table - top).mean())
        assert abs(six.known_path(z, x, s) - mean) < 1e-3 + 1e-5 * abs(mean)
        at = -first.astype(int)
        assert (at >= 0).all()
        assert (at < 20).all()
        assert table[20 * at[0] + at[1]] > top - 8


def test_targets_are_in_the_middle_of_their_way_in_the_middle_of_the_frame():
    rng = np.random.default_rng(5)
    middle = np.array([six.fly(six.Scene(), rng)[0, 11, ::2] for _ in range(400)])
    assert ((middle >= 10.5) & (middle <= 30.5)).all()
    assert (np.abs(middle.mean(axis=0) - 20.5) < 2.6 * 20 / 12**0.5 / 20).all()


@pytest.mark.slow
@pytest.mark.parametrize("s", [six.Scene(snr_db=1.0), six.Scene(snr_db=0.0, swerling=True)])
def test_the_threshold_of_the_bound_from_scenes_with_a_target_holds_on_empty_scenes(s):
    n, empty = 150, replace(s, snr_db=-math.inf)
    ratios = []
    for one in (s, empty):
        scenes = [scene(one, i + 1000 * (one is empty)) for i in range(n)]
        ratios.append(np.array([six.known_path(z, x[0], s) for x, z in scenes]))
    declared = six.within_bound(ratios[0], 0.1)
    t = ratios[0][declared].min()
    assert (ratios[0][~declared] < t).all()
    terms = np.where(declared, np.exp(-ratios[0]), 0)
    assert terms.mean() <= 0.1
    error = math.hypot(terms.std() / n**0.5, math.sqrt(0.1 * 0.9 / n))
    assert abs((ratios[1] >= t).mean() - terms.mean()) < 2.6 * error


def test_the_bound_may_reach_the_false_share():
    """Four scenes that say nothing, with a ratio of 1, have false shares of 1/4, 2/4 and so on."""
    assert six.within_bound(np.zeros(4), 0.5).tolist() == [True, True, False, False]


def test_half_of_the_bound_is_interpolated():
    ratio = np.array([[-9.0, -9, -9, -9], [9.0, 9, -9, -9], [9.0, 9, 9, 9]])
    assert six.bound_half([0.0, 1.0, 2.0], ratio, 0.05) == 1.0


def test_the_bound_on_holding_takes_the_more_likely_of_two_turns():
    s = six.Scene(K=15, enters=0, leaves=15, swerling=True, turn=0.1, snr_db=30.0)
    (x,), z = scene(s)
    assert np.hypot(*(six.known_turn(z, x, s) - x[:, ::2]).T)[3:].max() < 1e-9
    mirrored = np.array([motion.coordinated_turn(-w, 1.0) @ x[0] for w in (s.turn, -s.turn)])
    none = six.known_turn(np.zeros_like(z), x, s)
    assert np.isin(none[1].round(9), mirrored[:, ::2].round(9)).all()


def test_the_bound_on_holding_knows_the_snr(monkeypatch):
    s = six.Scene(K=8, enters=0, leaves=8, swerling=True, turn=0.1, snr_db=30.0)
    (x,), z = scene(s)
    given = given_to(six, "fading", monkeypatch, lambda: six.known_turn(z, x, s))
    assert given[3] == pytest.approx(1000.0)


def test_told_starts_have_the_covariance_that_is_told():
    x = np.zeros((2, 5, 4))
    x[:, 1:] = 100.0  # only the first state is told
    starts = [
        six.told_start(x, lambda kind, name, i=i: trials.generator(i, "together", name, 0, kind))
        for i in range(400)
    ]
    d2 = (np.array(starts) ** 2 / np.diag(six.KNOWN)).mean(axis=(0, 1))
    assert np.abs(d2 - 1).max() < 4 * math.sqrt(2 / 800)


def test_the_own_plot_is_the_nearest_one_if_there_is_one():
    path = np.array([[5.0, 0, 5, 0], [6.0, 0, 5, 0], [7.0, 0, 5, 0]])
    plots = [np.array([[5.9, 5, 1], [5.2, 5, 2]]), np.empty((0, 3)), np.array([[7.0, 9, 3]])]
    own = six.own_plots(plots, path)
    assert [rows.tolist() for rows in own] == [[[5.2, 5, 2]], [], []]


@pytest.mark.slow
def test_dynamic_programming_whose_set_is_the_known_path_reaches_the_bound():
    """Its frames are the exact log ratios, its only step is that of the target, (1, 1)."""
    s, n = six.Scene(snr_db=-1.0), 150
    k = np.arange(s.K)[:, None] - 11.0
    only = dp_tbd.box_transition(np.array([0.0, 1.0, 0.0]), (1, 1), 2)
    said = np.empty((2, 2, n))
    for i in range(n):
        truth, noise = (
            trials.generator(i, "together", "known", 0, each) for each in ("truth", "noise")
        )
        at = 10.0 + truth.integers(1, 21, size=2) + k
        x = np.stack([at[:, 0], 0 * at[:, 0] + 1, at[:, 1], 0 * at[:, 1] + 1], axis=-1)
        v = noise.standard_normal((2, s.K, s.n, s.n), dtype=np.float32) * 0.5**0.5
        turn = np.exp(2j * np.pi * truth.random(s.K))
        h = six.mm_pf_tbd.blob_image(x[:, 0], x[:, 2], 1.0, s.blur, (s.n, s.n))
        there = (np.arange(s.K) >= s.enters) & (np.arange(s.K) < s.leaves)
        for m, on in enumerate((0.0, 10 ** (s.snr_db / 20))):
            z = abs(v[0] + 1j * v[1] + on * (turn * there)[:, None, None] * h) ** 2
            said[0, m, i] = six.known_path(z, x, s)
            f = log_ratios(z[s.enters : s.leaves], s)
            f[0, :, :] += inside(x, s)
            said[1, m, i] = dp_tbd.forward(dp_tbd.margin(f, 2), only)[-1].max()
    V = np.quantile(said[:, 0], 0.9, axis=1)
    found = said[:, 1] > V[:, None]
    assert 0.3 < found[0].mean() < 0.97
    d = found[1] * 1.0 - found[0]
    assert abs(d.mean()) < 2.6 * max(d.std(), 0.2) / n**0.5 + 0.03  # of both thresholds


def log_ratios(z, s):
    """Exact log ratio (K, n, n) of a steady target in the middle of each cell."""
    d, snr = np.arange(-2, 3), 10 ** (s.snr_db / 10)
    h = np.exp(-np.add.outer(d**2, d**2) / (2 * s.blur**2))
    root = np.sqrt(np.pad(z, ((0, 0), (2, 2), (2, 2))))
    cells = np.lib.stride_tricks.sliding_window_view(root, (5, 5), axis=(1, 2))
    return six.log_bessel(2 * math.sqrt(snr) * cells * h).sum(axis=(3, 4)) - snr * (h * h).sum()


def inside(x, s):
    """0 where the path may start, far below 0 elsewhere."""
    first = (np.ceil(s.n / 4 + 0.5 - x[11, ::2]) + x[s.enters, ::2]).astype(int) - 1
    out = np.full((s.n, s.n), -1e3)
    out[first[0] : first[0] + 20, first[1] : first[1] + 20] = 0
    return out


def test_no_algorithm_is_copied():
    """Each method calls its page."""
    source = "\n".join(pages.cells("together", "algorithm"))
    for name in pages.papers():
        assert f'page("{name}")' in source
    kernels = [cell for cell in pages.cells("together") if "@kernel" in cell]
    assert kernels == []


# Plain rivals -----------------------------------------------------------------------------------


@pytest.mark.parametrize("level", "abc")
def test_log_ratios_are_those_of_independent_cells(level):
    _, z = scene(six.Scene(snr_db=9.0))
    d = np.arange(-2, 3)
    h2 = np.exp(-np.add.outer(d**2, d**2) / p.blur**2) if level != "a" else np.eye(5)[2] * np.eye(5)
    each = []
    for snr in [p.snr] if level == "c" else 10 ** np.array([0.0, 0.4, 0.8, 1.2]):
        mean = 1 + snr * h2
        cut = z[7, 8:13, 28:33].astype(float)
        each.append((cut - cut / mean - np.log(mean)).sum())
    expected = np.log(np.mean(np.exp(each)))
    assert abs(six.log_ratios(z, p, level)[7, 10, 30] - expected) < 1e-3


def test_the_grid_filter_is_certain_of_a_target_and_of_none():
    ratios = np.full((12, 9, 9), -1.0)
    score, _ = six.grid_filter(ratios, p)
    assert score[-1] < 0.01
    k = np.arange(12)
    ratios[k[3:], 1 + k[3:] // 2, 4] = 6.0
    score, place = six.grid_filter(ratios, p)
    assert score[-1] > 0.99
    assert place[-1].tolist() == [1 + 11 // 2 + 1, 5]


def test_the_recursive_maximum_follows_one_cell_a_frame_and_forgets():
    ratios = np.full((4, 9, 9), -1.0)
    ratios[[0, 1, 2], [2, 3, 4], 4] = 5.0
    score, place = six.recursive_maximum(ratios, p)
    assert np.allclose(score, [5, 9.5, 13.55, 0.9 * 13.55 - 1])
    assert place[2].tolist() == [5.0, 5.0]


# The committed products -------------------------------------------------------------------------


def committed(name):
    """A committed table, or the data of a figure."""
    return pd.read_csv(paths.products() / "together" / f"{name}.csv")


def finding(scene):
    """The rows of the study of one scene."""
    table = studies.read("together_finding")
    return table[table["scene"] == scene].set_index("method")


NAMES = [together.label(method) for method in six.METHODS]
every_scene = pytest.mark.parametrize("scene", together.SCENES)


@every_scene
def test_the_study_has_each_method_and_the_bound(scene):
    rows = finding(scene)
    assert list(rows.index) == [*NAMES, "known path"]
    assert np.isfinite(rows[["half_db", "half_db_se"]].to_numpy(float)).all()


@every_scene
def test_a_half_of_the_study_is_that_of_its_shares(scene):
    levels = [f"{v:g} dB" for v in together.SNR_DB]
    for row in finding(scene).loc[NAMES].to_dict("records"):
        above = np.flatnonzero([float(row[level]) >= 0.5 for level in levels])[0]
        assert above > 0, "half is inside the SNRs that were flown"
        assert together.SNR_DB[above - 1] <= row["half_db"] <= together.SNR_DB[above]


OTHERS = [together.label(method) for method in together.AGAIN]


def test_each_fast_method_within_a_decibel_of_the_lowest_is_flown_with_other_seeds():
    """In both scenes; fast: less than 10 ms for a scene."""
    cost = studies.read("together_cost").set_index("method")["cpu_ms"]
    near = {*NAMES}
    for half in (finding(scene)["half_db"][NAMES] for scene in together.SCENES):
        near &= {*half.index[half < half.min() + 1]}
    assert {name for name in near if cost[name] < 10} <= {*OTHERS}
    assert (cost[OTHERS] < 10).all()
    assert {*studies.read("together_seeds")["row"]} == {*OTHERS, "known path"}


LESS = [("Tonissen (b)", "Tonissen (a)", scene) for scene in together.SCENES]
LESS += [("Tonissen (c)", "Tonissen (b)", scene) for scene in together.SCENES]


@pytest.mark.parametrize(("lower", "higher", "scene"), LESS)
def test_a_method_that_needs_less_does_so_with_five_other_seeds(lower, higher, scene):
    """The sentences under the table of methods."""
    gap, se = seeds.lead(studies.read("together_seeds"), scene, higher, lower)
    assert gap > 2.6 * se
    half = finding(scene)["half_db"]
    assert half[lower] < half[higher]


@every_scene
@pytest.mark.parametrize("name", ["Tonissen (c)", "recursive maximum (b)"])
def test_what_the_first_screen_names_is_within_a_decibel_of_all_with_five_other_seeds(name, scene):
    for other in {*OTHERS} - {name}:
        gap, se = seeds.lead(studies.read("together_seeds"), scene, name, other)
        assert gap + 2.6 * se < 1


@every_scene
def test_the_bound_is_lower_than_all_with_five_other_seeds(scene):
    for name in OTHERS:
        gap, se = seeds.lead(studies.read("together_seeds"), scene, name, "known path")
        assert gap - 2.6 * se > 2


def test_the_false_share_holds_on_other_empty_scenes():
    other = studies.read("together_false")
    assert other["method"].tolist() == [together.label(it) for it in together.AGAIN]
    assert (other["n"] == together.EMPTY * len(together.FRESH)).all()
    quantile = norm.isf(0.0093 / 2 / len(other))  # 2.6 errors, of any of them
    assert ((other["share"] - together.SHARE).abs() < quantile * other["se"]).all()


def test_nobody_beats_the_bound():
    for scene in together.SCENES:
        half, se = finding(scene)[["half_db", "half_db_se"]].to_numpy(float).T
        assert (half[:-1] - half[-1] > -2.6 * np.hypot(se[:-1], se[-1])).all()
    for panel, sign in ((0, 1), (1, -1)):  # life and distance
        each = committed("holding")
        for _, rows in each[each["panel"] == panel].groupby("x"):
            best = rows.loc[rows["series"] == "known path but its side", "y"].item()
            assert (sign * (rows["y"] - best) <= 1e-9).all()


def test_tracks_are_better_than_their_start_alone():
    """At their highest SNR."""
    for figure, panel, method in (("holding", 0, "averaged (b)"), ("crossing", 1, "JIPDA-AI")):
        rows = committed(figure)
        rows = rows[rows["panel"] == panel]
        top = rows[rows["x"] == rows["x"].max()].set_index("series")
        error = np.hypot(*top.loc[[method, "start alone"], "se"])
        assert top.loc[method, "y"] - top.loc["start alone", "y"] > 2.6 * error


def tracks(table):
    """Rows of the study of tracks with five other seeds."""
    found = studies.read("together_tracks").query("table == @table")
    assert {*found["seed"]} == {*together.FIVE}
    return found


@pytest.mark.parametrize(("name", "own"), [("held", together.HELD), ("two", together.TWO)])
def test_the_study_of_tracks_has_the_scenes_of_the_page(name, own):
    lines = "\n".join(pages.cells("together")).splitlines()
    (line,) = (line for line in lines if line.startswith(f"{name} = "))
    scene = eval(line.removeprefix(f"{name} = "), {"Scene": six.Scene, "math": math})
    assert scene == six.Scene(**own)


def test_what_the_text_says_of_holding_holds_for_the_first_and_five_other_seeds():
    """Section 6: the mean distance at 6 dB."""
    far, best = tracks("holding"), "averaged (b)"
    drawn = committed("holding").query("panel == 1 and x == 6").set_index("series")
    assert {*far["row"]} == {*drawn.index}
    for other in {*drawn.index} - {best, "known path but its side"}:
        gap, se = seeds.lead(far, "6 dB", other, best)
        assert gap > 2.6 * se
        assert drawn.loc[other, "y"] - drawn.loc[best, "y"] > 2.6 * drawn.loc[other, "se"]


MORE_PAIRS = [("JIPDA", "IPDA"), ("JIPDA-AI", "LJIPDA-AI"), ("start alone", "nearest plots")]
MORE_PAIRS += [("JIPDA-AI", "LJIPDA-AI, largest prior"), ("start alone", "track CFAR")]


@pytest.mark.parametrize(("more", "fewer"), MORE_PAIRS)
def test_what_the_text_says_of_crossing_holds_for_the_first_and_five_other_seeds(more, fewer):
    """Section 6: pairs kept at 12 dB."""
    drawn = committed("crossing").query("x == 12").drop_duplicates("series").set_index("series")
    pairs = tracks("crossing")
    assert {*pairs["row"]} == {*drawn.index}
    gap, se = seeds.lead(pairs, "12 dB", more, fewer)
    assert gap > 2.6 * se
    error = np.hypot(*drawn.loc[[more, fewer], "se"])
    assert drawn.loc[more, "y"] - drawn.loc[fewer, "y"] > 2.6 * error


@every_scene
def test_the_table_of_methods_has_the_numbers_of_the_study(scene):
    table = committed("methods").set_index("method")
    column = {"steady": "steady, straight, dB", "turning": "Swerling 1, turning, dB"}[scene]
    rows = finding(scene).loc[table.index]
    assert np.allclose(table[column], rows["half_db"])
    assert np.allclose(table[f"{column}_se"], rows["half_db_se"])


def test_thresholds_of_white_noise_declare_too_much_of_other_noise():
    """Section 5."""
    noise = studies.read("together_noise")
    assert noise["method"].tolist() == 2 * [together.label(it) for it in together.NOISY]
    error = np.hypot(noise["empty_se"], math.sqrt(0.05 * 0.95 / together.EMPTY))
    assert (noise["empty"] - together.SHARE > 2.6 * error).all()
    found = noise.set_index(["condition", "method"])["found"]
    assert found["K, shape 3", "multiple model (c)"] == 0
    again = tracks("noise").groupby(["column", "row"])
    mean, se = again["value"].mean(), again["se"].agg(lambda se: math.hypot(*se) / len(se))
    assert set(mean.index) == set(found.index)
    threshold = math.sqrt(0.05 * 0.95 / together.EMPTY)
    assert (mean - together.SHARE > 2.6 * np.hypot(se, threshold)).all()


@every_scene
@pytest.mark.parametrize("name", ["Tonissen (c)", "recursive maximum (b)"])
def test_what_the_first_screen_names_is_within_a_decibel_of_the_lowest(name, scene):
    half = finding(scene)["half_db"]
    assert half[name] - half[NAMES].min() < 1


def test_the_first_screen_says_what_takes_less_time():
    cost = studies.read("together_cost").set_index("method")["cpu_ms"]
    filters = ["averaged (b)", "accumulating (b)", "Bernoulli (c)", "multiple model (c)"]
    assert cost[["Tonissen (c)", "recursive maximum (b)"]].max() < 0.75 * cost[filters].min()


@pytest.mark.parametrize("level", "abc")
def test_plots_come_from_about_one_cell_of_noise_in_a_hundred(level):
    f = np.array([six.filtered(scene(six.Scene(), i)[1], p, level) for i in range(4)])
    assert 0.009 < (f > six.ETA[level]).mean() < 0.016
