"""False claims, planted beside the committed measurements: the ledger must call each of them wrong.

A number is shifted by five combined standard errors beyond its half digit, an order is turned
round, and a bound is half of what was measured (a lower bound twice of it).  Each is judged under
the default readings alone.
"""

import math
import re

import pytest

from tbdcore.repro import claims


@pytest.fixture(scope="module")
def ledgers():
    books = {paper: claims.Ledger(paper, strict=False) for paper in claims.papers()}
    for ledger in books.values():
        ledger.readings, ledger.flown = {}, {}
    return books


def rows(*kinds, verdicts=claims.VERDICTS):
    """Paper, claim and committed verdict of the rows of some kinds that chance enters."""
    for paper in claims.papers():
        known, table = claims.read(paper), claims.verdicts(paper)
        for row in table[(table["se"] != "") & (table["n"] != "")].itertuples():
            fits = known[row.id].kind in kinds and row.verdict in verdicts
            if fits and row.verdict != "depends" and int(row.n) >= 60:
                yield paper, known[row.id], row


def judged(ledger, claim, measured, row, **changed):
    """The verdict on a claim that is changed, with a committed error and number of trials."""
    ledger.claims[claim.id] = claim._replace(**changed)
    ledger.verdicts.clear()
    return ledger.check(claim.id, measured, se=float(row.se), n=int(row.n)).verdict


def test_a_shifted_number_differs(ledgers):
    planted = {}
    for paper, claim, row in rows("number"):
        if not re.fullmatch(r"\d+(\.\d+)?", claim.value):
            continue
        m, se, n, rule = float(row.measured), float(row.se), int(row.n), claims.numbers(claim.rule)
        half = 0.5 * rule["step"] if "step" in rule else claims.parse(claim.value)[1]
        spread = math.hypot(se, se * math.sqrt(n / rule.get("runs", math.inf)))
        digits = len(claim.value.partition(".")[2])
        for side, away in ((-1, math.floor), (1, math.ceil)):
            shifted = away((m + side * (half + 5 * spread)) * 10**digits) / 10**digits
            false = judged(ledgers[paper], claim, m, row, value=f"{shifted:.{digits}f}")
            planted[paper, claim.id, side] = false
        assert judged(ledgers[paper], claim, m, row) == row.verdict
    assert len(planted) > 100
    assert {key: verdict for key, verdict in planted.items() if verdict != "differs"} == {}


def test_an_order_that_is_turned_round_differs(ledgers):
    planted = {}
    for paper, claim, row in rows("ordering", "trend", verdicts=["reproduced"]):
        margin = float(re.search(r"margin (-?[\d.]+)", row.measured)[1])
        planted[paper, claim.id] = judged(ledgers[paper], claim, -margin, row)
        assert judged(ledgers[paper], claim, margin, row) == "reproduced"
    assert len(planted) > 30
    assert set(planted.values()) == {"differs"}, planted


def test_a_bound_below_what_was_measured_differs(ledgers):
    planted = {}
    for paper, claim, row in rows("bound", verdicts=["reproduced"]):
        if side := re.match("[<>]", claim.value):
            error = float(row.measured.split()[0])
            bound = round(error / 2 if side[0] == "<" else 2 * error, 2)
            margin = bound - error if side[0] == "<" else error - bound
            false = judged(ledgers[paper], claim, margin, row, value=f"{side[0]} {bound}")
            planted[paper, claim.id] = false
    assert len(planted) > 5
    assert set(planted.values()) == {"differs"}, planted
