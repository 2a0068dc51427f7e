"""Where a printed value still stands after it was corrected in the claims file.

Searched are the texts about a paper that are written by hand (``texts``).  A value is found as it
is printed, and as a number that follows from it in a plain way (``following``).  What cannot be
found: a value of one digit, one in words, and a number that follows in another way or from several
values, or is rounded to fewer than three digits.
"""

import json
import math
import re

from tbdcore.repro import claims, pages, paths

COLUMNS = ("quantity", "conditions", "value", "rule", "cause")
FILES = ("data/papers.toml", "data/readings.csv", "README*.md", "docs/*.md")
DIGITS = 3  # a number with fewer is no sure sign of a copy
NUMBER = re.compile(r"(?<![A-Za-z_\d.])\d+(?:\.\d+)?(?!\.?\d)")


def texts(paper):
    """Place and text: columns of the claims; cells of the page and of those without claims, whose
    code counts too; lines of the files on all papers.
    """
    for claim in claims.read(paper).values():
        for column in COLUMNS:
            yield f"{paper}.csv, {claim.id}, {column}", getattr(claim, column)
    for page in {paper} | {*pages.notebooks()} - {*pages.papers()}:
        file = pages.path(page)
        for number, cell in enumerate(json.loads(file.read_text(encoding="utf-8"))["cells"]):
            yield f"{file.name}, cell {number}", "".join(cell["source"])
    for file in sorted(file for pattern in FILES for file in paths.root().glob(pattern)):
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
            yield f"{file.relative_to(paths.root())}, line {number}", line


def copies(paper, old, now, in_progress):
    """The places that have the old value of a claim, in lines.

    While the correction is in progress also those with a number that may follow from it, and with
    a value that another row prints too or that has two digits only.
    """
    least = 2 if in_progress else DIGITS
    wanted = re.compile(rf"(?<![\d.]){re.escape(old)}(?!\.?\d)")
    every = [*texts(paper)]
    if len(_digits(old)) < least:
        return []
    if not in_progress and any(wanted.search(text) for place, text in every if "value" in place):
        return []
    lines = [f"{place}: still has {old}" for place, text in every if wanted.search(text)]
    for place, text in every if in_progress else ():
        numbers = [it for it in NUMBER.findall(text) if it != old and _follows(it, old, now)]
        lines += [f"{place}: {it} may follow from {old}" for it in dict.fromkeys(numbers)]
    return lines


def following(value):
    """What follows from a printed number: itself, its inverse, what a share leaves, the decibels of
    a ratio, the ratio of decibels, the share that these save; nothing from a text.

    >>> [round(number, 4) for number in following("4.72")]
    [4.72, 0.2119, 95.28, 6.7394, 2.9648, 0.6627]
    """
    try:
        p = abs(claims.parse(value)[0])
    except ValueError:
        return []
    if not 0 < p <= 100:
        return [p]
    rest = 1 - p if p <= 1 else 100 - p
    return [p, 1 / p, rest, 10 * math.log10(p), 10 ** (p / 10), 1 - 10 ** (-p / 10)]


def _follows(number, old, now):
    """Whether a number has the digits of one that follows from the old value, not from the new."""
    digits = _digits(number)
    if len(digits.rstrip("0")) < DIGITS:
        return False
    gives = [{_rounded(it, len(digits)) for it in following(value)} for value in (old, now)]
    return digits in gives[0] - gives[1]


def _digits(text):
    """The digits of a number from the first that is not zero: 0.0345 has 345, 3.45 too."""
    return re.sub(r"\D", "", text).lstrip("0")


def _rounded(number, count):
    """The first digits of a number, rounded."""
    return _digits(f"{number:.{count - 1}e}".partition("e")[0])
