"""Citing: from a figure or table to its caption, files and bibliography, and from a file back to
what made it.

A product has the id ``<paper>/<name>``, for instance ``track_cfar/fig05``; the JSON beside it says
everything about it.  ``text`` writes what a report needs (a LaTeX environment, Markdown, BibTeX),
``which`` reads the id in a PDF, SVG or PNG that lies anywhere and says whether the sources have
changed since, ``gallery`` and ``bibliography`` are the pages ``figures/README.md`` and
``figures/figures.bib``.

Bibliographic fields come from ``data/papers.toml`` and, for this repository, from ``CITATION.cff``;
what is not known is left out. A paper without authors gets a ``key``, which BibTeX sorts by
instead.
"""

import os
import re
import tomllib
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from tbdcore.repro import claims, figures, pages, paths

ARTICLE = ("author", "title", "journal", "year")  # what BibTeX requires of an @article
# a table as it is, or as wide as the text
NARROWER = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"
FIELDS = (
    "author",
    "title",
    "journal",
    "volume",
    "number",
    "pages",
    "year",
    "version",
    "doi",
    "url",
    "key",
)


class Found(NamedTuple):
    """What a file says of itself: its id, the hash of the sources and the command that made it
    (None where it does not say).
    """

    id: str
    sources: str | None
    remake: str | None


def ids(folder=None):
    """Ids of all products, paper by paper, the papers' own figures and tables first."""
    found = [
        file
        for paper in pages.everything()
        for file in sorted(((folder or paths.figures()) / paper).glob("*.json"), key=_rank)
    ]
    return [f"{file.parent.name}/{file.stem}" for file in found]


def _rank(file):
    """Order in a gallery: fig1, fig2, fig10, table1, then everything else by name."""
    kind, number, rest = re.fullmatch(r"([a-z_]*)(\d*)(.*)", file.stem).groups()
    return (
        ("fig", "table").index(kind) if kind in ("fig", "table") else 2,
        kind,
        int(number or 0),
        rest,
    )


def product(id, folder=None):
    """Everything that is known of a product; raises ValueError, with the nearest id, when there is
    none.
    """
    folder = folder or paths.figures()
    if id not in ids(folder):
        known = ids(folder)
        advice = (
            f"the nearest is {claims.nearest(id, known)!r}"
            if known
            else "there are none in this folder; make them: tbdcore run"
        )
        raise ValueError(f"{id!r}: no such figure or table; {advice}")
    return figures.record(folder / f"{id}.json")


def files(id, folder=None):
    """Files of a product by extension."""
    folder = folder or paths.figures()
    found = [
        (folder / f"{id}.{extension}")
        for extension in ("pdf", "svg", "png", "md", "tex", "csv", "json")
    ]
    return {file.suffix[1:]: file for file in found if file.is_file()}


def text(id, form="", folder=None):
    """What a report needs of a product.

    `form` is "caption", "bibtex", "latex" (a figure or table environment), "markdown", or empty for
    everything at a glance. Paths in it are relative to the present folder, where the report is.
    """
    about, have = product(id, folder), files(id, folder)
    if form == "caption":
        return f"{about['caption']}\n"
    if form == "bibtex":
        own = (
            [paper_entry(about["paper"])] if about["paper"] in _papers() else []
        )  # the index is of no paper
        return "\n".join([*own, repository_entry()])
    if form == "latex":
        return _latex(about, have)
    if form == "markdown":
        return _markdown(about, have)
    names = "".join(f"  {_here(file)}\n" for file in have.values())
    return f"{id}\n  {about['caption']}\n  {_provenance(about)}\n\n{names}\n{text(id, 'bibtex', folder)}"


def _provenance(about):
    """Seed, trials and sources of a product."""
    remake = about.get("remake") or f"tbdcore run {about['paper']}"
    return f"seed {about['seed']}, {about['trials']} trials, sources {about['sources']}; {remake}"


def _here(file, start=None):
    """A path relative to a folder, by default the present one."""
    return Path(os.path.relpath(file, start)).as_posix()


def _latex(about, have):
    """A figure or a table environment, which needs no other packages than graphicx and booktabs."""
    kind = "figure" if "png" in have or "pdf" in have else "table"
    if {"figure": "pdf", "table": "tex"}[kind] not in have:
        raise ValueError(
            f"{about['id']}: its files are incomplete; make them anew: tbdcore run {about['paper']}"
        )
    label = f"\\label{{{kind[:3]}:{about['id'].replace('/', ':')}}}"
    source = _after(about)
    says = figures.tex(about["caption"].rstrip(" ."))
    caption = f"\\caption{{{says}. {source} with~\\cite{{tbdcore}}.}}"
    if kind == "figure":
        body = [f"\\includegraphics[width=\\linewidth]{{{_here(have['pdf'])}}}", caption, label]
    else:
        body = [caption, label, r"\smallskip", NARROWER, f"  \\input{{{_here(have['tex'])}}}}}%"]
    package = {"figure": "graphicx", "table": "booktabs,graphicx"}[kind]
    entries = _here(next(iter(have.values())).parent.parent / "figures")
    lines = [
        f"% needs \\usepackage{{{package}}}, and \\bibliography{{{entries}}} with "
        f"\\bibliographystyle{{plain}}"
    ]
    lines += [f"\\begin{{{kind}}}", "  \\centering", *(f"  {line}" for line in body)]
    return "\n".join([*lines, f"\\end{{{kind}}}", ""])


