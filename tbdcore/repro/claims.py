"""Published numbers, our numbers, and what may be said of the two.

``data/claims/<paper>.csv`` lists everything a paper publishes, one row each.  All values are read
as text: "287.10" says that its last digit is a hundredth, the number 287.1 does not.  A notebook
opens a ledger for its paper and enters one verdict for each row:

================  ===========================================================================
``reproduced``    the print lies within the chance of both runs, and we know the value at
                  least as well as the paper did
``differs``       neither the print's rounding nor chance explains the difference; the file
                  must give a cause
``depends``       measured, and ``reproduced`` under one reading of the paper's words, ``differs``
                  under another
``inconclusive``  neither can be said
``untestable``    needs what nobody here has, is an opinion, or judges an implementation's
                  choice instead of the method; with the reason
``used``          an input: the parameter the code runs with equals the printed one
================  ===========================================================================

``judge`` and ``judge_margins`` hold the statistic.  Beside each verdict stands its *evidence*:
``measured`` (the experiment could have come out the other way), ``calibrated`` (an unprinted
choice was made with this number, or another of its column, in view), ``constructed`` (follows
from definitions, arithmetic or the page's own assumptions), ``repeats <id>`` (the same
measurement as another row).  Only measured rows make the headline.

The *rule* of a row says in a sentence what is measured and on which trials, and gives the numbers
of the judgement as ``; name = number``.  Four of them are used here: ``runs``, the paper's number
of runs; ``null``, the value of "no effect"; ``step``, the smallest difference the print could
show where its digits do not say; ``half``, the half digit of a printed bound that has no number in
its value.  The others are a page's: ``Ledger.number(id, "tolerance")``.  Rules were declared
before measuring; ``data/claims/CHANGES.md`` lists those that changed afterwards.  The measured
quantity and the margin of the others are unchanged since they were first measured; their statistic
is that of the second edition.

What a paper leaves open is a *reading*: ``data/readings.csv`` lists the words, the options, the
default and the rows that it touches.  Each other option is flown on the scenes of the default.

The ledger is complete or it fails: every row once; in a default run a cause for each ``differs``
and for nothing else.
"""

import csv
import dataclasses
import hashlib
import io
import math
import re
from fnmatch import fnmatchcase
from functools import partial
from typing import NamedTuple

import numpy as np

from tbdcore.repro import paths

KINDS = ("input", "number", "ordering", "trend", "bound", "statement")
JUDGED = ("reproduced", "differs", "depends", "inconclusive")
VERDICTS = (*JUDGED, "untestable", "used")
EVIDENCE = ("measured", "calibrated", "constructed", "repeats")
_COUNTED = """-;cells;cell;frame;frames;particles;runs;trials;power;scans (about);not printed;\
cells/frame;cell/s;1/m^2 (inferred);1/rad^2 (inferred)"""
_DIMENSIONS = {
    "number": dict.fromkeys(["", *_COUNTED.split(";")], 1.0),
    "ratio": {"%": 0.01},
    "level": {"dB": 1.0},
    "length": {"m": 1.0, "km": 1e3},
    "time": {"s": 1.0},
    "speed": {"m/s": 1.0},
    "frequency": {"Hz": 1.0, "MHz": 1e6, "GHz": 1e9},
    "angle": {"rad": 1.0, "deg": math.pi / 180},
    "turn rate": {"rad/s": 1.0},
}
UNITS = {  # printed unit: (dimension, size in the unit the code would use)
    unit: (name, size) for name, units in _DIMENSIONS.items() for unit, size in units.items()
}
LEVEL = 2.6  # standard errors of a normal law beyond which a difference is no chance


class Claim(NamedTuple):
    """One row of a claims file, all text."""

    id: str
    item: str  # table, figure or section of the paper
    quantity: str
    conditions: str
    value: str  # as printed
    unit: str
    kind: str  # one of KINDS
    where: str  # section or page that prints it
    rule: str  # how it is judged; empty for inputs and what cannot be tested
    evidence: str  # one of EVIDENCE, "repeats" with the other row's id; empty without a rule
    cause: str  # why our result differs; empty where it does not


COLUMNS = Claim._fields


