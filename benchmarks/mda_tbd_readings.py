"""Readings of (12) in chapter 03: ``python -m benchmarks.mda_tbd_readings``, minutes.

The choices that the paper leaves open are made for each reading by the same rule and grid
(``benchmarks.mda_map``); it takes the default's for all.  Then rows of Tables 2, 4 and 6 are flown
on the scenes of the page, whose own run is the default reading.  Flown are the readings and rows on
which a verdict may turn; the other ones have the thirty trials of ``data/mda_map.csv``.

``data/mda_tbd_readings.csv`` has a line for each reading and row: detection frame, mean OSPA, bias
of the intensity, with standard errors.  ``data/mda_tbd_readings_trials.csv`` has the bias of each
trial, for differences from the page's.  ``data/mda_tbd_late.csv`` has the frames by which the first
declared frame comes earlier than with the default, paired, in the first sixty frames: with windows
that are divided by the frames there are (*available*), and with births where the power is high.
"""

import math
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pandas as pd

import tbdcore
from benchmarks import mda_map
from tbdcore.kernels import mda_tbd
from tbdcore.repro import paths, products, trials

N, SEED, CUT, EARLY = 100, 20, 200.0, 60  # the page's trials and seed
ROWS = {"t2.4": (6, 0), "t4.1": (12, 0), "t4.2": (9, 0), "t6.4": (9, 4)}  # R, R_T
FLOWN = {way: ["t2.4", "t4.1", "t4.2"] for way in ("available", "letter")}
LATE = "t2.4", "t4.2", "t6.4"  # printed at 6 dB, at 9 dB, and at a threshold of 4 dB
CHANGES = {"own-cell": {}, "available": {"reading": "available"}}
CHANGES |= {"births by power": {"births": "power"}}


def cases(page):
    """Filters by (reading, row), and for the lateness by (change, row)."""
    told = {row: page.Filter(R=float(R), R_T=float(R_T)) for row, (R, R_T) in ROWS.items()}
    whole = {(way, row): replace(told[row], reading=way) for way in FLOWN for row in FLOWN[way]}
    return whole, {
        (how, row): replace(told[row], **CHANGES[how]) for row in LATE for how in CHANGES
    }


def trial(seed, i):
    """Existence, OSPA and intensity (cases, 3, K), and existence (changes, EARLY), on a scene."""
    page = tbdcore.page("mda_tbd")
    base = page.Scene()

    def draws(purpose):
        return trials.generator(seed, "mda_tbd", "scenes", i, purpose)

    rng = draws("noise")
    empty = mda_tbd.noise_power((base.scans, *base.grid[4:]), rng)
    scenes = {}
    for R in {R for R, _ in ROWS.values()}:
        scene = replace(base, R=float(R))
        scenes[R] = page.simulate(scene, draws("truth"), deepcopy(rng), empty)
    path, found, early = page.target(base)[:, ::2], [], []
    whole, late = cases(page)
    for p in whole.values():
        track = page.recursion(scenes[p.R], p, draws("filter"))
        ospa = mda_tbd.ospa_bernoulli(track.x[:, ::2], track.existence, path, CUT)
        found.append((track.existence, ospa, track.P))
    for p in late.values():
        early.append(page.recursion(scenes[p.R][:EARLY], p, draws("filter")).existence)
    return np.array(found), np.array(early)


def first_declared(existence, appears=15):
    """First declared frame (n,) from `appears` on, the number of frames + 1 without one."""
    on = existence[:, appears - 1 :] > 0.5
    return np.where(on.any(axis=1), on.argmax(axis=1) + appears, existence.shape[1] + 1)


def tables(whole, early):
    """The three tables of trials (n, cases, 3, K) and (n, changes, EARLY)."""
    page = tbdcore.page("mda_tbd")
    readings, late = cases(page)
    lines, each, gains = [], [], []
    rng = trials.generator(SEED, "mda_tbd", "readings", len(whole), "filter")
    for ((way, row), p), fields in zip(readings.items(), np.moveaxis(whole, 0, 2), strict=True):
        scene = page.scene_of(p)
        lines.append([way, row, len(whole), *mda_map.measures(scene, *fields, rng)[:6]])
        bias = fields[2][:, scene.appears - 1 :].mean(axis=1) - scene.P_tar
        each += [[way, row, i, float(f"{b:.6g}")] for i, b in enumerate(bias)]
    firsts = dict(zip(late, map(first_declared, np.moveaxis(early, 0, 1)), strict=True))
    for how, row in late:
        gain = firsts["own-cell", row] - firsts[how, row]
        if how != "own-cell":
            se = gain.std(ddof=1) / math.sqrt(len(gain))
            gains.append([row, how, len(gain), *(float(f"{v:.3g}") for v in (gain.mean(), se))])
    names = ["reading", "row", "n", *mda_map.NAMES[:6]]
    return {
        "mda_tbd_readings": pd.DataFrame(lines, columns=names),
        "mda_tbd_readings_trials": pd.DataFrame(each, columns=["reading", "row", "trial", "bias"]),
        "mda_tbd_late": pd.DataFrame(gains, columns=["row", "change", "n", "gain", "gain_se"]),
    }


def write(made):
    """Write the files."""
    head = f"# python -m benchmarks.mda_tbd_readings: the page's scenes, seed {SEED}\n".encode()
    files = {f"{name}.csv": head + products.csv(table) for name, table in made.items()}
    products.write(paths.claims().parent, files)


if __name__ == "__main__":
    write(tables(*trials.run(trial, N, seed=SEED, label="readings")))