def _after(about):
    """How a caption names the paper: a product of ours beyond the paper is not after it."""
    name = about["id"].partition("/")[2]
    if about["paper"] not in _papers():
        return "Computed"
    return f"{'Not in' if name.startswith(('beyond_', 'open_')) else 'After'}~\\cite{{{about['paper']}}}, computed"


def _markdown(about, have):
    """A picture with its caption, or the table."""
    if "png" in have:
        return f"![{about['caption']}]({_here(have['png'])})\n"
    return f"{have['md'].read_text(encoding='utf-8')}\n{about['caption']}\n"


# Bibliography -------------------------------------------------------------------------------------
# ---------------------


def entry(kind, key, fields):
    """A BibTeX entry of fields in TeX; empty ones are left out."""
    lines = [f"  {name} = {{{fields[name]}}}," for name in FIELDS if fields.get(name)]
    return "\n".join([f"@{kind}{{{key},", *lines, "}", ""])


def paper_entry(paper):
    """BibTeX of a paper: an @article where everything is known that one needs, else a @misc."""
    about = _papers()[paper]
    fields = {name: _latin(str(about.get(name, ""))) for name in FIELDS}
    fields["author"] = figures.tex(" and ".join(about.get("authors", ())))
    fields["key"] = "" if fields["author"] else fields["title"]
    fields["title"] = f"{{{fields['title']}}}"
    fields["pages"] = fields["pages"].replace("-", "--")
    return entry("article" if all(fields[name] for name in ARTICLE) else "misc", paper, fields)


def _latin(text):
    """Text in TeX without what stands in brackets in Chinese, which pdfTeX cannot set."""
    return figures.tex(re.sub(r"\s*\([^)]*[\u3000-\u9fff][^)]*\)", "", text))


def repository_entry():
    """BibTeX of this repository, from CITATION.cff."""
    import yaml

    try:
        about = yaml.safe_load(paths.CITATION.read_text(encoding="utf-8"))
        author, title = (
            " and ".join(map(_name, about["authors"])),
            f"{{{figures.tex(about['title'])}}}",
        )
    except (yaml.YAMLError, KeyError, TypeError):
        raise ValueError(
            f"{paths.CITATION.name}: no authors or no title in it; "
            f"take it from the repository again"
        ) from None
    fields = {
        "author": author,
        "title": title,
        "version": about.get("version"),
        "year": str(about.get("date-released", ""))[:4],
        "doi": about.get("doi"),
        "url": about.get("repository-code"),
    }
    return entry("misc", "tbdcore", fields)


def _name(who):
    """An author of CITATION.cff: a person, or an entity that BibTeX must not take apart."""
    return (
        f"{{{figures.tex(who['name'])}}}"
        if "name" in who
        else figures.tex(f"{who['family-names']}, {who['given-names']}")
    )


def _papers():
    return tomllib.loads((paths.DATA / "papers.toml").read_text(encoding="utf-8"))


def bibliography():
    """figures.bib: every paper and this repository."""
    return "\n".join([*(paper_entry(paper) for paper in pages.papers()), repository_entry()])


# Gallery ------------------------------------------------------------------------------------------
# ---------------------


def gallery(folder=None):
    """figures/README.md: every figure and table with its caption, the verdicts of the claims it
    shows, and its files.
    """
    folder = folder or paths.figures()
    lines = [
        "# Figures and tables",
        "",
        "Written by `tbdcore score`. Cite one with `tbdcore cite <id>`, "
        "trace a file with `tbdcore which <file>`.",
        "",
    ]
    for paper in pages.everything():
        about, page = _papers().get(paper), pages.path(paper)
        said = f"{about['short']}: *{about['title']}*. " if about else ""
        lines += [
            f"## {about['topic'] if about else 'All papers'}",
            "",
            f"{said}Notebook [{page.stem}]({_here(page, folder)}).",
            "",
        ]
        verdicts = claims.verdicts(paper, folder).set_index("id") if about else pd.DataFrame()
        for id in ids(folder):
            lines += _exhibit(id, verdicts, folder) if id.startswith(f"{paper}/") else []
    return "\n".join(lines)