class Reading(NamedTuple):
    """One row of data/readings.csv: words of a paper that can be read in several ways."""

    chapter: str
    name: str
    words: str  # or the gap
    options: list
    default: str
    rows: list  # ids of the claims that it touches
    refuted: dict  # option -> why the paper's other numbers exclude it

    def others(self):
        """The options that are flown beside the default."""
        return [each for each in self.options if each != self.default and each not in self.refuted]


class Option(NamedTuple):
    """A claim measured under another option of a reading, on the scenes of the default."""

    measured: object  # as in Ledger.check: a number, margins or a bool
    difference: object  # from the default, paired; of margins one each
    error: object = 0.0  # standard error of the difference
    se: object = 0.0  # standard error of `measured`
    n: int | None = None  # trials


class Judgement(NamedTuple):
    """What a measurement says of a claim, before it is written down."""

    verdict: str
    text: str = ""  # the number or margin
    se: float = 0.0
    z: float = math.nan
    sign_probability: float = math.nan


class Verdict(NamedTuple):
    """One row of verdicts.csv, all text."""

    id: str
    item: str
    quantity: str
    published: str
    measured: str
    se: str  # standard error of `measured`, or of its margin
    n: str  # trials
    z: str  # distance from the print, or the least margin, in standard errors
    sign_probability: str  # that the paper's own runs print this order, if it is not reproduced
    verdict: str  # one of VERDICTS
    readings: str  # how many options reproduce it, and what each gives
    evidence: str
    cause: str  # why it differs or is untestable

    def __repr__(self):
        spread = f" ± {self.se}" if self.se else ""
        count = f" (n = {self.n})" if self.n else ""
        measured = f"published {self.published}, measured {self.measured}{spread}{count}"
        return f"{self.id}: {measured}: {self.verdict}"


# The files -----------------------------------------------------------------------------------


def papers(folder=None):
    """Names of the papers that have a claims file."""
    return sorted({path.stem for path in (folder or paths.CLAIMS).glob("*.csv")} - {"declared"})


def read(paper, folder=None):
    """Claims of a paper by id.

    Raises FileNotFoundError when the paper has no file, and ValueError, naming file, row and
    column, for one that a spreadsheet has touched or a row that breaks the rules above.
    """
    path = (folder or paths.CLAIMS) / f"{paper}.csv"
    if not path.is_file():
        known = ", ".join(papers(folder))
        raise FileNotFoundError(f"{path.name}: no claims file under data/claims; papers: {known}")
    claims = records(path, Claim, _complaints)
    for number, claim in enumerate(claims.values(), start=2):
        word, _, original = claim.evidence.partition(" ")
        known = claims.get(original)
        if word == "repeats" and (known is None or known.evidence.startswith("repeats")):
            wrong = "repeats another row itself" if known else "is no row"
            raise fault(path.name, number, "evidence", f"{original!r} {wrong}; name the original")
    return claims


def records(path, kind, complaints, name=lambda row: row.id):
    """The rows of a CSV file as named tuples of text by their names; none if there is no file.

    `complaints` of a row are pairs of a column and what is wrong in it.  Raises ValueError, naming
    file, row and column, for a row that has any or is there twice, and as :func:`rows` does.
    """
    found = {}
    listed = rows(path, kind._fields) if path.is_file() else []
    for number, row in enumerate(map(kind._make, listed), start=2):
        twice = [("", f"{name(row)!r} stands there twice")] if name(row) in found else []
        for column, wrong in (*complaints(row), *twice):
            raise fault(path.name, number, column, wrong)
        found[name(row)] = row
    return found


def fault(name, number, column, wrong):
    """The error about a row of a file, with its column if one is named."""
    return ValueError(f"{name}, row {number}{f', column {column}' if column else ''}: {wrong}")


