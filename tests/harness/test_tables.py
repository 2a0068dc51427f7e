"""Methods and limits: their columns, what is refused, how they are shown, their numbers with other
seeds, and the CPU times of a study.
"""

import io
import math
import shutil
import time

import numpy as np
import pandas as pd
import pytest

from benchmarks import rows, seeds, timing
from tbdcore.repro import cite, pages, paths, products, screen, studies, tables
from tbdcore.repro.publish import Publication
from tests import tiny

PROVENANCE = {"parameters": {}, "seed": 20, "trials": 400, "digest": "0" * 16, "versions": {}}
PROVENANCE |= {"remake": "tbdcore run tiny"}
COST = "# least of 5\nmethod,cpu_ms\none frame,0.5\nweighted,12.5\n"
CELL = """import pandas as pd

both = pd.DataFrame({"method": ["one frame", "weighted"], "mean": [x.mean(), x.mean() + shift]})
both["mean_se"] = x.std() / n_trials**0.5
portfolio.methods(both.assign(told="nothing"), "Two methods.")"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The small repository as that of this process, with a study of CPU times."""
    tiny.here(tmp_path, monkeypatch)
    (tmp_path / "data" / "tiny_cost.csv").write_text(COST)
    return tmp_path


def methods(**changed):
    """Two methods: SNR at one half in two scenes, of which one method never gets there."""
    frame = {"method": ["one frame", "weighted"], "straight": [9.124, 6.25], "straight_se": 0.05}
    frame |= {"turn": ["never", 8.0], "turn_se": [math.nan, 0.0], "told": ["nothing", "speed"]}
    return pd.DataFrame(frame | changed)


def limits(**changed):
    """A condition that breaks a promise, with a cure for false alarms alone."""
    row = {"condition": "level, 1 dB", "false_promised": 0.05, "false_promised_se": 0.0}
    row |= {"false_stored": 0.752, "false_stored_se": 0.019, "false_recorded": 0.026}
    row |= {"false_recorded_se": 0.007, "found_promised": 0.91, "found_promised_se": 0.013}
    row |= {"found_stored": 0.94, "found_stored_se": 0.011}
    row |= {"found_recorded": "no cure", "found_recorded_se": math.nan}
    return pd.DataFrame([row | changed])


def portfolio(folder):
    return Publication("tiny", folder, PROVENANCE)


def test_methods_are_a_product_with_the_times_of_a_study(folder):
    run = portfolio(folder / "figures")
    run.methods(methods(), "Two methods.")
    assert {f"methods.{end}" for end in ("csv", "md", "tex", "json")} <= set(run.files)
    assert run.files["methods.csv"].decode().splitlines() == [
        "method,straight,straight_se,turn,turn_se,cpu_ms,told",
        "one frame,9.124,0.05,never,,0.5,nothing",
        "weighted,6.25,0.05,8.0,0,12.5,speed",
    ]
    _, _, head, _, *lines = run.files["methods.md"].decode().splitlines()
    assert head == "| method | straight | turn | CPU time, ms | told |"
    assert lines[0] == "| one frame | 9.124 ± 0.05 | never | 0.5 | nothing |"
    assert lines[1] == "| weighted | 6.250 ± 0.05 | 8 | 12.5 | speed |"


def test_limits_are_a_product(folder):
    run = portfolio(folder / "figures")
    run.limits(limits(), "One condition.")
    _, _, head, _, line = run.files["limits.md"].decode().splitlines()
    assert head.startswith("| condition | false alarms, promised | false alarms, as stored | false")
    assert line.startswith("| level, 1 dB | 0.05 | 0.752 ± 0.019 | 0.0260 ± 0.007 | 0.910 ± 0.013")
    assert line.endswith("| 0.940 ± 0.011 | no cure |")
    text = run.files["limits.csv"].decode().splitlines()
    assert text[0].split(",") == tables.LIMIT_COLUMNS
    assert "breaks_at" not in text[0]


def many(frame, n):
    names = [f"{i}" for i in range(n)]
    return pd.concat([frame[:1]] * n, ignore_index=True).assign(**{frame.columns[0]: names})


