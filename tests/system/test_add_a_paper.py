"""docs/add_a_paper.md, followed to the letter in a copy of the repository."""

import json
import re
import shutil
import subprocess
import sys

import pytest
import tiny

from tbdcore.repro import paths

TEXT = (paths.root() / "docs" / "add_a_paper.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*) ?([\w-]*)\n(.*?)```", TEXT, re.S)
COPIED = ("data", "notebooks", "figures", "README.md", "CITATION.cff", "environment.txt")


def blocks(language):
    return [(tag, text) for kind, tag, text in BLOCKS if kind == language]


def cell(tag, text):
    metadata = {"tags": [tag]} if tag else {}
    kept = {"cell_type": "code", "execution_count": None, "outputs": [], "metadata": metadata}
    return kept | {"source": text.strip()}


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the repository with the files that the text gives."""
    folder = tmp_path_factory.mktemp("copy")
    tiny.copy_package(folder)
    for name in COPIED:
        whole = shutil.copytree if (paths.root() / name).is_dir() else shutil.copy
        whole(paths.root() / name, folder / name)
    (folder / "data/claims/square_law.csv").write_text(blocks("text")[0][1], encoding="utf-8")
    with (folder / "data/papers.toml").open("a", encoding="utf-8") as bibliography:
        bibliography.write("\n" + blocks("toml")[0][1])
    (_, declare), *cells = blocks("python")
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook = {"cells": [cell(*each) for each in cells], "metadata": {"kernelspec": kernel}}
    notebook |= {"nbformat": 4, "nbformat_minor": 4}
    (folder / "notebooks/07_square_law.ipynb").write_text(json.dumps(notebook), encoding="utf-8")
    python = [sys.executable, "-c", declare]
    subprocess.run(python, cwd=folder, env=tiny.environment(folder), check=True)
    return folder


def test_the_commands_of_the_text_make_a_chapter(copy):
    commands = [line.split("#")[0].split()[1:] for line in blocks("")[0][1].strip().splitlines()]
    codes = {}
    for number, words in enumerate(commands):
        if "index" not in words:  # it has tests of its own, and nothing here depends on it
            done = tiny.run(copy, *words)
            codes[number] = done.returncode, done.stderr
    stale = codes.pop(1)
    assert stale[0] == 1
    assert "first screen is stale; run again" in stale[1]
    assert [code for code, _ in codes.values()] == [0] * len(codes), codes
    verdicts = (copy / "figures/square_law/verdicts.csv").read_text(encoding="utf-8")
    assert re.findall(r"(used|reproduced),,(?:measured|),$", verdicts, re.M) == [
        "used",
        "reproduced",
        "reproduced",
    ]
    assert "square_law" in (copy / "README.md").read_text(encoding="utf-8")
    assert "@misc{square_law," in (copy / "figures/figures.bib").read_text(encoding="utf-8")
