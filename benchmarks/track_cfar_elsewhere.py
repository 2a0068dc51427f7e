"""Thresholds of chapter 04 elsewhere: ``python -m benchmarks.track_cfar_elsewhere``.

It writes ``data/track_cfar_elsewhere.csv``: the track false-alarm probability P_F of each method of
the chapter, with its error, for a target that vanishes in one of six frames: on the paper's course,
for weaker and stronger targets, for filters that expect other process noise, and for a target that
crosses.  The thresholds are those of ``data/track_cfar_tuned.csv``, not tuned again.  Minutes.
``python -m benchmarks.track_cfar_elsewhere seeds`` does so with five other seeds, and writes
``data/track_cfar_elsewhere_seeds.csv``.
"""

import sys
from dataclasses import replace

import numpy as np
import pandas as pd

from benchmarks import track_cfar_tuned as tuned
from benchmarks.seeds import FIVE
from tbdcore import score
from tbdcore.repro import paths, products, studies

FLIGHTS, SEED = 40_000, 103
FEWER = 2_000  # with each of the other seeds
NEAREST = 250e3  # m, of the crossing course
SCENES = {
    "paper's course": {},
    "6 dB weaker": {"snr0_db": 24.0},
    "3 dB weaker": {"snr0_db": 27.0},
    "3 dB stronger": {"snr0_db": 33.0},
    "6 dB stronger": {"snr0_db": 36.0},
    "sigma_p = 0.03": {"sigma_p": 0.03},
    "sigma_p = 1": {"sigma_p": 1.0},
    "sigma_p = 3": {"sigma_p": 3.0},
    "crossing course": {},
}


def course(p, name):
    """True plots (K + 2, 2) of a scene; the crossing target passes at NEAREST in the middle."""
    if name != "crossing course":
        return tuned.page.truth(p)
    x = p.speed * p.scan * (np.arange(-2, p.frames) - p.frames / 2)
    return np.stack([np.hypot(x, NEAREST), np.arctan2(NEAREST, x)], axis=-1)


def designs(p):
    """Numbers of the five methods in a scene, by name; the tuned ones as on the paper's course."""
    table, course = studies.read("track_cfar_tuned"), tuned.page.truth(p)
    found = {"traditional": tuned.page.design(p, p.cell_pfa), "proposed": tuned.page.design(p)}
    for key, name in tuned.NAMES.items():
        values = table.loc[table["method"] == name, "probability"].to_numpy()
        found[name] = tuned.rule(p, course, key, values)
    return found


def fly(name, change, n, seed):
    """The lines of one scene, from n flights."""
    p = replace(tuned.page.Scenario(), **change)
    true = course(p, name)
    drawn, km = tuned.scenes(p, true, n, seed, name), true[2:, 0][tuned.GONE] / 1e3
    for method, d in designs(p).items():
        alive, left = tuned.counts(*drawn, true, d, tuned.GONE, p.miss_limit)
        P_F, se = score.proportion(left, alive)
        print(name, method, P_F.round(3), flush=True)
        lines = zip([name] * 6, [method] * 6, tuned.GONE, km, P_F, se, alive, strict=True)
        yield from (line for line in lines if line[-1])  # no track: no share


def scenes(n, seed):
    """The lines of all scenes with one seed."""
    return [line for name, change in SCENES.items() for line in fly(name, change, n, seed)]


def main():
    """Fly all scenes, and write the file."""
    columns = ["scene", "method", "frame", "km", "P_F", "P_F_se", "tracks"]
    if sys.argv[1:] == ["seeds"]:
        found = [(seed, *line) for seed in FIVE for line in scenes(FEWER, seed)]
        words, file = f" seeds; seeds {FIVE[0]} to {FIVE[-1]}, {FEWER}", "elsewhere_seeds"
        table = pd.DataFrame(found, columns=["seed", *columns])
    else:
        table, words = pd.DataFrame(scenes(FLIGHTS, SEED), columns=columns), f": {FLIGHTS}"
        file = "elsewhere"
    head = f"# python -m benchmarks.track_cfar_elsewhere{words} flights in each scene\n"
    content = {f"track_cfar_{file}.csv": head.encode() + products.csv(table)}
    products.write(paths.claims().parent, content)


if __name__ == "__main__":
    main()
