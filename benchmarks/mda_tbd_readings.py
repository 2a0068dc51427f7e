"""Readings of (12) in chapter 03: ``python -m benchmarks.mda_tbd_readings``, restartable.

The choices that the paper leaves open are made for each reading by the same rule and grid
(``benchmarks.mda_map``); it takes the default's for all.  Then rows of Tables 2, 4 and 6 are flown
on the scenes of the page, whose own run is the default reading.  Flown are the readings and rows on
which a verdict may turn; the other ones have the thirty trials of ``data/mda_map.csv``.

``data/mda_tbd_readings.csv`` has a line for each reading and row: detection frame, mean OSPA, bias
of the intensity, with standard errors.  ``data/mda_tbd_readings_trials.csv`` has the bias of each
trial, for differences from the page's.  ``data/mda_tbd_late.csv`` has the frames by which the first
declared frame comes earlier than with the default, paired, in the first sixty frames: with windows
that are divided by the frames there are (*available*), and with births where the power is high.
What the files have is not flown again; all of it takes a quarter of an hour.
"""

import math
from copy import deepcopy
from functools import partial
from itertools import product

import numpy as np
import pandas as pd

import tbdcore
from benchmarks import mda_map
from tbdcore.kernels import mda_tbd
from tbdcore.repro import paths, products, studies, trials

N, SEED, CUT, EARLY = 100, 20, 200.0, 60  # the page's trials and seed
ROWS = {"t2.4": (6, 0), "t4.1": (12, 0), "t4.2": (9, 0)}  # R, R_T
ROWS |= {"t6.1": (9, 1), "t6.4": (9, 4)}
FOUR = "available", "letter", "per-sample", "least-squares"  # all but the default and strict
PARTS = [  # (reading, row), flown together
    [*product(("available", "letter"), ("t2.4", "t4.1", "t4.2"))],
    [*product(FOUR, ("t6.1", "t6.4"))],
]
LATE = "t2.4", "t4.2", "t6.4"  # printed at 6 dB, at 9 dB, and at a threshold of 4 dB
CHANGES = {"own-cell": {}, "available": {"reading": "available"}}
CHANGES |= {"births by power": {"births": "power"}}
COLUMNS = ["reading", "row", "n", *mda_map.NAMES[:6]]
TRIALS = ["reading", "row", "trial", "bias"]


def told(page, row, **settings):
    """The filter of a row."""
    R, R_T = ROWS[row]
    return page.Filter(R=float(R), R_T=float(R_T), **settings)


def trial(filters, scans, seed, i):
    """Existence, OSPA and intensity (filters, 3, scans) on the scene of a trial of the page."""
    page = tbdcore.page("mda_tbd")
    base = page.Scene()

    def draws(purpose):
        return trials.generator(seed, "mda_tbd", "scenes", i, purpose)

    rng = draws("noise")
    empty = mda_tbd.noise_power((base.scans, *base.grid[4:]), rng)
    scenes, found = {}, []
    for p in filters:
        if p.R not in scenes:
            scene = page.scene_of(p)
            scenes[p.R] = page.simulate(scene, draws("truth"), deepcopy(rng), empty)[:scans]
        track = page.recursion(scenes[p.R], p, draws("filter"))
        path = page.target(base)[:scans, ::2]
        ospa = mda_tbd.ospa_bernoulli(track.x[:, ::2], track.existence, path, CUT)
        found.append((track.existence, ospa, track.P))
    return np.array(found)


def fly(filters, scans, label):
    """All trials of some filters (filters, 3, N, scans)."""
    flown = trials.run(partial(trial, filters, scans), N, seed=SEED, label=label)
    return np.moveaxis(flown, 0, 2)


def first_declared(existence, appears=15):
    """First declared frame (n,) from `appears` on, the number of frames + 1 without one."""
    on = existence[:, appears - 1 :] > 0.5
    return np.where(on.any(axis=1), on.argmax(axis=1) + appears, existence.shape[1] + 1)


def measured(number, page):
    """The lines of the first two files that a part of PARTS makes."""
    lines, each, pairs = [], [], PARTS[number]
    filters = [told(page, row, reading=way) for way, row in pairs]
    rng = trials.generator(SEED, "mda_tbd", "readings", N + number, "filter")
    flown = fly(filters, page.Scene().scans, f"part {number + 1}")
    for (way, row), p, fields in zip(pairs, filters, flown, strict=True):
        scene = page.scene_of(p)
        lines.append([way, row, N, *mda_map.measures(scene, *fields, rng)[:6]])
        bias = fields[2][:, scene.appears - 1 :].mean(axis=1) - scene.P_tar
        each += [[way, row, i, float(f"{b:.6g}")] for i, b in enumerate(bias)]
    return pd.DataFrame(lines, columns=COLUMNS), pd.DataFrame(each, columns=TRIALS)


def gains(page):
    """The third file."""
    late = [*product(LATE, CHANGES)]
    flown = fly([told(page, row, **CHANGES[how]) for row, how in late], EARLY, "lateness")
    firsts = dict(zip(late, map(first_declared, flown[:, 0]), strict=True))
    lines = []
    for row, how in late:
        gain = firsts[row, "own-cell"] - firsts[row, how]
        if how != "own-cell":
            se = gain.std(ddof=1) / math.sqrt(len(gain))
            lines.append([row, how, len(gain), *(float(f"{v:.3g}") for v in (gain.mean(), se))])
    return pd.DataFrame(lines, columns=["row", "change", "n", "gain", "gain_se"])


def read(name, columns):
    """A file of this study, empty where there is none."""
    there = (paths.claims().parent / f"{name}.csv").is_file()
    return studies.read(name) if there else pd.DataFrame(columns=columns)


def write(**made):
    """Write the files."""
    head = f"# python -m benchmarks.mda_tbd_readings: the page's scenes, seed {SEED}\n".encode()
    files = {f"mda_tbd_{name}.csv": head + products.csv(table) for name, table in made.items()}
    products.write(paths.claims().parent, files)


def main():
    """Fly what the files lack, and write them after each part."""
    page = tbdcore.page("mda_tbd")
    table, each = (read("mda_tbd_readings", COLUMNS), read("mda_tbd_readings_trials", TRIALS))
    for number, pairs in enumerate(PARTS):
        have = set(zip(table["reading"], table["row"], strict=True))
        if not have >= set(pairs):
            lines, biases = measured(number, page)
            table = pd.concat([table, lines], ignore_index=True)
            each = pd.concat([each, biases], ignore_index=True)
            write(readings=table, readings_trials=each)
    if read("mda_tbd_late", []).empty:
        write(late=gains(page))


if __name__ == "__main__":
    main()
