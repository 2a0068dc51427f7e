"""Runs of a small notebook: what is said, skipped, counted, swept, and left behind after a Ctrl-C."""

import csv
import json
import shutil
import signal
import subprocess
import sys
import time
from functools import partial

import psutil
import pytest
import tiny


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The small repository after its first run, and what that run said."""
    folder = tmp_path_factory.mktemp("ran") / "repository"
    folder.mkdir()
    return folder, tiny.repository(folder)("run")


@pytest.fixture
def folder(ran, tmp_path):
    """A copy of it."""
    return shutil.copytree(ran[0], tmp_path / "repository", symlinks=True)


@pytest.fixture
def tbdcore(folder):
    return lambda *words: subprocess.run(
        tiny.command(*words),
        cwd=folder,
        env=tiny.environment(folder),
        capture_output=True,
        text=True,
    )


def products(folder):
    """Every file under figures/ and its time."""
    return {file: file.stat().st_mtime_ns for file in sorted((folder / "figures").rglob("*"))}


def would_skip(folder, *runs):
    """Whether the paper would be skipped by resumed runs with these parameters."""
    code = f"from tbdcore.repro import batch, paths; print([batch.done('tiny', values, paths.figures()) for values in {runs}])"
    said = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=tiny.environment(folder),
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(said.stdout.lower())


def test_run_says_what_it_does_and_what_to_expect_the_next_time(ran, folder, tbdcore):
    _, first = ran
    assert (first.returncode, first.stderr) == (0, "")
    assert first.stdout.startswith("tiny: running\ntiny: 3 claims (2 reproduced, 1 untestable); ")
    again = tbdcore("run")
    assert " s the last time\n" in again.stdout
    assert ", expected " in again.stdout
    assert not list((folder / "build").glob("*.part*"))


def test_resume_skips_what_is_done(tbdcore, folder):
    made = products(folder)
    skipped = tbdcore("run", "--resume", "--json")
    assert json.loads(skipped.stdout) == {
        "paper": "tiny",
        "seconds": 0.0,
        "verdicts": {"reproduced": 2, "untestable": 1},
        "folder": str(folder / "figures" / "tiny"),
        "notebook": str(folder / "build" / "01_tiny.ipynb"),
        "skipped": True,
        "status": 0,
        "error": "",
    }
    assert "skipped" in skipped.stderr
    assert products(folder) == made


def test_resume_goes_by_the_parameters_that_can_change_a_result(folder):
    assert would_skip(folder, {}, {"workers": 7}, {"shift": 2.0}) == [True, True, False]


@pytest.mark.parametrize(
    "change", ["a product", "repro/trials", "repro/figures", "repro/pages", "__init__", "a version"]
)
def test_resume_does_not_skip_what_is_not_done(folder, change):
    about = folder / "figures" / "tiny" / "table1.json"
    if change == "a product":
        about.with_suffix(".tex").unlink()
    elif change != "a version":
        module = folder / "tbdcore" / f"{change}.py"
        module.write_text(module.read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
    else:
        about.write_text(about.read_text().replace('"numpy": "', '"numpy": "0'))
    assert would_skip(folder, {}) == [False]


def test_a_failing_run_is_one_line_and_leaves_the_products(tbdcore, folder):
    made = products(folder)
    cells = tiny.CELLS | {"table": "1 / 0"}
    (folder / "notebooks" / "01_tiny.ipynb").write_text(tiny.notebook(cells), encoding="utf-8")
    failed = tbdcore("run", "tiny", "--json")
    assert failed.returncode == 1
    assert json.loads(failed.stdout)["status"] == 1
    assert "ZeroDivisionError" in json.loads(failed.stdout)["error"]
    left = folder / "build" / "01_tiny.failed.ipynb"
    assert json.loads(failed.stdout)["notebook"] == str(left)
    assert left.is_file()
    assert [line.partition(":")[0] for line in failed.stderr.splitlines()] == ["tiny", "tbdcore"]
    assert products(folder) == made
    (folder / "notebooks" / "01_tiny.ipynb").write_text(tiny.notebook(tiny.CELLS), encoding="utf-8")
    assert (
        tbdcore("run", "tiny", "--quick", "--resume").returncode
        == tbdcore("run", "tiny").returncode
        == 0
    )
    assert not left.exists()


def test_a_product_that_is_no_longer_made_is_removed(tbdcore, folder):
    other = folder / "figures" / "tiny" / "notes.txt"
    other.write_text("mine")
    other.with_name("fig1.tex").write_text("of a figure that was a table once")
    cells = {name: source for name, source in tiny.CELLS.items() if name != "table"}
    (folder / "notebooks" / "01_tiny.ipynb").write_text(tiny.notebook(cells), encoding="utf-8")
    assert tbdcore("run").returncode == 0
    names = {file.name for file in (folder / "figures" / "tiny").iterdir()}
    assert names == {
        "notes.txt",
        "verdicts.csv",
        *(f"fig1.{kind}" for kind in ("pdf", "svg", "png", "csv", "json")),
    }


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_leaves_no_process_and_no_half_written_file(tbdcore, folder, sent):
    made = products(folder)
    words = ["run", "tiny", "--workers", "2", "-p", "pause=2", "--out", "build/slow"]
    listening = partial(
        signal.signal, signal.SIGINT, signal.SIG_DFL
    )  # a runner in the background hands down a deaf ear
    options = {
        "cwd": folder,
        "env": tiny.environment(folder),
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
    }
    run = subprocess.Popen(tiny.command(*words), preexec_fn=listening, text=True, **options)
    own, seen, deadline = psutil.Process(run.pid), set(), time.monotonic() + 60
    while (
        sum("popen_loky" in " ".join(process.cmdline()) for process in seen) < 2
        and time.monotonic() < deadline
    ):
        time.sleep(0.2)
        seen = set(own.children(recursive=True))
    assert len(seen) >= 3, "a kernel and two workers"
    time.sleep(1)
    run.send_signal(sent)
    out, err = run.communicate(timeout=60)
    assert (run.returncode, err) == (
        130,
        "tbdcore: interrupted; finished papers are kept, nothing is half written\n",
    )
    assert not [process for process in seen if process.is_running()]
    assert products(folder) == made
    assert not [
        file
        for file in (folder / "build").rglob("*")
        if ".part" in file.name or file.parent.name == "tiny"
    ]


def test_sweep_is_one_tidy_table(tbdcore, folder):
    made = products(folder)
    swept = tbdcore("sweep", "tiny", "shift=-2,2", "-p", "n_trials=100", "--json")
    assert swept.returncode == 0, swept.stderr
    assert [json.loads(line)["status"] for line in swept.stdout.splitlines()] == [0, 0]
    place = folder / "build" / "sweep" / "tiny"
    rows = list(csv.DictReader((place / "shift.csv").read_text().splitlines()))
    assert list(rows[0]) == ["value", "claim", "published", "measured", "se", "n", "verdict"]
    assert [row["value"] for row in rows if row["claim"] == "order"] == ["-2", "2"]
    assert [row["verdict"] for row in rows if row["claim"] == "order"] == ["differs", "reproduced"]
    assert (place / "shift=-2" / "tiny" / "fig1.pdf").is_file()
    assert (place / "shift=-2" / "01_tiny.ipynb").is_file()
    assert products(folder) == made


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sweep", "tiny", "shift"), "name=v1,v2"),
        (("sweep", "tiny", "shif=1"), "the nearest is 'shift'"),
        (("sweep", "tiny", "shift=1,9"), "out of range"),
        (("sweep", "tiny", "workers=1,2"), "cannot change a result"),
        (("sweep", "tini", "shift=1,2"), "the nearest is 'tiny'"),
        (("run", "--resume", "--in-place"), "drop"),
    ],
)
def test_bad_usage_is_refused_in_one_line_before_anything_runs(tbdcore, folder, words, said):
    refused = tbdcore(*words)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr.count("\n") == 1
    assert said in refused.stderr
