"""Rows flown under their readings: the file, the verdicts that follow from it, and the study."""

import math
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import readings as driver
from benchmarks import readings_ljipda_ai as boats
from benchmarks import rows
from tbdcore.repro import claims, pages, products

HEADER = ",".join(claims.Claim._fields)
NUMBER = "a,Sec. 3,range,,287.10,km,number,Sec. 3,Mean range,{},"
READINGS = ",".join(claims.Reading._fields)
READINGS += "\ntoy,weights,p. 3,own cell;gated;single,own cell,a,\ntoy,births,p. 4,all;new,all,a,\n"
FLOWN = ",".join(claims.Flown._fields)
LINE = "toy,a,{},287.1,0.001,400,{},{},0123456789abcdef"
TOLD = ["default", "weights: gated", "weights: single", "births: new"]


@pytest.fixture
def folder(tmp_path):
    """A folder of claims `toy`, with readings and what was flown beside it."""
    (tmp_path / "claims").mkdir()
    write(tmp_path / "claims", "measured")
    (tmp_path / "readings.csv").write_text(READINGS)
    return tmp_path / "claims"


def write(folder, evidence):
    (folder / "toy.csv").write_text(f"{HEADER}\n{NUMBER.format(evidence)}\n")


def fly(folder, *verdicts, apart="yes", told=TOLD):
    lines = [LINE.format(it, apart, v) for it, v in zip(told, verdicts, strict=True)]
    (folder.parent / "readings_flown.csv").write_text("\n".join([FLOWN, *lines, ""]))
    return claims.Ledger("toy", True, folder)


SAME = ["reproduced"] * 3


@pytest.mark.parametrize(
    ("verdicts", "apart", "verdict", "told"),
    [
        ([*SAME, "differs"], "yes", "depends", "3 of 4: 3 reproduced, 1 differs"),
        ([*SAME, "differs"], "no", "reproduced", "3 of 4: 3 reproduced, 1 differs"),
        ([*SAME, "inconclusive"], "yes", "reproduced", "3 of 4: 3 reproduced, 1 inconclusive"),
        (["differs", *SAME], "yes", "depends", "3 of 4: 3 reproduced, 1 differs"),
        (
            ["inconclusive", "differs", *SAME[:2]],
            "yes",
            "depends",
            "2 of 4: 2 reproduced, 1 differs, 1 inconclusive",
        ),
    ],
)
def test_depends_follows_from_what_was_flown(folder, verdicts, apart, verdict, told):
    found = fly(folder, *verdicts, apart=apart).check("a", 287.1, se=0.001, n=400)
    assert (found.verdict, found.readings) == (verdict, told)


def test_a_calibrated_row_names_its_readings_and_keeps_its_verdict(folder):
    write(folder, "calibrated")
    found = fly(folder, *SAME, "differs").check("a", 287.1, se=0.001, n=400)
    assert (found.verdict, found.readings[:6]) == ("reproduced", "3 of 4")


def test_options_are_flown_together(folder):
    told = ["default", "weights: gated; births: new", "weights: single"]
    found = fly(folder, "differs", *SAME[:2], told=told).check("a", 287.1, se=0.001, n=400)
    assert (found.verdict, found.readings[:6]) == ("depends", "2 of 3")


def test_a_living_option_that_was_not_flown_is_named(folder):
    for kept, lost in ((TOLD[:3], "births: new"), (TOLD[1:], "default")):
        book = fly(folder, *SAME, told=kept)
        again = r"python -m benchmarks\.readings toy a"
        with pytest.raises(ValueError, match=f"^toy: a: not flown: {lost}; {again}$"):
            book.check("a", 287.1, se=0.001, n=400)


def test_a_page_does_not_fly_what_the_file_has(folder):
    options = {"weights": {"gated": claims.Option(287.1, 0.0, 0.1, se=0.001, n=400)}}
    with pytest.raises(ValueError, match=r"readings_flown\.csv has its readings; give none here"):
        fly(folder, *SAME, "differs").check("a", 287.1, se=0.001, readings=options)


