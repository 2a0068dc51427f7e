"""Claims: files that a spreadsheet has touched, the edges of every verdict, and a ledger that is
complete or fails.
"""

import dataclasses
import math
import shutil

import numpy as np
import pytest
from scipy import stats

from tbdcore.repro import claims, paths
from tbdcore.repro.claims import Ledger
from tbdcore.scenario import given

HEADER = ",".join(claims.Claim._fields)
GOOD = [
    HEADER,
    "a.in,Sec. 1,speed,,500,m/s,input,Sec. 1,,,",
    "a.num,Fig. 1,range,,287.10,km,number,Sec. 2,Mean range of all trials,measured,",
    "a.order,Fig. 1,A beats B,,greater,,ordering,Sec. 2,Mean of A less B,measured,",
]
ROW = "b,Fig. 2,range,,1.5,km,number,Sec. 2,Mean range,measured,"


def written(folder, *lines, end="\n"):
    """A claims file `toy` of some lines."""
    (folder / "toy.csv").write_bytes(end.join([*lines, ""]).encode())
    return folder


def ledger(folder, *lines, strict=True):
    return Ledger("toy", strict, written(folder, *(lines or GOOD)))


def refused(folder, *words):
    """Reading fails in one line that holds the words."""
    with pytest.raises(ValueError, match="toy.csv") as caught:
        claims.read("toy", folder)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_a_good_file(tmp_path):
    rows = claims.read("toy", written(tmp_path, *GOOD))
    assert list(rows) == ["a.in", "a.num", "a.order"]
    assert rows["a.num"].value == "287.10"  # text: the zero is a digit


BAD_LINES = [  # a line, and the row or the column that is named
    (GOOD[1], "row 5"),
    (ROW.replace("1.5", "about 1.5"), "value"),
    (ROW.replace("1.5", '"1,5"'), "value"),
    (ROW.replace("1.5", ""), "value"),
    ('b,Sec. 1,speed,,"1,5",m/s,input,Sec. 1,,,', "value"),
    (ROW.replace("km", "furlong"), "unit"),
    (ROW.replace("number", "figure"), "kind"),
    ("b,Fig. 2,range,,1.5,km,number", "where"),
    (ROW + ",more", "cause"),
    (ROW.replace(",", ";"), "row 5"),
    (ROW.replace("b,Fig", ",Fig"), "id"),
    (ROW.replace("measured", ""), "evidence"),
    (ROW.replace("measured", "guessed"), "evidence"),
    (ROW.replace("measured", "repeats c"), "evidence"),
    (ROW.replace("Mean range", ""), "rule"),
    (ROW.replace("range,,", "gain in range,,"), "rule"),  # without its null value
    (ROW.replace("Mean range", "Mean range; tolerance = small"), "rule"),
    (ROW.replace("number", "input"), "rule"),
]


@pytest.mark.parametrize(("line", "named"), BAD_LINES)
def test_a_bad_row_is_named_by_file_row_and_column(tmp_path, line, named):
    named = named if " " in named else f"column {named}"
    refused(written(tmp_path, *GOOD, line), "row 5", named)


def test_a_missing_column(tmp_path):
    lines = [",".join(part for i, part in enumerate(line.split(",")) if i != 5) for line in GOOD]
    refused(written(tmp_path, *lines), "row 1, column unit: the columns are")


def test_columns_in_another_order(tmp_path):
    refused(written(tmp_path, HEADER.replace("id,item", "item,id"), *GOOD[1:]), "row 1", "item,id")


def test_semicolons(tmp_path):
    refused(
        written(tmp_path, *(line.replace(",", ";") for line in GOOD)),
        "row 1, column id: the columns are",
    )


def test_crlf(tmp_path):
    refused(written(tmp_path, *GOOD, end="\r\n"), "row 1", "CR")


def test_the_rows_of_a_file_are_counted_from_its_first_line(tmp_path):
    (tmp_path / "toy.csv").write_bytes(b"\n\n\r\n")
    refused(tmp_path, "row 3", "CR")


def test_byte_order_mark(tmp_path):
    refused(written(tmp_path, "\ufeff" + GOOD[0], *GOOD[1:]), "row 1", "byte-order mark")


def test_latin_1(tmp_path):
    (tmp_path / "toy.csv").write_bytes(
        "\n".join([*GOOD, ROW.replace("range", "portée")]).encode("latin-1")
    )
    refused(tmp_path, "row 5", "not UTF-8")


def test_an_empty_file(tmp_path):
    (tmp_path / "toy.csv").write_bytes(b"")
    refused(tmp_path, "row 1, column id: the columns are")


def test_a_quote_that_is_never_closed(tmp_path):
    refused(written(tmp_path, *GOOD, ROW.replace("range", '"range')), "row 5", "quotation mark")


def test_no_file_of_this_name(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"toy.csv.*papers: ") as caught:
        claims.read("toy", tmp_path)
    assert "\n" not in str(caught.value)


NUMBERS = {
    "287.10": (287.1, 0.005),
    "14 600": (14600, 0.5),
    "3e-5": (3e-5, 0.5e-5),
    "10^-6": (1e-6, 0.5e-6),
    "100%": (100, 0.5),
    "-1.5": (-1.5, 0.05),
}


