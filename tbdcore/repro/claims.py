"""Published numbers, our numbers, and what may be said of the two.

``data/claims/<paper>.csv`` lists everything a paper publishes, one row each, as text: "287.10" says
that its last digit is a hundredth.  A notebook opens a ledger for its paper and enters one verdict
for each row; ``judge`` and ``judge_margins`` hold the statistic:

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

The *evidence* of a verdict is ``measured`` (the experiment could have come out the other way),
``calibrated`` (an unprinted choice was made with this number, or another of its column, in view),
``constructed`` (follows from definitions, arithmetic or the page's own assumptions) or
``repeats <id>`` (the same measurement as another row).  Only measured rows make the headline.

The *rule* of a row says what is measured on which trials, and gives the numbers of the judgement as
``; name = number``: ``runs``, the paper's number of runs; ``null``, the value of "no effect";
``step``, the smallest difference the print could show where its digits do not say; ``half``, the
half digit of a printed bound without a number; others are a page's.  Rules were declared before
measuring; ``data/claims/changes.csv`` lists those that changed (``changes``).
"""

import csv
import dataclasses
import functools
import hashlib
import io
import math
import re
from difflib import get_close_matches
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from tbdcore.repro import paths

KINDS = ("input", "number", "ordering", "trend", "bound", "statement")
JUDGED = ("reproduced", "differs", "depends", "inconclusive")
VERDICTS = (*JUDGED, "untestable", "used")
EVIDENCE = ("measured", "calibrated", "constructed", "repeats")
_SIZES = {"length": {"m": 1.0, "km": 1e3}, "angle": {"rad": 1.0, "deg": math.pi / 180}}
_SIZES |= {"frequency": {"Hz": 1.0, "MHz": 1e6, "GHz": 1e9}, "ratio": {"%": 0.01}}
_SIZES |= {unit: {unit: 1.0} for unit in ("dB", "s", "m/s", "rad/s")}
_COUNTED = """-;cells;cell;frame;frames;particles;runs;trials;power;scans (about);not printed;\
cells/frame;cell/s;1/m^2 (inferred);1/rad^2 (inferred)"""
_SIZES["number"] = dict.fromkeys(["", *_COUNTED.split(";")], 1.0)
# printed unit: (dimension, size in the unit the code would use)
UNITS = {unit: (name, size) for name, units in _SIZES.items() for unit, size in units.items()}
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


class Reading(NamedTuple):
    """One row of data/readings.csv, all text: words of a paper that can be read in several ways."""

    chapter: str
    name: str
    words: str  # or the gap
    options: str  # with ; between them
    default: str
    rows: str  # the claims that it touches, as patterns with ; between them
    refuted: str  # option: why the paper's other numbers exclude it; and so on

    def others(self):
        """The options that are flown beside the default."""
        refuted = [each.partition(":")[0] for each in _items(self.refuted)]
        return [it for it in _items(self.options) if it not in (self.default, *refuted)]

    def touches(self, id):
        """Whether a claim is judged under the options."""
        return any(fnmatchcase(id, pattern) for pattern in _items(self.rows))


class Option(NamedTuple):
    """A claim measured under another option of a reading, on the scenes of the default."""

    measured: object  # as in Ledger.check: a number, margins or a bool
    difference: object  # from the default, paired; of margins one each
    error: object = 0.0  # standard error of the difference
    se: object = 0.0  # standard error of `measured`
    n: int | None = None  # trials


class Flown(NamedTuple):
    """One row of data/readings_flown.csv, all text: a claim under some options of its readings."""

    paper: str
    row: str  # id of the claim
    reading: str  # "default", or "name: option" of each reading that is another, ; between them
    measured: str
    error: str
    n: str  # trials
    apart: str  # whether its difference from the default is beyond chance, yes or no
    verdict: str  # one of JUDGED but `depends`
    digest: str  # of what flew it


class Verdict(NamedTuple):
    """One row of verdicts.csv, all text."""

    id: str
    item: str
    quantity: str
    published: str
    measured: str = ""
    se: str = ""  # standard error of `measured`, or of its margin
    n: str = ""  # trials
    z: str = ""  # distance from the print, or the least margin, in standard errors
    sign_probability: str = ""  # that the paper's own runs print this order, if not reproduced
    verdict: str = ""  # one of VERDICTS
    readings: str = ""  # how many options reproduce it, and what each gives
    evidence: str = ""
    cause: str = ""  # why it differs or is untestable

    def __repr__(self):
        spread = f" ± {self.se}" if self.se else ""
        measured = f"{self.measured}{spread}" + (f" (n = {self.n})" if self.n else "")
        return f"{self.id}: published {self.published}, measured {measured}: {self.verdict}"