FIVE = {f"m{i}{end}": 0.5 for i in range(5) for end in ("", "_se")}
WRONG = {
    "an error too few": (methods().drop(columns="turn_se"), "columns method, .*each measure with"),
    "told is not last": (methods()[["told", *list(methods())[:-1]]], "columns told, .*; give"),
    "no measure": (methods()[["method", "told"]], "0 measures; give 1 to 4"),
    "five measures": (pd.DataFrame([{"method": "a", **FIVE, "told": "b"}]), "5 measures; give 1"),
    "its own times": (methods(told_se=0.0), "columns .*; give method"),
    "nine rows": (many(methods(), 9), "9 rows; give 1 to 8"),
    "no row": (methods()[:0], "0 rows; give 1 to 8"),
    "twice": (methods(method="weighted"), "'weighted' stands there twice"),
    "unknown to the study": (methods(method=["one frame", "wieghted"]), "no CPU time of 'wieg"),
    "no number": (methods(straight=[math.nan, 6.0]), "row 1, column straight: nan is no number"),
    "infinite": (methods(straight=[1.0, math.inf]), "row 2, column straight: inf is no number"),
    "a truth value": (methods(straight=[True, 6.0]), "column straight: True is no number"),
    "blank": (methods(turn=[" ", 8.0]), "row 1, column turn: ' ' is no number; give one, or a"),
    "no error": (methods(straight_se=math.nan), "column straight_se: nan is no standard error"),
    "negative": (methods(straight_se=-0.1), "column straight_se: -0.1 is no standard error"),
    "error of a word": (methods(turn_se=0.1), "column turn_se: 0.1 is the error of a word"),
    "told nothing": (methods(told=""), "column told: '' is no text; say it in words"),
}


@pytest.mark.parametrize(("frame", "words"), WRONG.values(), ids=WRONG)
def test_methods_that_are_incomplete_are_refused_in_one_line(folder, frame, words):
    run = portfolio(folder / "figures")
    with pytest.raises(ValueError, match=words) as error:
        run.methods(frame, "Two methods.")
    assert "\n" not in str(error.value)
    assert not run.files


WRONG_LIMITS = {
    "breaks_at": (limits(breaks_at=0.3), "give condition, false_promised"),
    "no share with a target": (limits().iloc[:, :7], "columns condition, .*give condition"),
    "seven rows": (many(limits(), 7), "7 rows; give 1 to 6"),
    "no error": (limits(found_stored_se=""), "row 1, column found_stored_se: '' is no standard"),
    "no condition": (limits(condition=3), "column condition: 3 is no text"),
}


@pytest.mark.parametrize(("frame", "words"), WRONG_LIMITS.values(), ids=WRONG_LIMITS)
def test_limits_that_are_incomplete_are_refused_in_one_line(folder, frame, words):
    run = portfolio(folder / "figures")
    with pytest.raises(ValueError, match=f"^tiny/limits[:,] .*{words}") as error:
        run.limits(frame, "One condition.")
    assert "\n" not in str(error.value)
    assert not run.files


def test_a_chapter_may_have_another_measure_where_it_says_so(folder):
    frame = pd.DataFrame([{"method": "weighted", **FIVE, "told": "speed"}])
    assert "m4" in portfolio(folder).methods(frame, "Five.", measures=5)


def shown_by(exhibit, monkeypatch):
    """The texts of the outputs of an exhibit, by the names of their places."""
    from IPython import display

    shown = {}

    def keep(data, display_id, **how):
        shown[display_id] = data["text/markdown"]

    monkeypatch.setattr(display, "display", keep)
    exhibit.show()
    return shown


def test_methods_stand_on_the_first_screen(folder, monkeypatch):
    """In the two places that stand empty before the first run."""
    assert repr(screen.exhibit("tiny/methods")) == "tiny/methods: Not yet run."
    empty = shown_by(screen.exhibit("tiny/methods"), monkeypatch)
    run = portfolio(folder / "figures")
    run.methods(methods(), "Two methods.")
    run.publish()
    table, caption = shown_by(screen.exhibit("tiny/methods"), monkeypatch).items()
    assert table[1].startswith("| method | straight | turn | CPU time, ms | told |\n")
    assert table[1].endswith("| speed |")
    assert caption[1] == "*tiny/methods.* Two methods."
    assert {table[0]: "", caption[0]: "*tiny/methods.* Not yet run."} == empty


