"""From a recording to what a filter takes, against SciPy's laws, brute force and known truth."""

import warnings

import numpy as np
import pytest
from scipy import ndimage, stats

from tbdcore import noise, recording
from tbdcore.recording.misfit import Misfit

LAWS = ("gaussian", "exponential")


def rng(seed=1):
    return np.random.default_rng(seed)


def draw(law, shape=(20, 60, 50), seed=1):
    """Frames of mean 5 and deviation 2, or of power 3, with a bright place that stands still."""
    if law == "gaussian":
        z = 5.0 + 2.0 * noise.gaussian(shape, rng(seed))
        z[:, 30:33, 20:23] += 40.0
    else:
        z = 3.0 * noise.exponential(shape, rng(seed))
        z[:, 30:33, 20:23] *= 100.0
    return z


TRUE = {"gaussian": (5.0, 2.0), "exponential": (3.0, 3.0)}


# Noise and background


@pytest.mark.parametrize("law", LAWS)
def test_level_and_spread_in_spite_of_a_bright_place(law):
    assert recording.clipped(draw(law), law) == pytest.approx(TRUE[law], rel=0.01)


@pytest.mark.parametrize("law", LAWS)
def test_gaps_do_not_move_the_level(law):
    z = draw(law)
    holes = z.copy()
    holes[rng().random(len(z)) < 0.3] = np.nan
    holes[rng().random(z.shape) < 0.2] = np.nan
    assert recording.clipped(holes, law) == pytest.approx(recording.clipped(z, law), rel=0.02)
    near = recording.clipped(holes, law, 11)
    assert np.isnan(near.mean[np.isnan(holes).all(axis=(1, 2))]).all()
    assert np.nanmedian(near.mean) == pytest.approx(TRUE[law][0], rel=0.02)
    z[:, :15] = np.nan
    edge = recording.clipped(z, law, 11).mean[0, 9:15, 40]  # of 11 rows 0 to 5 are known
    assert np.isnan(edge).tolist() == [True, True, True, False, False, False]


@pytest.mark.parametrize("law", LAWS)
def test_windows_follow_a_slope(law):
    ramp = np.linspace(1.0, 3.0, 60)[:, None]
    z = draw(law) + 10 * ramp if law == "gaussian" else draw(law) * ramp
    flat = recording.normalise(z, recording.clipped(z, law, 13), law)
    flat[:, 28:35, 18:25] = np.nan
    for part in (flat[:, 5:25], flat[:, 38:55]):
        assert recording.clipped(part, law) == pytest.approx(
            ((0.0, 1.0), (1.0, 1.0))[law != "gaussian"], abs=0.05
        )


@pytest.mark.parametrize("law", LAWS)
def test_the_background_of_each_cell_goes(law):
    scene = rng().random((30, 20)) * 9 + 1
    white = noise.gaussian((200, 30, 20), rng())
    z = scene + white if law == "gaussian" else scene * noise.as_power(white)
    flat = recording.normalise(z, recording.background(z, law), law)
    assert recording.clipped(flat, law) == pytest.approx(TRUE_FLAT[law], abs=0.03)
    assert flat.mean(axis=0).std() < 0.25
    z[:, 3, 4], z[:, 5, 6] = np.nan, 7.0
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        flat = recording.normalise(z, recording.background(z, law), law)
    assert len(said) == (law == "gaussian")  # a cell that is cut out is said
    assert np.isnan(flat[:, 3, 4]).all()
    assert np.isnan(flat[:, 5, 6]).all() == (law == "gaussian")  # a cell that does not change


TRUE_FLAT = {"gaussian": (0.0, 1.0), "exponential": (1.0, 1.0)}


@pytest.mark.parametrize("at", [3.0, (np.ones(3), 1.0), ("a", "b"), (0.0, 1.0, 2.0), None], ids=str)
def test_what_is_no_level_is_refused(at):
    with pytest.raises(ValueError, match="normalise: at: give Level"):
        recording.normalise(noise.gaussian((2, 3, 4), rng()), at)


