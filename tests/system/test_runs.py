"""Whole runs of a small notebook: what they leave, say and never touch."""

import base64
import csv
import json
import re
import shutil
import subprocess
import sys

import pytest
import tiny

from tbdcore.repro import batch, claims, cli, screen


def test_a_second_run_gives_the_same_bytes_and_a_clean_notebook(folder):
    """With another number of workers."""
    made = tiny.products(folder)
    assert len(made) == 10
    again = tiny.run(folder, "run", "tiny", "--in-place", "--workers", "2")
    assert again.returncode == 0, again.stderr
    assert {file: content for file, (content, _) in tiny.products(folder).items()} == {
        file: content for file, (content, _) in made.items()
    }
    text = (folder / "notebooks" / "01_tiny.ipynb").read_text(encoding="utf-8")
    assert [cell["execution_count"] for cell in json.loads(text)["cells"]] == list(range(1, 9))
    assert "papermill" not in text
    assert text.endswith("}\n")


def test_quick_never_touches_the_figures(folder):
    made = tiny.products(folder)
    quick = tiny.run(folder, "run", "--quick", "--resume")
    assert quick.returncode == 0, quick.stderr
    assert "verdicts void: n_trials 40 of 400\n" in quick.stdout
    assert tiny.products(folder) == made
    about = json.loads((folder / "build" / "quick" / "tiny" / "fig1.json").read_text())
    assert about["trials"] == 40


def test_other_parameters_never_touch_the_figures(folder):
    made = tiny.products(folder)
    assert tiny.run(folder, "run", "-p", "n_trials=1e2").returncode == 0
    assert tiny.products(folder) == made
    about = json.loads((folder / "build" / "run" / "tiny" / "fig1.json").read_text())
    assert about["trials"] == 100


def test_the_callers_folder_encoding_and_a_closed_clone_change_nothing(folder, tmp_path):
    """Files named as modules where the command is given, output that knows no letter but ASCII,
    and build/ that cannot be written.
    """
    caller = tmp_path / "caller"
    caller.mkdir()
    for name in ("signal", "random", "queue", "numba"):
        (caller / f"{name}.py").write_text("raise SystemExit('of the caller')")
    cell = tiny.CELLS["trials"] + "\nimport numba, queue, random\nprint('σ')"
    tiny.change(folder, trials=cell)
    papers = folder / "data" / "papers.toml"
    papers.write_text(papers.read_text().replace("Means", "μ"))
    shutil.rmtree(folder / "build")
    (folder / "build").touch()
    options = {"env": tiny.environment(folder) | {"PYTHONIOENCODING": "ascii"}, "cwd": caller}
    options |= {"capture_output": True, "text": True}
    ran = subprocess.run(tiny.command("run", "--workers", "2", "--out", "try"), **options)
    assert (ran.returncode, ran.stderr) == (0, "")
    said = f"{folder}/build cannot be written; executed notebooks go to {caller}/try/build"
    assert ran.stdout.splitlines()[0] == said
    assert f"; products in {caller}/try/tiny\n" in ran.stdout
    assert (caller / "try" / "build" / "01_tiny.ipynb").is_file()
    assert len(list((caller / "try" / "tiny").iterdir())) == 10
    listed = subprocess.run(tiny.command("list"), **options)
    assert (listed.returncode, listed.stdout) == (0, "tiny        01_tiny.ipynb         \\u03bc\n")


RC = "lines.linewidth: 7\nfont.family: serif\nsavefig.dpi: 30\naxes.grid: False\nbackend: pdf\n"
STARTUP = """import matplotlib, numpy, tbdcore.repro.figures as figures
matplotlib.rcParams["lines.linewidth"] = figures.STYLE["lines.linewidth"] = 9
numpy.random.Generator = None
"""


