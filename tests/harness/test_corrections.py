"""A printed number stands in the claims file alone: no page's code has a copy of it, and a
correction names the texts that have one.
"""

import ast
import re

import pytest
import tiny

from tbdcore.repro import changes, claims, cli, corrections, pages, paths

# Numbers that a page still has; each one goes when the page reads it from its claims file
KNOWN: dict[str, set] = {}
DIGITS = 3  # a printed number with fewer is no sure sign of a copy
NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d+)?(?![\w.]*\d)")


def printed(paper):
    """The numbers that a paper prints with at least three digits."""
    numbers = set()
    for claim in claims.read(paper).values():
        digits = re.sub(r"\D", "", claim.value).lstrip("0")
        if claim.kind == "number" and len(digits) >= DIGITS:
            numbers.add(abs(claims.parse(claim.value)[0]))
    return numbers


def copies(paper):
    """The printed numbers of a paper that stand in the code of its page, as numbers or in texts."""
    wanted, found = printed(paper), set()
    for cell in pages.cells(paper):
        for node in ast.walk(ast.parse(re.sub(r"(?m)^[%!].*\n?", "", cell))):
            value = getattr(node, "value", None) if isinstance(node, ast.Constant) else None
            if isinstance(value, str):
                found |= {float(text) for text in NUMBER.findall(value)}
            elif isinstance(value, int | float):
                found.add(abs(value))
    return wanted & found


@pytest.mark.parametrize("paper", claims.papers())
def test_no_code_of_a_page_has_a_printed_number_as_a_literal(paper):
    assert copies(paper) == KNOWN.get(paper, set())


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("x = 14.11", {14.11}),
        ("x = [1.0, -14.11]", {14.11}),
        ('x = "transmitted power that 14.11 dB save"', {14.11}),
        ('x = f"{y:.2f}; published: 14.11"', {14.11}),
        ("x = 14.1 + 114.11", set()),
        ('x = "figure 14.1, v14.11.2"', set()),
    ],
)
def test_a_copy_is_found(repository, code, found):
    (repository / "data" / "claims" / "tiny.csv").write_text(
        tiny.CLAIMS.replace(",0.0,", ",14.11,")
    )
    tiny.change(repository, trials=code)
    assert copies("tiny") == found


# After a correction ------------------------------------------------------------------------------

OTHER = 'saving,text,power saved,"from {}",cheap,,statement,Sec. 1,,,"{}"\n'


def correct(repository, old, now, listed=True, texts=("", "")):
    """Correct the value of the row `mean`, once printed as `old`; another row has two texts."""
    rows = tiny.CLAIMS.replace(",0.0,", ",PRINTED,") + OTHER.format(*texts)
    declared = tiny.declared(rows.replace("PRINTED", old))
    (paths.claims() / "declared.csv").write_text(declared)
    (paths.claims() / "tiny.csv").write_text(rows.replace("PRINTED", now))
    line = f"tiny,mean,reproduced,differs,misread,0123abc,,{old} > {now}"
    lines = [",".join(changes.Change._fields), *[line] * listed, ""]
    (paths.claims() / "changes.csv").write_text("\n".join(lines))


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize(
    ("place", "file", "text"),
    [
        ("cell 5", "notebooks/01_tiny.ipynb", ""),
        ("papers.toml, line 6", "data/papers.toml", 'result = "It is 14.11 dB."\n'),
        ("README.zh.md, line 1", "README.zh.md", "增益14.11分贝"),
        ("docs/running.md, line 2", "docs/running.md", "\n(14.11)"),
    ],
)
def test_every_text_that_has_the_old_value_is_named(repository, listed, place, file, text):
    correct(repository, "14.11", "14.17", listed)
    assert changes.copies() == []
    if text:
        (repository / file).parent.mkdir(exist_ok=True)
        with (repository / file).open("a", encoding="utf-8") as opened:
            opened.write(text)
    else:
        tiny.change(repository, figure='x = "the printed 14.11 dB"')
    (said,) = changes.copies()
    assert f"{place}: still has 14.11, of mean" in said


@pytest.mark.parametrize("listed", [False, True])
def test_other_columns_of_the_claims_are_named(repository, listed):
    correct(repository, "14.11", "14.17", listed, texts=("14.11 dB", "14.11 dB save little"))
    columns = [said.partition(":")[0] for said in changes.copies()]
    assert columns == ["tiny.csv, saving, conditions", "tiny.csv, saving, cause"]


