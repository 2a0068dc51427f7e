"""The command line: exit codes, errors of one line, and the scorecard."""

import json
import shlex
import shutil
import subprocess
import sys

import pandas as pd
import pytest
import tiny

import tbdcore
from tbdcore.repro import batch, cite, claims, cli, commands, pages, paths, trials

HEADER = ",".join(claims.Verdict._fields)
VERDICTS = f"""{HEADER}
mean,Table 1,mean of the draws,0.0,0.01,0.05,400,0.00,,reproduced,,measured,
order,text,shifted draws are larger,larger,margin 1.00,0.05,400,20.00,,reproduced,,measured,
price,text,price,cheap,,,,,,untestable,,,An opinion.
"""
TABLES = """<!-- papers -->
| chapter | paper | what came out |
| --- | --- | --- |
| [01](notebooks/01_tiny.ipynb) Means | authors not known, *On the mean of some draws* |  |
<!-- /papers -->
<!-- scorecard -->
| kind | published | measured | reproduced | differs | depends | inconclusive | not measured |
| --- | --- | --- | --- | --- | --- | --- | --- |
| numbers | 1 | 1 | 1 | 0 | 0 | 0 | 0 |
| orderings | 1 | 1 | 1 | 0 | 0 | 0 | 0 |
| trends | 0 | 0 | 0 | 0 | 0 | 0 | 0 |
| statements | 1 | 0 | 0 | 0 | 0 | 0 | 1 |
| bounds | 0 | 0 | 0 | 0 | 0 | 0 | 0 |
| all | 3 | 2 | 2 | 0 | 0 | 0 | 1 |
<!-- /scorecard -->
"""


DONE = batch.Result("tiny", 0.0, {}, "", "")


def said(capsys, code, *words):
    """The single line that a command complained in, with its exit code checked."""
    assert cli.main([str(word) for word in words]) == code
    out, err = capsys.readouterr()
    assert err.count("\n") == 1, err
    assert err.startswith("tbdcore: ")
    assert "Traceback" not in out + err
    return err


USAGE = [  # a command, what its error names
    ("", "command"),
    ("run tinny", "'tiny'"),
    ("run 07", "tiny"),
    ("run docs/", "tiny"),
    ("run 01x", "'01'"),
    ("run tiny -p n_trails=5", "'n_trials'"),
    *((f"run tiny -p n_trials={bad}", "n_trials") for bad in ("many", "2.5", "0", "1e99", "inf")),
    *((f"run tiny -p n_trials={bad}", "n_trials") for bad in ("1e400", "9" * 4000, "9" * 5000)),
    ("run tiny -p n_trials=__import__('os').getpid()", "n_trials"),
    ("run tiny -p pause=61", "pause"),
    *((f"run tiny -p seed={bad}", "seed") for bad in ("-1", "0.5", 2**63)),
    *((f"run tiny -p shift={bad}", "shift") for bad in ("9" * 400, "-1e400", "nan")),
    ("run tiny -p shift=1 -p shift=2", "shift"),
    ("run tiny --workers=1 -p workers=1", "workers"),
    ("run tiny --workers -1", "workers"),
    ("run tiny --workers two", "--workers"),
    ("run tiny --in-place -p shift=2", "-p"),
    ("run --resume --in-place", "--resume"),
    ("sweep tiny shift=1,2 -p shift=3", "shift"),
    ("sweep tiny shif=1", "'shift'"),
    ("sweep tiny shift=1,9", "shift"),
    ("sweep tiny shift=1,2,1.0", "1.0"),
    ("sweep tiny workers=1,2", "workers"),
    ("sweep tini shift=1,2", "'tiny'"),
    ("show tiny", "tiny"),
    ("show tiny/fig1", "tiny/fig1"),
    ("cite tini", "'tiny'"),
    ("cite tiny", "tiny"),
    ("cite tiny/fig1 --latex --bibtex", "--bibtex"),
    ("list tini", "'tiny'"),
    ("list --figures no/such", "no/such"),
]


@pytest.mark.parametrize(("words", "named"), USAGE, ids=[words[:40] for words, _ in USAGE])
def test_bad_usage_is_one_line_and_code_2(repository, capsys, words, named):
    assert named in said(capsys, 2, *words.split())
    made = (repository / "build").rglob("*.ipynb")
    assert not list(made), "nothing was started"


def test_one_bad_paper_stops_all_before_the_first_starts(repository, capsys):
    assert "tinny" in said(capsys, 2, "run", "tiny", "tinny")


