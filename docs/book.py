"""Build the book: ``build/book/index.html``, from the committed notebooks, figures and pages.

A copy of the texts gets anchors, links (claims, sections, figures) and the pages that are made of
the verdicts and products; Sphinx makes HTML of it and executes nothing.  The finished book takes
the place of the old one, which stays when anything fails: one line, exit code 1.
"""

import ast
import html
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import urlencode

import pandas as pd
from itables import javascript, options
from PIL import Image

import tbdcore
from tbdcore.repro import changes, cite, claims, clone, pages, paths, products, reach, scorecard

FOLDERS = ("benchmarks", "data", "docs", "figures", "notebooks", "tests")
FILES = ("README.md", "README.zh.md", "CHANGELOG.md", "LICENSE", "LICENSE-TEXT", "CITATION.cff")
TITLES = {"data": "Data", "tests": "Tests", "benchmarks": "Benchmarks"}  # of pages without one
NUMBER = r"[1-7A-G](?:\.\d+)?"
HEADING = re.compile(rf"^##+ (?:Appendix )?({NUMBER})[. ].*", re.MULTILINE)
# code and headings stay; a link to a chapter's section, a claim, a section become links of the book
LINKS = re.compile(
    rf"```.*?```|^\#.*?$|\[([^\]]*)\]\((\d\d_\w+)\.ipynb\#(?:Appendix-)?({NUMBER})[^)]*\)"
    rf"|\[[^\]]*\]\([^)]*\)|`([\w.]+)`|\b(?:Section|Appendix) ({NUMBER})\b",
    re.DOTALL | re.MULTILINE,
)
FILTERED = [0, 2, 5, 6]  # columns of the table of claims that have a list of their values
PANES = {"columns": FILTERED, "layout": "columns-4", "controls": False}
TABLE = {
    "layout": {"top1": {"searchPanes": PANES}},
    "columnDefs": [{"searchPanes": {"show": True}, "targets": FILTERED}],
    **dict.fromkeys(("paging", "ordering", "autoWidth"), False),
}

# what is chosen in the lists stands in the address: claims.html#paper=mda_tbd&verdict=differs
FILTERS = """
const asked = new URLSearchParams(location.hash.slice(1));
options.layout.top1.searchPanes.preSelect = Object.entries(columns)
  .filter(([name]) => asked.get(name))
  .map(([name, column]) => ({ column, rows: asked.get(name).split(",") }));
const body = document.querySelector("table.claims tbody");
new ITable(document.querySelector("table.claims"), options);
document.querySelectorAll("input.dtsp-search").forEach(pane => pane.ariaLabel = pane.placeholder);
document.getElementById(decodeURI(location.hash.slice(1)))?.scrollIntoView();
const write = () => {
  const chosen = [...document.querySelectorAll("div.dtsp-searchPane")].map((pane, i) => {
    const rows = [...pane.querySelectorAll("tr.selected .dtsp-name")].map(row => row.textContent);
    return rows.length ? `${Object.keys(columns)[i]}=${rows.join(",")}` : "";
  });
  const address = chosen.filter(text => text).join("&");
  const old = location.hash.includes("=") ? location.pathname : location.href;
  history.replaceState(null, "", address ? `#${address}` : old);
};
new MutationObserver(write).observe(body, { childList: true });
addEventListener("hashchange", () => location.hash.includes("=") && location.reload());
"""


def complaint():
    """What keeps the book from being built, in a line, or nothing."""
    for paper in pages.notebooks():
        pages.cells(paper)  # or a ValueError that names the file
        cells = json.loads(pages.path(paper).read_text(encoding="utf-8"))["cells"]
        if any(cell["cell_type"] == "code" and not cell["execution_count"] for cell in cells):
            name = pages.path(paper).name
            return f"{name} is not executed; run: tbdcore run {paper} --in-place"
    for about in map(cite.product, cite.ids()):
        for name in about["files"]:
            if not (paths.products() / about["paper"] / name).is_file():
                return f"figures/{about['paper']}/{name} is missing; run: {about['remake']}"
    made = scorecard.files(paths.products(), readme=True)
    stale = [path.name for path in made if not path.is_file() or path.read_bytes() != made[path]]
    return f"{', '.join(stale)}: not what the verdicts say; run: tbdcore score" if stale else ""