def _exhibit(id, verdicts, folder):
    """One figure or table of the gallery."""
    about, have = product(id, folder), files(id, folder)
    links = ", ".join(f"[{extension}]({_here(file, folder)})" for extension, file in have.items())
    show = (
        [f"![{about['caption']}]({_here(have['png'], folder)})"]
        if "png" in have
        else [have["md"].read_text(encoding="utf-8")]
    )
    shown = [(claim, verdicts.loc[claim]) for claim in about["claims"] if claim in verdicts.index]
    judged = [f"- `{claim}` {_judged(row)}" for claim, row in shown]
    return [
        f"### {id}",
        "",
        *show,
        "",
        f"{about['caption']} ({links})",
        "",
        *judged,
        *([""] if judged else []),
    ]


def _judged(row):
    """A verdict in a line: the quantity, what was published and measured, the verdict."""
    measured = f", measured {row['measured']}" if row["measured"] else ""
    error = (
        f" ± {row['se']}"
        if row["se"] and row["measured"].lstrip("-").replace(".", "").isdigit()
        else ""
    )
    return f"{row['quantity']}: published {row['published']}{measured}{error}, **{row['verdict']}**"


# Tracing ------------------------------------------------------------------------------------------
# ---------------------


def embedded(file):
    """What a product says of itself; raises ValueError when it says nothing, FileNotFoundError when
    it is not there.
    """
    if not file.is_file():
        raise FileNotFoundError(
            f"{file}: no such file; give a PDF, SVG or PNG that tbdcore has made"
        )
    kind, content = file.suffix[1:].lower(), file.read_bytes()
    read = {"pdf": _pdf, "svg": _svg, "png": _png}.get(kind)
    if read is None:
        about = _beside(file)
        return _found([about.get(name) for name in ("id", "sources", "remake")], file)
    said = read(content)
    return _found([said.get(name) for name in figures.EMBEDDED[kind]], file)


def _beside(file):
    """The record that lies beside a product, empty without one."""
    path = file.with_suffix(".json")
    return figures.record(path) if path.is_file() else {}


def _found(said, file):
    if not re.fullmatch(r"[a-z0-9_]+/[a-z0-9_]+", said[0] or ""):
        raise ValueError(
            f"{file.name}: no product of this repository (no id in it); give a PDF, "
            f"SVG or PNG that tbdcore has made"
        )
    return Found(*said)


def _pdf(content):
    """Plain strings of a PDF's document information."""
    pairs = re.findall(rb"/(Title|Subject|Keywords) \(((?:[^()\\]|\\.)*)\)", content)
    return {
        name.decode(): re.sub(r"\\(.)", r"\1", value.decode("latin-1")) for name, value in pairs
    }


def _svg(content):
    """Dublin Core elements of an SVG; the first title is the picture's, the second its creator's."""
    from html import unescape

    pairs = re.findall(
        r"<dc:(title|source|description)>(.*?)</dc:\1>",
        content.decode("utf-8", "replace"),
        re.DOTALL,
    )
    return {name.capitalize(): unescape(value.strip()) for name, value in reversed(pairs)}


def _png(content):
    """Text chunks of a PNG."""
    said, at = {}, 8
    while at + 8 <= len(content):
        size, kind = int.from_bytes(content[at : at + 4]), content[at + 4 : at + 8]
        if kind == b"tEXt":
            name, _, value = content[at + 8 : at + 8 + size].partition(b"\0")
            said[name.decode("latin-1")] = value.decode("latin-1")
        at += size + 12
    return said


def which(file, folder=None):
    """What a file is, as text, and whether the sources that made it are the present ones."""
    found = embedded(file)
    paper = found.id.partition("/")[0]
    kept = (folder or paths.figures()) / f"{found.id}{file.suffix}"
    same = kept.is_file() and kept.read_bytes() == file.read_bytes()
    now, made = pages.sources(paper), found.sources or "unknown"
    state = (
        "current, the sources are the same" if made == now else f"stale, the sources are now {now}"
    )
    beside = _beside(file)
    known = beside if beside.get("id") == found.id else _beside(kept) if same else {}
    caption = [known["caption"]] if known else []
    data = f", data/claims/{paper}.csv" if paper in claims.papers() else ""
    sources = (
        f"sources {made}: {pages.path(paper).name}{data} and the modules of the package behind it"
    )
    copy = (
        f"{'the same bytes as' if same else 'differs from'} {_here(kept)}"
        if kept.is_file()
        else f"there is no {_here(kept)}"
    )
    lines = [
        found.id,
        *caption,
        sources,
        state,
        copy,
        f"remake: {found.remake or f'tbdcore run {paper}'}",
    ]
    return "\n  ".join(lines) + "\n", made == now