def rows(path, columns):
    """The rows of a CSV file as lists of text.

    Raises ValueError, naming file, row and column, when the file is none, has other columns or an
    incomplete row, or has been saved by a spreadsheet program.
    """
    raw, name = path.read_bytes(), path.name
    repair = "save it as plain CSV: UTF-8 without byte-order mark, LF line ends, commas"
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line, wrong = raw[: error.start].count(b"\n") + 1, f"byte {raw[error.start]:#x}"
        raise fault(name, line, "", f"not UTF-8 ({wrong}); {repair}") from None
    for mark, wrong in (("\ufeff", "a byte-order mark"), ("\r", "CR")):
        if mark in text:
            line = text[: text.index(mark)].count("\n") + 1
            raise fault(name, line, columns[0], f"there is {wrong} in the line; {repair}")
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        header, *found = list(reader) or [[]]
    except csv.Error as error:
        wrong = f"{error}; look for a quotation mark without its partner"
        raise fault(name, reader.line_num, "", wrong) from None
    wanted = f"the header is {','.join(columns)}"
    if missing := [column for column in columns if column not in header]:
        raise fault(name, 1, missing[0], f"missing; {wanted}")
    if header != list(columns):
        raise fault(name, 1, "", f"the columns are {','.join(header)}; {wanted}")
    for number, row in enumerate(found, start=2):
        if len(row) != len(columns):
            wrong = f"{len(row)} fields instead of {len(columns)}; quote fields with commas"
            raise fault(name, number, columns[min(len(row), len(columns) - 1)], wrong)
    return found


_DIFFERENCE = re.compile(r"\b(gain|loss|saving|advantage|reduction|ratio|difference)\b")


def _complaints(claim):
    """Column and fault of everything that is wrong in a row."""
    for column, allowed in (("kind", KINDS), ("unit", UNITS)):
        if (found := getattr(claim, column)) not in allowed:
            yield column, f"{found!r} is unknown; known are {', '.join(filter(None, allowed))}"
    for column in ("id", "quantity", "value"):
        if not getattr(claim, column).strip():
            yield column, "empty"
    number, rule = claim.kind == "number", numbers(claim.rule)
    if re.fullmatch(r"[+-]?\d+,\d+", claim.value):
        yield "value", f"{claim.value!r} has a decimal comma; write a point"
    if number and claim.value != "N/A" and not is_number(claim.value):
        yield "value", f"{claim.value!r} is no number; kind number needs one"
    if claim.evidence and claim.evidence.split(" ")[0] not in EVIDENCE:
        yield "evidence", f"{claim.evidence!r} is unknown; known are {', '.join(EVIDENCE)} <id>"
    if bool(claim.rule) != bool(claim.evidence):
        column = "rule" if claim.evidence else "evidence"
        yield column, "empty; a row that is judged has both"
    if claim.kind == "input" and claim.rule:
        yield "rule", "an input has none; it is compared with what the code uses"
    if claim.rule and number and _DIFFERENCE.search(claim.quantity.lower()) and "null" not in rule:
        yield "rule", "a gain, loss, ratio or difference names its null value: ; null = 0"
    if claim.rule.count(" = ") != len(rule):
        yield "rule", "an item is no number; write ; name = number"


def readings(paper, folder=None):
    """Readings of a paper by name, from the file beside the folder of the claims.

    Raises ValueError, naming file, row and column, for a damaged file, an unknown chapter, a
    default or a refuted option that is not among the options, and rows that do not exist.
    """
    path = (folder or paths.CLAIMS).parent / "readings.csv"
    listed = records(path, Reading, partial(_doubts, folder), lambda row: (row.chapter, row.name))
    found = {}
    for reading in (row for row in listed.values() if row.chapter == paper):
        options, patterns, refuted = map(_items, (reading.options, reading.rows, reading.refuted))
        touched = [id for id in read(paper, folder) if _any(id, patterns)]
        refuted = dict(re.split(": *", each, maxsplit=1) for each in refuted)
        found[reading.name] = reading._replace(options=options, rows=touched, refuted=refuted)
    return found


def _items(text):
    """The parts between semicolons."""
    return [part.strip() for part in text.split(";") if part.strip()]


def _any(id, patterns):
    return any(fnmatchcase(id, pattern) for pattern in patterns)


