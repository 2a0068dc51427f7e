"""Scans of plots from the rows of a table, and plots in polar coordinates made x, y."""

import math
import warnings
from typing import Annotated, Any

import numpy as np

from tbdcore.checks import Array, ArrayLike, Numbers, array, checked, numbers
from tbdcore.recording.misfit import Misfit

__all__ = ["cartesian", "scans"]

GAP = 1.5  # median steps between two scans: one may be missing


@checked
def scans(rows: Any, times: Any = None) -> tuple[Array, list]:
    """Times (K,) in seconds that rise, and for each the plots (n, d) of that scan.

    rows : (N, 1 + d), the time first, in any order; numbers, text, or a table of both.  A time is
        a number of seconds or a date, "2021-05-04T09:01:20.5".  A row whose plot is NaN or empty
        says that the scan was taken and has no plot.
    times : (K,) of all scans that were taken; those without a row have no plot.  None: the scans
        are those that have a row, and a step of 1.5 median steps or more is a ``Misfit`` warning.

    A scan that was not taken is no scan: it is in neither list.  Chapters 04 and 05 read a scan of
    no rows, (0, d), as a miss.
    """
    name = "recording.scans: rows"
    table = array(name, rows)
    if table.ndim != 2 or table.shape[0] < 1 or table.shape[1] < 3:
        raise ValueError(f"{name}: shape {table.shape}; give rows of time, x, y, ...")
    at = _seconds(name, table[:, 0])
    plots = _floats(name, table[:, 1:])
    empty = np.isnan(plots).all(axis=1)
    numbers(name, plots[~empty], "N", "d", low=-1e300, high=1e300)
    t = np.unique(at if times is None else _seconds("recording.scans: times", times))
    k = np.searchsorted(t, at)
    strange = (k == t.size) | (t[np.minimum(k, t.size - 1)] != at)
    if strange.any():
        row = int(strange.argmax())
        raise ValueError(f"{name}[{row}]: its time is none of times; give the times of all scans")
    if times is None:
        _warn_gaps(t)
    return t, [plots[(k == n) & ~empty] for n in range(t.size)]


def _seconds(name, column):
    """Times (N,) as seconds; dates count from 1970."""
    column = array(name, column)
    if column.ndim != 1 or not column.size:
        raise ValueError(f"{name}: times of shape {column.shape}; give one for each row or scan")
    if column.dtype.kind in "OSU" and not _is_number(column[0]):
        column = _converted(name, column.astype(str), "datetime64[us]", "a date")
    if column.dtype.kind == "M":
        column = (column - np.datetime64(0, "s")) / np.timedelta64(1, "s")
    return numbers(name, _floats(name, column), "N", low=-1e15, high=1e15)


def _is_number(value):
    try:
        return math.isfinite(float(value))
    except (TypeError, ValueError):
        return False


def _floats(name, table):
    """A table of numbers or text as floats; empty text is NaN."""
    if table.dtype.kind in "OSU":
        text = table.astype(str)
        table = _converted(
            name, np.where(np.isin(text, ["", "None"]), "nan", text), float, "number"
        )
    return numbers(name, table, ...).astype(float)


def _converted(name, text, kind, noun):
    try:
        return text.astype(kind)
    except ValueError as error:
        words = " ".join(str(error).split())[:60]
        raise ValueError(f"{name}: a text is no {noun} ({words}); leave out such rows") from None


def _warn_gaps(t):
    steps = np.diff(t)
    if wide := int((steps >= GAP * np.median(steps)).sum()) if steps.size else 0:
        words = f"{wide} of {steps.size} steps are {GAP} times the median or more"
        advice = "a scan without plots has no row: give times, those of all scans"
        warnings.warn(f"recording.scans: rows: {words}; {advice}", Misfit, stacklevel=4)


@checked
def cartesian(scan: Annotated[ArrayLike, Numbers("n", "d")]) -> Array:
    """Plots of range (m), azimuth (rad) and further columns as x, y and the same columns.

    Azimuth counts from x to y; a bearing from north is pi / 2 less azimuth.
    """
    if scan.shape[1] < 2 or (scan[:, :1] < 0).any():
        words = f"shape {scan.shape}, or a range below 0; give columns range, azimuth, ..."
        raise ValueError(f"recording.cartesian: scan: {words}")
    if (abs(scan[:, 1]) > 2 * math.pi).any():
        words = "an azimuth beyond 2 pi; give radians, np.radians(degrees), as the second column"
        raise ValueError(f"recording.cartesian: scan: {words}")
    r, a = scan[:, 0], scan[:, 1]
    return np.column_stack([r * np.cos(a), r * np.sin(a), scan[:, 2:]])