BAD = {
    "paper": (LINE.replace("toy", "tyo"), "'tyo'; the nearest is 'toy'"),
    "row": (LINE.replace(",a,", ",b,"), "'b'; the nearest claim is 'a'"),
    "reading": (LINE.replace("{}", "weights: gatde", 1), "births: new; weights: gated; weights"),
    "measured": (LINE.replace("287.1,", ","), "write it down"),
    "apart": (LINE.replace("{},{}", "maybe,{}"), "write yes or no"),
    "verdict": (LINE.replace("{},0123", "depends,0123"), "no such verdict"),
}


@pytest.mark.parametrize(("column", "line", "words"), [(k, *v) for k, v in BAD.items()])
def test_a_bad_line_is_named_by_file_row_and_column(folder, column, line, words):
    line = line.format("default", "no", "reproduced")
    (folder.parent / "readings_flown.csv").write_text(f"{FLOWN}\n{line}\n")
    with pytest.raises(ValueError, match=f"^readings_flown.csv, row 2, column {column}") as caught:
        claims.flown("toy", folder)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


# The study ---------------------------------------------------------------------------------------


def test_all_combinations_of_living_options_are_asked_for(folder):
    book = claims.Ledger("toy", True, folder)
    asked = [driver.named(book, it) for it in driver.combinations(book, "a")]
    assert asked == [
        "default",
        "births: new",
        "weights: gated",
        "weights: gated; births: new",
        "weights: single",
        "weights: single; births: new",
    ]


def test_options_are_compared_on_the_same_trials():
    rng = np.random.default_rng(3)
    x = rng.standard_normal((1, 400)) + [[0.0], [1.0]]
    default, other = driver.compared(x)
    assert (default.difference, default.error) == (0.0, 0.0)
    assert other.difference == pytest.approx(1.0, abs=1e-12)
    assert other.error == pytest.approx(0.0, abs=1e-12)
    assert other.se == pytest.approx(0.05, rel=0.2)
    assert other.n == 400


def test_the_file_is_not_behind_its_sources():
    assert driver.stale() == []


def test_a_change_of_study_page_or_reading_makes_a_row_stale(monkeypatch, tmp_path):
    study = types.SimpleNamespace(USES=boats.USES, ROWS=boats.ROWS, __file__=boats.__file__)
    now = driver.digest("ljipda_ai", "con.dense", study)
    text = Path(boats.__file__).read_text()
    (tmp_path / "study.py").write_text(f"# a comment\n{text}")
    study.__file__ = tmp_path / "study.py"
    assert driver.digest("ljipda_ai", "con.dense", study) == now
    (tmp_path / "study.py").write_text(text.replace("100.0 *", "99.0 *"))
    assert driver.digest("ljipda_ai", "con.dense", study) != now
    study.__file__ = boats.__file__
    plain = claims.readings("ljipda_ai")
    changed = {k: v._replace(default="one gate") for k, v in plain.items()}
    monkeypatch.setattr(claims, "readings", lambda paper: changed)
    assert driver.digest("ljipda_ai", "con.dense", study) != now


def test_rows_that_no_study_flies_are_refused():
    studies = {paper: driver.studies(paper) for paper in pages.papers()}
    assert driver.wanted([]) == {paper: [*it.ROWS] for paper, it in studies.items() if it}
    assert driver.wanted(["05", "con.dense"]) == {"ljipda_ai": ["con.dense"]}
    with pytest.raises(ValueError, match=r"ljipda_ai con\.dence: no study flies it"):
        driver.wanted(["05", "con.dence"])


@pytest.fixture(scope="module")
def two_boats():
    """What one crossing needs: no cell that flies trials."""
    names = ("page", "crossing", "flown", "pd_of", "ONE", "SNR", "SEA_PFA")
    return types.SimpleNamespace(**rows.definitions("ljipda_ai", names))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "method"),
    [
        (boats.Way(boats.VISIBLE, boats.EVERY, False, False), "LJIPDA"),
        (boats.Way(boats.VISIBLE, boats.EVERY, False, True), "LJIPDA-AI"),
        (boats.Way(boats.VISIBLE, boats.LARGEST, False, True), "LJIPDA-AI, largest prior"),
        (boats.Way(boats.VISIBLE, boats.LONE, False, True), "LJIPDA-AI, one gate"),
    ],
)
def test_the_study_of_05_tracks_as_the_page_does(two_boats, way, method):
    """Where the page has a method of its own for a reading; with one P_D, and by track."""
    _, plots, _, s = two_boats.crossing(6, 20, 0)
    by_track = two_boats.pd_of(two_boats.SEA_PFA, two_boats.SNR)
    for ours, level, told in (
        (way, two_boats.ONE, s),
        (way._replace(by_track=True), two_boats.SNR, replace(s, p_detect=by_track)),
    ):
        theirs = two_boats.flown(plots, told, method, level)
        found = boats.track(two_boats, plots, s, ours)
        np.testing.assert_allclose(found, theirs, rtol=1e-9, atol=1e-6)