@pytest.mark.parametrize("out", ["/no/such/folder/here", "README.md", "README.md/below"])
def test_a_folder_that_cannot_be_written(repository, capsys, monkeypatch, out):
    monkeypatch.chdir(repository)
    assert f"output folder {out}" in said(capsys, 2, "run", "tiny", "--out", out)


@pytest.mark.parametrize("option", [["--scheduler", "nonsense"], ["-p", "scheduler=nonsense"]])
def test_an_unreachable_scheduler_is_the_environments_fault(repository, capsys, option):
    """One that does not answer is in test_trials."""
    pytest.importorskip("distributed")
    assert "no address of a dask scheduler" in said(capsys, 3, "run", "tiny", *option)


def test_a_run_says_what_cluster_it_found(repository, capsys, monkeypatch):
    """What it counts is in test_trials."""
    monkeypatch.setattr(trials, "cluster", lambda address, papers: (2, 6))
    monkeypatch.setattr(batch, "execute", lambda *given, **options: DONE)
    assert cli.main(["run", "tiny", "--scheduler", "tcp://host:8786"]) == 0
    assert capsys.readouterr().out == "scheduler tcp://host:8786: workers 2, threads 6\n"


@pytest.mark.parametrize("words", [["score"], ["run", "tiny"], ["sweep", "tiny", "shift=1,2"]])
def test_a_spoilt_claims_file_is_named_before_anything_starts(repository, capsys, words):
    (paths.claims() / "tiny.csv").write_text(tiny.CLAIMS.replace("\n", "\r\n"))
    enter(repository, VERDICTS)
    assert "tiny.csv, row" in said(capsys, 2, *words)


def test_a_missing_claims_file_is_named_before_anything_starts(repository, capsys):
    (paths.claims() / "tiny.csv").unlink()
    assert "tiny.csv: no claims file" in said(capsys, 2, "run", "tiny")


@pytest.mark.parametrize("words", [["--quick"], ["-p", "shift=2"]])
def test_the_figures_are_for_default_parameters_by_any_name(repository, capsys, words):
    out = f"{repository}/data/../figures"
    assert "figures are for default parameters" in said(
        capsys, 2, "run", "tiny", *words, "--out", out
    )


NOTEBOOK, TOML = "notebooks/01_tiny.ipynb", "data/papers.toml"
OTHER_PAPER = tiny.PAPERS.replace("[tiny]", "[tini]")
DAMAGED = [  # a file, what is in it, the exit code of a command
    ("figures/tiny/verdicts.csv", VERDICTS.replace(",", ";"), 1, "score"),
    ("figures/tiny/verdicts.csv", "", 1, "score"),
    ("figures/scorecard.csv", "<<<<<<< HEAD\n", 2, "score"),
    ("CITATION.cff", "authors: [", 2, "score"),
    (NOTEBOOK, "<<<<<<< HEAD\n", 2, "run tiny"),
    (NOTEBOOK, "{}", 2, "run tiny"),
    (NOTEBOOK, "[]", 2, "list tiny"),
    (NOTEBOOK, '{"cells": [{"cell_type": "code"}]}', 2, "run tiny"),
    (NOTEBOOK, tiny.notebook({"parameters": "a = 1"}), 2, "run tiny"),
    (NOTEBOOK, tiny.notebook({"parameters": "a: int = b"}), 2, "run"),
    (NOTEBOOK, tiny.notebook({"parameters": "a: = ("}), 2, "list tiny"),
    ("figures/tiny/fig1.json", "{}", 2, "cite tiny/fig1"),
    ("figures/tiny/fig1.json", "[]", 2, "cite"),
    ("figures/tiny/fig1.json", "\udcff", 2, "run tiny --resume"),
    ("data/claims/tiny.csv", "", 2, "run"),
    (TOML, "[tiny", 2, "cite tiny --bibtex"),
    (TOML, OTHER_PAPER, 2, "list"),
    (TOML, OTHER_PAPER, 2, "cite tiny --bibtex"),
    (TOML, "", 2, "cite tiny --bibtex"),
    (TOML, tiny.PAPERS.replace("topic", "subject"), 2, "list"),
]


@pytest.mark.parametrize(("file", "text", "code", "words"), DAMAGED)
def test_a_damaged_file_is_named(repository, capsys, file, text, code, words):
    enter(repository, VERDICTS)
    (repository / file).write_text(text, encoding="utf-8", errors="surrogateescape")
    message = said(capsys, code, *words.split())
    assert file.rpartition("/")[2] in message
    assert "bug" not in message