@pytest.mark.parametrize("law", ["normal", None, np.ones(3), 5.0], ids=str)
def test_what_is_no_law_is_refused(law):
    with pytest.raises(ValueError, match="normal_scores: law: "):
        recording.normal_scores(noise.gaussian((2, 3, 4), rng()), law)


def test_negative_power_is_refused():
    with pytest.raises(ValueError, match="not decibels"):
        recording.clipped(-noise.exponential((2, 3, 4), rng()), "exponential")


# Any law of the noise

KNOWN = [stats.norm(2.0, 3.0), stats.expon(scale=2.0), stats.laplace(), stats.gamma(0.5)]


@pytest.mark.parametrize("law", KNOWN, ids=lambda law: law.dist.name)
def test_a_measured_law_is_the_law(law):
    found = recording.empirical_law(law.rvs((20, 60, 50), random_state=rng()))
    for q in (0.005, 0.01, 0.1, 0.5, 0.9, 0.99, 0.999):
        x = law.ppf(q)
        assert found.cdf(x) == pytest.approx(q, rel=0.3)
        assert found.sf(x) == pytest.approx(1 - q, rel=0.3)
        assert found.cdf(x) + found.sf(x) == pytest.approx(1.0)


def test_a_heavy_tail_is_continued():
    law = recording.empirical_law(noise.k_power((40, 60, 50), 1.0, rng()))
    for power in (12.0, 20.0, 30.0):  # the last beyond every value that was seen
        assert law.sf(power) == pytest.approx(noise.k_survival(power, 1.0), rel=0.6)


@pytest.mark.parametrize("law", KNOWN, ids=lambda law: law.dist.name)
def test_scores_of_the_right_law_are_normal(law):
    z = law.rvs((3, 50, 40), random_state=rng())
    for known in (law, law.cdf, recording.empirical_law(law.rvs((3, 50, 40), random_state=rng(2)))):
        assert stats.kstest(recording.normal_scores(z, known).ravel(), "norm").pvalue > 1e-3
    assert (np.diff(recording.normal_scores(np.sort(z.ravel())[None, None], law)) >= 0).all()


def test_scores_reach_far_into_the_tail():
    z = np.array([[[5.0, 700.0, 1e4, np.nan, 0.0]]])
    scores = recording.normal_scores(z, stats.expon())
    assert stats.norm.logsf(scores[0, 0, :2]) == pytest.approx([-5.0, -690.8], rel=0.02)
    assert np.isnan(scores[0, 0, 3])
    assert np.isfinite(scores[0, 0, [2, 4]]).all()


def test_scores_of_a_measured_law_go_on_in_both_tails():
    z = np.linspace(-30.0, 30.0, 121)[None, None]
    cells = noise.gaussian((3, 50, 40), rng())
    scores = recording.normal_scores(z, recording.empirical_law(cells))
    assert ((np.diff(scores) > 0) & (np.diff(scores) < 1)).all()
    mirrored = recording.normal_scores(-z, recording.empirical_law(-cells))
    assert mirrored == pytest.approx(-scores, rel=1e-9, abs=1e-9)


def test_scores_of_a_function_end_where_it_rounds_to_one():
    scores = recording.normal_scores(np.array([[[7.0, 9.0, 40.0]]]), stats.norm.cdf)[0, 0]
    assert scores == pytest.approx([7.0, 8.2, 8.2], abs=0.1)


# Thresholds


def test_blocks_keep_the_order_of_time():
    z = np.arange(31.0 * 4)[:, None, None] * np.ones((1, 2, 3))
    whole = recording.blocks(z, 4)
    assert whole.shape == (31, 4, 2, 3)
    assert (whole.reshape(z.shape) == z).all()
    sliding = recording.blocks(z, 5, step=2)
    assert sliding.shape == (60, 5, 2, 3)
    assert sliding[7, :, 0, 0].tolist() == [14, 15, 16, 17, 18]
    assert recording.blocks(list(z[:119]) + [None], 4)[29, :, 0, 0].tolist()[:3] == [116, 117, 118]
    assert len(recording.blocks(z[:119], 4)) == 29
    with pytest.raises(ValueError, match="recording.blocks: frames: 3 are no block of 4"):
        recording.blocks(z[:3], 4)


