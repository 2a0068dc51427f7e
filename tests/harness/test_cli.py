"""The command line: exit codes, errors of one line, and the scorecard."""

import subprocess
import sys

import pytest
import tiny

from tbdcore.repro import cli, paths

VERDICTS = """id,item,quantity,published,measured,se,n,verdict,cause
mean,Table 1,mean of the draws,0.0,0.01,0.05,400,reproduced,
order,text,shifted draws are larger,larger,margin 1.00,0.05,400,reproduced,
price,text,price,cheap,,,,untestable,An opinion.
"""
TABLE = """<!-- scorecard -->
| paper | notebook | reproduced | the rest | run time |
| --- | --- | --- | --- | --- |
| Means (the tiny paper) | [01_tiny](notebooks/01_tiny.ipynb) | 2 of 3 | 1 untestable |  |
<!-- /scorecard -->
"""


def said(capsys, code, *words):
    """The single line that a command complained in, with its exit code checked."""
    assert cli.main([str(word) for word in words]) == code
    out, err = capsys.readouterr()
    assert err.count("\n") == 1, err
    assert err.startswith("tbdcore: ")
    assert "Traceback" not in out + err
    return err


USAGE = {
    "no command": ([], "required: command"),
    "unknown command": (["rum"], "invalid choice: 'rum'"),
    "unknown option": (["run", "--fast"], "--fast"),
    "unknown paper": (["run", "tinny"], "the nearest is 'tiny'"),
    "unknown parameter": (["run", "tiny", "-p", "n_trails=5"], "the nearest is 'n_trials'"),
    "no value": (["run", "tiny", "-p", "n_trials"], "write -p name=value"),
    "wrong type": (["run", "tiny", "-p", "n_trials=many"], "'many' is str; give int"),
    "fraction of a trial": (["run", "tiny", "-p", "n_trials=2.5"], "2.5 is float; give int"),
    "zero trials": (["run", "tiny", "-p", "n_trials=0"], "0 is out of range"),
    "out of range": (["run", "tiny", "-p", "pause=61"], "in [0, 60]"),
    "code for a value": (
        ["run", "tiny", "-p", "n_trials=__import__('os').getpid()"],
        "is str; give int",
    ),
    "negative workers": (["run", "tiny", "--workers", "-1"], "workers"),
    "workers no number": (["run", "tiny", "--workers", "two"], "invalid int value: 'two'"),
    "in place, not the default": (["run", "tiny", "--in-place", "-p", "shift=2"], "drop -p"),
    "resumed in place": (["run", "--resume", "--in-place"], "drop"),
    "sweep without values": (["sweep", "tiny", "shift"], "name=v1,v2"),
    "sweep of an unknown parameter": (["sweep", "tiny", "shif=1"], "the nearest is 'shift'"),
    "sweep out of range": (["sweep", "tiny", "shift=1,9"], "out of range"),
    "sweep of no parameter of the result": (
        ["sweep", "tiny", "workers=1,2"],
        "cannot change a result",
    ),
    "sweep of an unknown paper": (["sweep", "tini", "shift=1,2"], "the nearest is 'tiny'"),
    "two forms of a citation": (
        ["cite", "tiny/fig1", "--latex", "--bibtex"],
        "not allowed with argument",
    ),
}


@pytest.mark.parametrize(("words", "message"), USAGE.values(), ids=USAGE)
def test_bad_usage_is_one_line_and_code_2(repository, capsys, words, message):
    assert message in said(capsys, 2, *words)
    assert not (repository / "build").exists() or not list(
        (repository / "build").rglob("*.ipynb")
    ), "nothing was started"


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


@pytest.mark.parametrize("words", [["score"], ["run", "tiny"], ["sweep", "tiny", "shift=1,2"]])
def test_a_spoilt_claims_file_is_named_before_anything_starts(repository, capsys, words):
    (paths.CLAIMS / "tiny.csv").write_text(tiny.CLAIMS.replace("\n", "\r\n"))
    enter(repository, VERDICTS)
    assert "tiny.csv, row" in said(capsys, 2, *words)


def test_a_missing_claims_file_is_named_before_anything_starts(repository, capsys):
    (paths.CLAIMS / "tiny.csv").unlink()
    assert "tiny.csv: no claims file" in said(capsys, 2, "run", "tiny")


def test_an_empty_table_of_verdicts_is_named(repository, capsys):
    enter(repository, "")
    assert "verdicts.csv: no table of verdicts" in said(capsys, 1, "score")


@pytest.mark.parametrize("words", [["--quick"], ["-p", "shift=2"]])
def test_the_figures_are_for_default_parameters_by_any_name(repository, capsys, words):
    out = f"{repository}/data/../figures"
    assert "figures are for default parameters" in said(
        capsys, 2, "run", "tiny", *words, "--out", out
    )


