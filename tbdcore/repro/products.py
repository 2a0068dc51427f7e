"""Products as files: text of tables, writing, and the records of what made them.

A product is a set of files with one name, ``<paper>/<name>``.  Its JSON, the *record*, says what
made it: caption, parameters, seed, trials, claims shown, package versions, and a digest of its
sources (``pages.digest``).
"""

import hashlib
import json
import math
import os
import re
import textwrap
from importlib.metadata import version

from tbdcore.repro.processes import signals_held

RECORDED = ("id", "caption", "paper", "claims", "files", "seed", "trials", "digest")


def write(folder, files, old=()):
    """Write files (name -> bytes) into a folder, all or none; then remove the files `old`.

    All are written beside their places first, then renamed; a signal that asks the run to end
    waits until the renaming is done.  Raises OSError, with nothing replaced, when the folder
    cannot be made or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    parts = {name: folder / f".{name}.{os.getpid()}.part" for name in files}
    try:
        for name, part in parts.items():
            part.write_bytes(files[name])
        with signals_held():
            for name, part in parts.items():
                os.replace(part, folder / name)
            for file in old:
                file.unlink(missing_ok=True)
    finally:
        for part in parts.values():
            part.unlink(missing_ok=True)


def record(file):
    """What a product's JSON file says of it; ValueError, naming the file, when it is damaged."""
    try:
        about = dict(json.loads(file.read_text(encoding="utf-8")))
        _ = [about[key] for key in RECORDED]
        return about
    except (ValueError, TypeError, KeyError):
        again = f"make the products anew: tbdcore run {file.parent.name}"
        raise ValueError(f"{file}: damaged; delete it, then {again}") from None


def digest(contents):
    """Short hash of some byte strings."""
    each = b"".join(hashlib.sha256(content).digest() for content in contents)
    return hashlib.sha256(each).hexdigest()[:16]


def versions():
    """Versions of the packages that numbers and pictures depend on."""
    return {name: version(name) for name in ("numpy", "scipy", "numba", "matplotlib", "pandas")}


def table_files(frame, name, id):
    """A frame as the files of a table: CSV, Markdown and LaTeX by name."""
    return {
        f"{name}.csv": csv(frame),
        f"{name}.md": f"<!-- {id} -->\n\n{markdown(frame)}".encode(),
        f"{name}.tex": f"% {id}\n{latex(frame)}".encode(),
    }


def csv(frame):
    """A frame as CSV, numbers to six digits: the same on all CPUs, and more than figures show."""
    named = _named(frame.index)
    return frame.to_csv(index=named, float_format="%.6g", lineterminator="\n").encode()


def _named(index):
    """Whether an index names the rows, or only counts them."""
    return index.names != [None] or type(index).__name__ != "RangeIndex"


def _cells(frame):
    """Lines of a frame as text, the header first; an index that names rows becomes a column."""
    if _named(frame.index):
        frame = (frame.rename_axis("") if frame.index.names == [None] else frame).reset_index()
    header = [" ".join(map(str, it)) if isinstance(it, tuple) else it for it in frame.columns]
    return [list(map(_cell, row)) for row in (header, *frame.itertuples(index=False, name=None))]


def _cell(value):
    """One cell as text; NaN is empty."""
    number = isinstance(value, float)  # NumPy's double is one
    return str(value) if not number else "" if math.isnan(value) else f"{value:.6g}"


def markdown(frame):
    """A frame as a Markdown table."""
    header, *rows = _cells(frame)
    lines = [header, ["---"] * len(header), *rows]
    escaped = [" | ".join(cell.replace("|", r"\|") for cell in line) for line in lines]
    return "".join(f"| {line} |\n" for line in escaped)


_LETTERS = """alpha beta gamma delta eta theta kappa lambda mu pi rho sigma tau phi chi omega
Delta Lambda Sigma Omega le ge times to pm infty approx"""
_SYMBOLS = zip("αβγδηθκλμπρστφχωΔΛΣΩ≤≥×→±∞≈", _LETTERS.split(), strict=True)
_TEX = {c: "\\" + c for c in "&%$#_{}"} | {c: rf"\ensuremath{{\{name}}}" for c, name in _SYMBOLS}
_TEX |= {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
_TO_TEX = str.maketrans(_TEX)
_SYMBOL = re.compile(r"\b([A-Za-z])_([A-Za-z0-9]{1,3}|FA|TAR)\b")  # P_d, R_T, r_P
_LONG = re.compile(r"(?<=[a-z]{2})_(?=[a-z]{2})")  # tested_from may be broken, P_d not
_NUMBER = re.compile(r"[-+−]?[\d.]+(e[-+]?\d+)?( ± [\d.]+)?|")


def latex(frame):
    """A frame as a LaTeX tabular with booktabs rules.

    Cells in dollars stay mathematics, symbols such as P_d and ± become it, everything else is
    escaped; columns of numbers are aligned to the right.  Headers wider than their column are
    broken, and so are long texts, in columns of 13 em or what a page on its side leaves for them.
    """
    header, *rows = _cells(frame)
    columns = [*zip(header, *rows, strict=True)]
    long, em = _broken(columns)
    head, form = [], ""
    for is_long, (name, *column) in zip(long, columns, strict=True):
        width = max(map(len, column), default=0)
        place = "r" if all(map(_NUMBER.fullmatch, column)) else "l"
        head.append(_stack(name, max(width, 9), place))
        form += f"p{{{em}em}}" if is_long else place
    lines = [" & ".join(line) + r" \\" for line in (head, *(map(tex, row) for row in rows))]
    lines = [rf"\begin{{tabular}}{{{form}}}", r"\toprule", lines[0], r"\midrule", *lines[1:]]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def _broken(columns):
    """Which columns are broken into lines, and how wide, in em: those of more than 34 letters, 13;
    where that is wider than a page on its side, 540 pt at 8 pt, every text, to what room is left.
    """
    widths = [max(map(len, column), default=0) for _, *column in columns]
    texts = (" ".join([_LONG.sub("_ ", name), *column]) for name, *column in columns)
    words = [max(map(len, text.split()), default=0) for text in texts]
    for least in (34, 14):
        long = [w > max(least, word) for w, word in zip(widths, words, strict=True)]
        kept = [max(w, word) for w, word, it in zip(widths, words, long, strict=True) if not it]
        room = 540 - sum(4.1 * width for width in kept) - 6 * len(columns)
        em = int(room / 8.5 / max(1, sum(long)))
        if em >= 13 * any(long):
            break
    return long, max(5, min(em, 13))


def _stack(text, width, place):
    """A header in as many lines as its column's width asks for."""
    parts = textwrap.wrap(_LONG.sub("_ ", text), width, break_long_words=False)
    lines = [text] if "$" in text or len(text) <= width else parts
    stacked = r" \\ ".join(tex(line.replace("_ ", "_")) for line in lines)
    return stacked if len(lines) < 2 else rf"\shortstack[{place}]{{{stacked}}}"


def tex(text):
    """Text with LaTeX's special characters escaped outside mathematics."""
    text = _SYMBOL.sub(r"$\1_{\\mathrm{\2}}$", text) if "$" not in text else text
    pieces = re.split(r"(\$[^$]+\$)", text)
    pieces[::2] = [piece.translate(_TO_TEX) for piece in pieces[::2]]
    return "".join(pieces)