@pytest.mark.parametrize(
    ("law", "n", "p"),
    [(stats.cauchy, 30, 2 / 31), (stats.cauchy, 50, 0.1), (stats.cauchy, 200, 0.05)],
    ids=["30", "50", "200"],
)
def test_a_threshold_delivers_its_probability_on_average(law, n, p):
    found = recording.threshold(law.rvs(size=(n, 4000), random_state=rng()), p)
    shares = law.sf(found.value)
    assert shares.mean() == pytest.approx(p, rel=0.03)
    inside = ((shares >= found.low) & (shares <= found.high)).mean()
    assert inside == pytest.approx(0.95, abs=0.02)


def test_overlapping_blocks_widen_the_interval():
    peaks = rng().standard_normal(200)
    wide, narrow = recording.threshold(peaks, 0.1, independent=50), recording.threshold(peaks, 0.1)
    assert wide.value == narrow.value
    assert wide.high - wide.low > 1.5 * (narrow.high - narrow.low)
    assert (wide.low, wide.high) == pytest.approx(stats.beta(5.1, 45.9).interval(0.95))
    for bad in (np.zeros((40, 2, 2)), np.float64(3.0), np.empty(0)):
        with pytest.raises(ValueError, match="recording.threshold: peaks: "):
            recording.threshold(bad, 0.1)
    with pytest.raises(ValueError, match="give 999 blocks"):
        recording.threshold(peaks, 1e-3)
    with pytest.raises(ValueError, match="or 10 for the law of Gumbel"):
        recording.threshold(peaks[:9], 1e-3, tail="gumbel")


# Plots and blur


def test_plots_are_the_clusters():
    z = np.zeros((1, 12, 12))
    z[0, 2, 3], z[0, 3, 4], z[0, 2, 4] = 6.0, 4.0, 5.0  # at a corner too: one plot
    z[0, 9, 9] = 7.0
    z[0, 6, 1] = np.nan
    (found,) = recording.plots(z, 3.0, origin=(100.0, 1.0), cell=(10.0, 0.5))
    assert found[:, :3] == pytest.approx(
        np.array([[100 + 10 * 34 / 15, 1 + 0.5 * 54 / 15, 6.0], [190.0, 5.5, 7.0]])
    )
    assert found[1, 3:] == pytest.approx(
        np.array([10, 0.5]) * np.hypot(1 / 12**0.5, 1.1968 / 7), rel=1e-3
    )
    nothing, missing = recording.plots([z[0] * 0, None], 3.0)
    assert nothing.shape == (0, 5)
    assert missing is None
    with pytest.raises(ValueError, match="above the noise's mean, 1"):
        recording.plots(z, 1.0, "exponential")


@pytest.mark.parametrize(
    ("law", "strength", "blur", "eta"),
    [("gaussian", 8.0, 0.8, 3.5), ("gaussian", 20.0, 1.5, 3.5), ("exponential", 60.0, 1.2, 9.0)],
)
def test_the_accuracy_of_plots_is_that_of_their_errors(law, strength, blur, eta):
    K = 1500
    path = 8.0 + rng().random((K, 2))
    white = (noise.gaussian if law == "gaussian" else noise.exponential)((K, 17, 17), rng())
    frames = recording.inject(white, path, strength, blur, rng(2), law)
    ratios = []
    for truth, found in zip(path, recording.plots(frames, eta, law), strict=True):
        nearest = found[np.hypot(*(found[:, :2] - truth).T).argmin()]
        ratios.append((nearest[:2] - truth) / nearest[3:])
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.3


def test_plots_of_one_ship_become_one():
    scan = np.array([[0.0, 0, 1], [50, 50, 2], [3, 0, 3], [6, 0, 5]])
    assert recording.merge_plots(scan, 3.5).tolist() == [[3.0, 0.0, 3.0], [50.0, 50.0, 2.0]]
    heavy = recording.merge_plots(scan, 3.5, weights=[1.0, 1, 1, 2])
    assert heavy[0].tolist() == pytest.approx([15 / 4, 0.0, 14 / 4])
    assert recording.merge_plots(np.empty((0, 2)), 3.5).shape == (0, 2)