def papers(folder=None):
    """Names of the papers that have a claims file."""
    return sorted(
        {path.stem for path in (folder or paths.claims()).glob("*.csv")} - {"declared", "changes"}
    )


def read(paper, folder=None):
    """Claims of a paper by id; ValueError as :func:`records` raises, FileNotFoundError."""
    path = (folder or paths.claims()) / f"{paper}.csv"
    if not path.is_file():
        listed = ", ".join(papers(folder))
        raise FileNotFoundError(f"{path.name}: no claims file under data/claims; papers: {listed}")
    claims = records(path, Claim, _claim_faults)
    for number, claim in enumerate(claims.values(), start=2):
        word, _, id = claim.evidence.partition(" ")
        if word == "repeats" and (id not in claims or claims[id].evidence.startswith(word)):
            advice = f"{id!r} is no row or repeats one itself; name the original"
            raise fault(path.name, number, "evidence", advice)
    return claims


def records(path, kind, faults=lambda row: (), key=lambda row: row.id):
    """The rows of a CSV file as named tuples of text by their keys; none if there is no file.

    `faults` gives for a row what can be wrong: column, whether it is, and what to do.  Raises
    ValueError, naming file, row and column, for the first one that is, a row that is incomplete or
    there twice, other columns, and a file that is no CSV or that a spreadsheet program has saved.
    """
    if not path.is_file():
        return {}
    by_key, name, columns = {}, path.name, [*kind._fields]
    header, *rows = _rows(path)
    if header != columns:
        missing = next((column for column in columns if column not in header), "")
        reason = f"the columns are {','.join(header)}; make them {','.join(columns)}"
        raise fault(name, 1, missing, reason)
    for number, texts in enumerate(rows, start=2):
        if len(texts) != len(columns):
            reason = f"{len(texts)} fields instead of {len(columns)}; quote fields with commas"
            raise fault(name, number, columns[min(len(texts), len(columns) - 1)], reason)
        row = kind(*texts)
        for column, is_wrong, advice in faults(row):
            if is_wrong:
                raise fault(name, number, column, f"{getattr(row, column)!r}; {advice}")
        if key(row) in by_key:
            raise fault(name, number, "", f"{key(row)!r} stands there twice")
        by_key[key(row)] = row
    return by_key


def fault(name, number, column, reason):
    """The error about a row of a file, with its column if one is named."""
    return ValueError(f"{name}, row {number}{f', column {column}' if column else ''}: {reason}")


def _rows(path):
    """The rows of a CSV file, the header first, as lists of text."""
    text = path.read_bytes().decode("utf-8", "surrogateescape")
    if odd := re.search("[\ufeff\r\udc80-\udcff]", text):
        mark = {"\ufeff": "a byte-order mark", "\r": "CR"}.get(odd[0], "a byte that is not UTF-8")
        advice = "save it as plain CSV: UTF-8 without byte-order mark, LF line ends, commas"
        raise fault(path.name, text.count("\n", 0, odd.start()) + 1, "", f"{mark}; {advice}")
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        return list(reader) or [[]]
    except csv.Error as error:
        advice = "look for a quotation mark without its partner"
        raise fault(path.name, reader.line_num, "", f"{error}; {advice}") from None


_DIFFERENCE = re.compile(r"\b(gain|loss|saving|advantage|reduction|ratio|difference)\b")


def _claim_faults(it):
    """What can be wrong in a row of a claims file: column, whether it is, and what to do."""
    units, evidence = ", ".join(filter(None, UNITS)), ", ".join(EVIDENCE)
    number, rule, word = it.kind == "number", numbers(it.rule), it.evidence.partition(" ")[0]
    gain = number and it.rule and _DIFFERENCE.search(it.quantity.lower())
    return [
        *_empty(it, "id", "quantity", "value"),
        ("kind", it.kind not in KINDS, f"known are {', '.join(KINDS)}"),
        ("unit", it.unit not in UNITS, f"known are {units}"),
        ("value", re.fullmatch(r"[+-]?\d+,\d+", it.value), "write a point for the decimal comma"),
        ("value", number and not _PRINTED.fullmatch(it.value), "give a number, or N/A"),
        ("evidence", word not in ("", *EVIDENCE), f"known are {evidence} <id>"),
        ("evidence", it.rule and not word, "a row that is judged has both"),
        ("rule", word and not it.rule, "a row that is judged has both"),
        ("rule", it.kind == "input" and it.rule, "an input has none"),
        ("rule", gain and "null" not in rule, "a gain or ratio names its null value: ; null = 0"),
        ("rule", it.rule.count(" = ") != len(rule), "write each item as ; name = number"),
    ]