def _doubts(folder, row):
    """Column and fault of everything that is wrong in a row of readings.csv."""
    if row.chapter not in papers(folder):
        near = nearest(row.chapter, papers(folder))
        yield "chapter", f"{row.chapter!r} is no paper; the nearest is {near!r}"
        return
    ids, options = list(read(row.chapter, folder)), _items(row.options)
    known = ", ".join(options)
    for column in ("name", "words", "rows"):
        if not getattr(row, column).strip():
            yield column, "empty"
    if len(options) < 2 or len({*options}) < len(options):
        yield "options", f"give two or more, each once, with ; between them, not {known!r}"
    if row.default not in options:
        yield "default", f"{row.default!r} is none of the options {known}"
    for each in _items(row.rows):
        if not any(_any(id, [each]) for id in ids):
            yield "rows", f"{each!r} is no claim; the nearest is {nearest(each, ids)!r}"
    for each in _items(row.refuted):
        option, _, why = each.partition(":")
        if option not in options or option == row.default or not why.strip():
            yield (
                "refuted",
                f"{each!r}; write option: reason, the option one of {known}, no default",
            )


_ITEM = re.compile(r"; ?([a-z][a-z ]*) = ([+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?)(?![\w.])")


def numbers(rule):
    """The numbers of a rule by name: ``numbers("...; null = 0 dB; runs = 100")``."""
    return {name: float(value) for name, value in _ITEM.findall(rule)}


def rule_digest(rule):
    """Short hash of a rule, as declared.csv and CHANGES.md have it."""
    return hashlib.sha256(rule.encode()).hexdigest()[:8]


_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?")


def parse(text):
    """Value and half of its last printed digit, both in the printed unit.

    Understands "287.10" (half digit 0.005), "14 600" (thin spaces between thousands), "3e-5",
    "10^-6" and "100%".

    >>> parse("287.10")
    (287.1, 0.005)
    """
    plain = re.sub(r"(?<=\d)[\s\u2009\u202f\u00a0](?=\d{3})", "", text.strip()).removesuffix("%")
    if match := re.fullmatch(r"10\^([+-]?\d+)", plain):
        return 10.0 ** int(match[1]), 0.5 * 10.0 ** int(match[1])
    if not _NUMBER.fullmatch(plain):
        raise ValueError(f"{text!r} is no number")
    mantissa, _, exponent = plain.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(plain), 0.5 * 10.0 ** (int(exponent or 0) - decimals)


def is_number(text):
    """Whether :func:`parse` understands a text."""
    try:
        return bool(parse(text))
    except ValueError:
        return False


# The statistic -------------------------------------------------------------------------------


def quantile(n=None, points=1):
    """Standard errors beyond which a difference is no chance: 2.6, two-sided level 0.93 %.

    Below 60 trials Student's quantile of the same level; for one of several points Bonferroni's.
    """
    from scipy.special import ndtr, ndtri, stdtrit

    tail = float(ndtr(-LEVEL)) / points
    return float(-stdtrit(n - 1, tail) if n and 1 < n < 60 else -ndtri(tail))


def judge(published, half, measured, se, n=None, runs=None, null=None):
    """Verdict on a number and its z = max(0, |m - p| - h) / sqrt(s_p^2 + s^2).

    p +- h is the print, m our value with standard error s from n trials; s_p = s sqrt(n / runs)
    is the paper's own error, 0 where its runs are unknown.  A test at 2.6 standard errors: a
    number that is right is called `differs` in 0.93 % of cases at most.  `reproduced` also needs
    s <= max(s_p, h / 2), and then has power: a true difference of h + 5.5 s_p (3 h where s_p is 0)
    is found in nine of ten cases; and, for a gain or the like, a print that excludes the null.

    Returns the verdict and z (without chance 0 or infinity).
    """
    s_p = se * math.sqrt(n / runs) if n and runs else 0.0
    spread = math.hypot(s_p, se)
    z = _distance(published, half, measured, spread)
    if math.isnan(z):
        return "inconclusive", z
    if z > quantile(n):
        return "differs", z
    vacuous = null is not None and _distance(published, half, null, spread) <= quantile(n)
    known = se <= max(s_p, half / 2)
    return ("reproduced" if known and not vacuous else "inconclusive"), z


def _distance(published, half, value, spread):
    off = abs(value - published) - half
    if math.isnan(off):
        return off
    if spread == 0:
        return 0.0 if off <= half * 1e-9 else math.inf
    return max(0.0, off) / spread