def test_a_misspelt_paper_is_told_its_table(repository, capsys):
    paths.bibliography().write_text(tiny.PAPERS.replace("[tiny]", "[tini]"))
    assert "papers.toml: there is no table [tiny]; is [tini] meant" in said(capsys, 2, "list")


def test_the_default_folder_is_tried_before_anything_starts(repository, capsys, monkeypatch):
    monkeypatch.setenv("TBDCORE_FIGURES", "/proc/no/such")
    assert "output folder /proc/no/such" in said(capsys, 2, "run", "tiny")


def test_a_missing_package_is_the_environments_fault(repository, capsys, monkeypatch):
    def missing(*arguments):
        raise ModuleNotFoundError("No module named 'papermill'", name="papermill")

    monkeypatch.setattr(commands, "_find_clusters", missing)
    assert "papermill is missing; this needs the extra repro" in said(capsys, 3, "run")


@pytest.mark.parametrize(
    "command", ["run", "sweep", "stamp", "score", "cite", "show", "which", "list", "doctor"]
)
def test_help_has_examples_that_are_understood(capsys, command):
    with pytest.raises(SystemExit) as caught:
        cli.main([command, "--help"])
    assert caught.value.code == 0
    examples = capsys.readouterr().out.partition("examples:\n")[2].splitlines()
    assert examples
    for example in examples:
        words = cli._parse(shlex.split(example)[1:])
        assert words.name == command
        if "/" in getattr(words, "id", ""):
            assert cite.files(words.id)
        if getattr(words, "file", "").startswith("figures/"):
            assert (paths.root() / words.file).is_file()


@pytest.mark.parametrize("words", [["--debug", "run", "tinny"], ["run", "tinny", "--debug"]])
def test_debug_shows_the_traceback_instead(repository, capsys, words):
    assert cli.main(words) == 2
    err = capsys.readouterr().err
    assert err.startswith("Traceback")
    assert "tbdcore: " not in err


def test_an_unexpected_error_is_one_line(repository, capsys, monkeypatch):
    monkeypatch.setattr(paths, "root", lambda: 1 / 0)
    assert "ZeroDivisionError: division by zero; this is a bug" in said(capsys, 1, "list")


