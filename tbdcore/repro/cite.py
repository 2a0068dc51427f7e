"""Citing: from a figure or table to its caption, files and bibliography, and back from a file.

A product has the id ``<paper>/<name>``, for instance ``track_cfar/fig05``; the JSON beside it says
everything about it.  ``text`` writes what a report needs, ``which`` finds out what a file is that
lies anywhere under any name, and whether the sources that made it have changed since; ``retired``
lists what is no longer made; ``listing`` and ``bibliography`` are ``figures/README.md`` and
``figures/figures.bib``.  Bibliographic fields come from ``data/papers.toml`` and ``CITATION.cff``,
in ``entries`` also from the clone (``clone.find``).
"""

import itertools
import os
import re
import shlex
import tomllib
from pathlib import Path
from typing import NamedTuple

from tbdcore.repro import claims, clone, pages, paths, products

ARTICLE = ("author", "title", "journal", "year")  # what BibTeX requires of an @article
FIELDS = [*ARTICLE[:3], "volume", "number", "pages", "year", "version", "doi", "howpublished"]
FIELDS += ["key", "note"]
SHOWN_ROWS = 40  # of a table, at most
COLUMN = 325  # points: a little less than the text of an article, 345, is wide
KINDS = ("pdf", "svg", "png", "gif", "md", "tex", "csv", "json")
# pages that judge no paper
TOPICS = {"index": "All papers", "together": "The five ideas on the same scenes"}


def ids(*papers):
    """Ids of all products, paper by paper, the papers' own figures and tables first."""

    def rank(name):  # fig1, fig2, fig10, table1, then everything else by name
        kind, number, rest = re.fullmatch(r"([a-z_]*)(\d*)(.*)", name).groups()
        return {"fig": 0, "table": 1}.get(kind, 2), kind, int(number or 0), rest

    listed = []
    for paper in papers or pages.notebooks():
        names = [file.stem for file in (paths.figures() / paper).glob("*.json")]
        listed += [f"{paper}/{name}" for name in sorted(names, key=rank)]
    return listed


class Retired(NamedTuple):
    """One row of figures/retired.csv: a product that is no longer made."""

    id: str
    last_commit: str  # that has it
    instead: str  # id of what takes its place, or words; empty for nothing

    def __str__(self):
        instead = f"{self.instead} takes its place" if self.instead else "nothing takes its place"
        return f"{self.id} is retired: {instead}; the last commit that has it is {self.last_commit}"


def retired():
    """The products that are no longer made, by id; raises as :func:`claims.records` does."""

    def faults(it):
        page, instead = (re.fullmatch(r"(\w+)/\w+", id) for id in (it.id, it.instead))
        made, follows = ((paths.products() / f"{id}.json").is_file() for id in (it.id, it.instead))
        exists = page and page[1] in pages.notebooks()
        commit = re.fullmatch("[0-9a-f]{7,40}", it.last_commit)
        lost = instead and not follows
        return [
            ("id", not exists, "no id of a figure or table, such as track_cfar/fig05"),
            ("id", made, "it is still made; delete the row, or the figure"),
            ("last_commit", not commit, "give 7 to 40 hexadecimal digits"),
            ("instead", lost, "not made; give a product's id, words, or nothing"),
        ]

    return claims.records(paths.products() / "retired.csv", Retired, faults)


def product(id):
    """Everything that is known of a product; ValueError, with the nearest id, if there is none."""
    made = ids()
    if id not in made:
        if id in (old := retired()):
            raise ValueError(str(old[id]))
        advice = f"there are none in {paths.figures()}; make them: tbdcore run"
        if made:
            made = [it for it in made if it.startswith(f"{id.partition('/')[0]}/")] or made
            advice = f"the nearest is {claims.nearest(id, made)!r}; tbdcore cite lists them"
        raise ValueError(f"{id!r}: no such figure or table; {advice}")
    return products.record(paths.figures() / f"{id}.json")


def files(id):
    """Files of a product by extension."""
    candidates = [paths.figures() / f"{id}.{extension}" for extension in KINDS]
    return {file.suffix[1:]: file for file in candidates if file.is_file()}


def text(id, form=""):
    """What a report needs of a product.

    `form` is "caption", "bibtex", "latex" (a figure or table environment), "markdown", or empty for
    everything at a glance.  Paths in it are relative to the present folder, where the report is.
    """
    about, have = product(id), files(id)
    if form == "caption":
        return f"{_caption(about)}\n"
    if form == "latex":
        return _latex(about, have)
    if form == "markdown":
        return _markdown(about, have) + ("\n" if "png" in have else f"\n{_caption(about)}\n")
    if form == "bibtex":
        return entries(about["paper"], id)
    names = "".join(f"  {_relative(file)}\n" for file in have.values())
    made = f"seed {about['seed']}, {about['trials']} trials, digest {about['digest']}"
    again = about.get("remake", f"tbdcore run {about['paper']}")
    head = f"{id}\n  {about['caption']}\n  {made}; {again}\n"
    return f"{head}\n{names}\n{entries(about['paper'], id)}"


