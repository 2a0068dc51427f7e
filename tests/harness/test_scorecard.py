"""The files that hold the verdicts of all papers together."""

import pandas as pd
import pytest

from tbdcore.repro import cite, claims, cli, paths, scorecard

DEPENDS = f"""{",".join(claims.Verdict._fields)}
mean,Table 1,mean of the draws,0.0,0.01,0.05,400,0.0,,depends,"1 of 2: all reproduced, half differs",measured,
order,text,shifted draws are larger,larger,margin 1.00,0.05,400,20.0,,reproduced,,measured,
price,text,price,cheap,,,,,,untestable,,,An opinion.
"""  # noqa: E501
SEEDS = "# by hand\npaper,claim,seeds,reproduced,differs,depends,inconclusive,together,row\n"


@pytest.fixture
def folder(repository):
    """The small repository with a row that depends on a reading."""
    (repository / "figures" / "tiny").mkdir(parents=True)
    (repository / "figures" / "tiny" / "verdicts.csv").write_text(DEPENDS)
    return repository


def test_a_row_that_depends_is_counted_and_listed(folder):
    assert cli.main(["score"]) == 0
    every = scorecard.with_seeds(claims.ledger())
    assert scorecard.depending(every) == "These depend on a reading: [01](01_tiny.ipynb) `mean`."
    lines = paths.readme().read_text().splitlines()
    assert "| numbers | 1 | 1 | 0 | 0 | 1 | 0 | 0 |" in lines
    assert "| all | 3 | 2 | 1 | 0 | 1 | 0 | 1 |" in lines
    card = pd.read_csv(folder / "figures" / "scorecard.csv").set_index("id")
    assert list(card["readings"].dropna()) == ["1 of 2: all reproduced, half differs"]
    card = (folder / "figures" / "scorecard.md").read_text().splitlines()
    counts = dict(zip(card[0].split(" | "), card[-1].split(" | "), strict=True))
    assert (counts["measured: reproduced"], counts["measured: depends"]) == ("1", "1")
    row = claims.verdicts("tiny").set_index("id").loc["mean"]
    assert cite._judged(row).endswith("depends (1 of 2: all reproduced, half differs)")


@pytest.mark.parametrize(
    ("together", "said"),
    [
        ("differs", "these another verdict: [01](01_tiny.ipynb) `order` (differs, not reproduced)"),
        ("reproduced", "the same verdicts"),
    ],
)
def test_one_sentence_names_the_rows_that_all_seeds_together_change(folder, together, said):
    assert scorecard.together(scorecard.with_seeds(claims.ledger())) == "", "without a study"
    row = claims.row_digest(claims.read("tiny")["order"])
    (folder / "data" / "seeds.csv").write_text(f"{SEEDS}tiny,order,10,9,1,0,0,{together},{row}\n")
    every = scorecard.with_seeds(claims.ledger())
    assert scorecard.together(every) == f"All seeds together give {said}."


@pytest.mark.parametrize("field", ["value", "unit", "kind", "rule", "gone"])
def test_seeds_that_judged_another_value_or_rule_are_named_and_not_shown(folder, capsys, field):
    row = claims.read("tiny")["order"]
    old = claims.row_digest(row._replace(**{field: "other"} if field in row._fields else {}))
    name = "order" if field in row._fields else "older"
    study = folder / "data" / "seeds.csv"
    study.write_text(f"{SEEDS}tiny,{name},10,9,1,0,0,differs,{old}\n")
    assert scorecard.stale() == [f"tiny {name}"]
    assert cli.main(["score"]) == 1
    assert f"anew: python -m benchmarks.seeds tiny {name}\n" in capsys.readouterr().err
    card = pd.read_csv(folder / "figures" / "scorecard.csv")
    assert card[["seeds", "together"]].isna().all(axis=None)
    study.write_text(f"{SEEDS}tiny,order,10,9,1,0,0,differs,{claims.row_digest(row)}\n")
    assert scorecard.stale() == []


def test_the_seeds_of_the_repository_judge_the_present_rows():
    assert scorecard.stale() == []


def test_the_papers_own_figures_and_tables_come_first_in_their_order(folder):
    names = ["fig1", "fig2", "fig10", "table1", "table2", "advice", "beyond_gain", "open_births"]
    for name in reversed(names):
        (folder / "figures" / "tiny" / f"{name}.json").write_text("{}")
    assert cite.ids("tiny") == [f"tiny/{name}" for name in names]


@pytest.mark.parametrize("name", ["README.md", "README.zh.md"])
def test_a_readme_that_has_lost_a_marker_is_left_as_it_is(folder, capsys, name):
    """What stands after the table would be lost with it."""
    text = "<!-- papers -->\n<!-- /papers -->\n<!-- scorecard -->\nold\n\nAfter.\n"
    (folder / name).write_text(text, encoding="utf-8")
    assert cli.main(["score"]) == 2
    assert f"tbdcore: {name}: <!-- scorecard --> and " in capsys.readouterr().err
    assert (folder / name).read_text(encoding="utf-8") == text
