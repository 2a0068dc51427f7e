"""From a product to what a report needs, and from a file back to what made it."""

import json
import re
import shutil
import subprocess
import tarfile
import tomllib
import zipfile

import pandas as pd
import pytest
import tiny

from tbdcore.repro import cite, cli, clone, paths, products

ALL = tomllib.loads((tiny.ROOT / "data" / "papers.toml").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Products of a default run, and in another folder those of a run with other parameters."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        execute = tiny.here(folder, patch)
        execute()
        execute(out=str(folder / "other"), shift=2.5, n_trials=9)
    return folder


@pytest.fixture
def execute(made, tmp_path, monkeypatch):
    """The small repository with a copy of them; runs its notebook."""
    execute = tiny.here(tmp_path, monkeypatch)
    for folder in ("figures", "other"):
        shutil.copytree(made / folder, tmp_path / folder)
    return execute


def tbdcore(capsys, *words):
    """Exit code, standard output and standard error of a command."""
    code = cli.main(list(words))
    return code, *capsys.readouterr()


def test_everything_at_a_glance(execute, capsys):
    code, out, _ = tbdcore(capsys, "cite", "tiny/fig1")
    assert code == 0
    for part in (
        "Nine draws, 100 % of them.",
        "figures/tiny/fig1.pdf",
        "@misc{tiny,",
        "@misc{tbdcore,",
        "seed 20, 400 trials",
    ):
        assert part in out


def test_latex_of_a_figure_and_of_a_table(execute, capsys):
    _, figure, _ = tbdcore(capsys, "cite", "tiny/fig1", "--latex")
    assert r"\includegraphics[width=\linewidth]{figures/tiny/fig1.pdf}" in figure
    assert r"100 \% of them" in figure
    assert r"\label{fig:tiny:fig1}" in figure
    _, table, _ = tbdcore(capsys, "cite", "tiny/table1", "--latex")
    assert r"\input{figures/tiny/table1.tex}" in table
    for text in (figure, table):
        assert re.findall(r"\\begin\{(\w+)\}", text) == re.findall(r"\\end\{(\w+)\}", text)
        assert re.sub(r"\\.", "", text).count("{") == re.sub(r"\\.", "", text).count("}")


@pytest.mark.parametrize(
    ("name", "said"), [("fig1", "After~"), ("beyond_map", "Not in~"), ("open_gate", "Not in~")]
)
def test_a_caption_names_the_paper_only_for_what_the_paper_shows(execute, name, said):
    about = cite.product("tiny/fig1") | {"id": f"tiny/{name}"}
    assert f"{said}\\cite{{tiny}}" in cite._latex(about, cite.files("tiny/fig1"))


def test_a_caption_ends_once_and_the_bibliography_is_named(execute, capsys, tmp_path):
    about = tmp_path / "figures" / "tiny" / "fig1.json"
    for caption in ("Nine draws.", "Nine draws"):
        about.write_text(json.dumps(json.loads(about.read_text()) | {"caption": caption}))
        text = tbdcore(capsys, "cite", "tiny/fig1", "--latex")[1]
        assert r"\caption{Nine draws. After~\cite{tiny}" in text
        assert r"\bibliography{figures/figures}" in text


def compiled(folder, body):
    """Complaints of pdflatex and bibtex about a document: errors, missing entries, and what is
    wider or higher than the page.
    """
    head = "\\documentclass{article}\n\\usepackage{booktabs,graphicx,rotating}\n\\begin{document}\n"
    tail = "\\bibliographystyle{plain}\n\\bibliography{figures}\n\\end{document}\n"
    (folder / "report.tex").write_text(head + body + tail, encoding="utf-8")
    said = ""
    for program in (
        ["pdflatex", "-interaction=nonstopmode"],
        ["bibtex"],
        *[["pdflatex", "-interaction=nonstopmode"]] * 2,
    ):
        done = subprocess.run([*program, "report"], cwd=folder, capture_output=True, timeout=300)
        said = done.stdout.decode("utf-8", "replace")
        if done.returncode:
            return [
                line
                for line in said.splitlines()
                if line.startswith(("!", "l.", "I couldn't", "Warning"))
            ] or [said[-500:]]
    wrong = r"^.*(?:undefined|multiply defined|too large for page|Overfull \\[hv]box).*$"
    return re.findall(wrong, said, re.MULTILINE)


@pytest.mark.skipif(
    not (shutil.which("pdflatex") and shutil.which("bibtex")),
    reason="pdflatex and bibtex are not on this machine",
)
def test_a_report_with_every_figure_and_table_compiles_with_plain_pdflatex(tmp_path, monkeypatch):
    (tmp_path / "figures.bib").write_text(cite.bibliography(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    body = "".join(cite.text(id, "latex") + "\\clearpage\n" for id in cite.ids())
    assert compiled(tmp_path, body) == []


def test_what_is_given_to_latex_has_only_characters_that_it_sets():
    texts = {id: cite.text(id, "latex") for id in cite.ids()}
    tables = {
        file.name: file.read_text(encoding="utf-8") for file in paths.products().rglob("*.tex")
    }
    found = {
        name: set(re.findall(r"[^\x00-\x7f\xa1-\xff–—]", text))
        for name, text in (texts | tables).items()
    }
    assert {name: odd for name, odd in found.items() if odd} == {}


def test_the_width_of_a_tabular():
    """By hand: a letter is 4.1 pt, a cell 8 to 27 letters wide, 6 pt lie between."""
    head = "name & value \\\\\n"
    rows = rf"""\textbf{{a}} & {"x" * 40} \\
bb & 12345678901 \\
"""
    assert cite._points(head + rows) == pytest.approx(4.1 * 8 + 6 + 4.1 * 27 + 6)
    narrow = head + "a & 12345678901 \\\\\n"
    assert cite._points(narrow) == pytest.approx(4.1 * 8 + 6 + 4.1 * 11 + 6)


@pytest.mark.parametrize(("columns", "environment"), [(4, "table"), (9, "sidewaystable")])
def test_a_table_wider_than_the_text_lies_on_its_side(execute, columns, environment):
    frame = pd.DataFrame({f"a name of {k}": ["1.25 & 0.01"] for k in range(columns)})
    files = products.table_files(frame, "table1", "tiny/table1")
    (paths.figures() / "tiny" / "table1.tex").write_bytes(files["table1.tex"])
    text = cite.text("tiny/table1", "latex")
    assert re.findall(r"\\begin\{(\w+)\}", text) == [environment]
    assert ("rotating" in text) == (environment != "table")


def test_paths_are_those_of_the_folder_where_the_report_is(execute, capsys, monkeypatch, tmp_path):
    (tmp_path / "report").mkdir()
    monkeypatch.chdir(tmp_path / "report")
    for form in ("--latex", "--markdown"):
        assert "../figures/tiny/fig1.p" in tbdcore(capsys, "cite", "tiny/fig1", form)[1]


def test_a_figure_without_its_pdf_is_not_cited(execute, capsys):
    (paths.figures() / "tiny" / "fig1.pdf").unlink()
    code, out, err = tbdcore(capsys, "cite", "tiny/fig1", "--latex")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "tiny/fig1: its files are incomplete" in err


def test_caption_and_markdown(execute, capsys):
    assert tbdcore(capsys, "cite", "tiny/fig1", "--caption") == (
        0,
        "Nine draws, 100 % of them.\n",
        "",
    )
    assert tbdcore(capsys, "cite", "tiny/table1", "--markdown")[1].startswith(
        "<!-- tiny/table1 -->\n\n| draw |"
    )


@pytest.mark.parametrize(
    ("id", "nearest"),
    [("tiny/fig2", "tiny/fig1"), ("tiny/tabel1", "tiny/table1"), ("fig1", "give one of tiny/fig1")],
)
def test_unknown_id_names_the_nearest(execute, capsys, id, nearest):
    code, out, err = tbdcore(capsys, "cite", id)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert nearest in err


def test_a_caption_names_the_parameters_that_are_not_the_default_ones(execute, capsys, tmp_path):
    words = "cite", "tiny/fig1", "--figures", str(tmp_path / "other")
    caption = tbdcore(capsys, *words, "--caption")[1]
    assert caption.startswith("Nine draws, ")
    assert caption.endswith(". n_trials=9, shift=2.5.\n")
    latex = tbdcore(capsys, *words, "--latex")[1]
    assert r"n\_trials=9, shift=2.5. After~\cite{tiny}" in latex
    assert r"\bibliography{figures/figures}" in latex  # where score writes it, not in other/


def bibtex(text):
    """Entries of a BibTeX file by key: kind and fields; fails where the braces are not balanced."""
    entries = re.findall(r"@(\w+)\{(\w+),\n(.*?)\n\}", text, re.DOTALL)
    return {
        key: (kind, dict(re.findall(r"^  (\w+) = \{(.*)\},$", body, re.MULTILINE)))
        for kind, key, body in entries
    }


@pytest.mark.parametrize("paper", ALL)
def test_a_paper_has_a_legal_entry_with_what_is_known_and_nothing_else(paper):
    about = ALL[paper]
    ((key, (kind, fields)),) = bibtex(cite.paper_entry(paper)).items()
    assert key == paper
    assert kind == ("article" if "journal" in about and about["authors"] else "misc")
    assert fields["title"] == f"{{{about['title']}}}"
    assert fields.get("author", "").split(" and ") == (about["authors"] or [""])
    assert ("key" in fields) == (not about["authors"]), "BibTeX sorts by author, or by key"
    assert ("no authors" in fields.get("note", "")) == (not about["authors"])
    known = {"title", "author", "key", "note", "journal", "year", "volume", "number", "pages"}
    assert set(fields) <= known
    assert fields.get("year", "") == str(about.get("year", ""))
    assert all(value.isascii() for value in fields.values()), "pdfTeX sets these"


def test_repository_entry_is_that_of_the_citation_file():
    kind, fields = bibtex(cite.repository_entry())["tbdcore"]
    assert kind == "misc"
    assert fields["author"]
    assert fields["version"] in paths.citation().read_text(encoding="utf-8")


def test_score_writes_bibliography_and_listing(execute, tmp_path):
    assert cli.main(["score", "--figures", str(tmp_path / "figures")]) == 0
    assert set(bibtex((tmp_path / "figures" / "figures.bib").read_text())) == {"tiny", "tbdcore"}
    page = (tmp_path / "figures" / "README.md").read_text()
    figure = "- [tiny/fig1](tiny/fig1.png): Nine draws, 100 % of them.\n"
    table = "- [tiny/table1](tiny/table1.md): Three draws.\n"
    assert f"\n{figure}{table}" in page
    links = re.findall(r"\]\(([^)]+)\)", page)
    assert "../notebooks/01_tiny.ipynb" in links
    assert all((tmp_path / "figures" / link).is_file() for link in links)


def test_the_index_has_products_but_no_paper(execute, capsys, tmp_path):
    (tmp_path / "notebooks" / "00_index.ipynb").write_text(tiny.notebook(tiny.CELLS))
    old, new = tmp_path / "figures" / "tiny", tmp_path / "figures" / "index"
    new.mkdir()
    (new / "fig1.json").write_text((old / "fig1.json").read_text().replace('"tiny', '"index'))
    (new / "fig1.pdf").write_bytes(
        (old / "fig1.pdf").read_bytes().replace(b"tiny/fig1", b"index/fig1")
    )
    (new / "fig1.png").write_bytes((old / "fig1.png").read_bytes())
    assert set(bibtex(tbdcore(capsys, "cite", "index/fig1", "--bibtex")[1])) == {"tbdcore"}
    assert "Computed with~" in tbdcore(capsys, "cite", "index/fig1", "--latex")[1]
    assert tbdcore(capsys, "which", str(new / "fig1.pdf"))[1].startswith("index/fig1\n")
    page = cite.listing()
    assert page.index("[tiny/fig1]") < page.index("## All papers") < page.index("[index/fig1]")


@pytest.mark.parametrize(
    "name",
    [
        *(f"fig1.{kind}" for kind in ("pdf", "svg", "png", "csv", "json")),
        *(f"table1.{kind}" for kind in ("csv", "md", "tex", "json")),
    ],
)
def test_which_knows_its_own_files(execute, capsys, tmp_path, name):
    code, out, _ = tbdcore(capsys, "which", str(tmp_path / "figures" / "tiny" / name))
    assert code == 0
    caption = "Nine draws" if name.startswith("fig1") else "Three draws"
    stem, kind = name.split(".")
    for part in (f"tiny/{stem}\n", caption, "current", f"the same bytes as figures/tiny/{name}"):
        assert part in out
    assert "make it again: tbdcore run tiny\n" in out


@pytest.mark.parametrize(
    "name", ["fig1.png", "fig1.pdf", "fig1.svg", "fig1.csv", "table1.tex", "table1.md"]
)
def test_which_finds_a_renamed_copy_whatever_the_case_of_its_ending(
    execute, capsys, tmp_path, name
):
    stem, kind = name.split(".")
    copy = shutil.copy(tmp_path / "figures" / "tiny" / name, tmp_path / f"Figure_3B.{kind.upper()}")
    code, out, _ = tbdcore(capsys, "which", str(copy))
    assert (code, out.splitlines()[0]) == (0, f"tiny/{stem}")
    assert "draws" in out.splitlines()[1], "its caption"


def test_a_film_is_found_by_its_comment(execute, tmp_path):
    comment = b"GIF89a!\xfe\ntiny/fig1\x00;"
    (tmp_path / "film.gif").write_bytes(comment)
    assert cite.embedded(tmp_path / "film.gif") == "tiny/fig1"


def test_a_checksum_of_letters_is_no_part_of_an_id(execute, tmp_path):
    (tmp_path / "a.png").write_bytes(b"\0\0\0\x0ftEXtTitle\0tiny/fig10abc")
    assert cite.embedded(tmp_path / "a.png") == "tiny/fig1"


def test_a_re_saved_picture_keeps_id_and_caption(execute, capsys, tmp_path):
    copy = tmp_path / "again.png"
    content = (tmp_path / "figures" / "tiny" / "fig1.png").read_bytes()
    copy.write_bytes(content[:-12] + content[-12:] + b"\0")
    out = tbdcore(capsys, "which", str(copy))[1]
    assert out.startswith("tiny/fig1\n  Nine draws")
    assert "differs from figures/tiny/fig1.png" in out


@pytest.mark.parametrize("kind", ["pdf", "svg", "png"])
def test_which_traces_a_file_of_another_run(execute, capsys, tmp_path, kind):
    file = tmp_path / "other" / "tiny" / f"fig1.{kind}"
    code, out, _ = tbdcore(capsys, "which", str(file))
    assert code == 0
    assert "make it again: tbdcore run tiny -p n_trials=9 -p shift=2.5\n" in out
    claims = tmp_path / "data" / "claims" / "tiny.csv"
    claims.write_text(claims.read_text().replace("cheap", "dear"))
    code, out, _ = tbdcore(capsys, "which", str(file))
    assert code == 1
    assert "stale" in out


@pytest.mark.parametrize(
    "name", ["README.md", "missing.pdf", "empty.png", "foreign.pdf", "cut.svg"]
)
def test_which_refuses_what_is_not_ours_in_one_line(execute, capsys, tmp_path, name):
    for other, content in {
        "empty.png": b"",
        "foreign.pdf": b"%PDF-1.4 /Title (My thesis)",
        "cut.svg": b"<svg",
    }.items():
        (tmp_path / other).write_bytes(content)
    code, out, err = tbdcore(capsys, "which", name)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert name in err


@pytest.mark.slow
def test_the_same_run_gives_the_same_bytes(execute, tmp_path):
    first = {file.name: file.read_bytes() for file in (tmp_path / "figures" / "tiny").iterdir()}
    execute()
    assert {
        file.name: file.read_bytes() for file in (tmp_path / "figures" / "tiny").iterdir()
    } == first
    assert json.loads(first["fig1.json"])["files"] == [
        "fig1.pdf",
        "fig1.svg",
        "fig1.png",
        "fig1.csv",
    ]


# Retired ids ---------------------------------------------------------------------------------

RETIRED = "id,last_commit,instead\n"


@pytest.mark.parametrize(
    ("instead", "said"),
    [
        ("tiny/table1", "tiny/table1 takes its place"),
        ("the first figure of Section 5", "the first figure of Section 5 takes its place"),
        ("", "nothing takes its place"),
    ],
)
def test_a_retired_id_is_answered_in_one_line(execute, capsys, tmp_path, instead, said):
    folder = tmp_path / "figures"
    kept = shutil.copy(folder / "tiny" / "fig1.svg", tmp_path / "kept.svg")
    for file in (folder / "tiny").glob("fig1.*"):
        file.unlink()
    (folder / "retired.csv").write_text(f"{RETIRED}tiny/fig1,0123abc,{instead}\n")
    line = f"tiny/fig1 is retired: {said}; the last commit that has it is 0123abc"
    code, out, err = tbdcore(capsys, "cite", "tiny/fig1")
    assert (code, out, err) == (2, "", f"tbdcore: {line}\n")
    assert tbdcore(capsys, "which", str(kept)) == (1, f"{line}\n", "")
    assert f"## Retired\n\n- {line}.\n" in cite.listing()


def test_without_retired_ids_the_listing_has_none_of_them(execute, tmp_path):
    (tmp_path / "figures" / "retired.csv").write_text(RETIRED)
    assert "Retired" not in cite.listing()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("tiny/fig9", "row 2, column last_commit: 1 fields instead of 3"),
        ("fig9,0123abc,", "row 2, column id: 'fig9'; no id"),
        ("tyni/fig9,0123abc,", "row 2, column id: 'tyni/fig9'; no id"),
        ("tiny/fig1,0123abc,", "row 2, column id: 'tiny/fig1'; it is still made"),
        ("tiny/fig9,HEAD,", "row 2, column last_commit: 'HEAD'; give 7 to 40"),
        ("tiny/fig9,0123abc,tiny/fig8", "row 2, column instead: 'tiny/fig8'; not made"),
        (
            "tiny/fig9,0123abc,\ntiny/fig9,0123abc,",
            "row 3: 'tiny/fig9' stands there twice",
        ),
    ],
)
def test_a_bad_line_of_retired_ids_is_named(execute, capsys, tmp_path, line, words):
    (tmp_path / "figures" / "retired.csv").write_text(f"{RETIRED}{line}\n")
    code, out, err = tbdcore(capsys, "cite", "tiny/fig7")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"retired.csv, {words}" in err


# The clone -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("remote", "page"),
    [
        ("git@example.org:a/b.git", "https://example.org/a/b"),
        ("example.org:a/b.git", "https://example.org/a/b"),
        ("ssh://git@example.org:2222/a/b.git", "https://example.org/a/b"),
        ("git://example.org/a/b", "https://example.org/a/b"),
        ("https://name:secret@example.org/a/b.git", "https://example.org/a/b"),
        ("http://example.org:8080/a/b/", "http://example.org:8080/a/b"),
        ("/srv/b.git", ""),
        ("../b", ""),
        ("file:///srv/b.git", ""),
        ("C:/b.git", ""),
        ("", ""),
    ],
)
def test_the_page_of_a_remote(remote, page):
    assert clone.browsable(remote) == page