def test_a_chapter_retires_its_advice_for_methods(folder):
    run = portfolio(folder / "figures")
    run.methods(methods(), "Two methods.")
    run.publish()
    lines = "id,last_commit,instead\ntiny/advice,5e922774,tiny/methods\n"
    (folder / "figures" / "retired.csv").write_text(lines)
    with pytest.raises(ValueError, match="tiny/advice is retired: tiny/methods takes its place"):
        cite.product("tiny/advice")


def test_a_table_is_read_as_it_was_written(folder):
    text = products.csv(tables.methods("tiny", methods())).decode()
    found = tables.read(io.StringIO(text))
    assert list(found["straight"]) == [9.124, 6.25]
    assert list(found["turn"]) == ["never", 8.0]
    assert list(found["told"]) == ["nothing", "speed"]


def test_a_count_has_all_its_digits_before_the_point():
    frame = pd.DataFrame({"method": ["one", "other"], "size": [12345.6, 12.345]})
    assert list(tables.shown(frame)["size"]) == ["12346", "12.3"]


@pytest.mark.parametrize("paper", pages.notebooks())
def test_the_committed_tables_have_the_times_of_the_study(paper):
    file = paths.products() / paper / "methods.csv"
    if file.is_file():
        table = tables.read(file)
        assert list(table["cpu_ms"]) == studies.cost(paper, table["method"])


# Other seeds -------------------------------------------------------------------------------------


def with_methods(folder):
    """The small repository, whose page has a table of methods."""
    cells = {}
    for name, source in tiny.CELLS.items():
        cells |= {"methods": CELL} if name == "publish" else {}
        cells[name] = source
    (folder / "notebooks" / "01_tiny.ipynb").write_text(tiny.notebook(cells), encoding="utf-8")


def with_seeds(made, monkeypatch):
    """Tables of other seeds than 21: its own, with other numbers."""

    def of(paper, seed, **values):
        table = tables.read(io.StringIO(made["methods"]))
        table["mean"] += 0.01 * (seed - 21)
        return {"methods": products.csv(table).decode()}

    monkeypatch.setattr(rows, "tables", of)


@pytest.mark.slow
def test_the_tables_of_a_page_are_made_with_five_other_seeds(folder, monkeypatch):
    with_methods(folder)
    made = rows.tables("tiny", seed=21)
    assert list(made) == ["methods"]
    with_seeds(made, monkeypatch)
    other = "# python -m benchmarks.seeds other tables; seeds 21 to 25\n"
    other += ",".join(seeds.TABLE_COLUMNS) + "\nother,methods,a,b,21,1,0.1\n"
    paths.seeds().with_name("tables_seeds.csv").write_text(other)
    for _ in range(2):  # the second time it takes the place of the first
        seeds.write_tables("tiny")
    table = seeds.read_tables()
    own = table[table["paper"] == "tiny"]
    assert len(table) == 11
    assert list(own["seed"]) == [s for s in (21, 22, 23, 24, 25) for _ in range(2)]
    assert set(own["column"]) == {"mean"}, "the CPU time has no seed"
    lead, error = seeds.lead(own, "mean", "weighted", "one frame")
    assert lead == pytest.approx(1.0, abs=1e-5)
    assert error == pytest.approx(0.05 * math.sqrt(2 / 5), rel=0.2)
    text = paths.seeds().with_name("tables_seeds.csv").read_text()
    assert text.count("# python -m benchmarks.seeds tiny tables; seeds 21 to 25\n") == 1
    seeds.write_tables("tiny", n_trials=20)
    text = paths.seeds().with_name("tables_seeds.csv").read_text()
    assert (
        text.count(" tiny tables") == text.count(" tiny tables n_trials=20; seeds 21 to 25\n") == 1
    )


