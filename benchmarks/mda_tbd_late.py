"""What brings the first declared frame of chapter 03 forward:
``python -m benchmarks.mda_tbd_late``, minutes.

``data/mda_tbd_late.csv`` has the frames by which it comes earlier than with the default, paired, in
the first sixty frames of the page's scenes: with windows that are divided by the frames there are
(*available*), and with births where the power is high.
"""

import math
from functools import partial
from itertools import product

import numpy as np
import pandas as pd

import tbdcore
from tbdcore.repro import paths, products, trials

N, SEED, EARLY = 100, 20, 60  # the page's trials and seed; frames
ROWS = {"t2.4": (6.0, 0.0), "t4.2": (9.0, 0.0), "t6.4": (9.0, 4.0)}  # R, R_T
CHANGES = {"own-cell": {}, "available": {"reading": "available"}}
CHANGES |= {"births by power": {"births": "power"}}


def told(page, row, **settings):
    """The filter of a row."""
    R, R_T = ROWS[row]
    return page.Filter(R=R, R_T=R_T, **settings)


def trial(filters, seed, i):
    """Existence (filters, EARLY) on the scene of a trial of the page."""
    page, found = tbdcore.page("mda_tbd"), []

    def draws(purpose):
        return trials.generator(seed, "mda_tbd", "scenes", i, purpose)

    scenes = {}
    for p in filters:
        if p.R not in scenes:
            scenes[p.R] = page.simulate(page.scene_of(p), draws("truth"), draws("noise"))
        found.append(page.recursion(scenes[p.R][:EARLY], p, draws("filter")).existence)
    return np.array(found)


def first_declared(existence, appears=15):
    """First declared frame (n,) from `appears` on, the number of frames + 1 without one."""
    on = existence[:, appears - 1 :] > 0.5
    return np.where(on.any(axis=1), on.argmax(axis=1) + appears, existence.shape[1] + 1)


def main():
    """Fly the filters and write the file."""
    page, late = tbdcore.page("mda_tbd"), [*product(ROWS, CHANGES)]
    filters = [told(page, row, **CHANGES[how]) for row, how in late]
    flown = trials.run(partial(trial, filters), N, seed=SEED, label="lateness")
    firsts = dict(zip(late, map(first_declared, np.swapaxes(flown, 0, 1)), strict=True))
    lines = []
    for row, how in late:
        gain = firsts[row, "own-cell"] - firsts[row, how]
        if how != "own-cell":
            pair = gain.mean(), gain.std(ddof=1) / math.sqrt(N)
            lines.append([row, how, N, *(float(f"{value:.3g}") for value in pair)])
    table = pd.DataFrame(lines, columns=["row", "change", "n", "gain", "gain_se"])
    head = f"# python -m benchmarks.mda_tbd_late: the page's scenes, seed {SEED}\n".encode()
    products.write(paths.claims().parent, {"mda_tbd_late.csv": head + products.csv(table)})


if __name__ == "__main__":
    main()