def test_the_unit_of_the_noise():
    a = 7.0 * np.sqrt(2 * rng().standard_exponential(2000) + 4.0)
    a[:20] *= 4.0  # targets
    found = recording.noise_unit(a, 14.0, told=7.0)
    assert found.value == pytest.approx(7.0, abs=3 * found.se + 0.1)
    assert recording.noise_unit(a, 14.0) == found, "a unit that is not told is not compared"
    for wrong in (3.5, 14.0):
        with pytest.warns(Misfit, match=f"not {wrong:g}"):
            recording.noise_unit(a, 14.0, told=wrong)
    for bad in (a[:29], a - 5.0):
        with pytest.raises(ValueError, match="recording.noise_unit: amplitudes"):
            recording.noise_unit(bad, 14.0)
    values = [
        recording.noise_unit(np.sqrt(2 * rng(s).standard_exponential(100)), 0.0) for s in range(300)
    ]
    assert np.std([v.value for v in values]) == pytest.approx(values[0].se, rel=0.15)


def test_starts_are_straight_lines_of_three_plots():
    t, v = np.array([0.0, 1.6, 3.5]), np.array([3.0, -1.0])
    scans = [np.array([[100.0, 50, 7]]) + [*(v * s), 0] for s in t]
    scans[0] = np.r_[scans[0], [[90.0, 51, 7]]]  # on a line with the last two, but too fast
    scans[2] = np.r_[scans[2], [[100.0, 70, 7]]]  # on no line
    x, P = recording.starts(scans, t, 5.0, 1.0)
    assert x == pytest.approx(np.array([[110.5, 3.0, 46.5, -1.0]]))
    errors = rng().standard_normal((40_000, 3, 2)) * 2.0
    z = errors + v * t[:, None]
    found = np.array([z[:, 2], (z[:, 2] - z[:, 0]) / 3.5])[..., 0]
    assert recording.starts(scans, t, 5.0, 2.0)[1][0, :2, :2] == pytest.approx(
        np.cov(found), rel=0.05
    )
    assert P[0, :2, 2:] == pytest.approx(0.0)
    for gap in ([None, *scans[1:]], [scans[0], None, scans[2]], [*scans[:2], None]):
        assert [a.shape for a in recording.starts(gap, t, 5.0, 1.0)] == [(0, 4), (0, 4, 4)]
    for bad in (scans[:2], [*scans[:2], np.ones((2, 1))]):
        with pytest.raises(ValueError, match="recording.starts: "):
            recording.starts(bad, t, 5.0, 1.0)
    with pytest.raises(ValueError, match="times that rise"):
        recording.starts(scans, t[::-1], 5.0, 1.0)


def test_three_true_plots_in_a_hundred_are_on_no_line():
    hits = [
        len(recording.starts(list(2.0 * rng(s).standard_normal((3, 1, 2))), [0, 1, 2], 9.0, 2.0)[0])
        for s in range(500)
    ]
    assert 0.95 < np.mean(hits) <= 1.0  # 1 - exp(-9 / 2) = 0.989


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("blur", [0.8, 1.0, 1.6])
def test_the_blur_of_bright_places(blur, law):
    K = 200
    white = (noise.gaussian if law == "gaussian" else noise.exponential)((K, 40, 30), rng())
    path = np.array([14.0, 10.0]) + 10 * rng().random((K, 2))
    strength = 30.0 if law == "gaussian" else 300.0
    found = recording.blur_of(recording.inject(white, path, strength, blur, rng(), law), law, 20.0)
    width = blur if law == "gaussian" else blur / 2**0.5
    assert found.places >= K
    assert found.value == pytest.approx([width, width], abs=0.05 * width + 3 * found.se.max())


def images(place, strength, blur):
    """Targets (K, 30, 30) at places (2, K), with another blur on each axis."""
    x, y = np.exp(-0.5 * ((np.arange(30) - place[..., None]) / blur[:, None, None]) ** 2)
    return np.einsum("k,ki,kj->kij", strength, x, y)


