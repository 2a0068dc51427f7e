"""Published numbers, our numbers, and what may be said of the two.

``data/claims/<paper>.csv`` lists everything a paper publishes, one row each.  All values are read
as text, since "287.10" says that its last digit is a hundredth and the number 287.1 does not.  A
notebook opens a ledger for its paper and enters a verdict for each row:

================  ==================================================================================================
``reproduced``    our 99 % interval lies inside the band around the printed value
``differs``       our interval lies outside the band; the file must give a cause, and the notebook the experiment behind it
``inconclusive``  the interval straddles an edge of the band and our error is more than a fifth of
                  the band; the message says how many trials would settle it (with a smaller error
                  the point estimate decides)
``untestable``    needs what nobody here has, or is an opinion; with the reason
``used``          an input: the parameter the code runs with equals the printed one
================  ==================================================================================================

The band of a number is half its last printed digit, plus 2.6 standard errors of the *paper's own*
Monte Carlo: an average of 100 runs cannot be right to more digits than 100 runs allow.  That error
is ours, scaled from our number of trials to the paper's, ``se * sqrt(n / paper_n)``.  A claim that
is no number (an ordering, a trend, a bound, a statement) is settled by a *margin* which is positive
where the claim holds, with its standard error, or, where no chance is involved, by a plain truth
value and the evidence in words.

Bands follow from the printed text and from ``paper_n`` alone, and so are fixed before anything is
measured.  The ledger is complete or it fails: ``Ledger.table`` raises when a row has no verdict or
two, when something differs without a cause, and when a cause is given for something that does not
differ.  ``scorecard`` counts the verdicts of all papers.  A ledger may ``settle``: take over the
verdicts of one longer run, kept in ``data/longer``, with which its own trials must agree.

This module judges numbers and knows nothing of how they came about: it imports none of the
numerical ones.
"""

import csv
import dataclasses
import io
import math
import re
from typing import NamedTuple

import pandas as pd

from tbdcore.repro import paths
from tbdcore.score import Z99  # half width of our interval, in standard errors

COLUMNS = ("id", "item", "quantity", "conditions", "value", "unit", "kind", "where", "cause")
KINDS = ("input", "number", "ordering", "trend", "bound", "statement")
VERDICTS = ("reproduced", "differs", "inconclusive", "untestable", "used")
UNITS = {  # printed unit: (dimension, size in the unit the code would use)
    **dict.fromkeys(
        ("", "-", "cells", "cell", "frame", "frames", "particles", "runs", "trials", "power"),
        ("number", 1.0),
    ),
    **dict.fromkeys(
        (
            "scans (about)",
            "not printed",
            "cells/frame",
            "cell/s",
            "1/m^2 (inferred)",
            "1/rad^2 (inferred)",
        ),
        ("number", 1.0),
    ),
    "%": ("ratio", 0.01),
    "dB": ("level", 1.0),
    "m": ("length", 1.0),
    "km": ("length", 1e3),
    "s": ("time", 1.0),
    "m/s": ("speed", 1.0),
    "Hz": ("frequency", 1.0),
    "MHz": ("frequency", 1e6),
    "GHz": ("frequency", 1e9),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180),
    "rad/s": ("turn rate", 1.0),
}
Z_PAPER = 2.6  # room for the paper's own Monte Carlo error, in standard errors
FINE = 0.2  # an error below this share of the band lets the point estimate decide


class Claim(NamedTuple):
    """One row of a claims file; every field is the text that stands there."""

    id: str
    item: str
    quantity: str
    conditions: str
    value: str
    unit: str
    kind: str
    where: str
    cause: str


class Verdict(NamedTuple):
    """One row of verdicts.csv; `measured`, `se` and `n` are text, `note` is what its line adds.

    `cause` says why it differs, why it is untestable, or how many trials would settle it.
    """

    id: str
    item: str
    quantity: str
    published: str
    measured: str
    se: str
    n: str
    verdict: str
    cause: str
    note: str = ""

    def __repr__(self):
        spread = f" ± {self.se}" if self.se else ""
        count = f" (n = {self.n})" if self.n else ""
        return f"{self.id}: published {self.published}, measured {self.measured}{spread}{count}: {self.verdict}{self.note}"