def test_a_matplotlibrc_and_startup_files_of_the_user_change_no_product(folder, tmp_path):
    made, home = tiny.products(folder), tmp_path / "home"
    startup = home / ".ipython" / "profile_default" / "startup"
    startup.mkdir(parents=True)
    (startup / "00-mine.py").write_text(STARTUP)
    (startup.parent / "ipython_config.py").write_text(
        "c.InteractiveShellApp.exec_lines = ['1 / 0', 'import os; os._exit(9)']\n"
    )
    for place in (home / ".config" / "matplotlib", home / ".matplotlib", folder):
        place.mkdir(parents=True, exist_ok=True)
        (place / "matplotlibrc").write_text(RC)
    own = {"HOME": str(home), "IPYTHONDIR": str(home / ".ipython")}
    own |= {"MATPLOTLIBRC": str(folder / "matplotlibrc"), "XDG_CONFIG_HOME": str(home / ".config")}
    options = {"cwd": folder, "env": tiny.environment(folder) | own}
    words = tiny.command("run", "tiny", "--workers", "2")
    ran = subprocess.run(words, capture_output=True, text=True, **options)
    assert ran.returncode == 0, ran.stderr
    again = tiny.products(folder)
    assert {name: content for name, (content, _) in again.items()} == {
        name: content for name, (content, _) in made.items()
    }
    assert all(again[name][1] > made[name][1] for name in made)


def failing(folder, *words, **cells):
    """What a run with some other cells says when it fails; the products are untouched."""
    made = tiny.products(folder)
    tiny.change(folder, **cells)
    failed = tiny.run(folder, "run", *words)
    assert failed.returncode == 1
    assert failed.stderr.splitlines()[-1].startswith("tbdcore: tiny")
    assert "Traceback" not in failed.stdout + failed.stderr
    assert tiny.products(folder) == made
    assert not [file for file in folder.rglob("*.part*") if file.is_file()]
    return failed


def test_a_run_that_fails_in_its_last_cell_leaves_the_figures(folder):
    failed = failing(
        folder, "--json", publish="ledger.verdicts.popitem()\nportfolio.publish(ledger)"
    )
    told = json.loads(failed.stdout)
    assert told["status"] == 1
    assert 0 < told["seconds"] < 99
    assert "tiny, cell 8: ValueError: tiny: no verdict on 1 of 3 claims: price" in told["error"]
    assert told["error"] in failed.stderr
    left = folder / "build" / "01_tiny.failed.ipynb"
    assert told["notebook"] == str(left)
    assert left.is_file()
    assert [line.partition(":")[0] for line in failed.stderr.splitlines()] == ["tiny", "tbdcore"]


def test_a_kernel_that_dies_is_one_line_with_its_last_words(folder):
    cell = "import os\nos.write(2, b'out of paper\\n')\nos.kill(os.getpid(), 9)"
    failed = failing(folder, trials=cell)
    assert "tiny: the kernel died: out of paper; run it again" in failed.stderr
    assert failed.stderr.count("\n") == 1


def test_what_is_no_longer_made_is_removed(folder):
    """And the notebook that an earlier run left when it failed; other files stay."""
    other = folder / "figures" / "tiny" / "notes.txt"
    other.write_text("mine")
    other.with_name("fig1.tex").write_text("of a figure that was a table once")
    left = folder / "build" / "01_tiny.failed.ipynb"
    left.write_text("of an earlier run")
    tiny.change(folder, table=None)
    assert tiny.run(folder, "run").returncode == 0
    names = {file.name for file in (folder / "figures" / "tiny").iterdir()}
    assert names == {
        "notes.txt",
        "verdicts.csv",
        *(f"fig1.{kind}" for kind in ("pdf", "svg", "png", "csv", "json")),
    }
    assert not left.exists()


def table(file):
    return list(csv.DictReader(file.read_text().splitlines()))


