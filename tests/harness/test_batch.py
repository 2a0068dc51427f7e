"""Runs of a small notebook: what is said, skipped and removed (whole runs: system/test_runs.py)."""

import io
import json
import os
import re
import shutil
import subprocess
import sys
import types

import pandas as pd
import papermill
import pytest
import tiny
from jupyter_client.kernelspec import NoSuchKernel
from nbclient.exceptions import DeadKernelError

from tbdcore.repro import batch, claims, cli, paths

PIPES = {"capture_output": True, "text": True, "check": True}


def would_skip(*runs):
    """Whether the paper would be skipped by resumed runs with these parameters."""
    return [batch.done("tiny", values, paths.figures()) for values in runs]


def test_a_run_says_what_it_does(first_run):
    folder, said = first_run
    assert said.stderr == ""
    lines = said.stdout.splitlines()
    assert lines[:2] == ["tiny: running", "tiny: 2 measured (2 reproduced), 1 untestable"]
    assert re.fullmatch(rf"tiny: \d{{1,2}} s; products in {folder}/figures/tiny", lines[2])
    assert not list((folder / "build").glob("*.part*"))


def test_resume_skips_what_is_done(inside, capsys):
    made = tiny.products(inside)
    assert cli.main(["run", "--resume", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out) == {
        "paper": "tiny",
        "seconds": 0.0,
        "verdicts": {"measured: reproduced": 2, "untestable": 1},
        "folder": str(inside / "figures" / "tiny"),
        "notebook": str(inside / "build" / "01_tiny.ipynb"),
        "skipped": True,
        "status": 0,
        "error": "",
    }
    assert "skipped" in err
    assert tiny.products(inside) == made


def test_resume_goes_by_the_parameters_that_can_change_a_result(inside):
    assert would_skip({}, {"workers": 7}, {"shift": 2.0}) == [True, True, False]


@pytest.mark.parametrize("change", ["a product", "repro/trials", "repro/figures", "a version"])
def test_resume_does_not_skip_what_is_not_done(inside, change):
    about = inside / "figures" / "tiny" / "table1.json"
    if change == "a product":
        about.with_suffix(".tex").unlink()
    elif change != "a version":
        module = inside / "tbdcore" / f"{change}.py"
        module.write_text(
            module.read_text(encoding="utf-8") + "ON = print(end='')\n", encoding="utf-8"
        )
    else:
        about.write_text(about.read_text().replace('"numpy": "', '"numpy": "0'))
    assert would_skip({}) == [False]


def test_a_sweep_has_a_table_of_its_verdicts_and_one_of_their_shares(inside):
    places = {value: inside / "build" / f"shift={value}" for value in ("-1", "1", "2")}
    for value, place in places.items():
        file = shutil.copytree(inside / "figures" / "tiny", place / "tiny") / "verdicts.csv"
        if value == "-1":
            text = file.read_text()
            file.write_text(
                text.replace("reproduced,,measured,\nprice", "differs,,measured,\nprice")
            )
    batch.tabulate("tiny", "shift", places, inside / "build")
    every = pd.read_csv(inside / "build" / "shift.csv", dtype=str)
    assert list(every) == list(batch.TABLE)
    judged = every[every["claim"] == "order"]
    assert judged["value"].tolist() == ["-1", "1", "2"]
    assert judged["verdict"].tolist() == ["differs", "reproduced", "reproduced"]
    shares = pd.read_csv(inside / "build" / "shift_shares.csv").set_index("claim")
    assert list(shares) == ["evidence", "values", *claims.VERDICTS]
    assert shares["values"].tolist() == [3, 3, 3]
    assert shares.loc["order", ["reproduced", "differs"]].tolist() == [0.666667, 0.333333]
    assert shares.loc["price", "untestable"] == 1


def test_leftovers_of_processes_that_no_longer_exist_are_removed(inside):
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], **PIPES)
    pid, build, figures = int(ended.stdout), inside / "build", inside / "figures" / "tiny"
    (build / f"tmp.{pid}.part").mkdir()
    reused = build / f".old.{os.getpid()}.part"  # by another process that had this number
    left = [build / f"01_tiny.{pid}.part.ipynb", figures / f".fig1.png.{pid}.part", reused]
    kept = [
        build / f"01_tiny.{os.getpid()}.part.ipynb",
        build / "mine.part",
        build / "a.part.ipynb",
    ]
    for file in (*left, *kept):
        file.touch()
    os.utime(reused, (0, 0))
    names = sorted([f"tmp.{pid}.part", *(file.name for file in left)])
    said = []
    batch.execute("tiny", {}, build / "01_tiny.ipynb", say=said.append, resume=True)
    assert said[0] == f"tiny: removed what a killed run had left: {', '.join(names)}"
    assert not any(file.exists() for file in left)
    assert all(file.exists() for file in kept)
    assert not (build / f"tmp.{pid}.part").exists()