@pytest.mark.parametrize("text", NUMBERS)
def test_printed_numbers(text):
    np.testing.assert_allclose(
        claims.parse(text), NUMBERS[text], rtol=1e-15
    )  # the same decimal, to rounding


@pytest.mark.parametrize("text", ["", "1,5", "about 3", "3..5", "1 2", "nan", "inf", "0x10"])
def test_what_is_no_number(text):
    with pytest.raises(ValueError, match="is no number"):
        claims.parse(text)


def test_a_row_may_not_repeat_one_that_repeats(tmp_path):
    lines = [
        f"{id},Fig. 2,A beats B,,greater,,ordering,Sec. 2,As a.order,repeats {original},"
        for id, original in (("b", "a.order"), ("c", "b"))
    ]
    refused(
        written(tmp_path, *GOOD, *lines),
        "row 6, column evidence",
        "'b' is no row or repeats one itself",
    )


def test_numbers_of_a_rule():
    rule = "Mean of A; null = 0 dB; first frame = 101; tolerance = 1e-3; runs = 100"
    assert claims.numbers(rule) == {"null": 0, "first frame": 101, "tolerance": 1e-3, "runs": 100}


# A number printed as 10.0, half a digit 0.05; q is the quantile of 2.6 standard errors.
EDGES = [  # measured, se, n, runs, verdict
    (10.05, 0.0, None, None, "reproduced"),  # on the edge, which belongs to the print
    (10.0501, 0.0, None, None, "differs"),
    (9.95, 0.0, None, None, "reproduced"),
    (10.05 + 2.59 * 0.01, 0.01, 100, None, "reproduced"),
    (10.05 + 2.61 * 0.01, 0.01, 100, None, "differs"),
    (10.05 + 2.61 * 0.01, 0.01, 30, None, "reproduced"),  # Student's quantile is 2.8 there
    (10.05 + 2.80 * 0.01, 0.01, 30, None, "differs"),
    (10.0, 0.024, 100, None, "reproduced"),  # half of the half digit is 0.025
    (10.0, 0.026, 100, None, "inconclusive"),
    (10.0, 1.0, 100, 100, "reproduced"),  # as well known as the paper knew it
    (10.0, 1.0, 90, 100, "inconclusive"),
    (10.05 + 2.59 * 0.01 * math.sqrt(101), 0.01, 10_000, 100, "reproduced"),
    (10.05 + 2.61 * 0.01 * math.sqrt(101), 0.01, 10_000, 100, "differs"),
    (math.nan, 0.0, None, None, "inconclusive"),
    (math.inf, 0.0, None, None, "differs"),
]


@pytest.mark.parametrize(("measured", "se", "n", "runs", "verdict"), EDGES)
def test_the_edges_of_a_number(measured, se, n, runs, verdict):
    for value in (measured, 20.0 - measured):  # both edges alike
        assert claims.judge(10.0, 0.05, value, se, n, runs)[0] == verdict


@pytest.mark.parametrize(
    ("print_", "measured", "verdict"),
    [("1", 0.7, "inconclusive"), ("1.0", 0.95, "reproduced"), ("9", 0.0, "differs")],
)
def test_a_print_that_no_effect_passes_reproduces_nothing(print_, measured, verdict):
    """ "About 1 dB" of a hundred runs with a scatter of 0.2 dB is compatible with no gain."""
    number = claims.parse(print_)
    se, runs = {"1": (0.035, 100), "1.0": (0.02, 4000), "9": (0.035, 100)}[print_]
    assert claims.judge(*number, measured, se, 4000, runs, null=0.0)[0] == verdict


@pytest.mark.parametrize(
    ("margins", "se", "reached", "verdict"),
    [
        (1.0, 0.0, False, "reproduced"),
        (0.0, 0.0, False, "differs"),
        (0.0, 0.0, True, "reproduced"),
        (-1.0, 0.0, True, "differs"),
        (2.61, 1.0, False, "reproduced"),
        (2.59, 1.0, False, "inconclusive"),
        (-2.59, 1.0, False, "inconclusive"),
        (-2.61, 1.0, False, "differs"),
        (math.nan, 1.0, False, "inconclusive"),
        ([3.0, 2.7], [1.0, 1.0], False, "reproduced"),
        ([3.0, 2.5], [1.0, 1.0], False, "inconclusive"),
        ([3.0, -2.7], [1.0, 1.0], False, "inconclusive"),  # Bonferroni's quantile of two is 2.83
        ([3.0, -2.9], [1.0, 1.0], False, "differs"),
        ([3.0, -1.0], [1.0, 0.0], False, "differs"),
        ([3.0, math.nan], [1.0, 1.0], False, "inconclusive"),
    ],
)
def test_the_edges_of_margins(margins, se, reached, verdict):
    assert claims.judge_margins(margins, se, reached=reached)[0] == verdict


def test_quantiles_are_of_the_level_of_two_point_six():
    level = math.erfc(2.6 / math.sqrt(2))
    assert claims.quantile() == pytest.approx(2.6, rel=1e-12)
    assert claims.quantile(60) == claims.quantile()
    for n in (2, 30, 45, 59):
        assert claims.quantile(n) == pytest.approx(stats.t.isf(level / 2, n - 1), rel=1e-9)
    assert claims.quantile(points=5) == pytest.approx(stats.norm.isf(level / 10), rel=1e-9)


