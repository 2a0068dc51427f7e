"""Build the book: ``build/book/index.html``, from the committed notebooks, figures and pages.

A copy of the texts gets anchors and links (claims, sections, figures) and the pages Claims, Gallery
and Core; Sphinx makes HTML of it and executes nothing.  The finished book takes the place of the
old one, which stays when anything fails: one line, exit code 1.
"""

import ast
import html
import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from itables import javascript, options
from PIL import Image

from tbdcore.repro import cite, claims, pages, paths, scorecard

HERE = Path(__file__).resolve().parent
FOLDERS = ("benchmarks", "data", "docs", "figures", "notebooks", "tests")
FILES = ("README.md", "LICENSE", "LICENSE-TEXT", "CITATION.cff")
TITLES = {"data": "Data", "tests": "Tests", "benchmarks": "Benchmarks"}  # of pages without one
NUMBER = r"[1-7A-G](?:\.\d+)?"
HEADING = re.compile(rf"^##+ (?:Appendix )?({NUMBER})[. ]", re.MULTILINE)
# what stays as it is: code, headings; what may become a link: chapter's section, claim, section
LINKED = re.compile(
    rf"```.*?```|^\#.*?$|\[([^\]]*)\]\((\d\d_\w+)\.ipynb\#(?:Appendix-)?({NUMBER})[^)]*\)"
    rf"|\[[^\]]*\]\([^)]*\)|`([\w.]+)`|\b(?:Section|Appendix) ({NUMBER})\b",
    re.DOTALL | re.MULTILINE,
)
COLUMNS = (
    *("paper", "claim", "kind", "published", "measured"),
    *("verdict", "evidence", "chapter", "figure"),
)
PANES = {
    "layout": {
        "top1": {"searchPanes": {"columns": [0, 2, 5, 6], "layout": "columns-4", "controls": False}}
    },
    "paging": False,
    "ordering": False,
    "autoWidth": False,
    "columnDefs": [{"searchPanes": {"show": True}, "targets": [0, 2, 5, 6]}],
}


class Chapter:
    """A notebook whose claims, sections and figures can be found."""

    def __init__(self, paper):
        self.paper, self.file = paper, pages.path(paper)
        self.cells = json.loads(self.file.read_text(encoding="utf-8"))["cells"]
        tags = [cell["metadata"].get("tags", []) for cell in self.cells]
        first = next((i for i, own in enumerate(tags) if "parameters" in own), 0)
        code = [i for i, cell in enumerate(self.cells) if cell["cell_type"] == "code" and i > first]
        self.names = [(i, *name) for i in code for name in _names("".join(self.cells[i]["source"]))]
        self.claims = claims.read(paper) if paper in claims.papers() else {}
        self.sections, self.section = set(), {}
        for i, cell in enumerate(self.cells):
            found = HEADING.findall("".join(cell["source"])) if cell["cell_type"] != "code" else []
            self.sections.update(found)
            self.section[i] = found[-1] if found else self.section.get(i - 1, "")

    def place(self, name):
        """Index of the cell that names a claim or product most literally, or None."""
        found = [(-size, i) for i, size, pattern in self.names if pattern.fullmatch(name)]
        return min(found)[1] if found else None

    def place_of(self, claim, figures):
        """The cell that judges a claim, else the one that draws its figure, else Appendix E."""
        places = [self.place(claim), *(self.place(id.partition("/")[2]) for id in figures)]
        ledger = [i for i, section in self.section.items() if section.startswith("E")]
        return next((place for place in places if place is not None), ledger[0])

    def link(self, place):
        return f"notebooks/{self.file.stem}.html#{anchor(place)}"


def anchor(place):
    return f"cell-{place}"


def _names(source):
    """The strings of a cell as patterns, a placeholder for anything, and their literal sizes."""
    for node in ast.walk(ast.parse(source)):
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        texts = [part.value if isinstance(part, ast.Constant) else None for part in parts]
        literal = "".join(text for text in texts if isinstance(text, str))
        if "." in literal or len(literal) > 4:
            yield (
                len(literal),
                re.compile("".join(".+" if t is None else re.escape(str(t)) for t in texts)),
            )


# What must be there --------------------------------------------------------------------------


def complaint():
    """What keeps the book from being built, in a line, or nothing."""
    for paper in pages.everything():
        cells = json.loads(pages.path(paper).read_text(encoding="utf-8"))["cells"]
        if any(cell["cell_type"] == "code" and not cell["execution_count"] for cell in cells):
            name = pages.path(paper).name
            return f"{name} is not executed; run: tbdcore run {paper} --in-place"
    for id in cite.ids():
        folder, about = paths.PRODUCTS / id.partition("/")[0], cite.product(id)
        for name in about["files"]:
            if not (folder / name).is_file():
                return f"{folder.name}/{name} is missing; run: {about['remake']}"
    made = scorecard.files(paths.PRODUCTS, readme=True)
    stale = [path.name for path in made if not path.is_file() or path.read_bytes() != made[path]]
    return f"{', '.join(stale)}: not what the verdicts say; run: tbdcore score" if stale else ""