def git(folder, *words):
    name = ["-c", "user.name=A", "-c", "user.email=a@example.org"]
    done = subprocess.run(
        ["git", *name, *words], cwd=folder, check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


@pytest.fixture
def cloned(execute, tmp_path):
    """The small repository as a git clone with a remote that has its one commit."""
    (tmp_path / "figures" / "retired.csv").write_text("id,last_commit,instead")
    git(tmp_path, "init", "-q", "-b", "main")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "All")
    git(tmp_path, "remote", "add", "origin", "git@example.org:a/b_c.git")
    git(tmp_path, "update-ref", "refs/remotes/origin/main", "HEAD")
    return tmp_path


def ours(capsys, *words):
    """The lines before the entries of a command, and the fields of this repository's entry."""
    code, out, err = tbdcore(capsys, "cite", *words, "--bibtex")
    assert (code, err) == (0, "")
    said = [line for line in out.splitlines() if line.startswith("%")]
    return said, bibtex(out)["tbdcore"][1]


def test_an_entry_names_address_commit_and_what_is_cited(cloned, capsys):
    said, fields = ours(capsys, "tiny/fig1")
    commit = git(cloned, "rev-parse", "HEAD")[:12]
    assert said == []
    assert fields["howpublished"] == r"https://example.org/a/b\_c"
    assert fields["note"] == f"commit {commit}, figure tiny/fig1"
    assert {"author", "title", "year", "version"} <= set(fields)
    assert ours(capsys, "tiny/table1")[1]["note"] == f"commit {commit}, table tiny/table1"
    assert ours(capsys)[1]["note"] == f"commit {commit}"