def judge_margins(margins, errors, n=None, reached=False):
    """Verdict on a claim that holds where all of its margins are positive, and the least of them.

    One margin m with error s: `reproduced` when m > 2.6 s, `differs` when m < -2.6 s.  Of k
    margins each must be; one that is below -q s, q Bonferroni's quantile, makes the claim differ.
    Without chance (s = 0) a margin must be positive, or, if `reached` is enough, not negative.

    Returns the verdict and the index of the margin that decides.
    """
    m, s = np.broadcast_arrays(np.atleast_1d(margins).astype(float), np.asarray(errors, float))
    if np.isnan(m + s).any():
        return "inconclusive", int(np.isnan(m + s).argmax())
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(s > 0, m / s, np.where((m > 0) | (reached & (m == 0)), np.inf, -np.inf))
    least = int(np.lexsort((m, ratio))[0])
    if ratio[least] < -quantile(n, m.size):
        return "differs", least
    return ("reproduced" if ratio[least] > quantile(n) else "inconclusive"), least


def sign_probability(margin, se, n=None, runs=None):
    """Probability that a paper's own runs print the sign of our margin's claim: Phi(m / s)."""
    spread = math.hypot(se, se * math.sqrt(n / runs)) if n and runs else 0.0
    return math.erfc(-margin / spread / math.sqrt(2)) / 2 if spread else math.nan


def differs_between(verdict, others, options):
    """Whether a verdict is `reproduced` under one option and `differs` under another.

    `others` are the verdicts under the other `options`; those count whose paired difference from
    the default is beyond Bonferroni's quantile for all differences.
    """
    points, found = sum(np.size(option.difference) for option in options), {verdict}
    for other, option in zip(others, options, strict=True):
        limit = quantile(option.n, points) * np.asarray(option.error)
        found |= {other} if np.any(np.abs(option.difference) > limit) else set()
    return found >= {"reproduced", "differs"}


# The ledger -----------------------------------------------------------------------------------


def digits(value, se=0.0):
    """A number as text, to the second digit of its standard error; without one, seven digits.

    >>> digits(14.10632, 0.0137), digits(0.25)
    ('14.106', '0.25')
    """
    if not math.isfinite(value) or not math.isfinite(se) or not se:
        return f"{value:.7g}"
    return f"{value:.{max(0, 1 - math.floor(math.log10(se)))}f}"