def read(paper, folder=None):
    """Claims of a paper by id.

    Raises ValueError, naming file, row and column, for a file that a spreadsheet has touched
    (byte-order mark, CRLF, semicolons, a lost column), a duplicate id, an unknown kind or unit, or
    a number that is none; FileNotFoundError when the paper has no file.
    """
    path = (folder or paths.CLAIMS) / f"{paper}.csv"
    if not path.is_file():
        raise FileNotFoundError(
            f"{path.name}: no claims file of this name under data/claims; papers: "
            f"{', '.join(papers())}"
        )
    rows = _rows(path)
    claims = {}
    for number, row in enumerate(rows[1:], start=2):
        claim = _claim(path.name, number, row)
        if claim.id in claims:
            raise ValueError(
                f"{path.name}, row {number}, column id: {claim.id!r} stands there twice; "
                f"every claim has one row"
            )
        claims[claim.id] = claim
    return claims


def papers(folder=None):
    """Names of the papers that have a claims file."""
    return sorted(path.stem for path in (folder or paths.CLAIMS).glob("*.csv"))


def _rows(path):
    """The rows of a claims file as lists of text, header checked."""
    raw = path.read_bytes()
    repair = "save it as plain CSV: UTF-8 without byte-order mark, LF line ends, commas"
    if raw.startswith(b"\xef\xbb\xbf"):
        raise ValueError(
            f"{path.name}, row 1, column id: the file begins with a byte-order mark; {repair}"
        )
    if b"\r" in raw:
        line = raw[: raw.index(b"\r")].count(b"\n") + 1
        raise ValueError(f"{path.name}, row {line}, last column: the line ends in CR; {repair}")
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise ValueError(
            f"{path.name}, row {line}: not UTF-8 (byte {raw[error.start]:#x}); {repair}"
        ) from None
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        rows = list(reader)
    except csv.Error as error:
        raise ValueError(
            f"{path.name}, row {reader.line_num}: {error}; "
            f"look for a quotation mark without its partner"
        ) from None
    header = tuple(rows[0]) if rows else ()
    for column in COLUMNS:
        if column not in header:
            raise ValueError(
                f"{path.name}, row 1, column {column}: missing; the header is {','.join(COLUMNS)}"
            )
    if header != COLUMNS:
        raise ValueError(
            f"{path.name}, row 1: the columns are {','.join(header)}; "
            f"they must be {','.join(COLUMNS)}"
        )
    return rows


def _claim(name, number, row):
    """One validated row."""
    if len(row) != len(COLUMNS):
        column = COLUMNS[min(len(row), len(COLUMNS) - 1)]
        raise ValueError(
            f"{name}, row {number}, column {column}: {len(row)} fields instead of {len(COLUMNS)}; "
            f"quote fields with commas"
        )
    claim = Claim(*row)
    for column, allowed in (("kind", KINDS), ("unit", UNITS)):
        if getattr(claim, column) not in allowed:
            known = ", ".join(word for word in allowed if word)
            raise ValueError(
                f"{name}, row {number}, column {column}: {getattr(claim, column)!r} is unknown; "
                f"known are {known}"
            )
    for column in ("id", "quantity", "value"):
        if not getattr(claim, column).strip():
            raise ValueError(f"{name}, row {number}, column {column}: empty")
    if claim.kind == "number" and claim.value != "N/A":
        try:
            parse(claim.value)
        except ValueError:
            raise ValueError(
                f"{name}, row {number}, column value: {claim.value!r} is no number; "
                f"kind number needs one"
            ) from None
    return claim


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


def judge(published, half_digit, measured, se, n=None, paper_n=None):
    """Verdict on a number, and the trials that would settle it when it is inconclusive.

    Parameters
    ----------
    published, half_digit : float
        As :func:`parse` gives them.
    measured, se : float
        Our value and its standard error (0 for a value that no chance enters).
    n, paper_n : int or None
        Our trials and the paper's; without the latter the band is the half digit alone.

    Returns
    -------
    verdict : str
    trials : int or None
    """
    paper_se = se * math.sqrt(n / paper_n) if n and paper_n else 0.0
    band = half_digit * (1 + 1e-9) + Z_PAPER * paper_se
    off, half = abs(measured - published), Z99 * se
    if not math.isfinite(off + half):
        return ("inconclusive" if math.isnan(off + half) else "differs"), None
    if off + half <= band:
        return "reproduced", None
    if off - half > band:
        return "differs", None
    if half <= FINE * band:
        return ("reproduced" if off <= band else "differs"), None
    return "inconclusive", _trials_needed(half / max(abs(off - band), FINE * band), n)


