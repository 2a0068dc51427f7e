"""What a page shows a reader: the first screen, figures with captions, published beside measured.

The first screen is made of the committed products, so that a reader sees what came out before the
page has run.  A default run shows it anew when it has published (``refresh``).
"""

import ast
import re
import sys

import pandas as pd

from tbdcore.repro import claims, pages, paths, products

PARTS = ("screen.outcome", "screen.exhibit")  # calls that show products


class Table(str):
    """A table on a page, in Markdown."""

    def _repr_markdown_(self):
        return str(self)

    __repr__ = _repr_markdown_


class Exhibit:
    """A figure or a table on a page, and below it its caption; a picture's alternative text too.

    `png` is a picture, or else `text` a table in Markdown; both are empty before the first run.
    `place` names the two outputs where they may be shown anew.
    """

    def __init__(self, id, caption, png=b"", text="", place=""):
        self.id, self.caption, self.png, self.text, self.place = id, caption, png, text, place

    def __repr__(self):
        return f"{self.id}: {self.caption}"

    def show(self, update=False):
        """Show it, or put it in the place of what was shown there before."""
        alt = {"image/png": {"alt": self.caption}} if self.png else {}
        picture = {"text/plain": f"<{self.id}>", "image/png": self.png}
        _show(picture if self.png else {"text/markdown": self.text}, self.place, update, alt)
        caption = {"text/markdown": f"*{self.id}.* {self.caption}"}
        _show(caption, self.place and f"{self.place} caption", update)

    _ipython_display_ = show


class Part(Table):
    """A table made of the committed products, in a named place, where it may be shown anew."""

    def __new__(cls, text, place):
        part = super().__new__(cls, text)
        part.place = place
        return part

    def show(self, update=False):
        """Show it, or put it in the place of what was shown there before."""
        _show({"text/markdown": str(self)}, self.place, update)

    _ipython_display_ = show


def _show(data, place, update, metadata=None):
    """Show data by their types, or put them into a place where others were shown."""
    from IPython.display import display

    data = {"text/plain": data.get("text/markdown", "")} | data
    display(data, raw=True, metadata=metadata, display_id=place or None, update=update)


def refresh(paper):
    """Show the first screen of a page, and the other products that it exhibits, as they are now:
    the page's calls are made again, and what they return takes the place of what was shown.
    """
    for cell in pages.cells(paper):
        nodes = ast.walk(ast.parse(cell)) if "screen." in cell else ()
        for call in (ast.unparse(node) for node in nodes if isinstance(node, ast.Call)):
            if call.startswith(PARTS):
                eval(call, {"screen": sys.modules[__name__]}).show(update=True)


def outcome(paper, rows):
    """The table of a first screen: for each row what, published, measured, verdict; `rows` maps
    what is measured, in words, to the id of its claim.
    """
    head = "| | published | here | verdict |\n|---|---|---|---|\n"
    lines, said = _outcome_lines(paper, rows)
    return Part(f"{head}{''.join(lines)}\n*{said}*\n", f"{paper} outcome")


def _outcome_lines(paper, rows):
    """The lines of a first screen, and which run they come from."""
    folder = paths.products()
    try:
        verdicts = claims.verdicts(paper, folder).set_index("id")
    except (FileNotFoundError, ValueError):
        return [f"| {what} | | | not yet run |\n" for what in rows], "Not yet run."
    about, lines = next(map(products.record, sorted((folder / paper).glob("*.json"))), None), []
    for what, id in rows.items():
        if id not in verdicts.index:
            raise ValueError(f"{paper}: no claim {id!r} for the first screen; correct its id")
        row = verdicts.loc[id]
        kind = f" ({row['evidence']})" if row["evidence"] not in ("", "measured") else ""
        own = about and row["n"] not in ("", str(about["trials"]))  # another number of trials
        here = with_error(row["measured"], row["se"]) + (f" (n = {row['n']})" if own else "")
        lines.append(f"| {what} | {row['published']} | {here} | {row['verdict']}{kind} |\n")
    run = f": seed {about['seed']}, {about['trials']} trials" if about else ""
    return lines, f"Default run{run}; ± one standard error."


def exhibit(id):
    """A committed figure, ``exhibit("track_cfar/fig05")``, or table; a line where there is none."""
    text, caption = committed(id, paths.products())
    file = paths.products() / f"{id}.png"
    png = file.read_bytes() if file.is_file() else b""
    table = text.partition("-->")[2].strip()
    return Exhibit(id, caption or "Not yet run.", png, table, place=id)


def committed(id, folder):
    """Table and caption of a product, each empty where there is none."""
    about, table = folder / f"{id}.json", folder / f"{id}.md"
    text = table.read_text(encoding="utf-8") if table.is_file() else ""
    return text, products.record(about)["caption"] if about.is_file() else ""


def with_error(measured, se):
    """What was measured, as text, with its standard error; in words that of the margin."""
    if not se:
        return measured
    number = re.fullmatch(r"(.*margin )?[-+.\de]+( \w+)?", measured)
    return f"{measured} ± {se}" if number else f"{measured}; error of the margin {se}"


def _number(value, se):
    return with_error(claims.digits(value, se), f"{se:.2g}" if se else "")


def this_run(ledger, rows):
    """Published values beside those of the present run, without verdicts; `rows` maps what is
    measured, in words, to (id of its claim or "", measured, standard error), or to the id alone of
    a claim that the ledger has judged.
    """
    lines = []
    for what, row in rows.items():
        if isinstance(row, str):
            judged = ledger.named(row, ledger.verdicts, "claim judged so far")
            lines.append((what, judged.published, with_error(judged.measured, judged.se)))
        else:
            id, measured, se = row
            printed = claims.published(ledger.named(id, ledger.claims)) if id else ""
            lines.append((what, printed, _number(measured, se)))
    frame = pd.DataFrame(lines, columns=["", "published", "this run"])
    return Table(f"{products.markdown(frame)}\n*± one standard error.*\n")