# Links ---------------------------------------------------------------------------------------


def linked(text, chapters, paper, up="../"):
    """Markdown whose claims, sections and links into chapters are links of the book.

    A section or claim is that of the chapter that its line links to before it, else of `paper`.
    """

    def link(found):
        whole, (said, stem, number, claim, section) = found[0], found.groups()
        line = found.string[found.string.rfind("\n", 0, found.start()) + 1 : found.start()]
        named = re.findall(r"\d\d_(\w+)\.ipynb", line)
        own = chapters.get(named[-1] if named else paper)
        if stem and number:
            return f'<a href="{up}notebooks/{stem}.html#section-{number}">{said}</a>'
        if section and own and section in own.sections:
            return f'<a href="{up}notebooks/{own.file.stem}.html#section-{section}">{whole}</a>'
        if claim and own and claim in own.claims:
            return f'<a href="{up}claims.html#{own.paper}.{claim}">{whole}</a>'
        return whole

    return LINKED.sub(link, text)


def chapter_text(chapter, chapters, wanted):
    """The notebook with anchors before its sections and before the wanted cells, and with links."""
    cells = []
    for i, cell in enumerate(chapter.cells):
        if i in wanted:
            mark = {"cell_type": "markdown", "id": anchor(i), "metadata": {}}
            cells.append(mark | {"source": f'<span id="{anchor(i)}"></span>'})
        if cell["cell_type"] == "markdown":
            text = linked("".join(cell["source"]), chapters, chapter.paper)
            cell["source"] = HEADING.sub(r'<span id="section-\1"></span>\n\n\g<0>', text)
        for data in (output.get("data", {}) for output in cell.get("outputs", [])):
            if "text/markdown" in data:
                data["text/markdown"] = linked(
                    "".join(data["text/markdown"]), chapters, chapter.paper
                )
        cells.append(cell)
    notebook = json.loads(chapter.file.read_text(encoding="utf-8"))
    return json.dumps(notebook | {"cells": cells})


# Pages ---------------------------------------------------------------------------------------


def claims_page(chapters):
    """The table of all claims, and the script that filters it."""
    shown = {}
    for id in cite.ids():
        for claim in cite.product(id)["claims"]:
            shown.setdefault((id.partition("/")[0], claim), []).append(id)
    head = "".join(f'<th scope="col">{name}</th>' for name in COLUMNS)
    rows = "".join(
        claim_row(chapters[row.paper], row, shown.get((row.paper, row.id), []))
        for row in claims.ledger(paths.PRODUCTS).itertuples()
    )
    script = javascript.generate_init_offline_itables_html(options.dt_bundle).partition("<div")[0]
    ready = javascript._itables_underscore_version()
    start = f'new ITable(document.querySelector("table.claims"), {json.dumps(PANES)});'
    return (
        f'<table class="claims"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>\n\n'
        f'{script}\n\n<script type="module">'
        f"const {{ITable}} = await window.{ready}; {start}</script>"
    )


def claim_row(chapter, row, figures):
    claim = chapter.claims[row.id]
    texts = {name: html.escape(text) for name, text in row._asdict().items() if name != "Index"}
    evidence, _, original = row.evidence.partition(" ")
    more = {"conditions": claim.conditions, "where": claim.where, "rule": claim.rule}
    more |= {"repeats": original, "cause": row.cause}
    more = "".join(f"<br><b>{k}</b> {html.escape(v)}" for k, v in more.items() if v)
    place = chapter.place_of(row.id, figures)
    links = [f'<a href="figures/README.html#{id}">{id.partition("/")[2]}</a>' for id in figures]
    error = f" ± {row.se}" if row.se else ""
    cells = [
        chapter.paper,
        f"<code>{texts['id']}</code> {texts['quantity']}<details><summary>rule</summary>"
        f"{more[4:]}</details>",
        claim.kind,
        texts["published"],
        texts["measured"] + error,
        row.verdict,
        evidence or "none",
        f'<a href="{chapter.link(place)}">{chapter.section[place] or "start"}</a>',
        "<br>".join(links),
    ]
    cells = "".join(f"<td>{cell}</td>" for cell in cells)
    return f'<tr id="{chapter.paper}.{texts["id"]}">{cells}</tr>'


