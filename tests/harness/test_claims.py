"""Claims: files that a spreadsheet has touched, the edges of every verdict, and a ledger that is
complete or fails.
"""

import dataclasses
import math
import re

import numpy as np
import pytest

from tbdcore.repro import claims, paths
from tbdcore.repro.claims import Ledger, given

HEADER = ",".join(claims.COLUMNS)
GOOD = [
    HEADER,
    "a.in,Sec. 1,speed,,500,m/s,input,Sec. 1,",
    "a.num,Fig. 1,range,,287.10,km,number,Sec. 2,",
]
GOOD += ["a.order,Fig. 1,A beats B,,greater,,ordering,Sec. 2,"]
ROW = "b,Fig. 2,range,,1.5,km,number,Sec. 2,"


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


BAD_LINES = {
    "duplicate id": (GOOD[1], ("row 5, column id", "'a.in'", "twice")),
    "no number": (ROW.replace("1.5", "about 1.5"), ("row 5, column value", "'about 1.5'")),
    "decimal comma": (ROW.replace("1.5", '"1,5"'), ("row 5, column value", "'1,5'")),
    "unknown unit": (ROW.replace("km", "furlong"), ("row 5, column unit", "'furlong'", "km")),
    "unknown kind": (
        ROW.replace("number", "figure"),
        ("row 5, column kind", "'figure'", "ordering"),
    ),
    "short row": (
        "b,Fig. 2,range,,1.5,km,number",
        ("row 5, column where", "7 fields instead of 9"),
    ),
    "long row": (ROW + ",more", ("row 5, column cause", "10 fields instead of 9")),
    "semicolons in one row": (ROW.replace(",", ";"), ("row 5", "1 fields instead of 9")),
    "empty id": (ROW.replace("b,Fig", ",Fig"), ("row 5, column id", "empty")),
    "empty value": (ROW.replace("1.5", ""), ("row 5, column value", "empty")),
}


@pytest.mark.parametrize(("line", "words"), BAD_LINES.values(), ids=BAD_LINES)
def test_a_bad_row_is_named_by_file_row_and_column(tmp_path, line, words):
    refused(written(tmp_path, *GOOD, line), *words)


def test_a_missing_column(tmp_path):
    lines = [",".join(part for i, part in enumerate(line.split(",")) if i != 5) for line in GOOD]
    refused(written(tmp_path, *lines), "row 1, column unit: missing")


def test_columns_in_another_order(tmp_path):
    refused(written(tmp_path, HEADER.replace("id,item", "item,id"), *GOOD[1:]), "row 1", "item,id")


def test_semicolons(tmp_path):
    refused(
        written(tmp_path, *(line.replace(",", ";") for line in GOOD)), "row 1, column id: missing"
    )


def test_crlf(tmp_path):
    refused(written(tmp_path, *GOOD, end="\r\n"), "row 1", "CR")


def test_byte_order_mark(tmp_path):
    refused(written(tmp_path, "\ufeff" + GOOD[0], *GOOD[1:]), "row 1, column id", "byte-order mark")


def test_latin_1(tmp_path):
    (tmp_path / "toy.csv").write_bytes(
        "\n".join([*GOOD, ROW.replace("range", "portée")]).encode("latin-1")
    )
    refused(tmp_path, "row 5", "not UTF-8", "0xe9")


def test_an_empty_file(tmp_path):
    (tmp_path / "toy.csv").write_bytes(b"")
    refused(tmp_path, "row 1, column id: missing")


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


# A number printed as 10.0, half a digit 0.05: the band's edges stand at 9.95 and 10.05.
EDGES = [  # measured, se, n, paper_n, verdict
    (10.05, 0.0, None, None, "reproduced"),  # on the edge, which belongs to the band
    (10.0501, 0.0, None, None, "differs"),
    (9.95, 0.0, None, None, "reproduced"),
    (10.0 + 0.05 - 2.577 * 0.01, 0.01, 100, None, "reproduced"),  # 99 % interval just inside
    (10.0 + 0.05 - 2.575 * 0.01, 0.01, 100, None, "inconclusive"),  # just across
    (10.0 + 0.05 + 2.575 * 0.01, 0.01, 100, None, "inconclusive"),  # just not outside
    (10.0 + 0.05 + 2.577 * 0.01, 0.01, 100, None, "differs"),
    (
        10.0 + 0.05 - 0.001,
        0.0038,
        100,
        None,
        "reproduced",
    ),  # 2.576 se = 0.0098 < a fifth of the band: the estimate decides
    (10.0 + 0.05 + 0.001, 0.0038, 100, None, "differs"),
    (10.0 + 0.05 + 0.001, 0.0040, 100, None, "inconclusive"),  # 2.576 se = 0.0103 > a fifth
    (
        10.0 + 0.05 + 2.6 * 0.1 - 0.03,
        0.01,
        10_000,
        100,
        "reproduced",
    ),  # the paper's own error is 0.1
    (10.0 + 0.05 + 2.6 * 0.1 + 0.03, 0.01, 10_000, 100, "differs"),
    (10.0, 1.0, 100, None, "inconclusive"),
    (math.nan, 0.0, None, None, "inconclusive"),
    (math.inf, 0.0, None, None, "differs"),
]


