"""Rules and printed values that are no longer those that were first declared.

``data/claims/declared.csv`` has for each row of the claims files the digest of its rule and the
value that the paper prints, as first declared.  ``data/claims/changes.csv`` has a line for each row
whose rule, printed value or statistic changed after it had first been measured: the first verdict,
the verdict now, why, and the last commit before the change.  Its ``rules`` are the digests of the
rule from the declared one to the present one, ``values`` the printed values, with `` > `` between
them; each is empty where it is as declared.
"""

import contextlib
import csv
import io
import re
from typing import NamedTuple

from tbdcore.repro import claims, corrections, paths, products

WORDS = 15  # of a reason, at most
LATER = " > "  # between a rule or value and the one that took its place


class Declared(NamedTuple):
    """One row of declared.csv, all text."""

    paper: str
    id: str
    rule: str  # digest
    value: str  # as printed


class Change(NamedTuple):
    """One row of changes.csv, all text."""

    paper: str
    id: str
    first: str  # verdict
    now: str  # verdict
    why: str
    last_commit: str  # before the change
    rules: str
    values: str


def declared():
    """The rows of declared.csv by paper and id; ValueError as `claims.records` raises."""
    return claims.records(paths.claims() / "declared.csv", Declared, key=_key)


def changes():
    """The rows of changes.csv by paper and id; ValueError as `claims.records` raises."""
    return claims.records(paths.claims() / "changes.csv", Change, _faults, _key)


def _key(row):
    return row.paper, row.id


def _faults(it):
    """What can be wrong in a row of changes.csv: column, whether it is, and what to do."""
    verdicts, words = ", ".join(claims.VERDICTS), len(it.why.split())
    commit = re.fullmatch("[0-9a-f]{7,40}", it.last_commit)
    chain = re.fullmatch("([0-9a-f]{8} > )+[0-9a-f]{8}|", it.rules)
    return [
        ("first", it.first not in claims.VERDICTS, f"known are {verdicts}"),
        ("now", it.now not in claims.VERDICTS, f"known are {verdicts}"),
        ("why", not 1 <= words <= WORDS, f"{words} words; give a reason of at most {WORDS}"),
        ("last_commit", not commit, "give 7 to 40 hexadecimal digits"),
        ("rules", chain is None, f"write old{LATER}new, the digests of the rules"),
        ("values", it.values and LATER not in it.values, f"write old{LATER}new"),
    ]


def declare(paper):
    """Add the rows of a paper that are not there yet to declared.csv; returns how many."""
    first, file = declared(), paths.claims() / "declared.csv"
    new = [_declaration(paper, it) for it in claims.read(paper).values()]
    new = [row for row in new if _key(row) not in first]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([Declared._fields, *first.values(), *new])
    products.write(file.parent, {file.name: text.getvalue().encode()})
    return len(new)


def _declaration(paper, claim):
    return Declared(paper, claim.id, claims.rule_digest(claim.rule), claim.value)


def complaints(table=None):
    """What the two files do not say of the claims files, a line each; empty if they say all.

    `table` has the present verdicts, as `claims.ledger` gives them.
    """
    first, changed = declared(), changes()
    present = {
        (paper, it.id): it for paper in claims.papers() for it in claims.read(paper).values()
    }
    lines = [f"declared.csv: {' '.join(key)} is no claim" for key in first if key not in present]
    lines += [f"changes.csv: {' '.join(key)} is no claim" for key in changed if key not in present]
    for (paper, id), claim in present.items():
        now = _declaration(paper, claim)
        lines += _unlisted(now, first.get((paper, id)), changed.get((paper, id)))
    if table is not None:
        verdicts = table.set_index(["paper", "id"])["verdict"].to_dict()
        for key, it in changed.items():
            if it.now != verdicts.get(key, it.now):
                lines.append(f"changes.csv: {' '.join(key)} is {verdicts[key]}, not {it.now}")
    return lines


def copies():
    """Where printed values still stand that were corrected, in lines; see :mod:`corrections`.

    A correction is in progress until the run that judges by the new value and the line about it.
    """
    first, changed, lines = declared(), changes(), []
    for paper in claims.papers():
        judged = _judged(paper)
        for id, claim in claims.read(paper).items():
            values = _values(first.get((paper, id)), changed.get((paper, id)))
            in_progress = values[-1:] != [claim.value]
            in_progress |= judged.get(id, claims.published(claim)) != claims.published(claim)
            for old in {*values} - {claim.value}:
                places = corrections.copies(paper, old, claim.value, in_progress)
                lines += [f"{place}, of {id}" for place in places]
    return lines


def _judged(paper):
    """The printed values by which the verdicts of a paper were made, by id."""
    file = paths.figures() / paper / "verdicts.csv"
    with contextlib.suppress(ValueError):  # a damaged file: the scorecard says so
        return {row.id: row.published for row in claims.records(file, claims.Verdict).values()}
    return {}


def _values(first, change):
    """The printed values of a row from the declared one on; none of a row that is not declared."""
    if change and change.values:
        return change.values.split(LATER)
    return [first.value] if first else []


def _unlisted(now, first, change):
    """What is not listed of a row as it is now, in lines: `first` is how it was declared."""
    where = f"{now.paper} {now.id}"
    if first is None:
        return [f"declared.csv: {where} is missing; declare it before you measure it"]
    rules = change.rules.split(LATER) if change and change.rules else [first.rule]
    values = _values(first, change)
    lines = []
    if rules[0] != first.rule or values[0] != first.value:
        lines.append(f"changes.csv: {where} does not begin with the declared rule and value")
    if rules[-1] != now.rule:
        lines.append(f"changes.csv: {where} has another rule now; add its digest, {now.rule}")
    if values[-1] != now.value:
        lines.append(f"changes.csv: {where} has another value now; add it, {now.value}")
    return lines
