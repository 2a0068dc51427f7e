"""Scans from the rows of a table, and polar plots."""

import warnings

import numpy as np
import pytest

from tbdcore import recording
from tbdcore.recording.misfit import Misfit

ROWS = [[3.0, 1, 2, 9], [1.0, 5, 6, 8], [1.0, 7, 8, 7]]


def plain(found):
    return found[0].tolist(), [scan.tolist() for scan in found[1]]


def test_rows_are_sorted_and_a_scan_without_a_row_is_empty():
    t, scans = recording.scans(ROWS, [1.0, 2.0, 3.0])
    assert plain((t, scans)) == ([1, 2, 3], [[[5, 6, 8], [7, 8, 7]], [], [[1, 2, 9]]])
    assert scans[1].shape == (0, 3)


def test_a_row_without_numbers_is_a_scan_without_plots():
    t, scans = recording.scans([[1.0, 5, 6], [2.0, np.nan, np.nan], [3.0, 1, 2]])
    assert plain((t, scans)) == ([1, 2, 3], [[[5, 6]], [], [[1, 2]]])
    with pytest.raises(ValueError, match="recording.scans: rows"):
        recording.scans([[1.0, 5, 6], [2.0, np.nan, 4.0]])


@pytest.mark.parametrize("kind", [str, object])
def test_text_and_dates(kind):
    rows = np.array([[f"2021-05-04T09:01:2{s}.5", f"{s}.25", "7"] for s in (1, 0, 2)], kind)
    rows[2, 1:] = ["", ""]
    t, scans = recording.scans(rows)
    assert np.diff(t).tolist() == [1.0, 1.0]
    assert [scan.tolist() for scan in scans] == [[[0.25, 7]], [[1.25, 7]], []]
    numbers = np.array(ROWS).astype(kind)
    assert plain(recording.scans(numbers, [1, 2, 3])) == plain(recording.scans(ROWS, [1, 2, 3]))


def test_a_gap_between_scans_is_said():
    rows = np.c_[[0.0, 1, 2, 4, 5], np.ones((5, 2))]
    with pytest.warns(Misfit, match="1 of 4 steps"):
        recording.scans(rows)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        recording.scans(rows, np.arange(6.0))
        recording.scans(rows[:3])


@pytest.mark.parametrize(
    ("rows", "times"),
    [
        (ROWS, [1.0, 2.0]),
        ([["x", "1", "2"]], None),
        ([["1", "1", "two"]], None),
        (np.ones((3, 2)), None),
        (np.empty((0, 3)), None),
        ([[np.nan, 1, 2]], None),
        ([[1.0, np.inf, 2]], None),
        (ROWS, []),
        (None, None),
    ],
)
def test_what_is_no_table_is_refused_in_a_line(rows, times):
    with pytest.raises(ValueError, match=r"recording\.scans: ") as refused:
        recording.scans(rows, times)
    assert "\n" not in str(refused.value)


def test_polar_plots():
    scan = np.array([[100.0, np.pi / 2, 7], [50.0, np.pi, 8]])
    assert recording.cartesian(scan) == pytest.approx(np.array([[0, 100, 7], [-50, 0, 8]]))
    for bad in (np.degrees(scan), scan[:, [1, 0, 2]], -scan, scan[:, :1]):
        with pytest.raises(ValueError, match=r"recording\.cartesian: scan: "):
            recording.cartesian(bad)
