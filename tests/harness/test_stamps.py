"""Stamps are renewed without a new number: an innocent change is taken, any other is refused."""

import json
import shutil
import types

import pytest
import tiny

from benchmarks import readings
from tbdcore.repro import claims, stamps

INNOCENT = {"trials": tiny.CELLS["trials"].replace("x = ", "draws = 1\nx = ")}


def digests(folder):
    return {
        file.name: json.loads(file.read_text())["digest"]
        for file in (folder / "figures" / "tiny").glob("*.json")
    }


def without_digests(folder):
    made = {name: content for name, (content, _) in tiny.products(folder).items()}
    return {
        name: json.loads(content) | {"digest": ""} if name.endswith(".json") else content
        for name, content in made.items()
    }


@pytest.fixture(scope="module")
def executed(first_run, tmp_path_factory):
    """The small repository with its notebook as it is committed, executed."""
    folder = tmp_path_factory.mktemp("stamps") / "repository"
    shutil.copytree(first_run[0], folder, symlinks=True)
    assert tiny.run(folder, "run", "tiny", "--in-place").returncode == 0
    return folder


@pytest.fixture
def folder(executed, tmp_path):
    return shutil.copytree(executed, tmp_path / "repository", symlinks=True)


def rewrite(folder, cells):
    """Change cells of the executed notebook; what they showed stays."""
    file = folder / "notebooks" / "01_tiny.ipynb"
    notebook = json.loads(file.read_text(encoding="utf-8"))
    for cell in [*notebook["cells"]]:
        (name,) = cell["metadata"]["tags"]
        if name in cells and cells[name] is None:
            notebook["cells"].remove(cell)
        elif name in cells:
            cell["source"] = cells[name]
    file.write_text(json.dumps(notebook), encoding="utf-8")


@pytest.mark.slow
def test_an_innocent_change_gets_new_digests_and_nothing_else(folder):
    before, made = digests(folder), without_digests(folder)
    rewrite(folder, INNOCENT)
    notebook = (folder / "notebooks" / "01_tiny.ipynb").read_bytes()
    ran = tiny.run(folder, "stamp", "tiny")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert ran.stdout.endswith("tiny: 2 stamps renewed\n")
    after = digests(folder)
    assert all(after[name] != before[name] for name in before)
    assert without_digests(folder) == made
    assert (folder / "notebooks" / "01_tiny.ipynb").read_bytes() == notebook
    times = tiny.products(folder)
    again = tiny.run(folder, "stamp")
    assert (again.returncode, again.stdout) == (0, "tiny: as they are\n")
    assert tiny.products(folder) == times
    assert "skipped" in tiny.run(folder, "run", "--resume").stdout


@pytest.mark.slow
def test_a_change_of_a_number_is_refused(folder):
    rewrite(folder, {"trials": tiny.CELLS["trials"] + " * 1.001"})
    made = tiny.products(folder)
    ran = tiny.run(folder, "stamp", "tiny")
    assert ran.returncode == 1
    (line,) = ran.stderr.splitlines()
    assert line.startswith("tbdcore: tiny: ")
    assert "no stamp is renewed" in line
    assert tiny.products(folder) == made


def changed(file, old, new):
    file.write_bytes(file.read_bytes().replace(old, new, 1))


def warn(file):
    """Let the last cell of an executed notebook say something on standard error."""
    notebook = json.loads(file.read_text(encoding="utf-8"))
    said = {"output_type": "stream", "name": "stderr", "text": ["slow\n", "because\n"]}
    notebook["cells"][-1]["outputs"].append(said)
    file.write_text(json.dumps(notebook), encoding="utf-8")