def share_of(verdict, n, digits, offset=0.0, runs=100, replicas=20_000):
    """Share of prints of `runs` runs, off by an offset, that get a verdict from n trials."""
    rng, se = np.random.default_rng(1), 1 / math.sqrt(n)
    printed = np.round(rng.normal(offset, 1 / math.sqrt(runs), replicas), digits)
    ours = rng.normal(0.0, se, replicas)
    half = 0.5 * 10.0**-digits
    given = [claims.judge(p, half, o, se, n, runs)[0] for p, o in zip(printed, ours, strict=True)]
    return given.count(verdict) / replicas


@pytest.mark.parametrize(("n", "digits"), [(100, 6), (1000, 2), (4000, 6)])
def test_a_true_number_differs_in_less_than_one_of_a_hundred(n, digits):
    exact = math.erfc(2.6 / math.sqrt(2))
    assert share_of("differs", n, digits) <= exact + 4 * math.sqrt(exact / 20_000)
    assert share_of("reproduced", n, digits) >= 1 - exact - 4 * math.sqrt(exact / 20_000)


def test_the_power_of_the_docstring():
    """With as many trials as the paper, an offset of h + 5.5 of its errors is found."""
    assert 0.88 < share_of("differs", 100, 6, offset=0.55) < 0.92


def test_the_probability_of_the_printed_sign():
    """Our margin -1 with a negligible error, and 100 runs of the paper with an error of 1 each."""
    assert claims.sign_probability(-0.1, 0.001, 1_000_000, 100) == pytest.approx(0.1587, abs=1e-3)
    assert math.isnan(claims.sign_probability(-0.1, 0.0))


def test_a_printed_nought_is_judged_by_the_step_of_its_print(tmp_path):
    """Nought of 100 runs: 0.27 is no such thing, though it rounds to 0 as an integer."""

    def verdict(measured, items):
        row = f"zero,Figure 3,share of runs,,0,,number,Sec. 1,Share; runs = 100{items},measured,"
        return ledger(tmp_path, HEADER, row).check("zero", measured, se=0.001, n=1000).verdict

    assert verdict(0.27, "") == "reproduced"
    assert verdict(0.27, "; step = 0.01") == "differs"
    assert verdict(0.0, "; step = 0.01") == "reproduced"


def test_a_printed_bound_is_relaxed_by_its_half_digit(tmp_path):
    row = "b,Fig. 4,error,,> 2,cells,bound,Sec. 1,Error less 2,measured,"
    verdict = ledger(tmp_path, HEADER, row).check("b", -0.3, se=0.01, n=100)
    assert (verdict.verdict, verdict.measured, verdict.z) == ("reproduced", "margin 0.200", "20.0")


@pytest.mark.parametrize("value", ["> 2", "few"])
def test_a_rule_may_say_by_how_much_a_bound_is_relaxed(tmp_path, value):
    row = f"b,Fig. 4,error,,{value},cells,bound,Sec. 1,Error less 2; half = 0.25,measured,"
    verdict = ledger(tmp_path, HEADER, row).check("b", -0.2, se=0.01, n=100)
    assert (verdict.verdict, verdict.measured) == ("reproduced", "margin 0.050")


@pytest.mark.parametrize(
    ("shown", "table"),
    [
        ("", "margin 0.30"),
        ("A 1.3, B 1.0", "A 1.3, B 1.0; margin 0.30"),
        ("margin 1/3", "margin 1/3"),
    ],
)
def test_what_is_shown_of_an_ordering_has_its_margin(tmp_path, shown, table):
    book = ledger(tmp_path, HEADER, "b,Fig. 4,A > B,,A > B,,ordering,Sec. 1,A less B,measured,")
    assert book.check("b", 0.3, se=0.1, n=200, shown=shown).measured == table


def test_words_stand_alone_where_chance_has_no_part(tmp_path):
    book = ledger(tmp_path, HEADER, "b,Fig. 4,A > B,,A > B,,ordering,Sec. 1,A less B,constructed,")
    assert book.check("b", 0.3, shown="A is 1.3, B is 1").measured == "A is 1.3, B is 1"


def test_a_probability_of_nearly_nought_is_not_spelled_out(tmp_path):
    row = "b,Fig. 4,A > B,,A > B,,ordering,Sec. 1,A less B; runs = 50,measured,not excluded"
    assert ledger(tmp_path, HEADER, row).check("b", -9.0, se=0.1, n=50).sign_probability == "< 1e-9"


def test_the_error_is_that_of_the_margin_that_decides(tmp_path):
    row = "b,Fig. 4,A beats B,,A > B,,ordering,Sec. 1,A less B,measured,"
    found = ledger(tmp_path, HEADER, row).check("b", [9.0, 1.0, 8.0], se=[0.3, 0.2, 0.4], n=100)
    assert (found.measured, found.se, found.z) == ("least margin 1.00", "0.2", "5.0")


