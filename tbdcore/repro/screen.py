"""What a page shows a reader: figures with their captions, and the first screen.

The first screen is rendered from the committed products, never from the present run, so that a
reader who opens a page sees what came out before the page has run.  A default run compares it with
its own results when it publishes (``check``).
"""

import re

from tbdcore.repro import claims, paths, products

_SHOWN = {}  # paper -> rows of its first screen's table, and the table as it was shown
_EXHIBITS = {}  # id -> table and caption of a product that a first screen has shown


class Exhibit:
    """A figure on a page: the picture, with its caption as alternative text, and the caption."""

    def __init__(self, id, caption, png):
        self.id, self.caption, self.png = id, caption, png

    def __repr__(self):
        return f"{self.id}: {self.caption}"

    def _ipython_display_(self):
        from IPython.display import Markdown, display

        alt = {"image/png": {"alt": self.caption}}
        picture = {"image/png": self.png, "text/plain": f"<{self.id}>"}
        display(picture, raw=True, metadata=alt)
        display(Markdown(f"*{self.id}.* {self.caption}"))


class Table(str):
    """A table on the first screen, in Markdown."""

    def _repr_markdown_(self):
        return str(self)

    __repr__ = _repr_markdown_


def outcome(paper, rows):
    """The table of a first screen: for each row what, published, measured, verdict.

    `rows` maps what is measured, in words, to the id of its claim.  Without committed verdicts
    the table says "not yet run".
    """
    text = _table(paper, rows, paths.PRODUCTS)
    _SHOWN[paper] = dict(rows), text
    return Table(text)


def here(measured, se):
    """What was measured, as text, with its standard error; in words that of the margin."""
    if not se:
        return measured
    number = re.fullmatch(r"(.*margin )?[-+.\de]+( \w+)?", measured)
    return f"{measured} ± {se}" if number else f"{measured}; error of the margin {se}"


def _table(paper, rows, folder):
    head = "| | published | here | verdict |\n|---|---|---|---|\n"
    try:
        found = claims.verdicts(paper, folder).set_index("id")
    except (FileNotFoundError, ValueError):
        lines = "".join(f"| {what} | | | not yet run |\n" for what in rows)
        return f"{head}{lines}\n*Not yet run.*\n"
    about, lines = next(map(products.record, sorted((folder / paper).glob("*.json"))), None), []
    for what, id in rows.items():
        if id not in found.index:
            raise ValueError(f"{paper}: no claim {id!r} for the first screen; correct its id")
        row = found.loc[id]
        kind = f" ({row['evidence']})" if row["evidence"] not in ("", "measured") else ""
        own = about and row["n"] not in ("", str(about["trials"]))  # another number of trials
        found_here = here(row["measured"], row["se"]) + (f" (n = {row['n']})" if own else "")
        lines.append(f"| {what} | {row['published']} | {found_here} | {row['verdict']}{kind} |\n")
    known = f": seed {about['seed']}, {about['trials']} trials" if about else ""
    return f"{head}{''.join(lines)}\n*Default run{known}; ± one standard error.*\n"


def exhibit(id):
    """A committed figure, ``exhibit("track_cfar/fig05")``, or table; a line where there is none."""
    file = paths.PRODUCTS / f"{id}.png"
    _EXHIBITS[id] = text, caption = _text(paths.PRODUCTS, id)
    if text:
        return Table(f"{text.partition('-->')[2].strip()}\n\n*{caption}*")
    if not file.is_file():
        return Table(f"*{id}: not yet run.*")
    return Exhibit(id, caption, file.read_bytes())


def _text(folder, id):
    """Table and caption of a product, each empty where there is none."""
    about, table = folder / f"{id}.json", folder / f"{id}.md"
    text = table.read_text(encoding="utf-8") if table.is_file() else ""
    return text, products.record(about)["caption"] if about.is_file() else ""


def check(paper, folder):
    """Raise RuntimeError when the first screen showed other values, tables or captions than those
    in a folder.
    """
    rows, text = _SHOWN.get(paper, ({}, ""))
    old = bool(rows) and text != _table(paper, rows, folder)
    own = [id for id in _EXHIBITS if id.startswith(f"{paper}/")]
    old |= any(_EXHIBITS[id] != _text(folder, id) for id in own)
    if old:
        raise RuntimeError(f"{paper}: first screen is stale; run again")
