"""Stamps are renewed without a new number: an innocent change is taken, any other is refused."""

import json
import shutil

import pytest
import tiny

from benchmarks import readings
from tbdcore.repro import claims, stamps

INNOCENT = {"trials": tiny.CELLS["trials"].replace("x = ", "draws = 1\nx = ")}
OTHER = {
    "a number": {"trials": tiny.CELLS["trials"] + " * 1.001"},
    "a default": {"parameters": tiny.CELLS["parameters"].replace("= 400", "= 401")},
    "a caption": {"figure": tiny.CELLS["figure"].replace("Nine", "Ten")},
    "a product more": {
        "table": tiny.CELLS["table"] + "\n" + tiny.CELLS["table"].replace("e1", "e2")
    },
    "a product less": {"table": None},
    "what a cell shows": {"publish": "print(1)\n" + tiny.CELLS["publish"]},
}


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


@pytest.mark.parametrize("what", OTHER)
def test_a_change_of_what_a_page_makes_or_shows_is_refused(folder, what):
    rewrite(folder, OTHER[what])
    made = tiny.products(folder)
    ran = tiny.run(folder, "stamp", "tiny")
    assert ran.returncode == 1
    (line,) = ran.stderr.splitlines()
    assert line.startswith("tbdcore: tiny: ")
    assert "no stamp is renewed" in line
    assert tiny.products(folder) == made


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

    def call(given, environment, log, tick):
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