def test_debug_shows_where_a_run_failed(tmp_path, capsys):
    trace = "Traceback\n  ...\nValueError: bad\n"
    (tmp_path / "log").touch()
    (tmp_path / "outcome").write_text(json.dumps(["tiny: bad", trace]))
    with pytest.raises(RuntimeError, match="^tiny: bad$"):
        batch._raise_failure("tiny", 1, tmp_path, debug=True)
    assert capsys.readouterr().err == trace


@pytest.mark.slow
def test_a_notebook_imports_from_where_the_command_does(repository, monkeypatch):
    """Also when that is the current folder, which ipykernel takes from the front of the path."""
    cell = "import json, sys\nwith open('path', 'w') as file:\n    json.dump(sys.path, file)"
    tiny.change(
        repository, begin=cell, trials=None, claims=None, figure=None, table=None, publish=""
    )
    monkeypatch.setenv("PYTHONPATH", str(repository))
    batch._execute("tiny", {"out": "build/try"}, paths.build() / "01_tiny.ipynb", False)
    assert str(repository) in json.loads((repository / "path").read_text())


CHILD = [
    (NoSuchKernel("python3"), 3, "there is no Jupyter kernel python3; tbdcore doctor says how"),
    (OSError("no space left"), 3, "no space left"),
    (DeadKernelError("gone"), 1, "tiny: the kernel died; run it again"),
    (KeyError("odd"), 1, "tiny: KeyError: 'odd'"),
]


@pytest.mark.parametrize(("error", "code", "said"), CHILD)
def test_a_child_process_reports_how_it_failed(inside, tmp_path, monkeypatch, error, code, said):
    """By its exit code, and in a file; a fault of the environment is an OSError."""

    def failing(*_, **__):
        raise error

    monkeypatch.setattr(papermill, "execute_notebook", failing)
    monkeypatch.setattr(batch.processes, "end_with_parent", lambda parent: None)
    monkeypatch.setattr(batch.logging, "disable", lambda: None)
    monkeypatch.setattr(sys, "stderr", sys.stderr)  # which the child replaces
    with pytest.raises(SystemExit) as ended:
        batch._main("tiny", {}, str(tmp_path / "tiny.ipynb"), str(tmp_path), os.getppid())
    assert ended.value.code == code
    told, trace = json.loads((tmp_path / "outcome").read_text())
    assert told == said
    assert type(error).__name__ in trace
    (tmp_path / "log").touch()
    with pytest.raises(OSError if code == 3 else RuntimeError, match=f"^{re.escape(said)}$"):
        batch._raise_failure("tiny", code, tmp_path, debug=False)


def test_a_terminal_shows_how_long_a_run_has_taken(inside, monkeypatch):
    times, terminal = iter([100.0, 103.4]), io.StringIO()
    terminal.isatty = lambda: True
    monkeypatch.setattr(batch, "time", types.SimpleNamespace(monotonic=lambda: next(times)))
    monkeypatch.setattr(batch.processes, "call", lambda words, environment, log, tick, came: tick())
    monkeypatch.setattr(batch, "_raise_failure", lambda *report: None)
    monkeypatch.setattr(batch.sys, "stderr", terminal)
    batch._execute("tiny", {"out": "build/try"}, paths.build() / "01_tiny.ipynb", False)
    assert terminal.getvalue() == "\rtiny: 3 s\033[K\r"