# Chapters: where claims and products are -------------------------------------------------------


class Chapter:
    """A notebook, its sections, and the cells that name a claim or a product."""

    def __init__(self, paper):
        self.paper, self.file = paper, pages.path(paper)
        self.notebook = json.loads(self.file.read_text(encoding="utf-8"))
        self.claims = claims.read(paper) if paper in claims.papers() else {}
        self.changes = {id: it for (own, id), it in changes.changes().items() if own == paper}
        self.section, self.patterns, number = [], [], ""
        for i, cell in enumerate(self.notebook["cells"]):
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                number = ([number] + HEADING.findall(source))[-1]
            else:  # what stands before the first section shows what is made later
                self.patterns += [(not number, -size, i, it) for size, it in strings(source)]
            self.section.append(number)

    def find(self, *names):
        """The cell that names a claim or product most literally, the first known; else E."""
        for name in names:
            if found := [known for *known, it in self.patterns if it.fullmatch(name)]:
                return min(found)[-1]
        return next((i for i, number in enumerate(self.section) if number[:1] == "E"), 0)

    def link(self, *names):
        return f"notebooks/{self.file.stem}.html#cell-{self.find(*names)}"


def strings(source):
    """Literal size and pattern of each string of a cell; a placeholder stands for anything."""
    for node in ast.walk(ast.parse(source)):
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        texts = [getattr(part, "value", None) for part in parts]
        known = "".join(text for text in texts if isinstance(text, str))
        if len(known) > 2:
            texts = [re.escape(text) if isinstance(text, str) else ".+" for text in texts]
            yield len(known), re.compile(".*" * known.startswith(".") + "".join(texts))


def linked(text, chapters, paper):
    """Markdown whose claims, sections and links to sections are links of the book.

    A claim or section is that of the chapter that its line names before it, else of `paper`.
    """

    def link(found):
        said, stem, number, claim, section = found.groups()
        line = text[text.rfind("\n", 0, found.start()) + 1 : found.start()]
        own = chapters.get([paper, *re.findall(r"\d\d_(\w+)\.ipynb", line)][-1], chapters[paper])
        if stem:
            return f'<a href="../notebooks/{stem}.html#section-{number}">{said}</a>'
        if section and section in own.section:
            return f'<a href="../notebooks/{own.file.stem}.html#section-{section}">{found[0]}</a>'
        if claim in own.claims:
            return f'<a href="../claims.html#{own.paper}.{claim}">{found[0]}</a>'
        return found[0]

    return LINKS.sub(link, text)


def notebook_page(chapter, chapters):
    """The notebook with links, and with anchors before its sections and the cells of claims."""
    names = [*chapter.claims, *(id.partition("/")[2] for id in cite.ids(chapter.paper))]
    wanted, cells = set(map(chapter.find, names)), []
    for run in runs(chapter.notebook["cells"]):
        for i in (i for i, _ in run if i in wanted):
            mark = {"cell_type": "markdown", "id": f"cell-{i}", "metadata": {}}
            cells.append(mark | {"source": f'<span id="cell-{i}"></span>'})
        cell = folded([cell for _, cell in run]) if is_folded(run[0][1]) else run[0][1]
        for data in (output.get("data", {}) for output in cell.get("outputs", [])):
            if text := "".join(data.get("text/markdown", "")):
                data["text/markdown"] = linked(text, chapters, chapter.paper)
        if cell["cell_type"] == "markdown":
            text = linked("".join(cell["source"]), chapters, chapter.paper)
            cell["source"] = HEADING.sub(r'<span id="section-\1"></span>\n\n\g<0>', text)
        cells.append(cell)
    lab = f"`.venv/bin/jupyter lab notebooks/{chapter.file.name}`"
    line = f"Open this page in JupyterLab, in a [clone](../README.md): {lab}"
    cells.append({"cell_type": "markdown", "id": "open", "metadata": {}, "source": line})
    return json.dumps(chapter.notebook | {"cells": cells})