def test_an_open_ordering_says_how_likely_the_paper_prints_it(tmp_path):
    row = "b,Fig. 4,A beats B,,A > B,,ordering,Sec. 1,A less B; runs = 50,measured,"
    verdict = ledger(tmp_path, HEADER, row).check("b", [-0.1, 3.0], se=[0.1, 0.1], n=200)
    assert (verdict.verdict, verdict.measured) == ("inconclusive", "least margin -0.10")
    assert verdict.z == "-1.0"
    assert verdict.sign_probability == f"{stats.norm.cdf(-1 / math.sqrt(1 + 200 / 50)):.2g}"


@pytest.mark.parametrize(("runs", "known"), [((50, 50), 50), ((50, 60), None)])
def test_an_ordering_takes_the_runs_that_all_other_rules_name(tmp_path, runs, known):
    numbers = [
        f"n{m},Fig. 4,m,,{m},m,number,Sec. 1,x; runs = {n},measured," for m, n in enumerate(runs)
    ]
    book = ledger(
        tmp_path, HEADER, *numbers, "b,Fig. 4,A > B,,A > B,,ordering,Sec. 1,A less B,measured,"
    )
    chance = f"{claims.sign_probability(-0.1, 0.1, 200, known):.2g}" if known else ""
    assert book.check("b", -0.1, se=0.1, n=200).sign_probability == chance


@pytest.mark.parametrize("paper", claims.papers())
def test_each_open_ordering_has_its_probability(paper):
    """In the committed verdicts, wherever chance has a part."""
    table, rows = claims.verdicts(paper), claims.read(paper)
    open_ = table[table["verdict"].isin(["differs", "inconclusive"]) & (table["n"] != "")]
    for row in open_[open_["se"] != ""].itertuples():
        assert bool(row.sign_probability) == (rows[row.id].kind != "number"), row.id


def test_a_page_takes_the_numbers_of_a_rule_from_the_file(tmp_path):
    row = "b,Fig. 4,close,,close,,statement,Sec. 1,Within; tolerance = 14 m,measured,"
    book = ledger(tmp_path, HEADER, row)
    assert book.number("b", "tolerance") == 14.0
    with pytest.raises(
        ValueError, match=r"no number in the rule of b, 'tolerence'; the nearest is 't"
    ):
        book.number("b", "tolerence")


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("16", "16 m"),
        ("[0, 30]", "[0, 30] m"),
        ("rises", "rises"),
        ("{0,1}", "{0,1} m"),
        ("N/A", "N/A"),
    ],
)
def test_a_unit_stands_behind_numbers_only(tmp_path, value, shown):
    row = f'a,Table 1,what,,"{value}",m,statement,Sec. 1,What is seen,measured,'
    assert ledger(tmp_path, HEADER, row).check("a", True, shown="seen").published == shown


def test_a_complete_ledger(tmp_path):
    book = ledger(tmp_path)
    assert "published 500 m/s, measured 500" in repr(book.used("a.in", 500))
    assert repr(book.check("a.num", 287.0999, se=0.0001, n=50)).endswith(
        "measured 287.09990 ± 0.0001 (n = 50): reproduced"
    )
    book.check("a.order", True, shown="all 7 cases")
    table = book.table()
    assert list(table["verdict"]) == ["used", "reproduced", "reproduced"]
    assert list(table.columns) == list(claims.Verdict._fields)
    assert list(table["evidence"]) == ["", "measured", "measured"]
    assert book.summary() == "2 reproduced, 1 used"


def test_the_table_has_the_order_of_the_file(tmp_path):
    book = ledger(tmp_path)
    book.check("a.order", 1.0, se=0.1)
    book.check("a.num", 287.1)
    book.used("a.in", 500)
    assert list(book.table()["id"]) == ["a.in", "a.num", "a.order"]


def test_a_missing_claim_is_named(tmp_path):
    book = ledger(tmp_path)
    book.used("a.in", 500)
    with pytest.raises(ValueError, match=r"no verdict on 2 of 3 claims: a\.num, a\.order"):
        book.table()


def closed(folder, measured, cause, strict=True):
    """The table of a ledger with one number."""
    book = ledger(folder, HEADER, GOOD[2] + cause, strict=strict)
    book.check("a.num", measured)
    return book.table()


def test_what_differs_needs_a_cause_and_only_that(tmp_path):
    with pytest.raises(ValueError, match=r"a\.num differs and .* gives no cause"):
        closed(tmp_path, 280.0, "")
    with pytest.raises(ValueError, match=r"a\.num is reproduced but .* gives a cause"):
        closed(tmp_path, 287.1, "a slip; section 9")
    assert list(closed(tmp_path, 280.0, "a slip; section 9")["cause"]) == ["a slip; section 9"]


def test_with_other_parameters_verdicts_may_change_but_none_may_be_missing(tmp_path):
    assert list(closed(tmp_path, 280.0, "", strict=False)["verdict"]) == ["differs"]
    assert list(closed(tmp_path, 287.1, "a slip", strict=False)["verdict"]) == ["reproduced"]
    with pytest.raises(ValueError, match="no verdict on 3 of 3"):
        ledger(tmp_path, strict=False).table()


