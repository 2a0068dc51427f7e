"""docs/add_a_paper.md and docs/changing.md, followed to the letter in a copy of the repository."""

import re
import shutil
import subprocess
import sys

import pandas as pd
import pytest
import tiny

from benchmarks import seeds
from tbdcore.repro import cli, paths

TEXT = (paths.root() / "docs" / "add_a_paper.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*) ?([\w-]*)\n(.*?)```", TEXT, re.S)
AUTHOR = ("-c", "user.name=x", "-c", "user.email=x@x")
COPIED = ("data", "notebooks", "figures", "README.md", "CITATION.cff", "environment.txt")
# what needs more than an example: other chapters' products, twenty rows, a page test
NOT_HERE = "sources or trials_that_its_rule_names"


def blocks(language):
    return [(tag, text) for kind, tag, text in BLOCKS if kind == language]


def commands():
    """The commands of the text, each as words without the first one."""
    lines = "".join(text for _, text in blocks("")).strip().splitlines()
    return [line.split("#")[0].split()[1:] for line in lines]


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the repository with the chapter of the text, and how each command ended."""
    folder = tmp_path_factory.mktemp("copy")
    tiny.copy_package(folder)
    for name in COPIED:
        whole = shutil.copytree if (paths.root() / name).is_dir() else shutil.copy
        whole(paths.root() / name, folder / name)
    (folder / "docs").mkdir()
    shutil.copy(paths.root() / "docs" / "add_a_paper.md", folder / "docs")
    begin, *others = commands()
    assert begin == ["new", "square_law"]
    codes = [tiny.run(folder, *begin)]
    ((_, declare),) = [block for block in blocks("python") if block[0] == "declare"]
    python = [sys.executable, "-c", declare]
    subprocess.run(python, cwd=folder, env=tiny.environment(folder), check=True)
    for words in others:
        if "index" not in words:  # it has tests of its own, and nothing here depends on it
            codes.append(tiny.run(folder, *words))
    return folder, codes


def test_the_commands_of_the_text_make_a_chapter(copy):
    folder, (new, quick, *others) = copy
    assert (new.returncode, quick.returncode) == (0, 0), new.stderr + quick.stderr
    assert [done.returncode for done in others] == [0] * len(others), others
    verdicts = (folder / "figures/square_law/verdicts.csv").read_text(encoding="utf-8")
    assert re.findall(r"(used|reproduced),,(?:measured|),$", verdicts, re.M) == [
        "used",
        "reproduced",
        "reproduced",
    ]
    assert "square_law" in (folder / "README.md").read_text(encoding="utf-8")
    notebook = (folder / "notebooks/07_square_law.ipynb").read_text(encoding="utf-8")
    assert "Default run: seed 0, 2000 trials" in notebook, "the first screen"
    assert "@misc{square_law," in (folder / "figures/figures.bib").read_text(encoding="utf-8")


def test_the_new_chapter_meets_the_tests_of_all_chapters(copy):
    folder, _ = copy
    tests = str(paths.root() / "tests" / "pages" / "test_notebooks.py")
    chosen = ["-k", f"square_law and not ({NOT_HERE})", "-p", "no:cacheprovider"]
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", tests, *chosen],
        cwd=folder,
        env=tiny.environment(folder),
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout[-3000:]
    assert int(re.search(r"(\d+) passed", run.stdout)[1]) >= 20


# docs/changing.md --------------------------------------------------------------------------------

CHANGING = (paths.root() / "docs" / "changing.md").read_text(encoding="utf-8")
PLAIN = re.findall(r"^```\n(.*?)```", CHANGING, re.S | re.M)
STEPS = [line.split() for block in PLAIN for line in block.strip().splitlines()]


TO_COME = ("tests/recording",)  # rooms that are being built


def seeds_of(folder, words):
    """The study of the seeds as the text has it, with one seed for nine."""
    assert words[:3] == ["python", "-m", "benchmarks.seeds"]
    code = "from benchmarks import seeds; seeds.SEEDS = range(21, 22); seeds.main()"
    command = [sys.executable, "-c", code, *words[3:]]
    subprocess.run(["git", "init", "-q", folder], check=True)  # the study names a commit
    subprocess.run(
        ["git", "-C", folder, *AUTHOR, "commit", "-qm", "x", "--allow-empty"], check=True
    )
    made = subprocess.run(
        command, cwd=folder, env=tiny.environment(folder), capture_output=True, text=True
    )
    assert made.returncode == 0, made.stderr


def mentions(folder, text):
    """The files about the new chapter in which a number stands."""
    number, found = re.compile(rf"(?<![\d.]){re.escape(text)}(?!\d)"), []
    files = [*folder.glob("notebooks/07*"), *folder.glob("figures/square_law/*")]
    files += [folder / name for name in ("data/claims/square_law.csv", "figures/scorecard.csv")]
    for file in files:
        if file.suffix in (".ipynb", ".csv", ".md", ".tex", ".json"):
            lines = file.read_text(encoding="utf-8").splitlines()
            own = [line for line in lines if file.name != "scorecard.csv" or "square_law" in line]
            found += [file.name] * any(number.search(line) for line in own)
    return found


def test_a_misread_value_is_corrected_everywhere(copy):
    folder, _ = copy
    shutil.copytree(paths.root() / "benchmarks", folder / "benchmarks")
    steps = [words for words in STEPS if words[0] != "pytest" and "index" not in words]
    (study,) = [words for words in steps if words[0] == "python"]
    seeds_of(folder, study)
    assert tiny.run(folder, "score").returncode == 0
    assert {"verdicts.csv", "scorecard.csv", "07_square_law.ipynb"} <= {*mentions(folder, "0.66")}
    file = folder / "data" / "claims" / "square_law.csv"
    text = file.read_text().replace(",0.66,", ",0.658,")
    file.write_text(text.replace(",10 dB,", ",10 dB (0.66),"))
    first, run, *_, last = (words[1:] for words in steps)
    score = tiny.run(folder, *first)
    assert score.returncode == 1
    assert "square_law.csv, row 3, column value" in score.stderr, "verdicts on the old value"
    assert "changes.csv: square_law f1.pd has another value now" in score.stderr
    assert "anew: python -m benchmarks.seeds square_law f1.pd" in score.stderr
    assert "square_law.csv, f1.pd, conditions: still has 0.66, of f1.pd" in score.stdout
    file.write_text(text)
    assert tiny.run(folder, *run).returncode == 0
    seeds_of(folder, study)
    (line,) = re.findall(r"```text changes\n\s*(\S.*\n)", CHANGING)
    with (folder / "data" / "claims" / "changes.csv").open("a", encoding="utf-8") as changes:
        changes.write(line)
    score = tiny.run(folder, *last)
    assert score.returncode == 0, score.stderr
    assert mentions(folder, "0.66") == []
    assert {"verdicts.csv", "scorecard.csv", "07_square_law.ipynb"} <= {*mentions(folder, "0.658")}


def test_the_page_on_changes_names_files_and_tests_that_there_are():
    for words in (words for words in STEPS if words[0] == "pytest"):
        command = [sys.executable, "-m", *words, "--collect-only", "-p", "no:cacheprovider"]
        found = subprocess.run(command, cwd=paths.root(), capture_output=True, text=True)
        assert found.returncode == 0, found.stdout
    for name in re.findall(r"`((?:tests|data|tbdcore|repro|docs)/[\w./]+)`", CHANGING):
        place = name if not name.startswith("repro/") else f"tbdcore/{name}"
        there = (paths.root() / place).exists() or "square_law" in name
        assert there or name in TO_COME, name


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("dp_tbd", "there is such a chapter"),
        ("index", "there is such a chapter"),
        ("Square", "no name of a paper"),
        ("../x", "no name of a paper"),
    ],
)
def test_a_name_that_cannot_be_is_refused_and_nothing_is_written(name, says, capsys):
    before = paths.bibliography().read_bytes()
    assert cli.main(["new", name]) == 2
    assert says in capsys.readouterr().err
    assert paths.bibliography().read_bytes() == before


def test_the_seeds_of_one_paper_leave_the_rows_of_the_others():
    old = pd.DataFrame({"paper": ["dp_tbd", "mda_tbd", "mda_tbd"], "claim": ["a", "b", "c"]})
    new = pd.DataFrame({"paper": ["mda_tbd", "mm_pf_tbd"], "claim": ["d", "e"]})
    merged = seeds.merged(new, old, ["mda_tbd", "mm_pf_tbd"])
    assert list(zip(merged["paper"], merged["claim"], strict=True)) == [
        ("dp_tbd", "a"),
        ("mm_pf_tbd", "e"),
        ("mda_tbd", "d"),
    ]


def test_the_text_names_every_test_file_that_it_speaks_of():
    for name in re.findall(r"`(tests/\S+\.py)`", TEXT):
        assert (paths.root() / name).is_file() or "square_law" in name, name