def is_folded(cell):
    return "hide-input" in cell["metadata"].get("tags", [])


def runs(cells):
    """Cells with their numbers; neighbours that are folded, and of which only the last shows
    something, are together.
    """
    run = []
    for i, cell in enumerate(cells):
        if run and not (is_folded(run[-1][1]) and is_folded(cell) and not run[-1][1]["outputs"]):
            yield run
            run = []
        run.append((i, cell))
    yield run


def folded(cells):
    """One folded cell of several, with a name that says what is in it."""
    source = "\n\n".join("".join(cell["source"]).rstrip() for cell in cells)
    lines = len([line for line in source.splitlines() if line.strip()])
    made = re.findall(r"portfolio\.(?:save|film|table)\([^\"]*\"(\w+)\"", source)
    made += re.findall(r"screen\.exhibit\(\s*\"\w+/(\w+)\"", source)
    made += [f"{name}()" for name in re.findall(r"^def (\w+)", source, re.MULTILINE)]
    said = f"{', '.join(made[:3])}{' and more' if len(made) > 3 else ''}" or "this step"
    name = f"Code of {said}, {lines} line{'s' * (lines > 1)}"
    about = cells[-1]["metadata"]
    prompts = {"code_prompt_show": name, "code_prompt_hide": name}
    about["mystnb"] = about.get("mystnb", {}) | prompts
    return cells[-1] | {"source": source}


# Pages made of verdicts and products -----------------------------------------------------------


def claims_page(chapters):
    """The table of all claims, and the script that filters it."""
    shown = {}
    for about in map(cite.product, cite.ids()):
        for claim in about["claims"]:
            shown.setdefault((about["paper"], claim), []).append(about["id"])
    ledger = scorecard.with_seeds(claims.ledger(paths.products())).itertuples()
    rows = [
        claim_row(chapters[row.paper], row, shown.get((row.paper, row.id), [])) for row in ledger
    ]
    table = pd.DataFrame(rows).to_html(index=False, escape=False, border=0, classes="claims")
    script = javascript.generate_init_offline_itables_html(options.dt_bundle).partition("<div")[0]
    columns = {name: column for column, name in enumerate(rows[0]) if column in FILTERED}
    start = f"""<script type="module">
const {{ITable}} = await window.{javascript._itables_underscore_version()};
const columns = {json.dumps(columns)}, options = {json.dumps(TABLE)};
{FILTERS}
</script>"""
    return f"<div>{table}</div>\n\n{script}\n\n{start}"


def claim_row(chapter, row, figures):
    """One row of the table of claims."""
    about, word = chapter.claims[row.id], row.evidence.partition(" ")
    more = {name: getattr(about, name) for name in ("conditions", "where", "rule")}
    more |= {"repeats": word[2], "readings": row.readings, "cause": row.cause}
    if it := chapter.changes.get(row.id):
        more["changed"] = f"first {it.first}: {it.why}"
    more |= {"seeds": f"{row.seeds:.0%} give this verdict"} if row.seeds == row.seeds else {}
    more |= {"seeds together": row.together} if isinstance(row.together, str) else {}
    more = "<br>".join(f"<b>{name}</b> {html.escape(text)}" for name, text in more.items() if text)
    names = [row.id, *(id.partition("/")[2] for id in figures)]
    links = {chapter.link(*names): f"section {chapter.section[chapter.find(*names)]}"}
    links |= {f"figures/README.html#{id}": id.partition("/")[2] for id in figures}
    return {
        "paper": row.paper,
        "claim": f'<code id="{row.paper}.{row.id}">{row.id}</code> {html.escape(row.quantity)}'
        f"<details><summary>rule</summary>{more}</details>",
        "kind": about.kind,
        "published": html.escape(row.published),
        "measured": html.escape(row.measured + (f" ± {row.se}" if row.se else "")),
        "verdict": row.verdict,
        "evidence": word[0] or "none",
        "see": "<br>".join(f'<a href="{to}">{said}</a>' for to, said in links.items()),
    }