def _caption(about):
    """The caption, with the parameters that are not the default ones."""
    words = shlex.split(about.get("remake", ""))
    changed = ", ".join(word for option, word in itertools.pairwise(words) if option == "-p")
    return f"{about['caption'].rstrip('.')}. {changed}." if changed else about["caption"]


def _relative(file, start=None):
    """A path relative to a folder, by default the present one."""
    return Path(os.path.relpath(file, start)).as_posix()


def _latex(about, have):
    """A figure or a table environment, ready to be put into a report.

    A table is set at 8 pt in a document of 10 pt; one that is wider than the text lies on its side.
    """
    picture, id, paper = "png" in have or "pdf" in have, about["id"], about["paper"]
    if ("pdf" if picture else "tex") not in have:
        raise ValueError(f"{id}: its files are incomplete; make them anew: tbdcore run {paper}")
    kind, package = ("figure", "graphicx") if picture else ("table", "booktabs")
    label, origin = f"{kind[:3]}:{id.replace('/', ':')}", "Computed"
    if paper in pages.papers():  # a product of ours beyond the paper is not after it
        after = "Not in" if re.search("/(beyond|open)_", id) else "After"
        origin = f"{after}~\\cite{{{paper}}}, computed"
    ours = f"\\cite[{_escaped(id)}]{{tbdcore}}"
    says = f"{products.tex(_caption(about).rstrip(' .'))}. {origin} with~{ours}."
    body = [f"\\caption{{{says}}}", f"\\label{{{label}}}"]
    if picture:
        body.insert(0, f"\\includegraphics[width=\\linewidth]{{{_relative(have['pdf'])}}}")
    else:
        body += [r"\smallskip\footnotesize\tabcolsep=3pt", f"\\input{{{_relative(have['tex'])}}}"]
        if _points(have["tex"].read_text(encoding="utf-8")) > COLUMN:
            kind, package = "sidewaystable", "booktabs,rotating"
    entries = f"\\bibliography{{{_relative(paths.products() / 'figures')}}}"
    needs = f"% needs \\usepackage{{{package}}}, and {entries} with \\bibliographystyle{{plain}}"
    inner = "\n  ".join([f"\\begin{{{kind}}}", "\\centering", *body])
    return f"{needs}\n{inner}\n\\end{{{kind}}}\n"