def judge_margin(margin, se, n=None):
    """Verdict on a claim that holds where its margin is positive, and the trials that would settle
    it.
    """
    if math.isnan(margin + se):
        return "inconclusive", None
    if margin > Z99 * se:
        return "reproduced", None
    if margin < -Z99 * se or se == 0:
        return "differs", None
    return "inconclusive", _trials_needed(Z99 * se / abs(margin) if margin else math.inf, n)


def _trials_needed(shrink, n):
    """Trials after which our interval is `shrink` times narrower."""
    return math.ceil(n * shrink**2) if n and math.isfinite(shrink) else None


def digits(value, se=0.0):
    """A number as text, to the second significant digit of its standard error; without one, seven
    significant digits.

    >>> digits(14.10632, 0.0137), digits(0.25)
    ('14.106', '0.25')
    """
    if not math.isfinite(value) or not math.isfinite(se) or not se:
        return f"{value:.7g}"
    return f"{value:.{max(0, 1 - math.floor(math.log10(se)))}f}"


def given(default, symbol, unit="", row="open"):
    """A field of a scenario's frozen dataclass.

    Its value, its letter in the paper (TeX without dollars), its unit, and the id of the row that
    prints it, or "open" where the paper is silent.
    """
    return dataclasses.field(default=default, metadata={"symbol": symbol, "unit": unit, "row": row})