def test_a_row_that_repeats_has_the_verdict_of_its_original(tmp_path):
    again = "b,Sec. 3,A beats B,,greater,,ordering,Sec. 3,As a.order,repeats a.order,"
    for margin, strict in ((1.0, True), (-1.0, False)):
        book = ledger(tmp_path, *GOOD, again, strict=strict)
        book.used("a.in", 500)
        book.check("a.num", 287.1)
        book.check("a.order", 1.0, se=0.1)
        assert book.check("b", margin, se=0.1).evidence == "repeats a.order"
        assert len(book.table()) == 4
    book = ledger(tmp_path, *GOOD, again.replace("measured,", "measured,a slip"))
    book.used("a.in", 500)
    book.check("a.num", 287.1)
    book.check("a.order", 1.0, se=0.1)
    book.check("b", 0.1, se=0.1)
    with pytest.raises(ValueError, match=r"b is inconclusive but repeats a\.order, which is repro"):
        book.table()


def test_an_untestable_row_has_no_rule(tmp_path):
    row = "b,Sec. 3,cheap,,cheap,,statement,Sec. 3,,,"
    book = ledger(tmp_path, HEADER, row, GOOD[2])
    assert book.untestable("b", "an opinion").verdict == "untestable"
    with pytest.raises(ValueError, match=r"a\.num is untestable, so its rule has to go"):
        book.untestable("a.num", "an opinion")
    with pytest.raises(ValueError, match="b is checked twice"):
        book.check("b", True, shown="x")


MISUSES = {
    "unknown": (
        lambda book: book.check("a.nun", 1.0),
        r"no claim 'a\.nun'; the nearest is 'a\.num'",
    ),
    "input checked": (
        lambda book: book.check("a.in", 500.0),
        r"a\.in has no rule .* enter it with used",
    ),
    "number used": (
        lambda book: book.used("a.num", 287.1),
        r"a\.num is of kind number; only inputs are used",
    ),
    "truth of a number": (
        lambda book: book.check("a.num", True, shown="x"),
        r"a\.num is a number",
    ),
    "numpy truth of a number": (
        lambda book: book.check("a.num", np.True_, shown="x"),
        r"a\.num is a number",
    ),
    "truth without evidence": (
        lambda book: book.check("a.order", True),
        r"a\.order: a truth value needs shown=",
    ),
    "no reason": (
        lambda book: book.untestable("a.num", ""),
        r"a\.num: untestable needs its reason",
    ),
    "wrong input": (
        lambda book: book.used("a.in", 501),
        r"a\.in: the code runs with 501 .*the paper prints '500' m/s",
    ),
    "wrong dimension": (
        lambda book: book.used("a.in", 500, "km"),
        r"km and m/s are different dimensions",
    ),
    "unknown unit": (lambda book: book.used("a.in", 500, "knots"), r"unit 'knots' is unknown"),
}


@pytest.mark.parametrize(("misuse", "message"), MISUSES.values(), ids=MISUSES)
def test_misuse_is_refused(tmp_path, misuse, message):
    with pytest.raises(ValueError, match=message) as caught:
        misuse(ledger(tmp_path))
    assert "\n" not in str(caught.value)


def test_no_claim_is_judged_twice(tmp_path):
    book = ledger(tmp_path)
    book.check("a.num", 287.1)
    for again in (lambda: book.check("a.num", 287.1), lambda: book.untestable("a.num", "because")):
        with pytest.raises(ValueError, match=r"a\.num is checked twice"):
            again()


INPUTS = [  # printed value, printed unit, our value, our unit, same
    ("1", "GHz", 1e9, "Hz", True),
    ("2", "deg", math.radians(2), "rad", True),
    ("2", "deg", 2, "rad", False),
    ("10", "%", 0.1, "", True),
    ("100", "km", 100_000.0, "m", True),
    ("100", "km", 100, "km", True),
    ("10^-6", "", 1e-6, None, True),
    ("1 000", "m", 1000, None, True),
    ("1", "MHz", 1.0001e6, "Hz", False),
    ("origin", "", "origin", None, True),
    ("(0, 3)", "", (0, 3), None, False),  # a tuple is compared as a list
    ("[0, 3]", "", (0, 3), None, True),
]


@pytest.mark.parametrize(("printed", "printed_unit", "value", "unit", "same"), INPUTS)
def test_inputs_are_compared_in_their_units(tmp_path, printed, printed_unit, value, unit, same):
    row = f'p,Sec. 1,parameter,,"{printed}",{printed_unit},input,Sec. 1,,,'
    assert ledger(tmp_path, HEADER, row, strict=False).used("p", value, unit).verdict == (
        "used" if same else "differs"
    )


@dataclasses.dataclass(frozen=True)
class Scenario:
    speed: float = given(0.5, "v", "km", "a.in")
    order: int = given(3, "N")


def test_a_scenario_enters_its_inputs(tmp_path):
    book = ledger(tmp_path, HEADER, "a.in,Sec. 1,reach,,500,m,input,Sec. 1,,,")
    table = book.inputs(Scenario())
    assert book.verdicts["a.in"].verdict == "used"
    assert table.to_numpy().tolist() == [
        ["$v$", "speed", "0.5", "km", "Sec. 1"],
        ["$N$", "order", "3", "", "open"],
    ]