def rename(folder):
    (folder / ".git").rename(folder / "no_git")


@pytest.mark.parametrize(
    ("harm", "line", "lost"),
    [
        (rename, "no address and no commit: this folder is no git clone", "howpublished note"),
        (
            lambda folder: git(folder, "remote", "remove", "origin"),
            "no address: this clone has no remote",
            "howpublished",
        ),
        (
            lambda folder: git(folder, "remote", "set-url", "origin", "/srv/b.git"),
            "no address: the remote origin is no address on the network",
            "howpublished",
        ),
        (
            lambda folder: git(folder, "update-ref", "-d", "refs/remotes/origin/main"),
            "no branch of the remote known here has this commit",
            "",
        ),
        (
            lambda folder: git(folder, "update-ref", "-d", "HEAD"),
            "no commit: this clone has none yet",
            "note",
        ),
        (
            lambda folder: (folder / "figures" / "retired.csv").write_text(RETIRED),
            "files have changed since this commit",
            "",
        ),
    ],
)
def test_what_git_does_not_know_is_said_in_one_line(cloned, capsys, harm, line, lost):
    harm(cloned)
    (said,), fields = ours(capsys)
    assert said.startswith(f"% {line}")
    assert {"howpublished", "note"} - set(fields) == set(lost.split())
    changed = "changed" in line
    assert fields.get("note", "").endswith(" with changes") == changed