class Ledger:
    """The verdicts of one paper, entered one by one and closed when complete.

    Parameters
    ----------
    paper : str
    strict : bool
        True in a run with default parameters: then causes must match verdicts.  With other
        parameters or few trials the verdicts may rightly differ, and only completeness is required.
    """

    def __init__(self, paper, strict=True, folder=None):
        self.paper, self.strict = paper, strict
        self.claims = read(paper, folder)
        self.verdicts = {}

    def check(self, id, measured, *, se=0.0, n=None, paper_n=None, step=None, evidence=""):
        """Judge a claim; see the module docstring.

        `measured` is our number (in the printed unit) for a row of kind number; a margin, positive
        where the claim holds, for the other kinds, or a plain bool where no chance is involved, for
        which `evidence` is mandatory. `evidence` is what the table shows.  `step` is the smallest
        difference the print could show where its digits do not say: a share of 100 runs that is
        printed as 0 has a step of 0.01; by default it is one of the last printed digit.
        """
        claim = self._open(id)
        if claim.kind == "input":
            raise ValueError(
                f"{self.paper}: {id} is an input; enter it with used(id, value) or untestable(id, "
                f"reason)"
            )
        if isinstance(measured, bool) or type(measured).__name__ == "bool":
            return self._check_truth(claim, bool(measured), n, evidence)
        measured, se = float(measured), float(se)
        if claim.kind == "number":
            shown = digits(measured, se)
            published, half_digit = parse(claim.value)
            verdict, needed = judge(
                published, half_digit if step is None else 0.5 * step, measured, se, n, paper_n
            )
        else:
            shown = evidence or f"margin {digits(measured, se)}"
            verdict, needed = judge_margin(measured, se, n)
        if verdict != "inconclusive":
            return self._enter(
                claim, shown, _se(se), n, verdict, claim.cause if verdict == "differs" else ""
            )
        settled = (
            f"{needed} trials would settle it" if needed else "no number of trials can be told"
        )  # margin 0, or no error
        return self._enter(claim, shown, _se(se), n, verdict, settled, f"; {settled}")

    def _check_truth(self, claim, holds, n, evidence):
        """A claim settled without chance."""
        if claim.kind == "number":
            raise ValueError(
                f"{self.paper}: {claim.id} is a number; give the measured value, not a truth value"
            )
        if not evidence:
            raise ValueError(f"{self.paper}: {claim.id}: a truth value needs its evidence in words")
        verdict = "reproduced" if holds else "differs"
        return self._enter(claim, evidence, "", n, verdict, "" if holds else claim.cause)

    def used(self, id, value, unit=None):
        """Compare the parameter the code runs with to the printed input.

        `unit` is the unit of `value` (default: the row's own); units of one dimension are
        converted.  A difference is an error in a default run: the code does not run the paper's
        scenario.
        """
        claim = self._open(id)
        if claim.kind != "input":
            raise ValueError(f"{self.paper}: {id} is of kind {claim.kind}; only inputs are used")
        same = _same(claim, value, claim.unit if unit is None else unit)
        if not same and self.strict:
            raise ValueError(
                f"{self.paper}: {id}: the code runs with {value!r} {unit or ''}, "
                f"the paper prints {claim.value!r} {claim.unit}"
            )
        shown = _plain(value) + (f" {unit}" if unit else "")
        return self._enter(
            claim,
            shown,
            "",
            None,
            "used" if same else "differs",
            "" if same else "parameter changed in this run",
        )

    def inputs(self, scenario):
        """Enter every field of a frozen dataclass made with :func:`given`; returns the symbol
        table.
        """
        table = []
        for field in dataclasses.fields(scenario):
            value, about = getattr(scenario, field.name), field.metadata
            if about["row"] != "open":
                self.used(about["row"], value, about["unit"])
            where = self.claims[about["row"]].where if about["row"] != "open" else "open"
            table.append((f"${about['symbol']}$", field.name, _plain(value), about["unit"], where))
        return pd.DataFrame(
            table, columns=["symbol", "code", "value", "unit", "where in the paper"]
        )

    def untestable(self, id, reason):
        """Enter a claim that cannot be tested here, with the reason."""
        if not reason:
            raise ValueError(f"{self.paper}: {id}: untestable needs its reason")
        return self._enter(self._open(id), "", "", None, "untestable", reason)

    def settle(self):
        """Take over the verdicts of a longer run where they rest on more trials; returns those that
        change, here and there.

        ``data/longer/<paper>/verdicts.csv`` is of a run that went on where this one stops, for
        longer than a notebook has time; data/README.md says which.  This run's trials are the
        beginning of the longer one's, so the difference of two numbers has the variance se**2 -
        se'**2.  Only a default run takes anything over.

        Raises ValueError when a number or a margin is more than 4 such errors from the longer
        run's, or when it differs from it and the longer run's error is not the smaller one: the two
        do not belong together.
        """
        changed = []
        for row in (
            verdicts(self.paper, paths.LONGER).itertuples(index=False) if self.strict else ()
        ):
            here = self.verdicts[row.id]
            if not row.n or int(row.n) <= int(here.n):
                continue
            if (
                self.claims[row.id].kind == "number" or here.measured.startswith("margin ")
            ) and _errors_apart(here, row) > 4:
                raise ValueError(
                    f"{self.paper}: {row.id} is {here.measured} here and {row.measured} in "
                    f"data/longer; "
                    "make the longer run again, as data/README.md says"
                )
            cause = self.claims[row.id].cause if row.verdict == "differs" else row.cause
            note = f"; {cause}" if row.verdict == "inconclusive" else ""
            self.verdicts[row.id] = Verdict(*row)._replace(cause=cause, note=note)
            if here.verdict != row.verdict:
                changed.append(
                    (
                        row.id,
                        *(f"{v.measured} ± {v.se}" for v in (here, row)),
                        here.verdict,
                        row.verdict,
                    )
                )
        return pd.DataFrame(
            changed, columns=["claim", "here", "longer run", "verdict here", "verdict"]
        )

    def table(self):
        """All verdicts in the order of the claims file.

        Raises ValueError when a claim has none and, in a default run, when something differs
        without a cause or has a cause without differing.
        """
        missing = [id for id in self.claims if id not in self.verdicts]
        if missing:
            raise ValueError(
                f"{self.paper}: no verdict on {len(missing)} of {len(self.claims)} claims: "
                f"{', '.join(missing)}"
            )
        wrong = [
            complaint
            for id in self.verdicts
            if self.strict and (complaint := self._about_cause(id))
        ]
        if wrong:
            raise ValueError(
                f"{self.paper}: {'; '.join(wrong)}; set the column cause of "
                f"data/claims/{self.paper}.csv right"
            )
        rows = [self.verdicts[id][:9] for id in self.claims]
        return pd.DataFrame(rows, columns=Verdict._fields[:9])

    def _about_cause(self, id):
        """What is wrong with the cause of a claim, in words; empty when nothing is."""
        verdict, cause = self.verdicts[id], self.claims[id].cause
        if verdict.verdict == "differs" and not cause:
            return f"{id} differs and the file gives no cause ({verdict!r})"
        return (
            f"{id} is {verdict.verdict} but the file gives a cause for a difference"
            if verdict.verdict != "differs" and cause
            else ""
        )

    def summary(self):
        """One line: how many of each verdict."""
        counts = pd.Series([verdict.verdict for verdict in self.verdicts.values()]).value_counts()
        return ", ".join(
            f"{counts[verdict]} {verdict}" for verdict in VERDICTS if verdict in counts
        )

    def _open(self, id):
        """The claim of an id that has no verdict yet."""
        if id not in self.claims:
            raise ValueError(
                f"{self.paper}: no claim {id!r}; the nearest is {nearest(id, self.claims)!r}"
            )
        if id in self.verdicts:
            raise ValueError(f"{self.paper}: {id} is checked twice")
        return self.claims[id]

    def _enter(self, claim, measured, se, n, verdict, cause="", note=""):
        """Enter a verdict and return it."""
        speaks = claim.unit not in ("", "-", "not printed") and re.search(
            r"[\d\]}]$", claim.value
        )  # behind numbers only
        published = f"{claim.value} {claim.unit}" if speaks else claim.value
        count = "" if n is None else str(int(n))
        self.verdicts[claim.id] = Verdict(
            claim.id,
            claim.item,
            claim.quantity,
            published,
            measured,
            se,
            count,
            verdict,
            cause,
            note,
        )
        return self.verdicts[claim.id]