class Ledger:
    """The verdicts of one paper, entered one by one and closed when complete.

    A run with default parameters is `strict`: causes must match verdicts, and a row that repeats
    another has its verdict.  With other parameters or few trials the verdicts may rightly differ,
    and only completeness is required.
    """

    def __init__(self, paper, strict=True, folder=None):
        self.paper, self.strict = paper, strict
        self.claims, self.readings = read(paper, folder), readings(paper, folder)
        self.verdicts = {}
        runs = {numbers(claim.rule).get("runs") for claim in self.claims.values()} - {None}
        self.runs = runs.pop() if len(runs) == 1 else None  # the paper's own, for its orderings

    def number(self, id, name):
        """A number of a row's rule; ValueError, with the nearest name, when it has none."""
        known = numbers(self._claim(id).rule)
        if name not in known:
            advice = f"the nearest is {nearest(name, known)!r}"
            raise self._error(f"the rule of {id} has no {name!r}; {advice}")
        return known[name]

    def check(self, id, measured, *, se=0.0, n=None, shown="", reached=False, readings=None):
        """Judge a claim by its rule; see :func:`judge` and :func:`judge_margins`.

        `measured` is our number, in the printed unit, for a row of kind number; for the other
        kinds a margin, positive where the claim holds, or an array of them, or a plain bool where
        no chance is involved.  `se` is the standard error from `n` trials.  `shown` is what the
        table shows, mandatory for a bool; a margin with an error is added to it.  `reached`: a
        margin of 0 is enough ("at least").  `readings` has the same under the other options of each
        reading that touches the row, ``{name: {option: Option(...)}}``.
        """
        claim = self._open(id)
        if claim.kind == "input":
            advice = "enter it with used(id, value) or untestable(id, reason)"
            raise self._error(f"{id} is an input; {advice}")
        if not claim.rule:
            raise self._error(f"{id} has no rule in data/claims/{self.paper}.csv")
        found = self.judged(claim, measured, se, n, reached)
        if not (shown or found.text):
            raise self._error(f"{id}: a truth value needs shown=, its evidence in words")
        if not shown or claim.kind != "number" and found.se and "margin" not in shown:
            shown = "; ".join(filter(None, (shown, found.text)))
        verdict, told = found.verdict, ""
        if readings or (self._measured(claim) and any(self.options(claim).values())):
            verdict, told = self._compared(claim, verdict, readings or {}, reached)
        return self._enter(claim, verdict, shown, found, n, told)

    def judged(self, claim, measured, se, n, reached=False):
        """What a measurement says of a claim."""
        rule = numbers(claim.rule)
        if isinstance(measured, bool | np.bool_):
            if claim.kind == "number":
                raise self._error(f"{claim.id} is a number; give the measured value")
            return Judgement("reproduced" if measured else "differs")
        if claim.kind == "number":
            value, se = float(measured), float(se)
            published, half = parse(claim.value)
            half = 0.5 * rule["step"] if "step" in rule else half
            verdict, z = judge(published, half, value, se, n, rule.get("runs"), rule.get("null"))
            return Judgement(verdict, digits(value, se), se, z)
        bound = re.fullmatch(r"[<>≤≥]=?\s*(\S+)", claim.value) if claim.kind == "bound" else None
        half = rule["half"] if "half" in rule else parse(bound[1])[1] if bound else 0.0
        margins = np.atleast_1d(measured).astype(float) + half  # which relaxes a printed bound
        verdict, i = judge_margins(margins, se, n, reached)
        margin, se = margins[i], float(np.broadcast_to(se, margins.shape)[i])
        text = f"{'least ' if margins.size > 1 else ''}margin {digits(margin, se)}"
        chance = sign_probability(margin, se, n, rule.get("runs", self.runs))
        z = margin / se if se else math.nan
        return Judgement(verdict, text, se, z, math.nan if verdict == "reproduced" else chance)

    def options(self, claim):
        """The options beside the default that a row is flown under, by reading."""
        return {name: it.others() for name, it in self.readings.items() if claim.id in it.rows}

    def _compared(self, claim, verdict, readings, reached):
        """Verdict on a claim under several readings, and what each option gives, in words."""
        self._complete(claim, readings)
        flown = [(name, option) for name, options in readings.items() for option in options]
        names = ["default", *map(" ".join, flown)]
        if len(readings) == 1:
            names = [self.readings[next(iter(readings))].default, *(option for _, option in flown)]
        options = [readings[name][option] for name, option in flown]
        others = [self.judged(claim, it.measured, it.se, it.n, reached).verdict for it in options]
        every = [verdict, *others]
        each = ", ".join(map(" ".join, zip(names, every, strict=True)))
        if self._measured(claim) and differs_between(verdict, others, options):
            verdict = "depends"
        return verdict, f"{every.count('reproduced')} of {len(every)}: {each}"

    def _measured(self, claim):
        """Whether a claim is measured, or repeats one that is."""
        original = claim.evidence.removeprefix("repeats ")
        return "measured" in (original, getattr(self.claims.get(original), "evidence", ""))

    def _complete(self, claim, readings):
        """Raise ValueError unless exactly the options that a row needs are given."""
        wanted = self.options(claim)
        for name in (*readings, *wanted):
            if name not in wanted:
                near = f"the nearest is {nearest(name, self.readings)!r}"
                raise self._error(f"{claim.id}: readings.csv has no {name!r} for this row; {near}")
            given, others = (", ".join(sorted(each.get(name, ()))) for each in (readings, wanted))
            if given != others:
                wrong = f"the other options are {others or 'none'}, given are {given or 'none'}"
                raise self._error(f"{claim.id}: of reading {name!r} {wrong}")

    def used(self, id, value, unit=None):
        """Compare the parameter the code runs with to the printed input.

        `unit` is the unit of `value` (default: the row's own); units of one dimension are
        converted.  A difference is an error in a default run.
        """
        claim = self._open(id)
        if claim.kind != "input":
            raise self._error(f"{id} is of kind {claim.kind}; only inputs are used")
        same = _same(claim, value, claim.unit if unit is None else unit)
        if not same and self.strict:
            printed = f"the paper prints {claim.value!r} {claim.unit}"
            raise self._error(f"{id}: the code runs with {value!r} {unit or ''}, {printed}")
        shown = _plain(value) + (f" {unit}" if unit else "")
        return self._enter(claim, "used" if same else "differs", shown)

    def inputs(self, scenario):
        """Enter every field of a dataclass made by ``tbdcore.scenario.given``; the symbol table."""
        import pandas as pd

        table = []
        for field in dataclasses.fields(scenario):
            value, about = getattr(scenario, field.name), field.metadata
            row, where = about["row"], "open"
            if row != "open":
                self.used(row, value, about["unit"])
                where = self.claims[row].where
            table.append((f"${about['symbol']}$", field.name, _plain(value), about["unit"], where))
        return pd.DataFrame(table, columns=["symbol", "code", "value", "unit", "where"])

    def untestable(self, id, reason):
        """Enter a claim that cannot be tested here, with the reason."""
        claim = self._open(id)
        if not reason:
            raise self._error(f"{id}: untestable needs its reason")
        if claim.rule and self.strict:
            raise self._error(f"{id} is untestable, so its rule has to go")
        return self._enter(claim, "untestable", cause=reason)

    def table(self):
        """All verdicts in the order of the claims file, as a frame.

        Raises ValueError when a claim has none and, in a default run, when something differs
        without a cause, has a cause without differing, or repeats another row with another verdict.
        """
        import pandas as pd

        missing = [id for id in self.claims if id not in self.verdicts]
        if missing:
            count = f"{len(missing)} of {len(self.claims)}"
            raise self._error(f"no verdict on {count} claims: {', '.join(missing)}")
        wrong = [text for id in self.verdicts if self.strict and (text := self._wrong(id))]
        if wrong:
            raise self._error(f"{'; '.join(wrong)}; set data/claims/{self.paper}.csv right")
        return pd.DataFrame([self.verdicts[id] for id in self.claims], columns=Verdict._fields)

    def _wrong(self, id):
        """What is wrong with cause or evidence of a verdict, in words; empty when nothing is."""
        verdict, claim = self.verdicts[id], self.claims[id]
        if verdict.verdict == "differs" and not claim.cause:
            return f"{id} differs and the file gives no cause ({verdict!r})"
        if verdict.verdict != "differs" and claim.cause:
            return f"{id} is {verdict.verdict} but the file gives a cause for a difference"
        word, _, original = claim.evidence.partition(" ")
        if word == "repeats" and self.verdicts[original].verdict != verdict.verdict:
            other = self.verdicts[original].verdict
            return f"{id} is {verdict.verdict} but repeats {original}, which is {other}"
        return ""

    def summary(self):
        """One line: how many of each verdict."""
        found = [verdict.verdict for verdict in self.verdicts.values()]
        return ", ".join(f"{found.count(v)} {v}" for v in VERDICTS if v in found)

    def _error(self, wrong):
        return ValueError(f"{self.paper}: {wrong}")

    def _claim(self, id):
        if id not in self.claims:
            raise self._error(f"no claim {id!r}; the nearest is {nearest(id, self.claims)!r}")
        return self.claims[id]

    def _open(self, id):
        """The claim of an id that has no verdict yet."""
        if id in self.verdicts:
            raise self._error(f"{id} is checked twice")
        return self._claim(id)

    def _enter(self, claim, verdict, shown="", found=None, n=None, told="", cause=""):
        if verdict == "differs":
            cause = claim.cause if claim.kind != "input" else "parameter changed in this run"
        found, chance = found or Judgement(verdict), ""
        if not math.isnan(found.sign_probability):
            least = found.sign_probability < 1e-9
            chance = "< 1e-9" if least else f"{found.sign_probability:.2g}"
        self.verdicts[claim.id] = Verdict(
            *(claim.id, claim.item, claim.quantity, published(claim), shown),
            se=f"{found.se:.2g}" if found.se else "",
            n="" if n is None else str(int(n)),
            z=f"{found.z:.1f}" if found.se and math.isfinite(found.z) else "",
            sign_probability=chance,
            verdict=verdict,
            readings=told,
            evidence=claim.evidence if verdict in JUDGED else "",
            cause=cause,
        )
        return self.verdicts[claim.id]