def test_version(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"tbdcore {tbdcore.__version__}\n"


@pytest.mark.parametrize("words", [["--version"], ["--help"], ["list"]])
def test_the_command_line_starts_without_what_is_slow(repository, words):
    slow = {"numba", "pandas", "matplotlib", "papermill", "distributed"}
    code = (
        "import sys; from tbdcore.repro import cli\n"
        "try: cli.main(sys.argv[1:])\nexcept SystemExit: pass\n"
        f"print('loaded:', *{slow} & set(sys.modules))"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines()[-1] == "loaded:"


def test_list_names_the_papers(repository, capsys):
    assert cli.main(["list"]) == 0
    assert capsys.readouterr().out == "tiny        01_tiny.ipynb         Means\n"


@pytest.mark.parametrize("word", ["tiny", "01", "1", "01_tiny", "notebooks/01_tiny.ipynb"])
def test_a_paper_is_named_by_its_key_its_number_or_its_notebook(inside, capsys, monkeypatch, word):
    seen = []
    monkeypatch.setattr(batch, "execute", lambda paper, *_, **__: seen.append(paper) or DONE)
    monkeypatch.setattr(batch, "tabulate", lambda paper, *_: None)
    for words in (["list", word], ["run", word], ["sweep", word, "shift=1"], ["cite", word]):
        assert cli.main(words) == 0
    assert seen == ["tiny", "tiny"]
    out = capsys.readouterr().out
    assert out.startswith("tiny: Means")
    assert out.endswith("Three draws.\n")
    assert cli.main(["cite", f"{word}/fig1", "--caption"]) == 0
    assert capsys.readouterr().out == "Nine draws, 100 % of them.\n"


def test_an_unknown_paper_is_told_all_that_would_do():
    with pytest.raises(ValueError, match=r"nearest is 'index' of dp_tbd, .*, together, index$"):
        pages.paper_of("indx")


ADVICE = [
    ("run 1 -p shift=2 --out figures", "run 1 -p shift=2 --out build/try"),
    ("run 1 --quick --out figures", "run 1 --quick --out build/try"),
    ("run 1 -p n_trials", "run 1 -p n_trials=7"),
    ("sweep 1 shift", "sweep 1 shift=1,2"),
    ("sweep 1 shift=1,1", "sweep 1 shift=1"),
    ("cite --figures no/such", "cite --figures figures"),
    ("cite fig1", "cite tiny/fig1"),
    ("cite tiny --latex", "cite"),
    ("rum", "run"),
    ("run --quik", "run --quick"),
    ("doctor now", "doctor --help"),
]


@pytest.mark.parametrize(("words", "advice"), ADVICE)
def test_advice_that_is_followed_leads_on(inside, capsys, monkeypatch, words, advice):
    """The words of the advice are those of the error."""
    monkeypatch.chdir(inside)
    monkeypatch.setattr(batch, "execute", lambda *_, **__: DONE)
    monkeypatch.setattr(batch, "tabulate", lambda *_: None)
    error = said(capsys, 2, *words.split())
    assert advice.split()[-1].partition("=")[0] in error
    if "--help" in advice:
        with pytest.raises(SystemExit) as caught:
            cli.main(advice.split())
        assert caught.value.code == 0
    else:
        assert cli.main(advice.split()) == 0


def test_where_build_cannot_be_written_the_folder_of_out_takes_its_place(
    repository, capsys, monkeypatch
):
    """A file in its place refuses even a user whom no permission stops."""
    (repository / "build").touch()
    assert "build cannot be written; name a folder: --out DIR" in said(capsys, 3, "run", "tiny")
    seen = []
    monkeypatch.setattr(batch, "execute", lambda *given, **_: seen.append(given) or DONE)
    assert cli.main(["run", "tiny", "--out", "elsewhere"]) == 0
    build = repository / "elsewhere" / "build"
    assert f"executed notebooks go to {build}\n" in capsys.readouterr().out
    assert seen[0][2] == build / "01_tiny.ipynb"
    assert repository / "build" == paths.build(), "for one command only"


def test_in_place_refreshes_the_notebook_as_it_is_committed(inside, monkeypatch):
    """Indented by one blank, letters as they are, without what papermill adds."""
    notebook = inside / "notebooks" / "01_tiny.ipynb"
    made = json.loads(tiny.notebook(tiny.CELLS | {"algorithm": "print('σ')"}))

    def executed(paper, values, output, **_):
        output.parent.mkdir(exist_ok=True)
        output.write_text(json.dumps(made | {"metadata": {"papermill": {}}}))
        return DONE._replace(notebook=str(output))

    monkeypatch.setattr(batch, "execute", executed)
    assert cli.main(["run", "--in-place"]) == 0
    expected = json.dumps(pages.clean(made), indent=1, ensure_ascii=False)
    assert notebook.read_text(encoding="utf-8") == f"{expected}\n"
    monkeypatch.setattr(
        batch, "execute", lambda *_, **__: DONE._replace(status=1, error="tiny: bad")
    )
    before = notebook.read_bytes()
    assert cli.main(["run", "--in-place"]) == 1
    assert notebook.read_bytes() == before


def test_a_page_that_warns_is_refused(inside, monkeypatch, capsys):
    """The committed page does not show standard error, which the comparison of outputs refuses."""
    made = json.loads(tiny.notebook(tiny.CELLS))
    said = {"output_type": "stream", "name": "stderr", "text": "PerformanceWarning: slow\nhere"}
    made["cells"][1] |= {"execution_count": 2, "outputs": [said]}

    def executed(paper, values, output, **_):
        output.parent.mkdir(exist_ok=True)
        output.write_text(json.dumps(made))
        return DONE._replace(notebook=str(output))

    monkeypatch.setattr(batch, "execute", executed)
    assert cli.main(["run", "tiny", "--in-place"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "tiny: cell 2 wrote to standard error: PerformanceWarning: slow;" in line


def test_list_of_a_paper_shows_parameters_and_products(inside, capsys):
    assert cli.main(["list", "tiny"]) == 0
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert "  n_trials: int = 400  in [1, inf); quick 40\n      draws\n" in out
    assert "\n  tiny/fig1\n    Nine draws, 100 % of them.\n" in out
    assert max(map(len, lines)) <= 100


def test_cite_lists_ids_with_captions(inside, capsys):
    for words in (["cite"], ["cite", "tiny"]):
        assert cli.main(words) == 0
        out = capsys.readouterr().out
        assert out == "tiny/fig1\n  Nine draws, 100 % of them.\ntiny/table1\n  Three draws.\n"
    assert cli.main(["cite", "tiny", "--bibtex"]) == 0
    assert "@misc{tiny," in capsys.readouterr().out


def test_show_has_caption_data_and_verdicts(inside, capsys):
    for word in ("tiny/fig1", "1/fig1"):
        assert cli.main(["show", word]) == 0
        out = capsys.readouterr().out
        assert out.startswith("tiny/fig1\n  Nine draws, 100 % of them.\n")
        assert "figures/tiny/fig1.csv, 9 rows\n" in out
        (verdict,) = out.partition("\nverdicts\n")[2].splitlines()
        assert verdict.startswith("  mean mean of the draws: published 0.0, measured ")
        assert verdict.endswith(", reproduced")
    table = inside / "figures" / "tiny" / "fig1.csv"
    table.write_text("")
    assert "fig1.csv: no table" in said(capsys, 2, "show", "tiny/fig1")
    table.write_text("x\n" + "1\n" * 1000)
    assert cli.main(["show", "tiny/fig1"]) == 0
    out = capsys.readouterr().out
    assert "fig1.csv, 1000 rows" in out
    assert out.count("\n") < 60


@pytest.mark.parametrize("words", [["score"], ["new", "square_law"]])
def test_a_clone_that_cannot_be_written_is_said_in_one_line(repository, capsys, monkeypatch, words):
    enter(repository, VERDICTS)
    (repository / "docs").mkdir()
    shutil.copy(tiny.ROOT / "docs" / "add_a_paper.md", repository / "docs")
    before = {file: file.read_bytes() for file in repository.rglob("*") if file.is_file()}
    monkeypatch.setattr(paths, "writable", lambda folder: False)
    assert "cannot be written; work in a clone of your own" in said(capsys, 3, *words)
    assert before == {file: file.read_bytes() for file in repository.rglob("*") if file.is_file()}


def test_a_sweep_says_how_far_it_is(repository, capsys, monkeypatch):
    monkeypatch.setattr(batch, "execute", lambda *_, **__: DONE)
    monkeypatch.setattr(batch, "tabulate", lambda *_: None)
    assert cli.main(["sweep", "tiny", "shift=1,2,3"]) == 0
    assert "shift = 2 (2 of 3)\n" in capsys.readouterr().out


def test_a_run_that_is_too_small_for_verdicts_prints_no_counts(inside):
    assert batch.counts("tiny", paths.figures(), {})[1].startswith("2 measured (")
    assert batch.counts("tiny", paths.figures(), {"n_trials": 40}) == (
        {},
        "verdicts void: n_trials 40 of 400",
    )


def test_products_are_read_in_another_folder(inside, capsys):
    (inside / "figures").rename(inside / "elsewhere")
    assert "no products in" in said(capsys, 2, "cite")
    assert cli.main(["cite", "--figures", str(inside / "elsewhere")]) == 0
    assert "no products in" in said(capsys, 2, "cite"), "for one command only"


def enter(repository, text, folder="figures"):
    """Put a verdicts.csv into a folder of products."""
    (repository / folder / "tiny").mkdir(parents=True, exist_ok=True)
    (repository / folder / "tiny" / "verdicts.csv").write_text(text)


def test_score_writes_scorecard_and_table(repository, capsys):
    enter(repository, VERDICTS)
    paths.readme().write_text(
        "# Before\n\n<!-- papers -->\nold\n<!-- /papers -->\n"
        "<!-- scorecard -->\nold\n<!-- /scorecard -->\n\nAfter.\n"
    )
    assert cli.main(["score"]) == 0
    assert paths.readme().read_text() == f"# Before\n\n{TABLES}\nAfter.\n"
    card = (repository / "figures" / "scorecard.csv").read_text().splitlines()
    assert card[0].startswith("paper,id,item,")
    assert len(card) == 1 + 3
    assert capsys.readouterr().out == (repository / "figures" / "scorecard.md").read_text()
    assert cli.main(["score", "--check"]) == 0


def test_score_finds_a_missing_claim(repository, capsys):
    enter(repository, VERDICTS[: VERDICTS.index("price")])
    assert "do not match in price" in said(capsys, 1, "score")
    assert not (repository / "figures" / "scorecard.csv").exists()


def test_score_without_verdicts_says_how_to_make_them(repository, capsys):
    assert "tbdcore run tiny" in said(capsys, 1, "score")


def test_score_tells_a_changed_verdict_once(repository, capsys):
    enter(repository, VERDICTS)
    assert cli.main(["score"]) == 0
    capsys.readouterr()
    enter(
        repository,
        VERDICTS.replace("reproduced,,measured,\nprice", "differs,,measured,a slip\nprice"),
    )
    assert "tiny order was reproduced, is differs" in said(capsys, 1, "score")
    assert cli.main(["score"]) == 0


def test_check_writes_nothing_and_finds_what_is_stale(repository, capsys):
    enter(repository, VERDICTS)
    before = paths.readme().read_bytes()
    assert "README.md" in said(capsys, 1, "score", "--check")
    assert paths.readme().read_bytes() == before
    assert not (repository / "figures" / "scorecard.csv").exists()


def test_a_readme_without_markers_is_named(repository, capsys):
    enter(repository, VERDICTS)
    paths.readme().write_text("# Nothing\n")
    assert "<!-- /papers -->" in said(capsys, 2, "score")


def test_score_of_another_folder_leaves_the_readme_alone(repository, capsys):
    enter(repository, VERDICTS, "build/try")
    before = paths.readme().read_bytes()
    assert cli.main(["score", "--figures", str(repository / "build" / "try")]) == 0
    assert paths.readme().read_bytes() == before
    assert (repository / "build" / "try" / "scorecard.csv").is_file()


SEEDS = "# by hand\npaper,claim,seeds,reproduced,differs,depends,inconclusive,together,row\n"


def test_the_scorecard_has_the_share_of_the_seeds_and_counts_what_is_below_nine_tenths(
    repository, capsys
):
    enter(repository, VERDICTS)
    study = repository / "data" / "seeds.csv"
    row = claims.row_digest(claims.read("tiny")["order"])
    for of_ten, marked in ((9, 0), (8, 1)):
        study.write_text(f"{SEEDS}tiny,order,10,{of_ten},{10 - of_ten},0,0,differs,{row}\n")
        cli.main(["score"])
        card = pd.read_csv(repository / "figures" / "scorecard.csv").set_index("id")
        card = card[["seeds", "together"]]
        assert card.loc["order"].tolist() == [of_ten / 10, "differs"]
        assert card.drop("order").isna().all(axis=None), (
            "claims that the study has not are left open"
        )
        assert capsys.readouterr().out.splitlines()[-1].endswith(f"| {marked} |")


@pytest.mark.parametrize("damaged", ["", "<<<<<<< HEAD\n", SEEDS, SEEDS.replace("claim", "id")])
def test_a_damaged_study_of_the_seeds_is_named(repository, capsys, damaged):
    enter(repository, VERDICTS)
    (repository / "data" / "seeds.csv").write_text(damaged)
    wrong = said(capsys, 2, "score")
    assert "seeds.csv: no table of seeds; make it anew: python -m benchmarks.seeds" in wrong


def test_seeds_are_counted_by_claim_and_verdict():
    from benchmarks import seeds

    def table(**verdicts):
        return pd.DataFrame({"claim": verdicts.keys(), "verdict": verdicts.values()})

    one = pd.concat([table(b="differs", a="reproduced"), table(b="reproduced", a="reproduced")])
    counted = seeds.counts({"x": one, "y": table(a="inconclusive", used="used")})
    assert counted.to_numpy().tolist() == [
        ["x", "b", 2, 1, 1, 0, 0],
        ["x", "a", 2, 2, 0, 0, 0],
        ["y", "a", 1, 0, 0, 0, 1],
    ]
    assert list(counted) == ["paper", "claim", "seeds", *claims.JUDGED]


def test_seeds_together_are_one_longer_run():
    from benchmarks import seeds

    # 18 frames are printed, of a hundred runs: z is 2.4 with 100 trials of ours and 2.8 with 200
    columns = ["claim", "measured", "se", "n"]
    rows = [("t2.2.det", "21.8", "1.0", "100"), ("t2.2.det", "22.0", "1.0", "100")]
    rows += [("t2.order.det", "margin 1.0", "1.0", "100"), ("t2.3.det", "", "", "100")]
    for taken, verdict in ((slice(0, 1), "reproduced"), (slice(0, 4), "differs")):
        table = pd.DataFrame(rows[taken], columns=columns).assign(verdict="differs")
        found = seeds.together({"mda_tbd": table})
        assert found.to_numpy().tolist() == [["mda_tbd", "t2.2.det", verdict]]
    assert seeds.together({"mda_tbd": table.assign(verdict="depends")}).empty