def _errors_apart(here, longer):
    """Difference of two numbers or margins, the second over more of the same trials, in its own
    standard errors.

    Without room for a difference, since the second error is not the smaller one: 0 or infinity.
    """
    try:
        (a, da), (b, db) = (
            (float(v.measured.removeprefix("margin ")), float(v.se or 0)) for v in (here, longer)
        )
    except ValueError:  # words where a number belongs
        return math.inf
    if da > db:
        return abs(a - b) / math.sqrt(da**2 - db**2)
    return 0.0 if math.isclose(a, b, abs_tol=1e-12) else math.inf


def _se(se):
    """A standard error as text, two significant digits."""
    return f"{se:.2g}" if se else ""


def _plain(value):
    """A parameter as text."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def _same(claim, value, unit):
    """Whether a value in a unit is what a row prints; numbers to rounding, everything else as text
    without blanks.
    """
    if unit not in UNITS:
        raise ValueError(
            f"{claim.id}: unit {unit!r} is unknown; known are "
            f"{', '.join(word for word in UNITS if word)}"
        )
    try:
        printed = parse(claim.value)[0]
        number = float(value)
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


def scorecard(folder=None):
    """Count of verdicts by paper, with the `differs` that chance alone would give.

    A Monte Carlo claim that is true is called `differs` with a probability of about 1 % at the most
    (two 99 % margins add up), so among m of them about 0.01 m are expected.

    Raises FileNotFoundError when a paper has no verdicts, ValueError when its claims and verdicts
    do not match.
    """
    rows = []
    for paper in papers():
        table = verdicts(paper, folder)
        counts = table["verdict"].value_counts()
        chance = 0.01 * ((table["se"] != "") & table["verdict"].isin(VERDICTS[:3])).sum()
        rows.append(
            [
                paper,
                len(table),
                *(int(counts.get(verdict, 0)) for verdict in VERDICTS),
                f"{chance:.2f}",
            ]
        )
    card = pd.DataFrame(rows, columns=["paper", "claims", *VERDICTS, "differs by chance, about"])
    total = [
        "all",
        *(int(card[column].sum()) for column in card.columns[1:-1]),
        f"{card.iloc[:, -1].astype(float).sum():.2f}",
    ]
    card.loc[len(card)] = total
    return card


def ledger(folder=None):
    """The verdicts on every claim of every paper, one row each, the paper's name in front.

    Raises like :func:`verdicts`.
    """
    tables = [verdicts(paper, folder) for paper in papers()]
    frame = pd.concat(tables, keys=papers(), names=["paper", None])
    return frame.reset_index("paper").reset_index(drop=True)


def verdicts(paper, folder=None):
    """The verdicts.csv of a paper, all text; checked for completeness against its claims."""
    path = (folder or paths.figures()) / paper / "verdicts.csv"
    if not path.is_file():
        raise FileNotFoundError(
            f"{paper}: no verdicts.csv in {path.parent}; make it with: tbdcore run {paper}"
        )
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError):
        raise ValueError(
            f"{path}: no table of verdicts; make it anew: tbdcore run {paper}"
        ) from None
    if list(table.columns) != list(Verdict._fields[:9]):
        raise ValueError(
            f"{path}: its columns are {','.join(table.columns)}; make it anew: tbdcore run {paper}"
        )
    if list(table["id"]) != list(read(paper)):
        odd = sorted(set(table["id"]) ^ set(read(paper))) or ["their order"]
        raise ValueError(
            f"{paper}: verdicts.csv and data/claims/{paper}.csv do not match in {', '.join(odd)}; "
            f"run tbdcore run {paper}"
        )
    return table