def test_a_word_is_no_number_when_the_numbers_of_other_seeds_are_read(folder):
    lines = ",".join(seeds.TABLE_COLUMNS), "tiny,methods,a,b,21,,", "tiny,methods,a,c,21,1.5,0.1"
    paths.seeds().with_name("tables_seeds.csv").write_text("\n".join(lines))
    table = seeds.read_tables()
    assert table["value"].isna().tolist() == [True, False]
    assert table["se"].sum() == 0.1


def test_what_each_seed_repeats_comes_from_a_study_and_is_left_out(folder, monkeypatch):
    text = products.csv(tables.methods("tiny", methods())).decode()
    monkeypatch.setattr(rows, "tables", lambda paper, seed: {"methods": text})
    table = seeds.of_tables("tiny")
    assert list(table.index) == [*range(len(table))]
    assert set(table["column"]) == {"turn"}
    assert not (table["se"] > 0).any(), "only words and exact numbers may be the same"


def test_a_lead_needs_numbers_of_both_rows(folder):
    text = products.csv(tables.methods("tiny", methods())).decode()
    found = [row for seed in (1, 2) for row in seeds.numbers("tiny", "methods", seed, text)]
    table = pd.DataFrame(found, columns=seeds.TABLE_COLUMNS)
    lead = seeds.lead(table, "straight", "one frame", "weighted")
    assert lead == pytest.approx((2.874, 0.05))
    with pytest.raises(ValueError, match="turn: 'weighted' or 'one frame' has a word"):
        seeds.lead(table, "turn", "weighted", "one frame")
    with pytest.raises(ValueError, match="no numbers of 'weighted' and 'ideal' for the same"):
        seeds.lead(table, "straight", "weighted", "ideal")


def test_a_page_without_tables_is_refused(folder):
    with pytest.raises(ValueError, match=r"tiny: its page calls neither portfolio\.methods nor"):
        rows.tables("tiny", seed=21)


# CPU times ---------------------------------------------------------------------------------------


def test_a_study_of_cpu_times_can_be_read(folder):
    busy = np.ones((60, 60))
    trials = {"one": lambda: busy @ busy, "asleep": lambda: time.sleep(1e-3)}
    timing.write_costs("tiny", trials, repeat=2)
    head, *lines = (folder / "data" / "tiny_cost.csv").read_text().splitlines()
    assert head.startswith("# python -m benchmarks.tiny_cost: one process on ")
    assert lines[0] == "method,cpu_ms"
    one, asleep = studies.cost("tiny", ["one", "asleep"])
    assert one > 0
    assert asleep < 1.0, "sleeping takes no CPU time"


def test_a_portfolio_without_a_study_says_how_to_make_one(folder):
    (folder / "data" / "tiny_cost.csv").unlink()
    with pytest.raises(ValueError, match=r"no table .*: python -m benchmarks\.tiny_cost$"):
        portfolio(folder).methods(methods(), "Two methods.")
    (folder / "data" / "tiny_cost.csv").write_text("method,us_per_frame\nweighted,3\n")
    with pytest.raises(ValueError, match=r"^data/tiny_cost\.csv: no columns method, cpu_ms; make"):
        studies.cost("tiny", ["weighted"])


def test_the_index_shows_the_papers_method_and_the_best_of_the_others(tmp_path, monkeypatch):
    figures = shutil.copytree(
        paths.products(), tmp_path / "figures", ignore=shutil.ignore_patterns("*.p??", "*.svg")
    )
    monkeypatch.setenv("TBDCORE_FIGURES", str(figures))
    file = figures / "track_cfar" / "methods.csv"
    table = tables.read(file)
    table.loc[table["method"] == "best constant in the gate", "range (km)"] = 400.0
    file.write_bytes(products.csv(table))
    lessons = rows.definitions("index", ("lessons",))["lessons"]
    own, other = lessons[lessons["chapter"].str.startswith("[04]")].to_dict("records")
    assert (own["method"], other["method"]) == ("proposed", "best constant in the gate")
    assert other["what it reaches"].startswith("range at one half: 400.00 ± 0.22 km; largest")
    assert len(lessons) <= 10