def _empty(it, *names):
    """Those of some columns that must be filled, as what can be wrong."""
    return [(name, not getattr(it, name).strip(), "write it down") for name in names]


def readings(paper, folder=None):
    """Readings of a paper by name, from the file beside the folder of the claims; ValueError as
    :func:`records` raises.
    """

    def faults(it):
        chapters, options = papers(folder), _items(it.options)
        ids = list(read(it.chapter, folder)) if it.chapter in chapters else []
        lost = [each for each in _items(it.rows) if not any(fnmatchcase(id, each) for id in ids)]
        refuted = [re.fullmatch(r"(.*?): *\S.*", each) for each in _items(it.refuted)]
        good = all(each and each[1] in options and each[1] != it.default for each in refuted)
        near, claim = nearest(it.chapter, chapters), nearest(lost[0], ids) if lost else ""
        several = len({*options}) >= max(2, len(options))
        return [
            ("chapter", it.chapter not in chapters, f"the nearest paper is {near!r}"),
            *_empty(it, "name", "words", "rows"),
            ("options", not several, "give two or more, each once, with ;"),
            ("default", it.default not in options, f"choose one of {it.options}"),
            ("rows", lost, f"no claim is {lost}; the nearest is {claim!r}"),
            ("refuted", not good, f"write option: reason; one of {it.options}, no default"),
        ]

    path = (folder or paths.claims()).parent / "readings.csv"
    listed = records(path, Reading, faults, lambda row: (row.chapter, row.name)).values()
    return {row.name: row for row in listed if row.chapter == paper}


def flown(paper, folder=None):
    """What was flown of a paper under its readings: the rows of each claim, by its id.

    From the file beside the folder of the claims, made by ``benchmarks/readings.py``.  ValueError
    as :func:`records` raises.
    """
    chapters, path = papers(folder), (folder or paths.claims()).parent / "readings_flown.csv"

    @functools.cache
    def ids_and_readings(name):
        return (read(name, folder), readings(name, folder)) if name in chapters else ({}, {})

    def faults(it):
        ids, listed = ids_and_readings(it.paper)
        options = sorted(_options(listed, it.row))
        lost = [each for each in _items(it.reading) if each not in ("default", *options)]
        return [
            ("paper", it.paper not in chapters, f"the nearest is {nearest(it.paper, chapters)!r}"),
            ("row", it.row not in ids, f"the nearest claim is {nearest(it.row, ids)!r}"),
            ("reading", lost, f"delete the line; living options are {'; '.join(options)}"),
            *_empty(it, "reading", "measured", "digest"),
            ("apart", it.apart not in ("yes", "no"), "write yes or no"),
            ("verdict", it.verdict not in JUDGED or it.verdict == "depends", "no such verdict"),
        ]

    flown_rows = {}
    for row in records(path, Flown, faults, lambda it: (it.paper, it.row, it.reading)).values():
        if row.paper == paper:
            flown_rows.setdefault(row.row, []).append(row)
    return flown_rows


def _options(readings, id):
    """The options that a claim is flown under beside the default, as "name: option"."""
    return {f"{name}: {it}" for name, others in _living(readings, id).items() for it in others}


def _living(readings, id):
    """The options beside the default that a claim is flown under, by reading."""
    living = {it.name: it.others() for it in readings.values() if it.touches(id)}
    return {name: others for name, others in living.items() if others}


def apart(options):
    """Which of some options by key differ from the default beyond chance: by Bonferroni's quantile
    for all their differences.
    """
    points = sum(np.size(it.difference) for it in options.values())
    return {
        key
        for key, it in options.items()
        if np.any(np.abs(it.difference) > quantile(it.n, points) * np.asarray(it.error))
    }


def _items(text):
    """The parts between semicolons."""
    return [part.strip() for part in text.split(";") if part.strip()]


_ITEM = re.compile(r"; ?([a-z][a-z ]*) = ([+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?)(?![\w.])")


def numbers(rule):
    """The numbers of a rule by name: ``numbers("...; null = 0 dB; runs = 100")``."""
    return {name: float(value) for name, value in _ITEM.findall(rule)}


