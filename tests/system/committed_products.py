"""The committed products against those of a fresh execution of the notebooks, and the scorecard.

`make test` executes the notebooks with nbval, whose products go to build/nbval, and then runs this
file by its name; pytest does not collect it otherwise.  Data, tables and verdicts must agree line
by line; the last of six digits may differ by one, since on another CPU a sum may end in another
bit.  In a PNG one value of ten thousand may differ by one step of colour.
"""

import json
import re

import nbformat
import pytest
from quick_products import alike

from tbdcore.repro import claims, cli, pages, paths, scorecard

FRESH = paths.build() / "nbval"
PAGES = pages.notebooks()
TEXT = (".csv", ".md", ".tex", ".json")
ONE_IN_THE_SIXTH_DIGIT = 1.1e-5
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")


def text_files(folder):
    """Names of the files in a folder that are compared."""
    return {path.name for path in folder.iterdir() if path.suffix in TEXT}


def lines(path):
    """Lines of a file; of a record without versions and digest."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".json":
        about = {
            key: value
            for key, value in json.loads(text).items()
            if key not in ("versions", "digest")
        }
        text = json.dumps(about, indent=1, ensure_ascii=False)
    return text.splitlines()


def same(ours, theirs):
    """Whether two lines agree, numbers to the sixth digit."""
    if ours == theirs:
        return True
    numbers = [[float(number) for number in NUMBER.findall(line)] for line in (ours, theirs)]
    if NUMBER.sub("#", ours) != NUMBER.sub("#", theirs) or len(numbers[0]) != len(numbers[1]):
        return False
    return all(
        abs(a - b) <= ONE_IN_THE_SIXTH_DIGIT * max(abs(a), abs(b))
        for a, b in zip(*numbers, strict=True)
    )


def first_difference(committed, fresh):
    """The first line in which two files differ, or an empty string."""
    name = committed.relative_to(paths.root())
    ours, theirs = lines(committed), lines(fresh)
    for number, (a, b) in enumerate(zip(ours, theirs, strict=False), start=1):
        if not same(a, b):
            return f"{name}, line {number}: committed {a!r}, computed again {b!r}"
    if len(ours) != len(theirs):
        return f"{name}: committed {len(ours)} lines, computed again {len(theirs)}"
    return ""


@pytest.mark.parametrize("paper", PAGES)
def test_products_are_those_of_the_notebook(paper):
    committed, fresh = paths.products() / paper, FRESH / paper
    assert fresh.is_dir(), f"{fresh} is missing: execute the notebooks first (make test)"
    assert text_files(committed) == text_files(fresh)
    for name in sorted(text_files(committed)):
        difference = first_difference(committed / name, fresh / name)
        assert not difference, difference
    pictures = {file.name for file in committed.glob("*.png")}
    assert pictures == {file.name for file in fresh.glob("*.png")}
    assert [name for name in sorted(pictures) if not alike(committed / name, fresh / name)] == []


@pytest.mark.parametrize("paper", PAGES)
def test_every_product_is_complete(paper):
    """What a JSON announces is there, and no picture is without its JSON."""
    folder = paths.products() / paper
    for about in folder.glob("*.json"):
        kinds = {path.suffix for path in folder.glob(f"{about.stem}.*")}
        assert kinds >= {".pdf", ".svg", ".png"} or kinds >= {".csv", ".md", ".tex"}, about.name
        assert json.loads(about.read_text(encoding="utf-8"))["id"] == f"{paper}/{about.stem}"
    names = {path.stem for path in folder.iterdir()} - {"verdicts"}
    assert names == {path.stem for path in folder.glob("*.json")}


def test_scorecard_and_readme_are_current(capsys):
    assert cli.main(["score", "--check"]) == 0, capsys.readouterr().err


def test_the_scorecard_has_every_row_of_every_claims_file():
    rows = (paths.products() / "scorecard.csv").read_text(encoding="utf-8").count("\n") - 1
    assert rows == sum(len(claims.read(paper)) for paper in claims.papers())


@pytest.mark.parametrize(
    ("ours", "theirs", "agree"),
    [
        ("a,0.333333", "a,0.333334", True),
        ("a,0.333333", "a,0.333343", False),
        ("fig2,1", "fig3,1", False),
        ("x,1,2", "x,1", False),
        ("differs", "reproduced", False),
        ("-1e-05,nan", "-1.00001e-05,nan", True),
        ("-1", "1", False),
    ],
)
def test_what_counts_as_the_same_line(ours, theirs, agree):
    assert same(ours, theirs) == agree


def test_the_study_of_the_seeds_has_every_judged_claim():
    every = scorecard.with_seeds(claims.ledger(paths.products()))
    judged = every[every["verdict"].isin(claims.JUDGED)]
    assert judged["seeds"].notna().all()
    assert (judged["seeds"] > 0).all(), "the committed run is one of the seeds"


@pytest.mark.parametrize("paper", pages.papers())
def test_a_chapter_says_what_all_seeds_together_say_of_its_unsteady_numbers(paper):
    every = scorecard.with_seeds(claims.ledger(paths.products()))
    own = every[(every["paper"] == paper) & (every["seeds"] < scorecard.STEADY)]
    expected = own[own["together"].isin(["reproduced", "differs"])]
    study = scorecard.study().set_index(["paper", "claim"]).loc[paper].loc[expected["id"]]
    expected = expected[((study["reproduced"] > 0) & (study["differs"] > 0)).to_numpy()]
    cells = nbformat.read(pages.path(paper), 4).cells
    prose = " ".join(cell.source for cell in cells if cell.cell_type == "markdown")
    told = re.search(r"seeds together.*?: (.*?) (is|are) reproduced; (.*?) differs?\b", prose)
    said = dict.fromkeys(re.findall(r"`(\S+)`", told[1]), "reproduced") if told else {}
    said |= dict.fromkeys(re.findall(r"`(\S+)`", told[3]), "differs") if told else {}
    assert said == dict(zip(expected["id"], expected["together"], strict=True))