def published(claim):
    """What a row prints, with its unit behind numbers."""
    number = re.search(r"[\d\]}]$", claim.value)
    known = claim.unit not in ("", "-", "not printed")
    return f"{claim.value} {claim.unit}" if number and known else claim.value


def _plain(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


def _same(claim, value, unit):
    """Whether a value in a unit is what a row prints: numbers to rounding, all else as text."""
    if unit not in UNITS:
        known = ", ".join(filter(None, UNITS))
        raise ValueError(f"{claim.id}: unit {unit!r} is unknown; known are {known}")
    try:
        printed, number = parse(claim.value)[0], float(value)
    except (TypeError, ValueError):
        text = str(list(value) if isinstance(value, tuple) else value)
        return "".join(text.split()) == "".join(claim.value.split())
    (dimension, ours), (printed_dimension, theirs) = UNITS[unit], UNITS[claim.unit]
    if dimension != printed_dimension and "number" not in (dimension, printed_dimension):
        raise ValueError(f"{claim.id}: {unit} and {claim.unit} are different dimensions")
    if claim.unit == "not printed":
        ours = theirs = 1.0
    return math.isclose(number * ours, printed * theirs, rel_tol=1e-9, abs_tol=1e-300)


def nearest(word, words):
    """The most similar of some words."""
    from difflib import get_close_matches

    return next(iter(get_close_matches(word, list(words), n=1, cutoff=0.0)), "")


# All papers ----------------------------------------------------------------------------------


def verdicts(paper, folder=None):
    """The verdicts.csv of a paper as a frame of text, checked against its claims.

    Raises FileNotFoundError when there is none, ValueError when rows, published values or
    evidence are not those of the claims file.
    """
    import pandas as pd

    path = (folder or paths.figures()) / paper / "verdicts.csv"
    again = f"tbdcore run {paper}"
    if not path.is_file():
        raise FileNotFoundError(f"{paper}: no verdicts.csv in {path.parent}; make it with: {again}")
    try:
        table = pd.DataFrame(rows(path, Verdict._fields), columns=Verdict._fields)
    except ValueError as error:
        wrong = f"no table of verdicts ({error})"
        raise ValueError(f"{path}: {wrong}; make it anew: {again}") from None
    known = read(paper)
    if list(table["id"]) != list(known):
        odd = ", ".join(sorted(set(table["id"]) ^ set(known))) or "their order"
        files = f"verdicts.csv and data/claims/{paper}.csv"
        raise ValueError(f"{paper}: {files} do not match in {odd}; run {again}")
    for number, row in enumerate(table.itertuples(), start=2):
        claim = known[row.id]
        pairs = {"value": (published(claim), row.published)}
        pairs["evidence"] = (claim.evidence, row.evidence or claim.evidence)
        for column, (ours, theirs) in pairs.items():
            if ours != theirs:
                wrong = f"{ours!r}, but the verdict is on {theirs!r}; correct it, or run {again}"
                raise fault(f"{paper}.csv", number, column, wrong)
    return table


def ledger(folder=None):
    """The verdicts on every claim of every paper, one row each, the paper's name in front."""
    import pandas as pd

    tables = {paper: verdicts(paper, folder) for paper in papers()}
    return pd.concat(tables, names=["paper", None]).reset_index("paper").reset_index(drop=True)


def counts(table):
    """Counts of one table of verdicts: the measured by verdict, the other classes beside them.

    "differs by chance": of measured claims that chance enters, 0.93 % are so called though right.
    """
    kind = table["evidence"].str.split(" ").str[0]
    measured = table[kind == "measured"]
    row = {"claims": len(table)}
    row |= {f"measured: {v}": int((measured["verdict"] == v).sum()) for v in JUDGED}
    row |= {name: int((kind == name).sum()) for name in EVIDENCE[1:]}
    row |= {name: int((table["verdict"] == name).sum()) for name in ("untestable", "used")}
    return row | {"differs by chance, about": f"{0.0093 * (measured['se'] != '').sum():.2f}"}


def scorecard(folder=None):
    """Counts by paper, the last row for all; raises as :func:`verdicts` does."""
    import pandas as pd

    every = ledger(folder)
    tables = [*every.groupby("paper"), ("all", every)]
    return pd.DataFrame([{"paper": paper} | counts(table) for paper, table in tables])