def test_a_changed_scenario_is_an_error_in_a_default_run(tmp_path):
    row = "a.in,Sec. 1,reach,,500,m,input,Sec. 1,,,"
    with pytest.raises(ValueError, match=r"a\.in: the code runs with 0\.6"):
        ledger(tmp_path, HEADER, row).inputs(Scenario(speed=0.6))
    book = ledger(tmp_path, HEADER, row, strict=False)
    book.inputs(Scenario(speed=0.6))
    assert book.verdicts["a.in"].verdict == "differs"


VERDICTS = f"""{",".join(claims.Verdict._fields)}
mean,Table 1,mean of the draws,0.0,0.01,0.05,400,0.0,,reproduced,,measured,
order,text,shifted draws are larger,larger,margin 1.00,0.05,400,20.0,,reproduced,,measured,
price,text,price,cheap,,,,,,untestable,,,An opinion.
"""


def enter(repository, text):
    """Put a verdicts.csv into figures/."""
    folder = repository / "figures" / "tiny"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "verdicts.csv").write_text(text)


def test_the_scorecard_counts(repository):
    enter(repository, VERDICTS)
    card = claims.scorecard()
    assert list(card["paper"]) == ["tiny", "all"]
    columns = ["claims", *(f"measured: {v}" for v in claims.JUDGED)]
    columns += ["calibrated", "constructed", "repeats", "untestable", "used"]
    assert card[columns].to_numpy().tolist() == [[3, 2, 0, 0, 0, 0, 0, 0, 1, 0]] * 2
    assert list(card["differs by chance, about"]) == ["0.02", "0.02"]
    rows = claims.ledger()[["paper", "id", "verdict"]].to_numpy().tolist()
    assert rows == [
        ["tiny", "mean", "reproduced"],
        ["tiny", "order", "reproduced"],
        ["tiny", "price", "untestable"],
    ]


@pytest.mark.parametrize(("old", "new"), [("cheap", "dear"), ("0.0,,number", "0.1,,number")])
def test_a_published_value_that_changed_after_the_verdict_is_found(repository, old, new):
    """As a spreadsheet does to inputs that no run has compared since."""
    enter(repository, VERDICTS)
    file = paths.claims() / "tiny.csv"
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(ValueError, match=r"tiny\.csv, row \d, column value: ") as caught:
        claims.scorecard()
    assert "\n" not in str(caught.value)


def test_the_scorecard_refuses_verdicts_that_are_not_the_claims(repository):
    with pytest.raises(FileNotFoundError, match="tbdcore run tiny"):
        claims.scorecard()
    enter(repository, VERDICTS.replace("order,text", "odder,text"))
    with pytest.raises(ValueError, match=r"do not match in odder, order; run tbdcore run tiny"):
        claims.scorecard()


@pytest.mark.parametrize("paper", claims.papers())
def test_the_committed_claims_can_be_read(paper):
    rows = claims.read(paper)
    assert len(rows) > 0
    assert all(row.where for row in rows.values()), "every claim says where it stands in the paper"


# Readings ------------------------------------------------------------------------------------

READINGS = ",".join(claims.Reading._fields)
WEIGHTS = "toy,weights,p. 3: the weight of a sample,own cell;gated;single,own cell,a.num,"


def with_readings(folder, *lines, claims=GOOD):
    """The folder of a claims file `toy`, beside which is a file of readings."""
    (folder / "claims").mkdir(exist_ok=True)
    (folder / "readings.csv").write_text("\n".join([READINGS, *lines, ""]))
    return written(folder / "claims", *claims)


def flown(default, *values, error=0.001, names=("gated", "single")):
    """The options of a reading under which the range that is printed as 287.10 has these values."""
    return {
        name: claims.Option(value, value - default, error, se=0.001, n=400)
        for name, value in zip(names, values, strict=True)
    }


def judged(folder, default, readings, line=WEIGHTS, claims=GOOD):
    book = Ledger("toy", True, with_readings(folder, *line.splitlines(), claims=claims))
    return book.check("a.num", default, se=0.001, n=400, readings=readings)


@pytest.mark.parametrize(
    ("values", "verdict", "told"),
    [
        ((287.1, 287.1, 287.3), "depends", "2 of 3: {}reproduced, {}reproduced, {}differs"),
        ((287.3, 287.3, 287.1), "depends", "1 of 3: {}differs, {}differs, {}reproduced"),
        ((287.1, 287.1, 287.1), "reproduced", "3 of 3: {}reproduced, {}reproduced, {}reproduced"),
        ((287.3, 287.4, 287.5), "differs", "0 of 3: {}differs, {}differs, {}differs"),
    ],
)
def test_a_verdict_that_hangs_on_a_reading_depends(tmp_path, values, verdict, told):
    found = judged(tmp_path, values[0], {"weights": flown(*values)})
    assert (found.verdict, found.evidence) == (verdict, "measured")
    assert found.readings == told.format("own cell ", "gated ", "single ")
    assert found.measured == f"{values[0]:.4f}", "of the default"


@pytest.mark.parametrize(("errors", "verdict"), [(2.80, "reproduced"), (2.86, "depends")])
def test_a_difference_that_chance_explains_makes_no_verdict_depend(tmp_path, errors, verdict):
    """Bonferroni's quantile of two differences is 2.83."""
    options = flown(287.1, 287.1, 287.3, error=0.2 / errors)
    assert judged(tmp_path, 287.1, {"weights": options}).verdict == verdict


