"""Page 06: its scenes, the bound, the reference, and that each chapter is a method on them."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.special import i0
from scipy.stats import binom, kstest

import tbdcore
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


def chain(*args):
    """Places (K, 1 + s, 2) of the reference."""
    return np.array(list(six.chain(*args)))


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
    for k, rows in enumerate(six.scans(z, z)):
        assert (rows[:, 2] > six.LOW).all()
        if 3 <= k < 19:
            top = rows[rows[:, 2].argmax()]
            assert np.hypot(*(top[:2] - x[k, ::2])) < 0.5


def test_plots_are_local_maxima_counted_once():
    z = np.zeros((2, 9, 9), np.float32)
    z[0, 0, 0], z[0, 4, 4], z[0, 4, 5], z[1, 8, 2] = 9, 8, 4, 5
    first, second = six.scans(z, z)
    assert np.allclose(first, [[1, 1, 9], [5, 5 + 1 / 3, 8]])
    assert np.allclose(second, [[9, 3, 5]])


def one_cell(powers):
    return [np.array([[9.0, 9.0, u]]) for u in powers]


def test_the_reference_is_m_of_n_on_one_cell():
    """With plots in one place only, it declares in N frames with the binomial probability."""
    rng, n, tau, snr = stream("noise"), 3000, 4.0, 2.0
    power = (1 + snr) * rng.standard_exponential((n, p.block))
    declared = [np.isfinite(chain(one_cell(row), tau, p)).any() for row in power]
    assert declared == ((power > tau).sum(axis=1) >= p.hits).tolist()
    exact = binom.sf(p.hits - 1, p.block, math.exp(-tau / (1 + snr)))
    assert abs(np.mean(declared) - exact) < 2.6 * math.sqrt(exact * (1 - exact) / n)


def test_a_tentative_track_ends_when_its_window_cannot_be_filled():
    hits = [9, 0, 0, 0, 0, 0, 9, 9, 9, 0]  # four, but the first is given up in the sixth frame
    assert not np.isfinite(chain(one_cell(hits), 4.0, p)).any()
    alive = np.isfinite(chain(one_cell([*hits, 9]), 4.0, p)[:, 0, 0])
    assert alive.tolist() == [False] * 10 + [True]


def test_a_confirmed_track_ends_after_misses_in_a_row():
    alive = np.isfinite(chain(one_cell([9] * 4 + [0] * 6), 4.0, p)[:, 0, 0])
    assert alive.tolist() == [False] * 3 + [True] * 3 + [False] * 4


def test_a_track_takes_the_plot_that_is_nearest_in_all():
    """Two tracks, two plots: the sum of distances counts, and a far plot starts a track."""
    start = np.array([[10.0, 0, 10, 0], [12.0, 0, 10, 0]])
    plots = [np.array([[11.0, 10, 9], [12.9, 10, 9], [40.0, 40, 9]])]
    place = chain(plots, 4.0, p, start)[0]
    assert 10 < place[1, 0] < 11
    assert 12 < place[2, 0] < 12.9


def test_a_kalman_track_of_the_reference_has_the_covariance_of_the_textbook():
    x, P, count = np.zeros((1, 4)), six.KNOWN[None].copy(), np.array([[4, 0, 0, 1]])
    left = six.assign(x, P, count, np.array([[0.5, -0.5], [30.0, 30.0]]))
    H, R = np.eye(4)[::2], np.eye(2) * six.ERROR**2
    K = six.KNOWN @ H.T @ np.linalg.inv(H @ six.KNOWN @ H.T + R)
    assert np.allclose(x[0], K @ [0.5, -0.5])
    assert np.allclose(P[0], (np.eye(4) - K @ H) @ six.KNOWN)
    assert left.tolist() == [[30.0, 30.0]]
    assert count.tolist() == [[5, 0, 0, 1]]


def test_the_threshold_is_where_the_reference_just_declares():
    _, z = scene(six.Scene(), 5)
    plots = six.scans(z - 1, z)
    tau = six.highest(plots, p)
    assert 3 < tau < 9
    assert np.isfinite(chain(plots, tau, p)).any()
    assert not np.isfinite(chain(plots, tau + 0.03, p)).any()


TAU = {"a": 5.6, "b": 5.0, "c": 3.5}


def test_a_loud_target_is_declared_where_it_is_by_all():
    for i in range(2):
        (x,), z = scene(LOUD, i)
        said, place = six.observe(z, p, stream, tau=TAU)
        quiet, _ = six.observe(scene(six.Scene(), i)[1], p, stream, tau=dict.fromkeys("abc", 12.0))
        far = six.cells_off(place, x)
        right = (far < 3) & (said > quiet.max(axis=1)[:, None])
        assert right.any(axis=1).all(), np.array(six.METHODS)[~right.any(axis=1)]


@pytest.mark.parametrize(("name", "level"), [("Bernoulli", "b"), ("averaged", "a"), ("other", "a")])
def test_a_level_that_a_method_cannot_use_is_refused_in_one_line(name, level):
    with pytest.raises(ValueError, match=rf"methods: '{name}' cannot use level '{level}'") as error:
        six.observe(scene(six.Scene())[1], p, stream, [(name, level)])
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


@pytest.mark.parametrize("s", [six.Scene(snr_db=1.0), six.Scene(snr_db=0.0, swerling=True)])
def test_the_threshold_of_the_bound_from_scenes_with_a_target_holds_on_empty_scenes(s):
    n, empty = 150, replace(s, snr_db=-math.inf)
    ratios = []
    for one in (s, empty):
        scenes = [scene(one, i + 1000 * (one is empty)) for i in range(n)]
        ratios.append(np.array([six.known_path(z, x[0], s) for x, z in scenes]))
    order = np.sort(ratios[0])[::-1]
    share = np.cumsum(np.exp(-order)) / n
    t = order[np.flatnonzero(share <= 0.1)[-1]]
    terms = np.where(ratios[0] >= t, np.exp(-ratios[0]), 0)
    error = math.hypot(terms.std() / n**0.5, math.sqrt(0.1 * 0.9 / n))
    assert abs((ratios[1] >= t).mean() - terms.mean()) < 2.6 * error


def test_the_bound_on_holding_takes_the_more_likely_of_two_turns():
    s = six.Scene(K=15, enters=0, leaves=15, swerling=True, turn=0.1, snr_db=30.0)
    (x,), z = scene(s)
    assert np.hypot(*(six.known_turn(z, x, s) - x[:, ::2]).T)[3:].max() < 1e-9
    mirrored = np.array([motion.coordinated_turn(-w, 1.0) @ x[0] for w in (s.turn, -s.turn)])
    none = six.known_turn(np.zeros_like(z), x, s)
    assert np.isin(none[1].round(9), mirrored[:, ::2].round(9)).all()


def test_told_starts_have_the_covariance_that_is_told():
    x = np.zeros((2, 5, 4))
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


def test_chance_maxima_beside_a_target_help_tracks_that_are_told_their_plots():
    """Scenes without an echo, as the text says: about six pairs of ten, the start alone four."""
    s, q = replace(TWO, snr_db=-math.inf), replace(six.Setup(), misses=100)
    kept = []
    for i in range(100):
        x, z = scene(s, i)
        start = six.told_start(
            x, lambda kind, name, i=i: trials.generator(9, "together", name, i, kind)
        )
        plots = [rows[rows[:, 2] > six.TAU] for rows in six.scans(z, z)]
        own = [six.chain(six.own_plots(plots, x[t])[1:], six.TAU, q, start[[t]]) for t in (0, 1)]
        ends = [[[*each][-1][1] for each in own], start[:, ::2] + (s.K - 1) * start[:, 1::2]]
        kept.append((six.cells_off(np.array(ends), x[:, -1]) < 3).all(axis=1))
    told, alone = np.mean(kept, axis=0)
    assert 0.5 < told < 0.75
    assert 0.25 < alone < 0.5


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


# The committed products -------------------------------------------------------------------------


def committed(name):
    """A committed table, or the data of a figure."""
    return pd.read_csv(paths.products() / "together" / f"{name}.csv")


def test_the_false_share_holds_on_fresh_empty_scenes():
    table = committed("false")
    assert len(table) == len(six.METHODS)
    off = (table["empty scenes declared (%)"] - 5).abs() / table["error"]
    assert (off < 3.1).all()  # 2.6 for each, corrected for their number


def test_nobody_beats_the_bound():
    each = committed("acquisition").query("panel in [0, 1]")
    for _, rows in each.groupby(["panel", "x"]):
        top = rows[rows["series"] == "known path (bound)"].iloc[0]
        over = (rows["y"] - top["y"]) / np.hypot(rows["se"], top["se"])
        assert (over < 2.6).all()
    order = committed("order")
    assert (order["distance (dB)"].dropna() > -0.2).all()
    for panel, sign in ((0, 1), (1, -1)):  # life and distance
        each = committed("holding")
        for _, rows in each[each["panel"] == panel].groupby("x"):
            best = rows.loc[rows["series"] == "known path but its side", "y"].item()
            assert (sign * (rows["y"] - best) <= 1e-9).all()


def test_tracks_are_better_than_their_start_alone():
    """Where plots are worth something: the advised methods, at their highest SNR."""
    for figure, method in (("holding", "averaged (b)"), ("crossing", "JIPDA-AI")):
        rows = committed(figure).query("panel == 0")
        top = rows[rows["x"] == rows["x"].max()].set_index("series")
        error = np.hypot(*top.loc[[method, "start alone"], "se"])
        assert top.loc[method, "y"] - top.loc["start alone", "y"] > 2.6 * error


def test_exact_bayes_is_between_the_methods_and_the_known_path():
    bayes = studies.read("together_cost").query("method == 'exact Bayes on a grid'")
    each = committed("acquisition").query("panel == 0")
    for row in bayes.itertuples():
        others = each[each["x"] == row.snr_db]
        error = 2.6 * np.hypot(others["se"], row.found_se)
        above = others["series"] == "known path (bound)"
        assert (others["y"] < row.found + error)[~above].all()
        assert (others["y"] > row.found - error)[above].all()


def test_a_method_that_is_told_less_does_not_get_more():
    table = committed("knowledge")
    for mean, error in zip(table.columns[2::2], table.columns[3::2], strict=True):
        assert (table[mean] > -2.6 * table[error]).all()


def test_each_advice_is_beyond_chance():
    table = committed("advice")
    assert (table["gain"] > 2.6 * table["se"]).all()


def test_the_studies_fly_what_the_page_flies():
    """Detection at 5 dB of the study and of the page, other seeds, within their errors."""
    found = committed("acquisition").query("panel == 0 and x == 5").set_index("series")
    cost = studies.read("together_cost").query("snr_db == 5 and particles in [0, 500]")
    for row in cost.itertuples():
        name = f"{row.method} ({row.level})"
        if name in found.index:
            y, se = found.loc[name, ["y", "se"]]
            assert abs(y - row.found) < 3.5 * math.hypot(se, row.found_se) + 0.06, name


@pytest.mark.parametrize("level", "abc")
def test_plots_come_from_about_one_cell_of_noise_in_a_hundred(level):
    f = np.array([six.filtered(scene(six.Scene(), i)[1], p, level) for i in range(4)])
    assert 0.009 < (f > six.ETA[level]).mean() < 0.016