def index_page():
    """The counts of the scorecard, each a link to its claims, and where the book comes from."""
    counts = claims.scorecard(paths.products()).set_index("paper").filter(like="measured: ")
    counts = counts.rename(columns=lambda name: name.partition(": ")[2])
    counts.insert(0, "measured", counts.sum(axis=1))
    topics = {paper: about["topic"] for paper, about in cite.papers().items()}
    counts = counts.loc[[*(paper for paper in topics if paper in counts.index), "all"]].astype(
        object
    )
    for paper, verdict in itertools.product(counts.index, counts.columns):
        asked = {"paper": paper, "verdict": verdict, "evidence": "measured"}
        asked = {k: v for k, v in asked.items() if v != "all" and (k, v) != ("verdict", "measured")}
        if n := counts.loc[paper, verdict]:
            to = html.escape(f"claims.html#{urlencode(asked)}")
            counts.loc[paper, verdict] = f'<a href="{to}">{n}</a>'
    titles = {
        paper: f"[{topics[paper]}](notebooks/{pages.path(paper).name})"
        for paper in topics
        if paper in counts.index
    }
    counts = counts.rename(index=titles).rename_axis("paper").reset_index()
    return f"{products.markdown(counts)}\n{origin()}\n"


def origin():
    """Version, commit and address of what the book shows, as far as they are known."""
    known, version = clone.find(), tbdcore.__version__
    commit = f", commit {known.commit}" if known.commit else ""
    address = f" of [{known.address}]({known.address})" if known.address else ""
    return f"Version {version}{commit}{address}."


def gallery_page(folder, chapters):
    """Thumbnails of all figures with caption and id, paper by paper, linked to the chapters."""
    lines = []
    for paper in pages.notebooks():
        lines += [f"## {cite.topic(paper)}", ""]
        lines += ["::::{container} thumbs", ""]
        for id in (id for id in cite.ids(paper) if "png" in cite.files(id)):
            small, caption = folder / "thumbs" / f"{id}.png", cite.product(id)["caption"]
            small.parent.mkdir(parents=True, exist_ok=True)
            with Image.open(cite.files(id)["png"]) as picture:
                picture.thumbnail((480, 480))
                picture.save(small)
            target = chapters[paper].link(id.partition("/")[2])
            lines += [f":::{{figure}} thumbs/{id}.png", f":target: {target}"]
            lines += [f":alt: {html.escape(caption)}", "", f"`{id}` {caption}", ":::", ""]
        lines += ["::::", ""]
    return "\n".join(lines)


def figures_page(text, chapters):
    """figures/README.md: for each product an anchor, a link into the chapter, and its files."""

    def line(found):
        id, sentence = found.groups()
        paper, _, name = id.partition("/")
        link = f'<a href="../{chapters[paper].link(name)}">{id}</a>'
        have = cite.files(id).items()
        files = ", ".join(f"{{download}}`{kind} <{paper}/{file.name}>`" for kind, file in have)
        return f'- <span id="{id}"></span>{link}: {sentence} ({files})'

    text = re.sub(r"(?m)^- \[(\w+/\w+)\]\([^)]*\): (.*)$", line, text)
    return re.sub(r"(?m)^- (\w+/\w+)(?= is retired)", r'- <span id="\1"></span>\1', text)