@pytest.mark.parametrize(("errors", "verdict"), [(2.80, "reproduced"), (2.86, "depends")])
def test_each_margin_has_its_difference(tmp_path, errors, verdict):
    folder = with_readings(tmp_path, WEIGHTS.replace("gated;", "").replace("a.num", "a.order"))
    option = claims.Option([-3.0, 5.0], [-errors, 0.0], [1.0, 1.0], se=[0.5, 1.0], n=400)
    check = Ledger("toy", True, folder).check
    found = check("a.order", [5.0, 5.0], se=1.0, n=400, readings={"weights": {"single": option}})
    assert found.verdict == verdict


def test_without_chance_every_difference_counts(tmp_path):
    folder = with_readings(tmp_path, WEIGHTS.replace("gated;", "").replace("a.num", "a.order"))
    readings = {"weights": {"single": claims.Option(False, 1.0)}}
    found = Ledger("toy", True, folder).check("a.order", True, shown="7 of 7", readings=readings)
    assert (found.verdict, found.measured) == ("depends", "7 of 7")


def test_an_open_default_depends_when_two_others_contradict_one_another(tmp_path):
    options = flown(287.2, 287.1, 287.3)
    book = Ledger("toy", True, with_readings(tmp_path, WEIGHTS))
    found = book.check("a.num", 287.2, se=0.1, n=400, readings={"weights": options})
    assert found.readings.startswith("1 of 3: own cell inconclusive")
    assert found.verdict == "depends"


@pytest.mark.parametrize(
    ("evidence", "verdict"), [("calibrated", "reproduced"), ("constructed", "reproduced")]
)
def test_a_row_that_no_experiment_decides_keeps_its_verdict(tmp_path, evidence, verdict):
    lines = [line.replace("measured", evidence) for line in GOOD]
    found = judged(tmp_path, 287.1, {"weights": flown(287.1, 287.1, 287.3)}, claims=lines)
    assert (found.verdict, found.readings[:6]) == (verdict, "2 of 3")
    assert judged(tmp_path, 287.1, None, claims=lines).readings == ""


def test_two_readings_are_flown_one_at_a_time(tmp_path):
    lines = f"{WEIGHTS}\ntoy,births,a gap,all;new;none,all,a.*,none: 40 misses where 2 are printed"
    readings = {"weights": flown(287.1, 287.1, 287.1), "births": flown(287.1, 287.3, names=["new"])}
    found = judged(tmp_path, 287.1, readings, lines)
    said = "weights gated reproduced, weights single reproduced, births new differs"
    assert (found.verdict, found.readings) == ("depends", f"3 of 4: default reproduced, {said}")


def test_a_row_that_depends_has_no_cause_and_its_repeats_depend_too(tmp_path):
    again = "b,Sec. 3,range,,287.10,km,number,Sec. 3,As a.num,repeats a.num,"
    lines = [HEADER, GOOD[2], again]
    folder = with_readings(tmp_path, WEIGHTS.replace("a.num", "a.num; b"), claims=lines)
    readings = {"weights": flown(287.1, 287.1, 287.3)}
    book = Ledger("toy", True, folder)
    for id in ("a.num", "b"):
        book.check(id, 287.1, se=0.001, n=400, readings=readings)
    table = book.table()
    assert list(table["verdict"]) == ["depends"] * 2
    count = claims.counts(table)
    assert (count["measured: depends"], count["measured: reproduced"], count["repeats"]) == (
        1,
        0,
        1,
    )
    assert book.summary() == "2 depends"
    book.claims["a.num"] = book.claims["a.num"]._replace(cause="a slip; section 9")
    with pytest.raises(ValueError, match=r"a\.num is depends but the file gives a cause"):
        book.table()


def test_what_repeats_a_calibrated_row_keeps_its_verdict_as_well(tmp_path):
    again = "b,Sec. 3,range,,287.10,km,number,Sec. 3,As a.num,repeats a.num,"
    lines = [HEADER, GOOD[2].replace("measured", "calibrated"), again]
    book = Ledger("toy", True, with_readings(tmp_path, WEIGHTS.replace("a.num", "*"), claims=lines))
    options = {"weights": flown(287.1, 287.1, 287.3)}
    found = book.check("b", 287.1, se=0.001, n=400, readings=options)
    assert (found.verdict, found.readings[:6]) == ("reproduced", "2 of 3")


FLOWN = """chapter,name,words,options,default,rows,refuted
dp_tbd,eq. (10),|m - r| or |m|,m;m-r,m,f2.gain.sw_conv.w02,
mda_tbd,eq. (12),what counts,own-cell;available;strict;per-sample;least-squares,own-cell,t2.*,\
strict: z = 4.2 with the bias of the same row; per-sample: z = 8.0 with it
"""
OSPA = {  # of 03 under the readings of equation (12); 103.2 m is printed
    "available": claims.Option(99.5, 4.6, 2.0, se=2.1, n=100),
    "least-squares": claims.Option(83.8, -11.1, 3.0, se=2.5, n=100),
}