def rule_digest(rule):
    """Short hash of a rule, as declared.csv and changes.csv have it."""
    return hashlib.sha256(rule.encode()).hexdigest()[:8]


def row_digest(claim):
    """Short hash of what a verdict on a row rests on: the printed value and the rule.

    Studies keep it, so that one that judged another value or rule is found.
    """
    return rule_digest("\0".join((claim.kind, claim.value, claim.unit, claim.rule)))


_PRINTED = re.compile(r"(?:10\^)?[+-]?\d+(?:\s\d{3})*(?:\.(\d*))?(?:[eE][+-]?\d+)?%?|N/A")


def parse(text):
    """Value and half of its last printed digit, both in the printed unit.

    Understands "287.10" (half digit 0.005), "14 600" (thin spaces between thousands), "3e-5",
    "10^-6" and "100%".

    >>> parse("287.10")
    (287.1, 0.005)
    """
    match = _PRINTED.fullmatch(text.strip())
    if not match or text == "N/A":
        raise ValueError(f"{text!r} is no number")
    plain = re.sub(r"[\s%]", "", text).replace("10^", "1e").lower()
    exponent = int(plain.partition("e")[2] or 0) - len(match[1] or "")
    return float(plain), 0.5 * 10.0**exponent


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
    precise = se <= max(s_p, half / 2)
    return ("reproduced" if precise and not vacuous else "inconclusive"), z


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
        self.flown = flown(paper, folder)
        self.verdicts = {}
        runs = {numbers(claim.rule).get("runs") for claim in self.claims.values()} - {None}
        self.runs = runs.pop() if len(runs) == 1 else None  # the paper's own, for its orderings

    def named(self, name, names, kind="claim"):
        """What a name stands for; ValueError, with the nearest one, when it is not known."""
        if name not in names:
            raise self._error(f"no {kind} {name!r}; the nearest is {nearest(name, names)!r}")
        return names[name]

    def number(self, id, name):
        """A number of a row's rule; ValueError, with the nearest name, when it has none."""
        claim = self.named(id, self.claims)
        return self.named(name, numbers(claim.rule), f"number in the rule of {id},")

    def check(self, id, measured, *, se=0.0, n=None, shown="", reached=False, readings=None):
        """Judge a claim by its rule; see :func:`judge` and :func:`judge_margins`.

        `measured` is our number, in the printed unit, for a row of kind number; for the other
        kinds a margin, positive where the claim holds, or an array of them, or a plain bool where
        no chance is involved.  `se` is the standard error from `n` trials.  `shown` is what the
        table shows, mandatory for a bool; a margin with an error is added to it.  `reached`: a
        margin of 0 is enough ("at least").  `readings` has the same under the other options of each
        reading that touches the row, ``{name: {option: Option(...)}}``; nothing for a row that
        data/readings_flown.csv has, whose `depends` follows from that file.
        """
        claim = self._open(id)
        if not claim.rule:
            advice = "enter it with used(id, value) or untestable(id, reason)"
            raise self._error(f"{id} has no rule in data/claims/{self.paper}.csv; {advice}")
        row = self.judged(claim, measured, se, n, reached)
        if not (shown or row.measured):
            raise self._error(f"{id}: a truth value needs shown=, its evidence in words")
        if not shown or claim.kind != "number" and row.se and "margin" not in shown:
            shown = "; ".join(filter(None, (shown, row.measured)))
        if id in self.flown and readings:
            raise self._error(f"{id}: readings_flown.csv has its readings; give none here")
        if id in self.flown:
            row = self._as_flown(claim, row)
        elif readings or (self._measured(claim) and self.options(claim)):
            row = self._compared(claim, row, readings or {}, reached)
        cause = claim.cause if row.verdict == "differs" else ""
        return self._enter(row._replace(measured=shown, evidence=claim.evidence, cause=cause))

    def judged(self, claim, measured, se=0.0, n=None, reached=False):
        """The verdict on a claim by what was measured alone."""
        row, rule = _row(claim, n="" if n is None else str(int(n))), numbers(claim.rule)
        if isinstance(measured, bool | np.bool_):
            if claim.kind == "number":
                raise self._error(f"{claim.id} is a number; give the measured value")
            return row._replace(verdict="reproduced" if measured else "differs")
        if claim.kind == "number":
            value, se, chance = float(measured), float(se), math.nan
            printed, half = parse(claim.value)
            half = 0.5 * rule["step"] if "step" in rule else half
            verdict, z = judge(printed, half, value, se, n, rule.get("runs"), rule.get("null"))
            text = digits(value, se)
        else:
            half = rule.get("half", 0.0)  # by which the margin of a printed bound is relaxed
            if claim.kind == "bound" and "half" not in rule:
                printed = re.fullmatch(r"[<>≤≥]=?\s*(\S+)", claim.value)
                half = parse(printed[1])[1] if printed else 0.0
            margins = np.atleast_1d(measured).astype(float) + half
            verdict, i = judge_margins(margins, se, n, reached)
            margin, se = margins[i], float(np.broadcast_to(se, margins.shape)[i])
            text = f"{'least ' if margins.size > 1 else ''}margin {digits(margin, se)}"
            z = margin / se if se else math.nan
            chance = sign_probability(margin, se, n, rule.get("runs", self.runs))
        row = row._replace(verdict=verdict, measured=text, se=f"{se:.2g}" if se else "")
        if verdict != "reproduced" and not math.isnan(chance):
            row = row._replace(sign_probability="< 1e-9" if chance < 1e-9 else f"{chance:.2g}")
        return row._replace(z=f"{z:.1f}" if se and math.isfinite(z) else "")

    def options(self, claim):
        """The options beside the default that a row is flown under, by reading."""
        return _living(self.readings, claim.id)

    def _as_flown(self, claim, row):
        """A verdict, which is `depends` when those of data/readings_flown.csv contradict one
        another.
        """
        each = self.flown[claim.id]
        flown = {option for it in each for option in _items(it.reading)}
        if missing := {"default", *_options(self.readings, claim.id)} - flown:
            again = f"python -m benchmarks.readings {self.paper} {claim.id}"
            raise self._error(f"{claim.id}: not flown: {', '.join(sorted(missing))}; {again}")
        verdicts = [it.verdict for it in each]
        told = ", ".join(f"{verdicts.count(v)} {v}" for v in JUDGED if v in verdicts)
        row = row._replace(readings=f"{verdicts.count('reproduced')} of {len(each)}: {told}")
        sure = {it.verdict for it in each if it.apart == "yes" or it.reading == "default"}
        return self._if_sure(claim, row, sure)

    def _if_sure(self, claim, row, sure):
        """A verdict, or `depends` when a measured row has both of two among those that are sure."""
        depends = self._measured(claim) and sure >= {"reproduced", "differs"}
        return row._replace(verdict="depends") if depends else row

    def _compared(self, claim, row, readings, reached):
        """A verdict under the default and what the other options make of it.

        `reproduced` under one option and `differs` under another make it `depends`; of the other
        options those count whose paired difference from the default is beyond Bonferroni's quantile
        for all differences.  ValueError unless exactly the options that the row needs are given.
        """
        wanted, given = (
            "; ".join(f"{name}: {', '.join(sorted(each))}" for name, each in sorted(it.items()))
            for it in (self.options(claim), readings)
        )
        if wanted != given:
            reason = f"readings.csv has the other options {wanted or 'none'}"
            raise self._error(f"{claim.id}: {reason}; given are {given or 'none'}")
        options = {(name, it): each[it] for name, each in readings.items() for it in each}
        beyond = apart(options)
        alone = next(iter(readings)) if len(readings) == 1 else ""
        every = {self.readings[alone].default if alone else "default": row.verdict}
        sure = {row.verdict}
        for (name, option), it in options.items():
            verdict = self.judged(claim, it.measured, it.se, it.n, reached).verdict
            every[option if alone else f"{name} {option}"] = verdict
            sure |= {verdict} if (name, option) in beyond else set()
        told = ", ".join(map(" ".join, every.items()))
        count = [*every.values()].count("reproduced")
        row = row._replace(readings=f"{count} of {len(every)}: {told}")
        return self._if_sure(claim, row, sure)

    def _measured(self, claim):
        """Whether a claim is measured, or repeats one that is."""
        original = claim.evidence.removeprefix("repeats ")
        return "measured" in (original, getattr(self.claims.get(original), "evidence", ""))

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
        verdict, cause = ("used", "") if same else ("differs", "parameter changed in this run")
        return self._enter(_row(claim, shown, verdict=verdict, cause=cause))

    def inputs(self, scenario):
        """Enter every field of a dataclass made by ``tbdcore.scenario.given``; the symbol table."""
        import pandas as pd

        table = []
        for field in dataclasses.fields(scenario):
            value, about = getattr(scenario, field.name), field.metadata
            where = about["row"]
            if where != "open":
                self.used(where, value, about["unit"])
                where = self.claims[where].where
            table.append((f"${about['symbol']}$", field.name, _plain(value), about["unit"], where))
        return pd.DataFrame(table, columns=["symbol", "code", "value", "unit", "where"])

    def untestable(self, id, reason):
        """Enter a claim that cannot be tested here, with the reason."""
        claim = self._open(id)
        if not reason:
            raise self._error(f"{id}: untestable needs its reason")
        if claim.rule and self.strict:
            raise self._error(f"{id} is untestable, so its rule has to go")
        return self._enter(_row(claim, verdict="untestable", cause=reason))

    def table(self):
        """All verdicts in the order of the claims file, as a frame.

        Raises ValueError when a claim has none and, in a default run, when something differs
        without a cause, has a cause without differing, or repeats another row with another verdict.
        """
        import pandas as pd

        if missing := [id for id in self.claims if id not in self.verdicts]:
            count = f"{len(missing)} of {len(self.claims)}"
            raise self._error(f"no verdict on {count} claims: {', '.join(missing)}")
        if self.strict and (faults := list(filter(None, map(self._wrong, self.verdicts)))):
            raise self._error(f"{'; '.join(faults)}; set data/claims/{self.paper}.csv right")
        return pd.DataFrame([self.verdicts[id] for id in self.claims], columns=Verdict._fields)

    def _wrong(self, id):
        """What is wrong with cause or evidence of a verdict, in words; empty when nothing is."""
        row, claim = self.verdicts[id], self.claims[id]
        if row.verdict == "differs" and not claim.cause:
            return f"{id} differs and the file gives no cause ({row!r})"
        if row.verdict != "differs" and claim.cause:
            return f"{id} is {row.verdict} but the file gives a cause for a difference"
        original = self.verdicts.get(claim.evidence.removeprefix("repeats "), row)
        if original.verdict != row.verdict:
            return f"{id} is {row.verdict} but repeats {original.id}, which is {original.verdict}"
        return ""

    def summary(self):
        """One line: how many of each verdict."""
        given = [row.verdict for row in self.verdicts.values()]
        return ", ".join(f"{given.count(v)} {v}" for v in VERDICTS if v in given)

    def _error(self, reason):
        return ValueError(f"{self.paper}: {reason}")

    def _open(self, id):
        """The claim of an id that has no verdict yet."""
        if id in self.verdicts:
            raise self._error(f"{id} is checked twice")
        return self.named(id, self.claims)

    def _enter(self, row):
        self.verdicts[row.id] = row
        return row