def core_page():
    """The interface of each module of the core, and which chapters reach which function."""
    rooms = [paths.PACKAGE, paths.PACKAGE / "kernels", paths.PACKAGE / "recording"]
    files = [file for room in rooms for file in sorted(room.glob("[!_]*.py"))]
    chapters = {
        pages.path(paper).stem[:2]: reach.names(pages.code(paper))
        for paper in [*pages.papers(), "together"]
    }
    parts = []
    for file in files:
        name = ".".join(file.relative_to(paths.PACKAGE).with_suffix("").parts)
        functions = re.findall(r"^def ([a-z]\w*)", file.read_text("utf-8"), re.MULTILINE)
        used = {
            function: [
                it for it, names in chapters.items() if function in names.get(f"tbdcore.{name}", ())
            ]
            for function in functions
            if any(function in names.get(f"tbdcore.{name}", ()) for names in chapters.values())
        }
        lines = [f"`{function}` {', '.join(each)}" for function, each in used.items()]
        shared = lines and not name.startswith("kernels")
        said = f"Chapters that use it: {'; '.join(lines)}.\n\n" if shared else ""
        directive = f"```{{eval-rst}}\n.. automodule:: tbdcore.{name}\n```\n"
        parts.append(f"## {name}\n\n{said}{directive}")
    return "\n".join(parts)


# The book --------------------------------------------------------------------------------------


def stage(folder):
    """The texts of the book in a folder, where the repository has them, with anchors and links."""
    for name in FOLDERS:
        unwanted = shutil.ignore_patterns("*.py", "__pycache__", ".*")
        shutil.copytree(paths.root() / name, folder / name, ignore=unwanted)
    for name in FILES:
        shutil.copy(paths.root() / name, folder / name)
    cited = clone.citation(paths.citation().read_text("utf-8"), clone.find())
    (folder / paths.citation().name).write_text(cited, "utf-8")
    chapters = {paper: Chapter(paper) for paper in pages.notebooks()}
    texts = {f"{name}/README.md": f"# {title}\n\n{{}}" for name, title in TITLES.items()}
    texts = {name: text.format((folder / name).read_text("utf-8")) for name, text in texts.items()}
    gallery = (folder / "figures/README.md").read_text("utf-8")
    texts["figures/README.md"] = figures_page(gallery, chapters)
    for chapter in chapters.values():
        texts[f"notebooks/{chapter.file.name}"] = notebook_page(chapter, chapters)
    made = {"index": index_page(), "claims": claims_page(chapters)}
    made |= {"gallery": gallery_page(folder, chapters), "core": core_page()}
    for name, part in made.items():
        page = (folder / "docs" / f"{name}.md").rename(folder / f"{name}.md")
        text = scorecard.captions(page.read_text("utf-8"), paths.products())
        texts[f"{name}.md"] = text.replace("<!-- made -->", part)
    for name, text in texts.items():
        (folder / name).write_text(text, "utf-8")


def build():
    """Put the book into build/book; what is wrong, in a line, or nothing."""
    if wrong := complaint():
        return wrong
    paths.build().mkdir(exist_ok=True)
    book, log = paths.build() / "book", paths.build() / "book.log"
    with tempfile.TemporaryDirectory(dir=paths.build(), prefix="book.") as work:
        texts, made = Path(work, "texts"), Path(work, "html")
        texts.mkdir()
        stage(texts)
        words = ["-qWj2", "--keep-going", f"-c{Path(__file__).parent}", f"-d{work}/trees"]
        sphinx = [sys.executable, "-m", "sphinx", *words, texts, made]
        run = subprocess.run(sphinx, capture_output=True, text=True)
        said = run.stderr.replace(f"{texts}/", "")
        log.write_text(said, "utf-8")
        if run.returncode:
            return f"{said.strip().partition(chr(10))[0]} (log: build/{log.name})"
        shutil.rmtree(book, ignore_errors=True)
        made.rename(book)
    return ""


if __name__ == "__main__":
    os.environ.pop("TBDCORE_FIGURES", None)  # the book is that of the committed products
    try:
        wrong = build()
    except (ValueError, KeyError, OSError) as error:
        wrong = str(error)
    except KeyboardInterrupt:
        sys.exit(130)
    if wrong:
        sys.exit(f"book: {wrong}")
    print("book: build/book/index.html")