DENSITY = np.array([[4e-5, 9e-5, 0.0], [0.0, 6e-5, 5e-5]])  # of three plots under two tracks
P, D, CLUTTER, GAMMA = np.array([0.9, 0.8]), np.full(2, 0.95), 3e-5, 9.0
S = np.array([np.diag([900.0, 400.0]), np.array([[500.0, 100.0], [100.0, 300.0]])])
SENSOR = (1.0, 1.0, CLUTTER, GAMMA, 0.98889, 0.99, 0.0)


def shared(how):
    with np.errstate(divide="ignore"):
        return np.exp(boats.shared(how, np.log(DENSITY), S, P, SENSOR, D)) * CLUTTER


def test_strict_visibility_is_one_over_one_plus_the_odds_of_the_others():
    prior = DENSITY / DENSITY.sum(axis=1, keepdims=True) * (D * P)[:, None]
    odds = prior / (1 - prior)
    np.testing.assert_allclose(shared(boats.STRICT), DENSITY / (1 + odds[::-1]), rtol=1e-12)


def test_a_prior_by_plot_is_shared_among_the_tracks_without_existence():
    prior = D[:, None] * DENSITY / DENSITY.sum(axis=0)
    odds = prior / (1 - prior)
    visible = (1 + odds) / (1 + odds.sum(axis=0))
    np.testing.assert_allclose(shared(boats.BY_PLOT), DENSITY * visible, rtol=1e-12)


def test_the_squared_reading_counts_clutter_by_the_visibilities():
    """By hand: P_V squared, n = sum of P_V less P_D P_W P (1 - product of (1 - P_V))."""
    prior = DENSITY / DENSITY.sum(axis=1, keepdims=True) * (D * P)[:, None]
    odds = prior / (1 - prior)
    visible, found = (1 + odds) / (1 + odds.sum(axis=0)), np.zeros((2, 3))
    for t in range(2):
        seen, V = visible[t][DENSITY[t] > 0], math.pi * GAMMA * math.sqrt(np.linalg.det(S[t]))
        n = seen.sum() - D[t] * P[t] * (1 - np.prod(1 - seen))
        found[t] = CLUTTER * DENSITY[t] * visible[t] ** 2 * V / n
    np.testing.assert_allclose(shared(boats.SQUARED), found, rtol=1e-12)


def test_the_indicator_of_the_study_gives_a_shared_amplitude_as_it_says():
    rng, log_ratio = np.random.default_rng(2), np.log(np.maximum(DENSITY, 1e-300) / CLUTTER)
    log_ratio[DENSITY == 0] = -np.inf
    for who, first, second in (
        (boats.EVERY, 1, 1),
        (boats.LARGEST, 1, 0),
        (boats.LONE, 0, 0),
        (boats.FIRST, 1, 0),
        (boats.LAST, 0, 1),
    ):
        found = boats.omega(who, log_ratio, P, D, rng)
        np.testing.assert_array_equal(found, [[1, first, 0], [0, second, 1]])
    tossed = np.array([boats.omega(boats.COIN, log_ratio, P, D, rng)[:, 1] for _ in range(2000)])
    np.testing.assert_array_equal(tossed.sum(axis=1), 1)
    assert abs(tossed[:, 0].mean() - 0.5) < 4 / math.sqrt(8000)


def test_the_digest_of_a_page_follows_what_was_flown(monkeypatch):
    now = pages.digest("ljipda_ai")
    each = claims.flown("ljipda_ai")
    restamped = {id: [it._replace(digest="0") for it in them] for id, them in each.items()}
    monkeypatch.setattr(claims, "flown", lambda paper: restamped)
    assert pages.digest("ljipda_ai") == now
    other = {id: [it._replace(verdict="differs") for it in them] for id, them in each.items()}
    monkeypatch.setattr(claims, "flown", lambda paper: other)
    assert pages.digest("ljipda_ai") != now
    assert products.digest([]) != now