def _row(claim, measured="", **texts):
    return Verdict(claim.id, claim.item, claim.quantity, published(claim), measured, **texts)


def published(claim):
    """What a row prints, with its unit behind numbers."""
    number = re.search(r"[\d\]}]$", claim.value)
    has_unit = claim.unit not in ("", "-", "not printed")
    return f"{claim.value} {claim.unit}" if number and has_unit else claim.value


def _plain(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


def _same(claim, value, unit):
    """Whether a value in a unit is what a row prints: numbers to rounding, all else as text."""
    if unit not in UNITS:
        units = ", ".join(filter(None, UNITS))
        raise ValueError(f"{claim.id}: unit {unit!r} is unknown; known are {units}")
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


def nearest(word, words, cutoff=0.0):
    """The most similar of some words, empty if none has a similarity of `cutoff`, 0 to 1."""
    words = list(words)
    if word in words:  # at once: files of a thousand rows ask for each of them
        return word
    return next(iter(get_close_matches(word, words, n=1, cutoff=cutoff)), "")


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
        judged = records(path, Verdict)
    except ValueError as error:
        reason = f"no table of verdicts ({error})"
        raise ValueError(f"{path}: {reason}; make it anew: {again}") from None
    rows = read(paper)
    if list(judged) != list(rows):
        odd = ", ".join(sorted({*judged} ^ {*rows})) or "their order"
        files = f"verdicts.csv and data/claims/{paper}.csv"
        raise ValueError(f"{paper}: {files} do not match in {odd}; run {again}")
    for number, (row, claim) in enumerate(zip(judged.values(), rows.values(), strict=True), 2):
        if row.evidence not in ("", claim.evidence) or row.published != published(claim):
            column = "value" if row.published != published(claim) else "evidence"
            reason = f"not that of the verdict, {row.published!r}, {row.evidence!r}"
            raise fault(f"{paper}.csv", number, column, f"{reason}; correct it, or run {again}")
    return pd.DataFrame(judged.values(), columns=Verdict._fields)


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
