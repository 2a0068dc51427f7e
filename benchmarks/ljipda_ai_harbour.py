"""Two recorded scenes for chapter 05: ``python -m benchmarks.ljipda_ai_harbour``, seconds.

Two boats in a harbour (``data/recorded``), as in ``docs/examples/harbour.py``: plots within 6 m are
joined, the two tracks start at the places that satellite receivers tell, and each tracker without
amplitudes has the same settings.  It writes ``data/ljipda_ai_harbour.csv``: the share of scans in
which each track is within 15 m of its own boat, and of the other.
"""

import numpy as np
import pandas as pd

import tbdcore
from tbdcore import recording
from tbdcore.repro import paths, products

SCENES, METHODS = (2, 17), ("IPDA", "JIPDA", "LJIPDA")
AWAY = 10e3  # m, on both axes: far from the radar a plot has the same error on both
SIGMA, Q, P_DETECT, JOINED, NEAR = 4.0, 0.1, 0.6, 6.0, 15.0  # m, m^2/s^3, -, m, m
COLUMNS = ["scene", "method", "boat", "own", "other", "n"]


def recorded(scene):
    """Times (K,), plots of each scan, and places of the boats (K, 2, 2), NaN where unknown."""
    file = paths.claims().parent / "recorded" / f"autoferry_{scene:02d}"
    rows, true = (np.genfromtxt(f"{file}{end}.csv", delimiter=",")[1:] for end in ("", "_truth"))
    radar = {row[0]: row[[2, 1]] - rows[0, [2, 1]] for row in rows}
    t, scans = recording.scans(rows[:, [0, 4, 3]])
    moved = [z + radar[s] + AWAY for s, z in zip(t, scans, strict=True)]
    boats = np.full((t.size, 2, 2), np.nan)
    for s, boat, north, east in true:
        boats[np.searchsorted(t, s), int(boat) - 1] = radar[s] + [east, north] + AWAY
    return t, [recording.merge_plots(z, JOINED) for z in moved], boats


def tracked(t, scans, boats, method):
    """Places (K, 2, 2) of the two tracks; they start at the first two places of the boats."""
    page = tbdcore.page("ljipda_ai")
    (first, second), T = np.flatnonzero(np.isfinite(boats).all(axis=(1, 2)))[:2], np.diff(t)
    speed = (boats[second] - boats[first]) / (t[second] - t[first])
    x = np.stack([boats[first], speed], axis=-1).reshape(2, 4)
    P = np.diag([SIGMA**2, 1.0, SIGMA**2, 1.0])
    F = np.array([page.motion.cv(step) for step in T[first:]])
    noise = np.array([page.motion.white_acceleration(step, Q) for step in T[first:]])
    angle = np.degrees(SIGMA / np.hypot(AWAY, AWAY))
    setup = page.Setup(x, P, F, noise, SIGMA, angle, p_detect=P_DETECT)
    found = np.full((t.size, 2, 2), np.nan)
    found[first:] = page.run(scans[first:], setup, method=method).x[..., ::2]
    return found


def shares(scene, method):
    """Rows of the file for one scene and method."""
    t, scans, boats = recorded(scene)
    place = tracked(t, scans, boats, method)
    off = np.linalg.norm(place[:, :, None] - boats[:, None], axis=-1)  # scan, track, boat
    for track in range(2):
        told = np.isfinite(off[:, track]).all(axis=1)
        near = (off[told, track] < NEAR).mean(axis=0)
        yield scene, method, track + 1, near[track], near[1 - track], told.sum()


def main():
    """Track both scenes with each method, and write the file."""
    found = [row for scene in SCENES for method in METHODS for row in shares(scene, method)]
    table = pd.DataFrame(found, columns=COLUMNS).round(3)
    file = paths.claims().parent / "ljipda_ai_harbour.csv"
    head = b"# python -m benchmarks.ljipda_ai_harbour\n"
    products.write(file.parent, {file.name: head + products.csv(table)})
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
