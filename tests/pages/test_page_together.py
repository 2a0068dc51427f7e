"""Page 06: its scenes, the reference chain, and that each page works as a method on them."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, kstest

import tbdcore
from tbdcore.repro import pages, paths, trials

six = tbdcore.page("together")
p = replace(six.Setup(), N=200, births=100)
LOUD = six.Scene(snr_db=30.0)


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
    assert z.shape == (24, 64, 64)
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
        assert there.tolist() == [5 <= k < 21 for k in range(24)]
        assert x[there][:, ::2].min() >= 1
        assert x[there][:, ::2].max() <= 64
        v = x[there][:, 1::2]
        assert 0.5 <= np.hypot(*v[0]) <= 1.0
        angle = np.diff(np.unwrap(np.arctan2(v[:, 1], v[:, 0])))
        assert np.abs(np.abs(angle) - turn).max() < 1e-9


def test_two_targets_meet_in_the_middle():
    s = six.Scene(enters=0, leaves=24, crossing=math.radians(40), snr_db=0.0)
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
    for k, rows in enumerate(six.scans(z)):
        assert (rows[:, 2] > six.LOW).all()
        if 5 <= k < 21:
            top = rows[rows[:, 2].argmax()]
            assert np.hypot(*(top[:2] - x[k, ::2])) < 0.5


def test_plots_are_local_maxima_counted_once():
    z = np.zeros((2, 9, 9), np.float32)
    z[0, 0, 0], z[0, 4, 4], z[0, 4, 5], z[1, 8, 2] = 9, 8, 4, 5
    first, second = six.scans(z)
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


def test_the_level_is_where_the_reference_just_declares():
    _, z = scene(six.Scene(), 5)
    plots = six.scans(z)
    tau = six.level(plots, p)
    assert 5 < tau < 9
    assert np.isfinite(chain(plots, tau, p)).any()
    assert not np.isfinite(chain(plots, tau + 0.03, p)).any()


def test_a_loud_target_is_declared_where_it_is_by_all():
    for i in range(3):
        (x,), z = scene(LOUD, i)
        said, place = six.observe(z, p, stream)
        quiet, _ = six.observe(scene(six.Scene(), i)[1], p, stream)
        far = np.hypot(*np.moveaxis(place - x[:, ::2], -1, 0))
        right = (far < 3) & (said > quiet.max(axis=1)[:, None])
        assert right.any(axis=1).all()
        off = np.hypot(*(chain(six.scans(z), 7.0, p)[:, 0] - x[:, ::2]).T)
        assert np.nanmin(off) < 1


def test_a_loud_target_is_held_by_all():
    s = six.Scene(snr_db=15.0, K=15, enters=0, leaves=15)
    (x,), z = scene(s)
    place = six.hold(z, x, replace(p, N=400), 7.0, stream)
    assert place.shape == (9, 15, 2)
    off = np.hypot(*np.moveaxis(place - x[:, ::2], -1, 0))
    assert np.nanmedian(off, axis=1).max() < 1.5
    assert (off < 3).mean(axis=1).min() > 0.5
    assert (off[[0, 1, 3, 6, 7, 8]] < 3).all()


def test_crossing_targets_that_are_loud_are_kept_by_association():
    s = six.Scene(enters=0, leaves=24, crossing=math.radians(40), snr_db=20.0)
    x, z = scene(s)
    ends = six.ljipda(six.scans(z), x[:, 0], p, ("JIPDA", "LM-AI"))[:, :, -1]
    assert ends.shape == (2, 2, 2)
    far = np.hypot(*np.moveaxis(ends[1] - x[:, -1, ::2], -1, 0))
    assert far.max() < 3


def test_no_algorithm_is_copied():
    """Each method calls its page."""
    source = "\n".join(pages.cells("together", "algorithm"))
    for name in pages.papers():
        assert f'page("{name}")' in source
    kernels = [cell for cell in pages.cells("together") if "@kernel" in cell]
    assert kernels == []


# The advice of Section 7, held against the committed tables ---------------------------------------


def committed(name):
    """Rows of a committed table by method."""
    with (paths.PRODUCTS / "together" / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return {row["method"]: row for row in csv.DictReader(file)}


def test_the_advice_on_finding_stands_in_the_tables():
    straight, turning = committed("order_straight"), committed("order_turning")
    others = set(six.METHODS) - {"Bernoulli", "Tonissen"}
    for name in ("Bernoulli", "Tonissen"):
        for table in (straight, turning):
            assert all(table[name][other].startswith("+") for other in others)
    assert straight["Bernoulli"]["Tonissen"] == ""
    assert turning["Bernoulli"]["Tonissen"].startswith("+")
    for table in (straight, turning):
        assert table["Bernoulli"]["accumulating"].startswith("+")


def test_what_the_text_says_of_fading_and_turning_stands_in_the_table():
    breaks = committed("breaks")

    def margin(name, change):
        mean, error = map(float, breaks[name][change].split(" ± "))
        return mean / error

    assert all(margin(name, "Swerling 1") < -2.6 for name in (*six.METHODS[:3], "reference"))
    assert margin("accumulating", "Swerling 1") > 2.6
    assert all(abs(margin(name, "turning")) < 2.6 for name in six.METHODS)


def test_the_advice_on_holding_stands_in_the_table():
    advice = {name: row["not beaten"].split(", ") for name, row in committed("advice").items()}
    assert advice["hold a target that fades and turns"] == ["accumulating"]
    assert set(advice["hold two that fade and cross"]) == {"LM-AI", "JIPDA"}
    assert set(advice["find a steady target on a straight line"]) == {"Bernoulli", "Tonissen"}
    assert advice["find it early"] == ["Bernoulli"]
    assert advice["find a target that fades and turns"] == ["Bernoulli"]


def test_what_the_text_says_of_holding_stands_in_the_figure():
    held = {"0": {}, "1": {}}  # scans kept; mean OSPA
    with (paths.PRODUCTS / "together" / "holding.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            held[row["panel"]].setdefault(float(row["x"]), {})[row["series"]] = float(row["y"])
    nearest = {snr: sorted(row, key=row.get) for snr, row in held["1"].items()}
    assert [nearest[snr][0] for snr in (3, 6)] == ["accumulating"] * 2
    assert set(nearest[9][:2]) == {"accumulating", "LM-AI"}
    for snr in (3, 6, 9, 12):
        assert held["1"][snr]["LM-AI"] < min(held["1"][snr][m] for m in ("track CFAR", "reference"))
    assert max(held["0"][3], key=held["0"][3].get) == "accumulating"


def test_what_the_advice_says_of_cost_and_delay_stands_in_the_tables():
    practitioner, cost = committed("practitioner"), {}
    operations = "1000 operations per frame"
    assert float(practitioner["Bernoulli"][operations]) < float(
        practitioner["Tonissen"][operations]
    )
    with (paths.PRODUCTS / "together" / "cost.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            cost.setdefault(row["series"], []).append((float(row["x"]), float(row["y"])))
    cheap, reference = min(cost["Bernoulli"]), cost["reference"][0]
    assert cheap[1] == 0.95
    assert cheap[0] < 1.2 * reference[0]


def test_what_the_advice_says_of_crossing_targets_stands_in_the_figure():
    kept = {}
    with (paths.PRODUCTS / "together" / "crossing.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            kept[row["series"], float(row["x"])] = float(row["y"]), float(row["se"])
    for snr, sign in ((9, 1), (18, -1)):
        (a, s), (b, t) = kept["LM-AI", snr], kept["JIPDA", snr]
        assert sign * (a - b) > 2.6 * math.hypot(s, t)


def test_thresholds_hold_on_fresh_noise():
    for row in committed("false").values():
        assert abs(float(row["declared (%)"]) - 5) < 2.6 * float(row["error"])
