"""README.md, README.zh.md and the workflows: what a stranger meets first."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import tbdcore
from tbdcore.repro import cite, claims, pages, paths, products, scorecard

README = paths.readme().read_text(encoding="utf-8")
CHINESE = scorecard.chinese().read_text(encoding="utf-8")
PAPERS = tomllib.loads(paths.bibliography().read_text(encoding="utf-8"))


@pytest.mark.parametrize("text", [README, CHINESE], ids=["README.md", "README.zh.md"])
@pytest.mark.parametrize("paper", PAPERS)
def test_a_paper_is_found_by_its_titles(paper, text):
    about = PAPERS[paper]
    assert about["title"] in text
    assert about.get("title_zh", "") in text
    for author in about["authors"]:
        assert author.partition(",")[0] in text


@pytest.mark.parametrize("id", ["index/numbers", "index/evidence"])
def test_a_picture_stands_above_its_caption(id):
    caption = cite.product(id)["caption"]
    kind = "gif" if "gif" in cite.files(id) else "png"
    for text in (README, CHINESE):
        assert f"](figures/{id}.{kind})" in text
    assert f"<!-- caption {id} -->\n*{caption}*\n<!-- /caption -->" in README


def test_a_caption_without_a_product_stays_as_it_was(tmp_path):
    text = "<!-- caption index/numbers -->\nold\n<!-- /caption -->\n"
    assert scorecard.captions(text, tmp_path) == text
    (tmp_path / "index").mkdir()
    made = cite.product("index/numbers")
    (tmp_path / "index" / "numbers.json").write_text(json.dumps(made), encoding="utf-8")
    assert scorecard.captions(text, tmp_path) == text.replace("old", f"*{made['caption']}*")


# The Chinese README --------------------------------------------------------------------------


def behind(chinese, english):
    """A line if a Chinese README follows an older English one.

    It names the digest of the text that it translates, without what is made of products.
    """
    for name in ("papers", "scorecard"):
        before, _, rest = english.partition(f"<!-- {name} -->")
        english = before + rest.partition(f"<!-- /{name} -->")[2]
    now = products.digest([scorecard.CAPTION.sub("", english).encode()])
    followed = re.findall(r"^<!-- README\.md ([0-9a-f]+) -->$", chinese, re.MULTILINE)
    says = "translate what has changed, then name the digest"
    return "" if followed[:1] == [now] else f"README.zh.md is behind: {says} {now}"


def test_the_chinese_readme_follows_the_english_one():
    assert not behind(CHINESE, README)


def test_only_what_is_written_by_hand_puts_the_translation_behind():
    assert behind(CHINESE, README.replace("number by number", "one by one")).count("\n") == 0
    assert "is behind" in behind(CHINESE, README.replace("number by number", "one by one"))
    assert "is behind" in behind("no digest\n", README)
    other = re.sub(r"(<!-- scorecard -->\n).*?(?=<!-- /s)", r"\1new\n", README, flags=re.DOTALL)
    other = re.sub(r"(<!-- caption \S+ -->\n).*?\n", r"\1*new*\n", other)
    assert other != README
    assert not behind(CHINESE, other)


def test_the_tables_of_both_languages_say_the_same():
    pattern = r"^\| .* \| (\d+(?: \| \d+){6}) \|$"
    rows = [re.findall(pattern, text, re.MULTILINE) for text in (README, CHINESE)]
    counts = scorecard.by_kind(claims.ledger(paths.products()))
    made = [" | ".join(map(str, row[1:])) for row in counts.itertuples(index=False)]
    assert rows == [made, made]
    for paper, about in PAPERS.items():
        link = f"| [{pages.path(paper).stem[:2]}](notebooks/{pages.path(paper).name})"
        for text, language in ((README, ""), (CHINESE, "_zh")):
            (row,) = (line for line in text.splitlines() if line.startswith(link))
            assert about[f"topic{language}"] in row
            assert row.endswith(f"| {about[f'result{language}']} |")


def test_the_chinese_readme_has_the_commands_and_links_of_the_english_one():
    commands = [re.findall(r"^(make \w+|\S*tbdcore (?:run|list) .*?)(?:  |$)", text, re.M)
                for text in (README, CHINESE)]  # fmt: skip
    assert commands[0] == commands[1]
    links = [set(re.findall(r"\]\(([\w./]+)\)", text)) for text in (README, CHINESE)]
    assert links[0] - links[1] <= {"README.zh.md"}
    for target in links[1]:
        assert (paths.root() / target).exists(), target


def glossary():
    """Rows of the glossary: Chinese, English, numbers of the papers that use the Chinese word."""
    text = (paths.root() / "docs" / "glossary.md").read_text(encoding="utf-8")
    table = text[text.index("| 中文 |") :].splitlines()[2:]
    rows = [tuple(cell.strip() for cell in line.strip("|").split("|")) for line in table if line]
    return [row for row in rows if len(row) == 3]


def english():
    """What the chapters and the pages of the documentation say, in small letters."""
    files = {*(paths.root() / "docs").glob("*.md")} - {paths.root() / "docs" / "glossary.md"}
    parts = [file.read_text(encoding="utf-8") for file in sorted(files)]
    for paper in pages.notebooks():
        cells = json.loads(pages.path(paper).read_text(encoding="utf-8"))["cells"]
        parts += ["".join(cell["source"]) for cell in cells]
    parts += [(paths.claims() / f"{paper}.csv").read_text(encoding="utf-8") for paper in PAPERS]
    return " ".join(re.sub(r"[-_\s]+", " ", " ".join([README, *parts]).lower()).split())


def test_the_glossary_has_each_word_once():
    words = [row[0] for row in glossary()]
    assert len(words) == len(set(words)) >= 55


def test_each_english_word_of_the_glossary_is_used_here():
    text, missing = english(), []
    for _, word, _ in glossary():
        plain = " ".join(re.sub(r"[-_\s]+", " ", word.lower()).split())
        missing += [word] if plain not in text else []
    assert not missing


def test_each_chinese_word_of_a_title_or_claim_is_in_the_papers_that_the_glossary_names():
    """The texts of the papers are not part of the repository; their Chinese titles are."""
    for word, _, numbers in glossary():
        named = [int(number) for number in numbers.split()]
        assert named, f"{word}: no paper"
        assert set(named) <= set(range(1, len(PAPERS) + 1)), word
        for number, about in enumerate(PAPERS.values(), start=1):
            if word in about.get("title_zh", ""):
                assert number in named, f"{word} is in the title of {number:02d}"


def test_the_glossary_is_that_of_the_papers():
    """TBDCORE_PAPERS names a folder with the texts, <paper>.txt or <paper>/paper.txt."""
    folder = os.environ.get("TBDCORE_PAPERS")
    if not folder:
        pytest.skip("needs the texts of the papers: TBDCORE_PAPERS=/path/to/them")
    for number, paper in enumerate(PAPERS, start=1):
        files = [Path(folder, f"{paper}.txt"), Path(folder, paper, "paper.txt")]
        text = "".join(next(file for file in files if file.is_file()).read_text("utf-8").split())
        for word, _, numbers in glossary():
            assert (f"{number:02d}" in numbers.split()) == (word in text), f"{word}: {paper}"


# Workflows -------------------------------------------------------------------------------------

WORKFLOWS = sorted((paths.root() / ".github" / "workflows").glob("*"))


def steps(workflow):
    """All steps of a workflow."""
    jobs = yaml.safe_load(workflow.read_text(encoding="utf-8"))["jobs"].values()
    return [step for job in jobs for step in job["steps"]]


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda file: file.name)
def test_a_workflow_is_one(workflow):
    """By the schema of GitHub's workflows, as check-jsonschema has it."""
    words = ["--builtin-schema", "vendor.github-workflows", str(workflow)]
    run = subprocess.run(
        [sys.executable, "-m", "check_jsonschema", *words], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout


def test_the_schema_finds_a_wrong_workflow(tmp_path):
    wrong = tmp_path / "wrong.yml"
    text = WORKFLOWS[0].read_text(encoding="utf-8")
    wrong.write_text(text.replace("runs-on", "runs_on"), encoding="utf-8")
    with pytest.raises(AssertionError, match="runs_on"):
        test_a_workflow_is_one(wrong)


@pytest.mark.parametrize("workflow", WORKFLOWS, ids=lambda file: file.name)
def test_a_workflow_runs_what_is_in_ci_and_nothing_else(workflow):
    commands = [step["run"] for step in steps(workflow) if "run" in step]
    assert commands
    for command in commands:
        script = re.fullmatch(r"sh (\.ci/\w+)", command)
        assert script, command
        assert (paths.root() / script[1]).is_file()
    known = "actions/(checkout|setup-python|upload-pages-artifact|deploy-pages)@v[0-9]+"
    assert all(re.fullmatch(known, step["uses"]) for step in steps(workflow) if "uses" in step)


def test_the_tests_run_on_the_oldest_and_the_newest_python():
    about = tomllib.loads((paths.root() / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = [line.rpartition(" ")[2] for line in about["classifiers"] if "Python :: 3." in line]
    (test,) = (file for file in WORKFLOWS if file.name == "test.yml")
    jobs = yaml.safe_load(test.read_text(encoding="utf-8"))["jobs"]
    assert jobs["test"]["strategy"]["matrix"]["python"] == [named[0], named[-1]]


def test_the_changelog_has_the_newest_edition_first():
    parts = (paths.root() / "CHANGELOG.md").read_text(encoding="utf-8").split("\n## ")[1:]
    assert [part.partition(" ")[0] for part in parts] == ["Fourth", "Third", "Second", "First"]


def test_one_version_stands_everywhere():
    """In pyproject.toml, CITATION.cff with its tag, BibTeX, the changelog and the book."""
    about = tomllib.loads((paths.root() / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load(paths.citation().read_text(encoding="utf-8"))
    newest = (paths.root() / "CHANGELOG.md").read_text(encoding="utf-8").split("\n## ")[1]
    version = about["version"]
    assert citation["version"] == tbdcore.__version__ == version
    assert [it["value"] for it in citation["identifiers"]] == [f"v{version}"]
    assert f"version = {{{version}}}" in cite.repository_entry()
    assert newest.startswith(f"Fourth edition ({version})\n")