@pytest.mark.parametrize(
    ("old", "text", "number"),
    [
        ("4.72", "$1-10^{-0.472}$", "0.472"),  # the point elsewhere
        ("4.72", "it saves 66.27 %", "66.27"),
        ("4.72", "a power ratio of 2.965", "2.965"),
        ("2.965", "a gain of 4.720 dB", "4.720"),
        ("0.658", "it misses 34.2 %", "34.2"),
        ("287.10", "287.1 km", "287.1"),
        ("0.66", "0.66", "still has 0.66"),  # two digits
        ("4.72", "4.71, 14.72, 4.725, 47.2.1, x0472", ""),
        ("5", "5", ""),  # one digit
        ("3000", "3000, 300", "still has 3000"),  # a round number may be anything else
    ],
)
def test_a_number_that_may_follow_is_named_while_the_correction_is_in_progress(
    repository, old, text, number
):
    correct(repository, old, "3.21", listed=False, texts=(text, ""))
    said = changes.copies()
    assert len(said) == bool(number)
    assert all(number in line for line in said)


def test_what_the_new_value_gives_too_is_not_named(repository):
    correct(repository, "4.721", "4.719", listed=False, texts=("0.472", ""))
    assert changes.copies() == []
    correct(repository, "4.721", "4.729", listed=False, texts=("0.472", ""))
    assert len(changes.copies()) == 1


def test_a_finished_correction_names_what_is_certain_alone(repository):
    for old, text in [("0.66", "0.66"), ("4.72", "66.27 and 0.472"), ("4.72", "14.72, 4.725")]:
        correct(repository, old, "3.21", texts=(text, ""))
        assert changes.copies() == []
    correct(repository, "4.72", "3.21", texts=("4.72", ""))
    assert len(changes.copies()) == 1
    with (paths.claims() / "tiny.csv").open("a") as file:
        file.write("again,text,again,,4.72,,number,Sec. 1,,,\n")  # another row prints it
    assert changes.copies() == []


def test_a_value_that_was_corrected_twice_is_looked_for_twice(repository):
    correct(repository, "14.11", "14.14 > 14.17")
    text = (paths.claims() / "tiny.csv").read_text()
    (paths.claims() / "tiny.csv").write_text(text.replace("14.14 > 14.17", "14.17"))
    assert changes.copies() == []
    tiny.change(repository, figure="x = [14.11, 14.14]")
    assert len(changes.copies()) == 2


def test_what_follows_from_a_number():
    """Inverse, rest to 100 %, decibels of a ratio, ratio of decibels, the share that these save."""
    by_hand = [4.72, 0.211864, 95.28, 6.739420, 2.964831, 0.662713]
    assert corrections.following("4.72") == pytest.approx(by_hand, abs=5e-7)
    for text, rest in (("0.658", 0.342), ("1", 0.0), ("100", 0.0)):
        assert corrections.following(text)[2] == pytest.approx(rest)
    for text, numbers in (("101", [101.0]), ("0.0", [0.0]), ("larger", [])):
        assert corrections.following(text) == numbers


def test_score_names_the_places_before_the_chapter_has_been_run(inside, capsys):
    file = paths.claims() / "tiny.csv"
    text = file.read_text().replace(",0.0,", ",14.17,")
    file.write_text(text.replace("price,,", 'price,"once 0.0, then 14.11",'))
    declared = paths.claims() / "declared.csv"
    declared.write_text(declared.read_text().replace(",0.0", ",14.11"))
    assert cli.main(["score"]) == 1
    said = capsys.readouterr()
    assert said.out == "tiny.csv, price, conditions: still has 14.11, of mean\n"
    assert said.err.count("\n") == 1
    for part in ("row 2, column value", "mean has another value now", "listed above: 1"):
        assert part in said.err
    assert not (inside / "figures" / "scorecard.csv").exists()


def test_a_correction_is_in_progress_until_the_chapter_has_been_run(inside):
    correct(inside, "14.11", "14.17", texts=("0.1411", ""))
    assert len(changes.copies()) == 1  # the verdict has 0.0
    verdicts = paths.figures() / "tiny" / "verdicts.csv"
    verdicts.write_text(verdicts.read_text().replace(",0.0,", ",14.17,"))
    assert changes.copies() == []
    verdicts.write_text("damaged")
    assert changes.copies() == []