@pytest.mark.parametrize(
    ("file", "text", "code", "words", "message"),
    [
        (
            "figures/tiny/verdicts.csv",
            VERDICTS.replace(",", ";"),
            1,
            ["score"],
            "verdicts.csv: its columns are",
        ),
        ("figures/scorecard.csv", "<<<<<<< HEAD\n", 2, ["score"], "scorecard.csv: no scorecard"),
        ("CITATION.cff", "authors: [", 2, ["score"], "CITATION.cff: no authors"),
        (
            "notebooks/01_tiny.ipynb",
            "<<<<<<< HEAD\n",
            2,
            ["run", "tiny"],
            "01_tiny.ipynb: no notebook",
        ),
        ("figures/tiny/fig1.json", "{}", 2, ["cite", "tiny/fig1"], "fig1.json: damaged"),
    ],
    ids=["verdicts", "scorecard", "citation", "notebook", "record"],
)
def test_a_damaged_file_is_named(repository, capsys, file, text, code, words, message):
    enter(repository, VERDICTS)
    (repository / file).write_text(text)
    assert message in said(capsys, code, *words)


def test_the_default_folder_is_tried_before_anything_starts(repository, capsys, monkeypatch):
    monkeypatch.setenv("TBDCORE_FIGURES", "/proc/no/such")
    assert "output folder /proc/no/such" in said(capsys, 2, "run", "tiny")


def test_a_missing_package_is_the_environments_fault(repository, capsys, monkeypatch):
    def missing(arguments):
        raise ModuleNotFoundError("No module named 'papermill'", name="papermill")

    monkeypatch.setattr(cli, "_run", missing)
    assert "papermill" in said(capsys, 3, "run")


def test_help_is_no_error(capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["run", "--help"])
    assert caught.value.code == 0
    assert "--quick" in capsys.readouterr().out


def enter(repository, text, folder="figures"):
    """Put a verdicts.csv into a folder of products."""
    (repository / folder / "tiny").mkdir(parents=True, exist_ok=True)
    (repository / folder / "tiny" / "verdicts.csv").write_text(text)


def test_score_writes_scorecard_and_table(repository, capsys):
    enter(repository, VERDICTS)
    paths.README.write_text("# Before\n\n<!-- scorecard -->\nold\n<!-- /scorecard -->\n\nAfter.\n")
    assert cli.main(["score"]) == 0
    assert paths.README.read_text() == f"# Before\n\n{TABLE}\nAfter.\n"
    card = (repository / "figures" / "scorecard.csv").read_text().splitlines()
    assert card[0].startswith("paper,id,item,")
    assert len(card) == 1 + 3
    assert capsys.readouterr().out == (repository / "figures" / "scorecard.md").read_text()
    assert cli.main(["score", "--check"]) == 0


def test_score_finds_a_missing_claim(repository, capsys):
    enter(repository, VERDICTS.replace("price,text,price,cheap,,,,untestable,An opinion.\n", ""))
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
        VERDICTS.replace("0.05,400,reproduced,\nprice", "0.05,400,differs,a slip\nprice"),
    )
    assert "tiny order was reproduced, is differs" in said(capsys, 1, "score")
    assert cli.main(["score"]) == 0


def test_check_writes_nothing_and_finds_what_is_stale(repository, capsys):
    enter(repository, VERDICTS)
    before = paths.README.read_bytes()
    assert "README.md" in said(capsys, 1, "score", "--check")
    assert paths.README.read_bytes() == before
    assert not (repository / "figures" / "scorecard.csv").exists()


def test_a_readme_without_markers_is_named(repository, capsys):
    enter(repository, VERDICTS)
    paths.README.write_text("# Nothing\n")
    assert "<!-- /scorecard -->" in said(capsys, 2, "score")


def test_score_of_another_folder_leaves_the_readme_alone(repository, capsys):
    enter(repository, VERDICTS, "build/try")
    before = paths.README.read_bytes()
    assert cli.main(["score", "--figures", str(repository / "build" / "try")]) == 0
    assert paths.README.read_bytes() == before
    assert (repository / "build" / "try" / "scorecard.csv").is_file()


def test_plain_papermill_refuses_a_misspelt_parameter(repository):
    """Papermill itself would run it with the default and report success; the notebook's own first
    call does not.
    """
    (repository / "build").mkdir()
    words = [
        "papermill",
        "notebooks/01_tiny.ipynb",
        "build/try.ipynb",
        "-k",
        "python3",
        "-p",
        "n_trails",
        "5",
        "-p",
        "out",
        "build/try",
    ]
    run = subprocess.run(
        [sys.executable, "-m", *words],
        cwd=repository,
        env=tiny.environment(repository),
        capture_output=True,
        text=True,
    )
    assert run.returncode != 0
    assert "the nearest is 'n_trials'" in run.stderr
    assert not (repository / "build" / "try" / "tiny").exists()