def test_the_blur_of_each_axis_without_noise():
    blur, offsets = np.array([0.8, 1.3]), (np.arange(20) + 0.5) / 20 - 0.5
    place = 15 + np.array([offsets, np.roll(offsets, 7)])
    found = recording.blur_of(images(place, np.full(20, 60.0), blur), eta=20.0, half=8)
    assert found.value == pytest.approx(blur, abs=0.001)


def test_the_error_of_a_blur_is_what_it_varies_by():
    """Twenty targets of several strengths, a hundred times."""
    values, errors = [], []
    for seed in range(100):
        draw = rng(seed + 1000)
        place, strength = 15 + draw.random((2, 20)), draw.uniform(40.0, 160.0, 20)
        z = noise.gaussian((20, 30, 30), rng(seed)) + images(place, strength, np.array([0.7, 1.3]))
        found = recording.blur_of(z, eta=20.0)
        values.append(found.value)
        errors.append(found.se)
    assert np.std(values, axis=0) / np.mean(errors, axis=0) == pytest.approx(1.0, abs=0.25)


def test_without_bright_places_there_is_no_blur():
    with pytest.warns(Misfit, match="not measurable"):
        found = recording.blur_of(noise.gaussian((5, 30, 30), rng()), eta=8.0)
    assert np.isnan(found.value).all()
    assert found.places == 0


def test_binned_frames():
    z = noise.gaussian((30, 31, 20), rng())
    assert recording.bin_cells(z, 2)[3, 4, 5] == pytest.approx(z[3, 8:10, 10:12].sum() / 2)
    assert recording.bin_cells(z, 2).shape == (30, 15, 10)
    assert recording.bin_cells(z, 3, "exponential")[1, 2, 3] == pytest.approx(
        z[1, 6:9, 9:12].mean()
    )
    z[0, 0, 0] = np.nan
    assert np.isnan(recording.bin_cells(z, 2)).sum() == 1


# A target in one's own frames


def test_an_injected_target_is_the_image():
    K, place = 3, np.array([[4.0, 5.0], [np.nan, np.nan], [4.5, 5.25]])
    z = noise.gaussian((K, 9, 11), rng())
    z[0, 0, 0] = np.nan
    added = recording.inject(z, place, 3.0, 0.9, rng()) - z
    i, j = np.mgrid[:9, :11]
    for k in (0, 2):
        h = 3.0 * np.exp(-((i - place[k, 0]) ** 2 + (j - place[k, 1]) ** 2) / (2 * 0.81))
        h[np.isnan(z[k])] = np.nan
        assert added[k] == pytest.approx(h, nan_ok=True)
    assert (added[1] == 0).all()
    point = recording.inject(z, place, 3.0, 0.0, rng()) - z
    assert np.argwhere(point > 1).tolist() == [[0, 4, 5], [2, 5, 5]]


def test_power_of_a_steady_target_has_the_law_of_rice():
    K = 20_000
    z = noise.exponential((K, 3, 3), rng())
    power = recording.inject(z, np.ones((K, 2)), 4.0, 0.0, rng(2), "exponential")
    assert stats.kstest(2 * power[:, 1, 1], stats.ncx2(2, 8.0).cdf).pvalue > 0.01
    assert (power[:, 0] == z[:, 0]).all()


def test_plots_agree_with_a_flood_fill():
    z = ndimage.gaussian_filter(noise.gaussian((1, 40, 40), rng()), 1.0)
    (found,) = recording.plots(z, 0.3)
    left, groups = {tuple(c) for c in np.argwhere(z[0] > 0.3)}, []
    while left:
        group, border = [], [left.pop()]
        while border:
            i, j = border.pop()
            group.append((i, j))
            near = {(i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)} & left
            left -= near
            border += near
        w = np.array([z[0, i, j] for i, j in group])
        groups.append((*(w @ np.array(group)) / w.sum(), w.max()))
    assert sorted(map(tuple, found[:, :3].round(9))) == sorted(map(tuple, np.round(groups, 9)))