@pytest.mark.parametrize(("measured", "se", "n", "paper_n", "verdict"), EDGES)
def test_the_edges_of_a_number(measured, se, n, paper_n, verdict):
    assert claims.judge(10.0, 0.05, measured, se, n, paper_n)[0] == verdict
    assert (
        claims.judge(10.0, 0.05, 20.0 - measured, se, n, paper_n)[0] == verdict
    )  # both edges alike


@pytest.mark.parametrize(
    ("margin", "se", "verdict"),
    [
        (1.0, 0.0, "reproduced"),
        (0.0, 0.0, "differs"),
        (-1.0, 0.0, "differs"),
        (2.577, 1.0, "reproduced"),
        (2.575, 1.0, "inconclusive"),
        (-2.575, 1.0, "inconclusive"),
        (-2.577, 1.0, "differs"),
        (math.nan, 1.0, "inconclusive"),
    ],
)
def test_the_edges_of_a_margin(margin, se, verdict):
    assert claims.judge_margin(margin, se)[0] == verdict


@pytest.mark.parametrize("measured", [10.0, 10.03, 10.049, 10.07, 10.2])
def test_as_many_trials_as_it_asks_for_settle_it(measured):
    n, se = 100, 0.08
    verdict, needed = claims.judge(10.0, 0.05, measured, se, n)
    assert verdict == "inconclusive"
    assert (
        claims.judge(10.0, 0.05, measured, se * math.sqrt(n / needed), needed)[0] != "inconclusive"
    )
    verdict, needed = claims.judge_margin(0.1, se, n)
    assert claims.judge_margin(0.1, se * math.sqrt(n / (needed + 1)), needed + 1)[0] == "reproduced"


def share_that_differs(n, digits, paper_n=100, replicas=20_000):
    """Share of true numbers, printed to some digits, that are called `differs`: both Monte Carlo
    errors at work.
    """
    rng, se = np.random.default_rng(1), 1 / math.sqrt(n)
    printed = np.round(rng.normal(0.0, 1 / math.sqrt(paper_n), replicas), digits)
    ours = rng.normal(0.0, se, replicas)
    verdicts = [
        claims.judge(p, 0.5 * 10.0**-digits, o, se, n, paper_n)[0]
        for p, o in zip(printed, ours, strict=True)
    ]
    return verdicts.count("differs") / replicas


@pytest.mark.parametrize("n", [200, 1000, 2000])
def test_a_true_number_rarely_differs(n):
    """In at most 1 %, as long as our whole interval has to lie outside of the band."""
    assert share_that_differs(n, 2) <= 0.01


def test_where_the_point_estimate_decides_a_true_number_differs_in_about_one_of_a_hundred():
    """From 2500 trials on; a finely printed number is off by both errors, and the band is 2.6 of
    the paper's alone.
    """
    exact = math.erfc(claims.Z_PAPER / math.sqrt(2 * (1 + 100 / 2600)))
    assert 0.010 < exact < 0.011
    assert abs(share_that_differs(2600, 6) - exact) < 4 * math.sqrt(exact / 20_000)


def test_a_printed_nought_is_judged_by_the_step_of_its_print(tmp_path):
    """Nought of 100 runs: 0.27 is no such thing, though it rounds to 0 as an integer."""
    many = {"se": 0.001, "n": 1000, "paper_n": 100}

    def verdict(measured, **options):
        book = ledger(tmp_path, HEADER, "zero,Figure 3,share of runs,,0,,number,Sec. 1,")
        return book.check("zero", measured, **many, **options).verdict

    assert verdict(0.27) == "reproduced"
    assert verdict(0.27, step=0.01) == "differs"
    assert verdict(0.0, step=0.01) == "reproduced"


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
    book = ledger(tmp_path, HEADER, f'a,Table 1,what,,"{value}",m,statement,Sec. 1,')
    assert book.check("a", True, evidence="seen").published == shown


def test_what_is_open_says_how_many_trials_it_needs(tmp_path):
    book = ledger(tmp_path, HEADER, "a,Table 1,what,,10.0,m,number,Sec. 1,")
    verdict = book.check("a", 10.05, se=0.08, n=100)
    assert verdict.verdict == "inconclusive"
    assert verdict.cause.endswith(" trials would settle it")
    assert repr(verdict).endswith(f"inconclusive; {verdict.cause}")