OTHER = {  # what a run makes otherwise, and what is named
    "fig1.csv": lambda made, shown: changed(made / "fig1.csv", b"proposed", b"traditional"),
    "fig1.png": lambda made, shown: changed(made / "fig1.png", b"IDAT", b"iDAT"),
    "fig1.json": lambda made, shown: changed(made / "fig1.json", b"Nine", b"Ten"),
    "table1.json": lambda made, shown: changed(
        made / "table1.json", b'"trials": 400', b'"trials": 401'
    ),
    "verdicts.csv": lambda made, shown: changed(made / "verdicts.csv", b"reproduced", b"differs"),
    "table1.md": lambda made, shown: (made / "table1.md").unlink(),
    "table2.csv": lambda made, shown: (made / "table2.csv").write_text("draw"),
    "outputs": lambda made, shown: changed(shown, b"3 claims", b"4 claims"),
    "wrote to standard error": lambda made, shown: warn(shown),
}


@pytest.mark.parametrize("named", OTHER)
def test_whatever_a_run_makes_otherwise_is_refused(executed, tmp_path, monkeypatch, named):
    """The run gives the committed products with other digests, and one change."""
    folder = shutil.copytree(executed, tmp_path / "repository", symlinks=True)
    monkeypatch.setenv("TBDCORE_REPOSITORY", str(folder))
    before = tiny.products(folder)

    def execute(paper, values, output, **how):
        made = shutil.copytree(folder / "figures" / "tiny", folder / "build" / "stamp" / "tiny")
        for file in made.glob("*.json"):
            file.write_text(json.dumps(json.loads(file.read_text()) | {"digest": "f" * 16}))
        shutil.copy(folder / "notebooks" / "01_tiny.ipynb", output)
        if named:
            OTHER[named](made, output)
        return types.SimpleNamespace(error="", notebook=str(output))

    monkeypatch.setattr(stamps.batch, "execute", execute)
    monkeypatch.setattr(stamps.pages, "digest", lambda paper: "f" * 16)
    with pytest.raises(stamps.CheckFailed, match=named):
        stamps.renew("tiny", {})
    assert tiny.products(folder) == before
    shutil.rmtree(folder / "build" / "stamp")
    named = ""
    assert stamps.renew("tiny", {}) == ["fig1.json", "table1.json"]
    assert set(digests(folder).values()) == {"f" * 16}


@pytest.mark.slow
def test_a_page_that_fails_keeps_its_stamps(folder):
    rewrite(folder, {"claims": "raise RuntimeError('no')"})
    made = tiny.products(folder)
    ran = tiny.run(folder, "stamp", "tiny")
    assert ran.returncode == 1
    assert len(ran.stderr.splitlines()) == 1
    assert tiny.products(folder) == made


def test_a_flown_row_gets_a_new_digest_only_if_nothing_else_differs():
    have = [claims.Flown("toy", "a", "default", "1.5", "0.1", "40", "no", "differs", "old")]
    same = [("toy", "a", "default", 1.5, 0.1, 40, "no", "differs", "new")]
    assert readings.stamped(have, same) == same
    for place, value in ((3, 1.51), (4, 0.2), (5, 41), (6, "yes"), (7, "reproduced")):
        other = [tuple(value if i == place else it for i, it in enumerate(same[0]))]
        with pytest.raises(ValueError, match="toy a"):
            readings.stamped(have, other)
    with pytest.raises(ValueError, match="toy a"):
        readings.stamped([], same)


@pytest.mark.parametrize("code", [0, 1])
def test_flown_rows_are_flown_again_in_a_process_of_their_own(inside, monkeypatch, code):
    words = []

    def call(given, environment, log, tick, came):
        words.extend(given)
        log.write_text("tiny a: margin 1\ntiny a: not as in the file\n")
        return code

    monkeypatch.setattr(stamps.processes, "call", call)
    assert stamps.fly_again("tiny") is None
    assert not words, "there are no flown rows"
    monkeypatch.setattr(claims, "flown", lambda paper: {"a": []})
    if code:
        with pytest.raises(stamps.CheckFailed, match="^tiny a: not as in the file$"):
            stamps.fly_again("tiny")
    else:
        stamps.fly_again("tiny")
    assert words[1:] == ["-m", "benchmarks.readings", "--stamp", "tiny"]