def _points(tabular):
    """About how wide a tabular of ours is at 8 pt, 6 pt between its columns."""
    lines = [line for line in tabular.splitlines() if " & " in line][1:]
    rows = [line.removesuffix(r" \\").split(" & ") for line in lines]
    plain = [[re.sub(r"\\[a-z]+|[\\${}]", "", cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*plain, strict=True)]
    return sum(4.1 * min(max(width, 8), 27) + 6 for width in widths)


def _markdown(about, have):
    """A picture, or the table itself."""
    if "png" in have:
        return f"![{_caption(about)}]({_relative(have['png'])})"
    return have["md"].read_text(encoding="utf-8")


def _entry(kind, key, fields):
    """A BibTeX entry of fields in TeX; empty ones are left out."""
    lines = [f"  {name} = {{{fields[name]}}}," for name in FIELDS if fields.get(name)]
    return "\n".join([f"@{kind}{{{key},", *lines, "}", ""])


def paper_entry(paper):
    """BibTeX of a paper: an @article where everything is known that one needs, else a @misc.

    One without authors gets a ``key``, which BibTeX sorts by instead, and a ``note`` that says so.
    """
    about = papers()[paper]
    about["author"] = " and ".join(about.get("authors", ()))
    chinese = r"\s*\([^)]*[\u3000-\u9fff][^)]*\)"  # in brackets; pdfTeX cannot set it
    fields = {name: products.tex(re.sub(chinese, "", str(about.get(name, "")))) for name in FIELDS}
    if not fields["author"]:
        fields |= {"key": fields["title"], "note": "the text at hand names no authors"}
    fields |= {"title": f"{{{fields['title']}}}", "pages": fields["pages"].replace("-", "--")}
    return _entry("article" if all(fields[name] for name in ARTICLE) else "misc", paper, fields)


def repository_entry(origin=None, id=""):
    """BibTeX of this repository, from CITATION.cff; of a clone also where it is, and which commit.

    `id` is the figure or table that is cited.
    """
    import yaml

    origin = origin or clone.Clone()
    try:
        about = yaml.safe_load(paths.citation().read_text(encoding="utf-8"))
        fields = {"author": " and ".join(map(_name, about["authors"]))}
        fields["title"] = f"{{{products.tex(about['title'])}}}"
    except (yaml.YAMLError, KeyError, TypeError):
        reason = "no authors or no title in it; take it from the repository again"
        raise ValueError(f"{paths.citation().name}: {reason}") from None
    kind = "figure" if {"png", "pdf"} & {*files(id)} else "table"
    note = [origin.commit and f"commit {origin.commit}", id and f"{kind} {id}"]
    fields["year"] = str(about.get("date-released", ""))[:4]
    fields["howpublished"] = _escaped(origin.address or about.get("repository-code", ""))
    fields["note"] = _escaped(", ".join(filter(None, note)))
    return _entry("misc", "tbdcore", fields | {key: about.get(key) for key in ("version", "doi")})


def _name(who):
    """An author of CITATION.cff: a person, or an entity that BibTeX must not take apart."""
    if "name" in who:
        return f"{{{products.tex(who['name'])}}}"
    return products.tex(f"{who['family-names']}, {who['given-names']}")


def _escaped(text):
    return re.sub(r"([&%$#_{}])", r"\\\1", text)


def entries(page="", id=""):
    """BibTeX as `bibliography`, for a report: with address and commit of the clone if git knows
    them, a line for what it does not know, and the id of what is cited.
    """
    origin = clone.find()
    said = "".join(f"% {line}\n" for line in origin.missing)
    return f"{said}{bibliography(page, origin, id)}"


def papers():
    """What papers.toml says of each paper; ValueError, naming the file, when it is damaged."""
    name = paths.bibliography().name
    try:
        tables = tomllib.loads(paths.bibliography().read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{name}: no TOML ({error}); take it from the repository again") from None
    for paper in pages.papers():
        if not isinstance(tables.get(paper), dict):
            near = f"; is [{claims.nearest(paper, tables)}] meant for it?" if tables else ""
            raise ValueError(f"{name}: there is no table [{paper}]{near}")
        if missing := [key for key in ("title", "short", "topic") if not tables[paper].get(key)]:
            raise ValueError(f"{name}: table [{paper}] has no {', '.join(missing)}; add it")
    return {paper: tables[paper] for paper in pages.papers()}


def named(about, language=""):
    """A paper of papers.toml as a text names it: authors, titles, journal and year."""
    surnames = [author.partition(",")[0] for author in about.get("authors", [])]
    authors = ", ".join([*surnames[:-2], " and ".join(surnames[-2:])])
    title, other = f"*{about['title']}*", about.get("title_zh", "")
    year = str(about.get("year", ""))
    if language:
        chinese = "：".join(filter(None, ["、".join(about.get("authors_zh", [])), other]))
        english = ": ".join(filter(None, [authors, title]))
        issue = _issue(about, "journal_zh")
        return "，".join(filter(None, [chinese, issue, year, english]))
    title += f" ({other})" if other else ""
    parts = [authors or "authors not known", title, _issue(about, "journal"), year]
    return ", ".join(filter(None, parts))


def _issue(about, key):
    """Journal, volume and number of a paper, as far as they are known."""
    return f"{about[key]} {about['volume']}({about['number']})" if key in about else ""


def topic(page):
    """What a page is about, in words."""
    return TOPICS.get(page) or papers()[page]["topic"]


def bibliography(page="", origin=None, id=""):
    """BibTeX of all papers, or of a page's if it has one, and of this repository.

    Without a clone and an id it is the same everywhere, as ``figures.bib`` has to be.
    """
    if page:
        pages.path(page)  # there is one
    listed = [paper for paper in pages.papers() if page in ("", paper)]
    return "\n".join([*map(paper_entry, listed), repository_entry(origin, id)])


def listing():
    """figures/README.md: every figure and table in a line, with the first sentence of its caption.

    `tbdcore show` has the whole caption, the data and the verdicts.
    """
    folder = paths.figures()
    uses = (
        "`tbdcore show <id>` shows caption, data and verdicts of one, `tbdcore cite <id>` cites it."
    )
    lines = ["# Figures and tables", "", f"Written by `tbdcore score`. {uses}", ""]
    for paper in pages.notebooks():
        page = pages.path(paper)
        lines += [f"## {topic(paper)}", ""]
        lines += [f"Notebook [{page.stem}]({_relative(page, folder)}).", ""]
        lines += [*map(_line, ids(paper)), ""]
    if old := retired():
        lines += ["## Retired", "", *(f"- {it}." for it in old.values()), ""]
    return "\n".join(lines)


def _line(id):
    """A product in a line of Markdown: its id, linked to the file to look at, and what it is."""
    have = files(id)
    file = have.get("gif") or have.get("png") or have.get("md") or have["json"]
    sentence = re.split(r"(?<=[^.][.?]) (?=[A-Z])", product(id)["caption"])[0]
    return f"- [{id}]({_relative(file, paths.figures())}): {sentence}"


def shown(id):
    """Caption, data and verdicts of a product, as text; of a long table the first and last rows."""
    import pandas as pd

    about, have = product(id), files(id)
    paper, text = about["paper"], f"{id}\n  {_caption(about)}\n"
    if "csv" in have:
        try:
            data = pd.read_csv(have["csv"], dtype=str, keep_default_na=False)
        except ValueError as error:  # pandas' own errors are ValueErrors
            again = f"make it anew: tbdcore run {paper}"
            raise ValueError(f"{have['csv']}: no table ({error}); {again}") from None
        lines = data.to_string(index=False, max_rows=SHOWN_ROWS)
        text += f"\n{_relative(have['csv'])}, {len(data)} rows\n{lines}\n"
    if about["claims"]:
        verdicts = claims.verdicts(paper).set_index("id").loc[about["claims"]]
        text += "\nverdicts\n" + "".join(f"  {_judged(row)}\n" for _, row in verdicts.iterrows())
    return text


def _judged(row):
    """A verdict in a line: its id, the quantity, what was published and measured, the verdict."""
    measured = f", measured {row['measured']}" if row["measured"] else ""
    number = row["measured"].lstrip("-").replace(".", "").isdigit()
    error = f" ± {row['se']}" if row["se"] and number else ""
    told = f" ({row['readings']})" if row["verdict"] == "depends" else ""
    what = f"{row.name} {row['quantity']}: published {row['published']}{measured}{error}"
    return f"{what}, {row['verdict']}{told}"


# where each kind of file keeps the id of its product; a PNG has its length, and "Title", before it
_PLACES = {
    ".pdf": rb"/Title\s*\((\w+/\w+)\)",
    ".svg": rb"<dc:title>\s*(\w+/\w+)\s*</dc:title>",
    ".png": rb"\0\0\0([\s\S])tEXtTitle\0(\w+/\w+)",
    ".gif": rb"!\xfe[\s\S](\w+/\w+)\0",
    ".md": rb"^<!-- (\w+/\w+) -->",
    ".tex": rb"^% (\w+/\w+)\n",
    ".json": rb'"id": "(\w+/\w+)"',
}


def embedded(file):
    """Id of a product, as its file says it; a CSV is found again by its content.

    Raises ValueError when it is no product of ours, FileNotFoundError when there is no file.
    """
    if not file.is_file():
        raise FileNotFoundError(f"{file}: no such file; give a product that tbdcore has made")
    kind, content, id = file.suffix.lower(), file.read_bytes(), ""
    if kind == ".csv":
        tables = (files(id).get("csv") for id in ids())
        same = (table for table in tables if table and table.read_bytes() == content)
        id = next((f"{table.parent.name}/{table.stem}" for table in same), "")
    elif mark := re.search(_PLACES.get(kind, rb"(?!)"), content, re.MULTILINE):
        *length, text = mark.groups()
        id = text[: length[0][0] - len("Title\0") if length else None].decode()
    if id.partition("/")[0] not in pages.notebooks():
        why = "a picture carries its id, a CSV must be one of those in figures/"
        raise ValueError(f"{file}: no product of this repository ({why})")
    return id


def which(file):
    """What a file is, as text, and whether the sources that made it are the present ones.

    A copy with the bytes of the product in ``figures/`` was made by what the record there says; a
    file beside a record of its own id, by what that says.
    """
    id = embedded(file)
    if id in (old := retired()):
        return f"{old[id]}\n", False
    paper, kept = id.partition("/")[0], paths.figures() / f"{id}{file.suffix.lower()}"
    same = kept.is_file() and kept.read_bytes() == file.read_bytes()
    about = _record_of(file, id) or (_record_of(kept, id) if same else {})
    now, made = pages.digest(paper), about.get("digest", "")
    copy = "the same bytes as" if same else "differs from" if kept.is_file() else "there is no"
    caption = (about or _record_of(kept, id)).get("caption")
    state = f"stale: made by the sources {made}, the present ones are {now}"
    if not about:
        state = "made by a run whose record is not here"
    elif made == now:
        state = f"current: made by the present sources ({made})"
    again = f"make it again: {about.get('remake', f'tbdcore run {paper}')}"
    lines = filter(None, (id, caption, state, f"{copy} {_relative(kept)}", again))
    return "\n  ".join(lines) + "\n", not about or made == now


def _record_of(file, id):
    """The record beside a file if it is of this id, else nothing."""
    beside = file.with_name(f"{id.partition('/')[2]}.json")
    about = products.record(beside) if beside.is_file() else {}
    return about if about.get("id") == id else {}