@pytest.mark.parametrize(("evidence", "verdict"), [("calibrated", 0), ("measured", "depends")])
def test_the_readings_of_03(tmp_path, evidence, verdict):
    """Own-cell is within chance of the print; least-squares is not, and far from own-cell."""
    folder = shutil.copytree(paths.claims(), tmp_path / "claims")
    (tmp_path / "readings.csv").write_text(FLOWN)
    book = Ledger("mda_tbd", True, folder)
    assert set(book.readings) == {"eq. (12)"}
    book.claims["t2.4.ospa"] = book.claims["t2.4.ospa"]._replace(evidence=evidence)
    found = book.check("t2.4.ospa", 94.9, se=2.9, n=100, readings={"eq. (12)": OSPA})
    assert found.verdict == (verdict or "reproduced")
    assert (
        found.readings == "2 of 3: own-cell reproduced, available reproduced, least-squares differs"
    )


def test_the_readings_of_01(tmp_path):
    """With the literal equation (10) the gain is as far from the printed 3 dB."""
    folder = shutil.copytree(paths.claims(), tmp_path / "claims")
    (tmp_path / "readings.csv").write_text(FLOWN)
    readings = {"eq. (10)": {"m-r": claims.Option(1.71, -0.02, 0.01, se=0.03, n=4000)}}
    check = Ledger("dp_tbd", True, folder).check
    found = check("f2.gain.sw_conv.w02", 1.734, se=0.032, n=4000, readings=readings)
    assert (found.verdict, found.readings) == ("differs", "0 of 2: m differs, m-r differs")


BAD_OPTIONS = {
    "none": (None, "readings.csv has the other options weights: gated, single; given are none"),
    "one is missing": (
        {"weights": flown(287.1, 287.1, names=["gated"])},
        "given are weights: gated$",
    ),
    "unknown option": (
        {"weights": flown(287.1, 287.1, 287.1, names=["gated", "singel"])},
        "given are weights: gated, singel",
    ),
    "unknown reading": (
        {"weight": flown(287.1, 287.1, 287.1)},
        "has the other options weights: gated, single; given are weight: gated, single",
    ),
}


@pytest.mark.parametrize(("readings", "message"), BAD_OPTIONS.values(), ids=BAD_OPTIONS)
def test_a_row_is_judged_under_exactly_the_options_of_its_readings(tmp_path, readings, message):
    with pytest.raises(ValueError, match=message) as caught:
        judged(tmp_path, 287.1, readings)
    assert "\n" not in str(caught.value)


def test_a_reading_whose_other_options_are_refuted_asks_for_none(tmp_path):
    refuted = f"{WEIGHTS}gated: z = 9; single: z = 8"
    assert judged(tmp_path, 287.1, None, refuted).readings == ""
    with pytest.raises(ValueError, match="has the other options none; given are weights: gated"):
        judged(tmp_path, 287.1, {"weights": flown(287.1, 287.1, names=["gated"])}, refuted)


def test_a_reading_touches_its_rows_only(tmp_path):
    book = Ledger("toy", True, with_readings(tmp_path, WEIGHTS))
    with pytest.raises(
        ValueError, match="readings.csv has the other options none; given are weights"
    ):
        book.check("a.order", 1.0, se=0.1, readings={"weights": flown(1.0, 1.0, 1.0)})
    assert book.check("a.order", 1.0, se=0.1).readings == ""


BAD_READINGS = [  # lines, and the row or the column that is named
    ("a,b", "words"),
    (WEIGHTS.replace("toy", "tyo"), "chapter"),
    (f"{WEIGHTS}\n{WEIGHTS}", "row 3"),
    (WEIGHTS.replace("p. 3: the weight of a sample", ""), "words"),
    (WEIGHTS.replace(";gated;single", ""), "options"),
    (WEIGHTS.replace("gated", "single"), "options"),
    (WEIGHTS.replace(",own cell,a", ",cell,a"), "default"),
    (WEIGHTS.replace("a.num", "a.nun"), "rows"),
    (WEIGHTS.replace("a.num", ""), "rows"),
    (f"{WEIGHTS}gated", "refuted"),
    (f"{WEIGHTS}own cell: z = 9", "refuted"),
    (f"{WEIGHTS}gate: z = 9", "refuted"),
]


@pytest.mark.parametrize(("lines", "named"), BAD_READINGS)
def test_a_bad_reading_is_named_by_file_row_and_column(tmp_path, lines, named):
    folder = with_readings(tmp_path, *lines.splitlines())
    with pytest.raises(ValueError, match=r"^readings\.csv, row ") as caught:
        Ledger("toy", True, folder)
    assert "\n" not in str(caught.value)
    assert (named if " " in named else f"column {named}") in str(caught.value)


def test_the_claim_that_is_nearest_to_the_first_lost_one_is_named(tmp_path):
    folder = with_readings(tmp_path, WEIGHTS.replace("a.num", "a.nun; order of a.order"))
    with pytest.raises(ValueError, match=r"no claim is .*; the nearest is 'a\.num'"):
        Ledger("toy", True, folder)


@pytest.mark.parametrize("paper", claims.papers())
def test_the_committed_readings_can_be_read(paper):
    assert {reading.chapter for reading in claims.readings(paper).values()} <= {paper}