def test_without_git_a_line_says_so(cloned, capsys, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert ours(capsys)[0] == ["% no address and no commit: git is not installed"]


def test_a_folder_in_another_clone_is_no_clone(cloned, capsys, monkeypatch):
    inner = cloned / "inner"
    inner.mkdir()
    for name in ("data", "notebooks", "figures", "CITATION.cff"):
        (cloned / name).rename(inner / name)
    monkeypatch.setenv("TBDCORE_REPOSITORY", str(inner))
    assert ours(capsys)[0] == ["% no address and no commit: this folder is no git clone"]


def test_the_variables_of_a_git_hook_lead_nowhere_else(cloned, capsys, monkeypatch):
    monkeypatch.setenv("GIT_DIR", str(cloned / "elsewhere"))
    assert ours(capsys)[0] == []


def test_a_wheel_names_the_address_of_the_clone(cloned):
    for name in ("README.md", "LICENSE", "LICENSE-TEXT"):
        shutil.copy(tiny.ROOT / name, cloned / name)
    tiny.copy_package(cloned)
    (cloned / "tests" / "kernels").mkdir(parents=True)
    before = (cloned / "pyproject.toml").read_bytes()
    (wheel, source), known = clone.build(cloned / "build" / "dist")
    with zipfile.ZipFile(wheel) as packed:
        (about,) = [name for name in packed.namelist() if name.endswith("METADATA")]
        assert "Project-URL: Source, https://example.org/a/b_c" in packed.read(about).decode()
    with tarfile.open(source) as packed:
        (about,) = [name for name in packed.getnames() if name.endswith("CITATION.cff")]
        text = packed.extractfile(about).read().decode()
    assert 'repository-code: "https://example.org/a/b_c"' in text
    assert f'commit: "{known.commit}"' in text
    assert (cloned / "pyproject.toml").read_bytes() == before


def test_without_an_address_nothing_is_added():
    text = paths.citation().read_text(encoding="utf-8")
    assert clone.citation(text, clone.Clone()) == text
    assert clone.project("[project]\n", clone.Clone(commit="0123abc")) == "[project]\n"


def test_what_is_committed_does_not_depend_on_the_clone(cloned):
    committed = cite.bibliography()
    git(cloned, "remote", "set-url", "origin", "https://example.org/other/name")
    assert cite.bibliography() == committed
    assert "example.org" not in committed
    assert "commit" not in committed