def test_a_complete_ledger(tmp_path):
    book = ledger(tmp_path)
    assert "published 500 m/s, measured 500" in repr(book.used("a.in", 500))
    assert repr(book.check("a.num", 287.0999, se=0.0001, n=50)).endswith(
        "measured 287.09990 ± 0.0001 (n = 50): reproduced"
    )
    book.check("a.order", True, evidence="all 7 cases")
    table = book.table()
    assert list(table["verdict"]) == ["used", "reproduced", "reproduced"]
    assert list(table.columns) == [
        "id",
        "item",
        "quantity",
        "published",
        "measured",
        "se",
        "n",
        "verdict",
        "cause",
    ]
    assert book.summary() == "2 reproduced, 1 used"


def test_the_table_has_the_order_of_the_file(tmp_path):
    book = ledger(tmp_path)
    book.check("a.order", 1.0, se=0.1)
    book.untestable("a.num", "no such radar")
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


MISUSES = {
    "unknown": (
        lambda book: book.check("a.nun", 1.0),
        r"no claim 'a\.nun'; the nearest is 'a\.num'",
    ),
    "input checked": (lambda book: book.check("a.in", 500.0), r"a\.in is an input"),
    "number used": (
        lambda book: book.used("a.num", 287.1),
        r"a\.num is of kind number; only inputs are used",
    ),
    "truth of a number": (
        lambda book: book.check("a.num", True, evidence="x"),
        r"a\.num is a number",
    ),
    "numpy truth of a number": (
        lambda book: book.check("a.num", np.True_, evidence="x"),
        r"a\.num is a number",
    ),
    "truth without evidence": (
        lambda book: book.check("a.order", True),
        r"a\.order: a truth value needs its evidence",
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
    row = f'p,Sec. 1,parameter,,"{printed}",{printed_unit},input,Sec. 1,'
    assert ledger(tmp_path, HEADER, row, strict=False).used("p", value, unit).verdict == (
        "used" if same else "differs"
    )


@dataclasses.dataclass(frozen=True)
class Scenario:
    speed: float = given(0.5, "v", "km", "a.in")
    order: int = given(3, "N")


def test_a_scenario_enters_its_inputs(tmp_path):
    book = ledger(tmp_path, HEADER, "a.in,Sec. 1,reach,,500,m,input,Sec. 1,")
    table = book.inputs(Scenario())
    assert book.verdicts["a.in"].verdict == "used"
    assert table.to_numpy().tolist() == [
        ["$v$", "speed", "0.5", "km", "Sec. 1"],
        ["$N$", "order", "3", "", "open"],
    ]


def test_a_changed_scenario_is_an_error_in_a_default_run(tmp_path):
    row = "a.in,Sec. 1,reach,,500,m,input,Sec. 1,"
    with pytest.raises(ValueError, match=r"a\.in: the code runs with 0\.6"):
        ledger(tmp_path, HEADER, row).inputs(Scenario(speed=0.6))
    book = ledger(tmp_path, HEADER, row, strict=False)
    book.inputs(Scenario(speed=0.6))
    assert book.verdicts["a.in"].verdict == "differs"


VERDICTS = """id,item,quantity,published,measured,se,n,verdict,cause
mean,Table 1,mean of the draws,0.0,0.01,0.05,400,reproduced,
order,text,shifted draws are larger,larger,margin 1.00,0.05,400,reproduced,
price,text,price,cheap,,,,untestable,An opinion.
"""


def enter(repository, text):
    """Put a verdicts.csv into figures/."""
    folder = repository / "figures" / "tiny"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "verdicts.csv").write_text(text)


def test_the_scorecard_counts(repository):
    enter(repository, VERDICTS)
    card = claims.scorecard().to_numpy().tolist()
    assert card == [["tiny", 3, 2, 0, 0, 1, 0, "0.02"], ["all", 3, 2, 0, 0, 1, 0, "0.02"]]
    rows = claims.ledger()[["paper", "id", "verdict"]].to_numpy().tolist()
    assert rows == [
        ["tiny", "mean", "reproduced"],
        ["tiny", "order", "reproduced"],
        ["tiny", "price", "untestable"],
    ]


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


# A longer run -------------------------------------------------------------------------------------
# ---------------------

TOY = [
    HEADER,
    "t.num,Table 1,mean,,10.0,m,number,Sec. 3,",
    "t.more,Table 1,A exceeds B,,A > B,,ordering,Sec. 3,",
]


def settled(folder, monkeypatch, lines, strict=True):
    """A ledger with 100 trials behind it, undecided twice, after it has met a longer run with these
    lines.
    """
    monkeypatch.setitem(paths.PLACES, "CLAIMS", str(written(folder, *TOY)))
    monkeypatch.setitem(paths.PLACES, "LONGER", str(folder / "longer"))
    (folder / "longer" / "toy").mkdir(parents=True)
    rows = [",".join(claims.Verdict._fields[:9]), *lines, ""]
    (folder / "longer" / "toy" / "verdicts.csv").write_text("\n".join(rows), encoding="utf-8")
    book = Ledger("toy", strict)
    assert (
        book.check("t.num", 10.9, se=0.4, n=100).verdict
        == book.check("t.more", 0.5, se=0.4, n=100).verdict
        == "inconclusive"
    )
    return book, book.settle()


LONGER = [
    "t.num,Table 1,mean,10.0 m,10.01,0.011,1000,reproduced,",
    "t.more,Table 1,A exceeds B,A > B,margin 0.10,0.13,1000,{}",
]
OPEN, DECIDED = (
    LONGER[1].format("inconclusive,1122 trials would settle it"),
    LONGER[1].format("differs,"),
)


def test_a_longer_run_decides_what_is_open_here(tmp_path, monkeypatch):
    book, changed = settled(tmp_path, monkeypatch, [LONGER[0], OPEN])
    assert changed.to_numpy().tolist() == [
        ["t.num", "10.90 ± 0.4", "10.01 ± 0.011", "inconclusive", "reproduced"]
    ]
    assert [(v.verdict, v.n, v.measured) for v in book.verdicts.values()] == [
        ("reproduced", "1000", "10.01"),
        ("inconclusive", "1000", "margin 0.10"),
    ]
    assert book.verdicts["t.more"].note == "; 1122 trials would settle it"
    assert book.table()["cause"].tolist() == ["", "1122 trials would settle it"]


def test_what_differs_in_a_longer_run_needs_its_cause_too(tmp_path, monkeypatch):
    book, _ = settled(tmp_path, monkeypatch, [LONGER[0], DECIDED])
    with pytest.raises(ValueError, match="t.more differs and the file gives no cause"):
        book.table()


@pytest.mark.parametrize("strict", [True, False])
def test_fewer_trials_or_other_parameters_take_nothing_over(tmp_path, monkeypatch, strict):
    lines = [line.replace(",1000,", ",100,") if strict else line for line in (LONGER[0], DECIDED)]
    book, changed = settled(tmp_path, monkeypatch, lines, strict)
    assert changed.empty
    assert {v.n for v in book.verdicts.values()} == {"100"}


def test_a_longer_run_of_another_kind_is_refused(tmp_path, monkeypatch):
    """10.9 with an error of 0.4 in the first tenth, and 12.6 with 0.05 in the whole: 4.3 errors
    apart.
    """
    far = "t.num,Table 1,mean,10.0 m,12.60,0.05,1000,differs,"
    with pytest.raises(
        ValueError, match=r"t.num is 10.90 here and 12.60 in data/longer; make the longer run again"
    ):
        settled(tmp_path, monkeypatch, [far, OPEN])


@pytest.mark.parametrize("odd", ["10.8,0.5", "near,"])
def test_a_longer_run_that_cannot_be_one_is_refused(tmp_path, monkeypatch, odd):
    """More of the same trials and yet a larger error, or no number."""
    line = f"t.num,Table 1,mean,10.0 m,{odd},1000,reproduced,"
    with pytest.raises(
        ValueError, match=r"t.num is 10.90 here and .* in data/longer; make the longer run again"
    ):
        settled(tmp_path, monkeypatch, [line, OPEN])


def test_margins_of_a_longer_run_are_compared_too(tmp_path, monkeypatch):
    """0.5 with an error of 0.4 in the first tenth, and -1.2 with 0.13 in the whole: 4.5 errors
    apart.
    """
    far = OPEN.replace("margin 0.10", "margin -1.20")
    with pytest.raises(
        ValueError, match=r"t.more is margin 0.50 here and margin -1.20 in data/longer"
    ):
        settled(tmp_path, monkeypatch, [LONGER[0], far])


@pytest.mark.parametrize(
    "paper", sorted(path.parent.name for path in paths.LONGER.glob("*/verdicts.csv"))
)
def test_verdicts_of_a_committed_longer_run_follow_from_its_numbers(paper):
    """The file is read and not computed, so what it says is judged again from its own values,
    errors and counts.
    """
    known, judged = claims.read(paper), 0
    for row in claims.verdicts(paper, paths.LONGER).itertuples():
        if not row.se or not re.fullmatch(r"(margin )?-?[\d.]+", row.measured):
            continue
        value, se, n = float(row.measured.removeprefix("margin ")), float(row.se), int(row.n)
        if known[row.id].kind == "number":
            verdict, needed = claims.judge(*claims.parse(known[row.id].value), value, se, n, 100)
        else:
            verdict, needed = claims.judge_margin(value, se, n)
        assert verdict == row.verdict, row.id
        assert verdict != "inconclusive" or needed is None or needed > n, (
            row.id
        )  # at a margin of 0 nobody can tell
        judged += 1
    assert judged > 50
