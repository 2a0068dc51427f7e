"""The two tables of what a chapter says beyond its paper: its methods, and their limits.

``methods`` has a row for each method, at most eight.  Its columns are ``method``; at most four
measures, each with its standard error behind it (``P_D`` and ``P_D_se``); ``cpu_ms``, the CPU time
of a trial in milliseconds, from a committed study (``studies.cost``); and ``told``, what the method
is told beyond the others.

``limits`` has a row for each condition, at most six, each at one size that its name states.  False
alarms (``false``), and the share found or held with a target (``found``), stand there as promised
(without the condition), as stored, and after ``recording``, each with its standard error behind it.

A measure is a finite number, its error 0 where no chance is involved; or a word such as "never",
its error empty.
"""

import math
from numbers import Real

import pandas as pd

from tbdcore.repro import claims, studies

METHODS, LIMITS = 8, 6  # most rows
MEASURES = 4  # most of them in `methods`, unless a chapter says another number
CASES = {"promised": "promised", "stored": "as stored", "recorded": "after recording"}
SIZES = {"false": "false alarms", "found": "with a target"}
HEADERS = {f"{size}_{case}": f"{SIZES[size]}, {CASES[case]}" for size in SIZES for case in CASES}
HEADERS |= {"cpu_ms": "CPU time, ms"}
LIMIT_COLUMNS = ["condition", *(f"{s}_{c}{e}" for s in SIZES for c in CASES for e in ("", "_se"))]


def methods(paper, frame, measures=MEASURES):
    """The table of methods, with CPU times from the study of the paper; ValueError, in one line,
    for one that is not as the module says.
    """
    frame, where = frame.reset_index(drop=True), f"{paper}/methods"
    columns = list(frame.columns)
    named = [name for name in columns[1:-1] if not name.endswith("_se")]
    if columns != ["method", *(f"{name}{end}" for name in named for end in ("", "_se")), "told"]:
        reason = "give method, each measure with its error (P_D, P_D_se), and told"
        raise ValueError(f"{where}: columns {', '.join(map(str, columns))}; {reason}")
    if not 1 <= len(named) <= measures:
        raise ValueError(f"{where}: {len(named)} measures; give 1 to {measures}")
    _check(where, frame, ["method", "told"], METHODS)
    times = studies.cost(paper, frame["method"])
    frame.insert(len(columns) - 1, "cpu_ms", times)
    return frame


def limits(paper, frame):
    """The table of limits, checked in the same way."""
    frame, where = frame.reset_index(drop=True), f"{paper}/limits"
    if list(frame.columns) != LIMIT_COLUMNS:
        reason = f"columns {', '.join(map(str, frame.columns))}; give {', '.join(LIMIT_COLUMNS)}"
        raise ValueError(f"{where}: {reason}")
    _check(where, frame, ["condition"], LIMITS)
    return frame


def _check(where, frame, texts, most):
    """Raise ValueError for too few or too many rows, a row named twice, a cell that is wrong."""
    if not 1 <= len(frame) <= most:
        raise ValueError(f"{where}: {len(frame)} rows; give 1 to {most}")
    for number, row in enumerate(frame.to_dict("records"), start=1):
        for column, value in row.items():
            if reason := _fault(row, column, value, column in texts):
                raise claims.fault(where, number, column, f"{value!r} {reason}")
    names = frame.iloc[:, 0]
    if names.duplicated().any():
        raise ValueError(f"{where}: {names[names.duplicated()].iloc[0]!r} stands there twice")


def _fault(row, column, value, text):
    """What is wrong with a cell, in words; empty if nothing is."""
    word, number = isinstance(value, str) and value.strip() != "", _finite(value)
    if text:
        return "" if word else "is no text; say it in words"
    if not column.endswith("_se"):
        return "" if word or number else "is no number; give one, or a word"
    if _finite(row[column.removesuffix("_se")]):
        return "" if number and value >= 0 else "is no standard error; give one, 0 without chance"
    empty = value == "" or isinstance(value, float) and math.isnan(value)
    return "" if empty else "is the error of a word; leave it empty"


def _finite(value):
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def shown(frame):
    """A table of methods or limits as it is read: each measure with its error, in plain words."""
    columns = {}
    for name in frame.columns:
        if f"{name}_se" in frame.columns:
            pairs = zip(frame[name], frame[f"{name}_se"], strict=True)
            columns[HEADERS.get(name, name)] = [_with_error(*pair) for pair in pairs]
        elif not name.endswith("_se"):
            cells = [_plain(it) if _finite(it) else it for it in frame[name]]
            columns[HEADERS.get(name, name)] = cells
    return pd.DataFrame(columns)


def _plain(value):
    """A number of three digits, or of all its digits before the point."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _with_error(value, se):
    """A measure as text, to the second digit of its error."""
    if not _finite(value):
        return value
    return f"{claims.digits(value, se)} ± {se:.2g}" if se else claims.digits(value)


def read(file):
    """A table of methods or limits from its CSV file, numbers as numbers, words as words."""
    frame = pd.read_csv(file, keep_default_na=False, dtype=str)
    return frame.map(_number)


def _number(text):
    try:
        return float(text)
    except ValueError:
        return text