def gallery_page(folder):
    """Thumbnails of all figures with caption and id."""
    lines = []
    for id in (id for id in cite.ids() if "png" in cite.files(id)):
        small = folder / "thumbs" / f"{id}.png"
        small.parent.mkdir(parents=True, exist_ok=True)
        with Image.open(cite.files(id)["png"]) as picture:
            picture.thumbnail((480, 480))
            picture.save(small)
        caption = cite.product(id)["caption"]
        alt = html.escape(caption)
        lines += [f":::{{figure}} thumbs/{id}.png", f":target: figures/README.html#{id}"]
        lines += [f":alt: {alt}", "", f"`{id}` {caption}", ":::", ""]
    return "\n".join(["::::{container} thumbs", "", *lines, "::::"])


def figures_page(text, chapters):
    """figures/README.md with an anchor and a link into the chapter for each product."""
    parts = re.split(r"^(?=### )", text, flags=re.MULTILINE)
    for number, part in enumerate(parts[1:], start=1):
        id = part.split("\n")[0].removeprefix("### ")
        paper, _, name = id.partition("/")
        place = chapters[paper].place(name) if paper in chapters else None
        at = f'\n\n<a href="../{chapters[paper].link(place)}">In the chapter</a>' if place else ""
        part = re.sub(r"\[md\]\(([^)]*)\)", r"{download}`md <\1>`", part)  # a file, not a page
        title, _, rest = linked(part, chapters, paper).partition("\n")
        parts[number] = f'<span id="{id}"></span>\n\n{title}{at}\n{rest}'
    return "".join(parts)


def core_page():
    names = sorted(file.stem for file in paths.PACKAGE.glob("[!_]*.py"))
    directive = "## {0}\n\n```{{eval-rst}}\n.. automodule:: tbdcore.{0}\n```\n"
    return "\n".join(directive.format(name) for name in names)


# The book ------------------------------------------------------------------------------------


def stage(folder):
    """The texts of the book in a folder, as the repository has them, with anchors and links."""
    for name in FOLDERS:
        unwanted = shutil.ignore_patterns("*.py", "__pycache__", ".*")
        shutil.copytree(paths.ROOT / name, folder / name, ignore=unwanted)
    for name in FILES:
        shutil.copy(paths.ROOT / name, folder / name)
    for name, title in TITLES.items():
        page = folder / name / "README.md"
        page.write_text(f"# {title}\n\n{page.read_text(encoding='utf-8')}", encoding="utf-8")
    chapters = {paper: Chapter(paper) for paper in pages.everything()}
    for chapter in chapters.values():
        wanted = {chapter.place(id) for id in chapter.claims}
        wanted |= {chapter.place(id.partition("/")[2]) for id in cite.ids(chapter.paper)}
        text = chapter_text(chapter, chapters, wanted)
        (folder / "notebooks" / chapter.file.name).write_text(text, encoding="utf-8")
    gallery = folder / "figures" / "README.md"
    gallery.write_text(figures_page(gallery.read_text(encoding="utf-8"), chapters), "utf-8")
    made = {"claims": claims_page(chapters), "gallery": gallery_page(folder), "core": core_page()}
    for name in ("index", *made):
        text = (folder / "docs" / f"{name}.md").read_text(encoding="utf-8")
        text = text.replace(f"<!-- {name} -->", made.get(name, ""))
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
        (folder / "docs" / f"{name}.md").unlink()


def build():
    """The book in build/book, or a complaint."""
    if wrong := complaint():
        return wrong
    paths.BUILD.mkdir(exist_ok=True)
    book, log = paths.BUILD / "book", paths.BUILD / "book.log"
    with tempfile.TemporaryDirectory(dir=paths.BUILD, prefix="book.") as work:
        texts, made = Path(work, "texts"), Path(work, "html")
        texts.mkdir()
        stage(texts)
        words = ["-q", "-W", "--keep-going", "-j", "2", "-c", HERE, "-d", Path(work, "doctrees")]
        command = [sys.executable, "-m", "sphinx", *words, texts, made]
        said = subprocess.run(command, capture_output=True, text=True)
        log.write_text(said.stderr.replace(f"{texts}/", ""), encoding="utf-8")
        if said.returncode:
            first = next((line for line in log.read_text().splitlines() if line), "Sphinx failed")
            return f"{first} (log: {log.relative_to(paths.ROOT)})"
        shutil.rmtree(book, ignore_errors=True)
        made.rename(book)
    return ""


if __name__ == "__main__":
    try:
        wrong = build()
    except (ValueError, KeyError, OSError) as error:
        wrong = str(error)
    print(
        f"book: {wrong}" if wrong else "book: build/book/index.html",
        file=sys.stderr if wrong else sys.stdout,
    )
    sys.exit(1 if wrong else 0)