def test_sweep_makes_tidy_tables_and_goes_on_after_an_interruption(inside, monkeypatch, capsys):
    """The second value is interrupted in the middle; what is finished is not repeated."""
    made, execute, executed = tiny.products(inside), batch._execute, []

    def interrupted(paper, values, *rest):
        executed.append(values["shift"])
        if len(executed) == 2:
            raise KeyboardInterrupt
        execute(paper, values, *rest)

    monkeypatch.setattr(batch, "_execute", interrupted)
    words = ["sweep", "tiny", "shift=-2,2", "-p", "n_trials=100", "--resume", "--json"]
    place = inside / "build" / "sweep" / "tiny"
    assert cli.main(words) == 130
    assert {row["value"] for row in table(place / "shift.csv")} == {"-2"}
    assert cli.main(words) == 0
    assert executed == [-2.0, 2.0, 2.0]
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [one["status"] for one in told] == [0, 130, 0, 0]
    rows = table(place / "shift.csv")
    assert list(rows[0]) == list(batch.TABLE)
    judged = [(row["value"], row["verdict"]) for row in rows if row["claim"] == "order"]
    assert judged == [("-2", "differs"), ("2", "reproduced")]
    share = {row.pop("claim"): row for row in table(place / "shift_shares.csv")}
    assert list(share) == ["mean", "order", "price"]
    shares = {"reproduced": "0.5", "differs": "0.5"} | dict.fromkeys(claims.VERDICTS[2:], "0")
    assert share["order"] == {"evidence": "measured", "values": "2"} | shares
    assert share["price"]["untestable"] == "1"
    assert (place / "shift=-2" / "tiny" / "fig1.pdf").is_file()
    assert (place / "shift=-2" / "01_tiny.ipynb").is_file()
    assert tiny.products(inside) == made


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


SCREEN = """from tbdcore.repro import screen

screen.outcome("tiny", {"the mean": "mean"})"""
FIGURE = 'screen.exhibit("tiny/fig1")'


def first_screen(folder):
    """What the committed notebook of a small repository shows above its parameters, as text."""
    cells = json.loads((folder / "notebooks" / "01_tiny.ipynb").read_text("utf-8"))["cells"]
    assert {output["output_type"] for output in cells[-1]["outputs"]} == {"stream"}
    outputs = [output["data"] for cell in cells[:2] for output in cell["outputs"]]
    texts = ["".join(data.get("text/markdown", "")) for data in outputs]
    return "\n".join(texts), [data["image/png"] for data in outputs if "image/png" in data]


def test_one_default_run_shows_its_own_results_on_the_first_screen(repository):
    """Before it there are none, and later one has other results."""
    cells = {"screen": SCREEN, "picture": FIGURE} | tiny.CELLS
    notebook = repository / "notebooks" / "01_tiny.ipynb"
    notebook.write_text(tiny.notebook(cells), encoding="utf-8")
    run = tiny.run(repository, "run", "tiny", "--in-place")
    assert run.returncode == 0, run.stderr
    text, (picture,) = first_screen(repository)
    assert re.search(r"\| the mean \| 0\.0 \| -?0\.\d+ ± 0\.0\d+ \| reproduced \|", text)
    assert "seed 20, 400 trials" in text
    assert "*tiny/fig1.* Nine draws, 100 % of them." in text
    png = (repository / "figures" / "tiny" / "fig1.png").read_bytes()
    assert base64.b64decode(picture) == png
    changed = {"seed: int = 20": "seed: int = 21", "Nine draws": "Ten draws"}
    cells = {name: replaced(cell, changed) for name, cell in cells.items()}
    notebook.write_text(tiny.notebook(cells), encoding="utf-8")
    assert tiny.run(repository, "run", "tiny", "--in-place").returncode == 0
    text, (other,) = first_screen(repository)
    assert "seed 21, 400 trials" in text
    assert "*tiny/fig1.* Ten draws, 100 % of them." in text
    assert picture != other
    committed = notebook.read_bytes()
    assert tiny.run(repository, "run", "tiny", "--quick").returncode == 0
    assert notebook.read_bytes() == committed


def test_a_run_into_another_folder_leaves_the_first_screen_as_it_is(repository):
    cells = {"screen": SCREEN, "picture": FIGURE} | tiny.CELLS
    notebook = repository / "notebooks" / "01_tiny.ipynb"
    notebook.write_text(tiny.notebook(cells), encoding="utf-8")
    assert tiny.run(repository, "run", "tiny", "--out", "elsewhere").returncode == 0
    executed = (repository / "build" / "01_tiny.ipynb").read_text("utf-8")
    assert "*Not yet run.*" in executed
    assert "Default run" not in executed


def replaced(text, words):
    for old, new in words.items():
        text = text.replace(old, new)
    return text


def test_a_row_of_the_first_screen_needs_its_claim(tmp_path, monkeypatch):
    tiny.here(tmp_path, monkeypatch)()
    with pytest.raises(ValueError, match="no claim 'men' for the first screen"):
        screen.outcome("tiny", {"the mean": "men"})
