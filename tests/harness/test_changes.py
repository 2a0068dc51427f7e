"""Rules and printed values that changed: what is listed, what is not, and damaged lists."""

import pytest
import tiny

from tbdcore.repro import changes, claims, cli, paths

HEADER = ",".join(changes.Change._fields)
RULES = ("Mean of all draws; runs = 100", "Median", "Mode of all draws")
FIRST, SECOND, THIRD = map(claims.rule_digest, RULES)


def listed(*lines):
    """Write changes.csv of the small repository: the end of each line, from its rules on."""
    rows = [f"tiny,mean,reproduced,differs,a reason,0123abc,{line}" for line in lines]
    (paths.claims() / "changes.csv").write_text("\n".join([HEADER, *rows, ""]))


def change(rule=RULES[0], value="0.0"):
    """Give the row `mean` of the small repository another rule or another printed value."""
    text = tiny.CLAIMS.replace(RULES[0], rule).replace(",0.0,", f",{value},")
    (paths.claims() / "tiny.csv").write_text(text)


def test_every_change_of_the_repository_is_listed():
    assert changes.complaints(claims.ledger(paths.products())) == []
    assert changes.copies() == []


def test_every_row_was_declared_and_its_reason_is_short():
    rows = {(paper, id) for paper in claims.papers() for id in claims.read(paper)}
    assert set(changes.declared()) == rows
    assert len(changes.changes()) > 100


def test_a_row_as_declared_needs_no_line(repository):
    assert changes.complaints() == []


def test_a_rule_that_changed_without_a_line_is_named(repository):
    change(rule=RULES[1])
    (said,) = changes.complaints()
    assert "tiny mean" in said
    assert SECOND in said
    listed(f"{FIRST} > {SECOND},")
    assert changes.complaints() == []


def test_a_value_that_was_corrected_without_a_line_is_named(repository):
    change(value="0.1")
    (said,) = changes.complaints()
    assert "tiny mean has another value now" in said
    listed(",0.0 > 0.1")
    assert changes.complaints() == []


@pytest.mark.parametrize(
    ("line", "count"),
    [
        (f"{FIRST} > {SECOND} > {THIRD},", 0),
        (f"{FIRST} > {SECOND},", 1),  # it ends too early
        (f"{SECOND} > {THIRD},", 1),  # it does not begin with the declared rule
        (f"{FIRST} > {THIRD},0.1 > 0.0", 1),
        (f"{FIRST} > {THIRD},0.0 > 0.1", 1),
    ],
)
def test_a_chain_leads_from_what_was_declared_to_what_is_there(repository, line, count):
    change(rule=RULES[2])
    listed(line)
    assert len(changes.complaints()) == count


def test_a_row_that_is_not_declared_and_one_that_is_gone_are_named(repository):
    file = paths.claims() / "declared.csv"
    file.write_text(file.read_text().replace("tiny,mean", "tiny,median"))
    gone, missing = changes.complaints()
    assert "tiny median is no claim" in gone
    assert "tiny mean is missing" in missing
    listed(",")
    file.write_text(tiny.declared(tiny.CLAIMS))
    rest = tiny.CLAIMS.replace("mean,Table", "median,Table")
    (paths.claims() / "tiny.csv").write_text(rest)
    assert sum("is no claim" in said for said in changes.complaints()) == 2


def test_declaring_leaves_what_was_declared_before(repository):
    change(rule=RULES[1])
    more = 'more,text,more,,"a, b",,statement,Sec. 1,,,\n'
    with (paths.claims() / "tiny.csv").open("a") as file:
        file.write(more)
    assert changes.declare("tiny") == 1
    assert changes.declare("tiny") == 0
    assert changes.declared()["tiny", "mean"].rule == FIRST
    assert changes.declared()["tiny", "more"].value == "a, b"


def test_score_names_what_is_not_listed_and_an_old_verdict(inside, capsys):
    listed(",")
    assert cli.main(["score"]) == 1
    assert "tiny mean is reproduced, not differs" in capsys.readouterr().err
    (paths.claims() / "changes.csv").unlink()
    assert cli.main(["score", "--check"]) == 0


@pytest.mark.parametrize(
    ("old", "new", "column"),
    [
        ("reproduced,", "right,", "first"),
        ("differs", "wrong", "now"),
        ("a reason", "word " * 16, "why"),
        ("a reason", "", "why"),
        ("0123abc", "yesterday", "last_commit"),
        (FIRST, "rule", "rules"),
        ("0.0 > 0.1", "0.1", "values"),
        ("a reason", "a, reason", "values"),
        ("first,", "", "first"),
        ("a reason", '"a reason', ""),
        ("\n", "\r\n", ""),
        ("reason", "\udcff", ""),
    ],
)
def test_a_damaged_list_is_named_in_one_line(inside, capsys, old, new, column):
    listed(f"{FIRST} > {SECOND},0.0 > 0.1")
    file = paths.claims() / "changes.csv"
    text = file.read_text().replace(old, new)
    file.write_bytes(text.encode("utf-8", "surrogateescape"))
    assert cli.main(["score"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "changes.csv, row" in error
    assert f"column {column}" in error or not column


def test_a_row_that_is_listed_twice_is_refused(repository):
    listed(",", ",")
    with pytest.raises(ValueError, match="stands there twice"):
        changes.changes()
