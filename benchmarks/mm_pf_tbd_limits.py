"""Chapter 02's improved filter where a promise breaks: ``python -m benchmarks.mm_pf_tbd_limits``.

It takes minutes and writes ``data/mm_pf_tbd_limits.csv``: false declarations in 1000 frames without
a target, and the share of the frames with one that are declared within two cells of it, in the
paper's scene at the printed intensity.  `promised`: as told; `stored`: with the condition;
`recorded`: after ``tbdcore.recording`` has prepared the frames, or with the missing frames named.
The threshold is always that of white noise, ten in 1000, from 10200 frames; its error is part of
each error.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

import tbdcore
from tbdcore import baseline, noise, recording, score
from tbdcore.repro import paths, products, trials

page = tbdcore.page("mm_pf_tbd")
SEED, RUNS, EMPTY, PARTS = 20, 100, 170, 10
RATE, RADIUS = 0.01, 2.0
OFF, LOUDER_DB, FREEDOM, NARROW, TWICE, GAP = 0.2, 0.5, 5, 0.45, 2.0, 3
P = page.Scenario(scene=page.Scene(noise=1.0, amplitude=18.0 / 2.3))


def levelled(z):
    """Frames less their mean level, over their spread, both measured without bright cells."""
    return recording.normalise(z, recording.clipped(z))


def normal_again(z):
    """Frames of normal noise, by the law that the frames themselves show."""
    return recording.normal_scores(z, recording.empirical_law(z))


def tailed(z):
    """Normal noise as Student's, of variance 1."""
    from scipy import special

    return -special.stdtrit(FREEDOM, special.ndtr(-z)) / np.sqrt(FREEDOM / (FREEDOM - 2))


def gaps(z, value):
    """Frames of which the first three of every ten are replaced."""
    return [value if k % 10 < GAP else frame for k, frame in enumerate(z)]


def told(**change):
    """The filter that is told something else of the scene."""
    return replace(P, scene=replace(P.scene, **change))


def same(z):
    """Frames without a fault."""
    return z


FILLED = partial(gaps, value=np.zeros((P.scene.nx, P.scene.ny)))
CONDITIONS = {  # fault of the noise, of the frames, remedy (None: none known), filter
    "as told": (same, same, None, P),
    f"mean off by {OFF} deviations": (lambda z: z + OFF, same, levelled, P),
    f"noise {LOUDER_DB} dB stronger": (
        partial(noise.louder, decibels=LOUDER_DB),
        same,
        levelled,
        P,
    ),
    f"tails: Student, {FREEDOM} degrees": (tailed, same, normal_again, P),
    f"blur told {NARROW} for 0.6 cells": (same, same, None, told(blur=NARROW)),
    "intensity told twice": (same, same, None, told(amplitude=TWICE * P.scene.amplitude)),
    f"{GAP} of 10 frames missing, filled with the mean": (
        same,
        FILLED,
        partial(gaps, value=None),
        P,
    ),
}


def flight(seed, i, target):
    """Existence and distance from the target, (condition, stored or recorded, K)."""
    stream = partial(trials.generator, seed, "mm_pf_tbd", f"limits, {target}", i)
    white = page.simulate(P.scene, stream("noise"), 0.0)
    image = page.simulate(P.scene, stream("noise"), float(target)) - white
    states, found = page.path(P.scene)[0], []
    for of_noise, of_frames, remedy, p in CONDITIONS.values():
        z = of_noise(white) + image
        for frames in (of_frames(z), remedy(z) if remedy else None):
            if frames is None:
                found.append(np.full((2, len(z)), np.nan))
                continue
            r = page.recursion(frames, p, stream("filter"))
            found.append((r.existence, np.hypot(*(r.s[:, [0, 2]] - states[:, [0, 2]]).T)))
    existence, away = np.moveaxis(np.reshape(found, (len(CONDITIONS), 2, 2, -1)), 2, 0)
    return existence, away


def shares(blank, existence, away, white):
    """False declarations in 1000 frames, and the share held, of one case, each with its error;
    that of false declarations is at least the error of a share, never 0.
    """

    def at(some):
        level = np.quantile(some, 1 - RATE, method="higher")
        there = slice(P.scene.appear - 1, P.scene.t_f)
        held = ((existence > level) & (away < RADIUS))[:, there]
        return [1000.0 * (blank > level).mean(axis=1), held.mean(axis=1)]

    parts = np.array_split(np.arange(len(white)), PARTS)
    others = [[x.mean() for x in at(np.delete(white, part, axis=0))] for part in parts]
    level = (PARTS - 1) * np.var(others, axis=0)  # delete-a-group jackknife
    pairs = list(map(baseline.mean_se, at(white)))
    false = score.proportion(round(pairs[0][0] * blank.size / 1000), blank.size)
    pairs[0] = pairs[0][0], max(pairs[0][1], 1000 * false[1])
    together = zip(pairs, level, strict=True)
    return [it for (mean, se), of_level in together for it in (mean, np.hypot(se, of_level**0.5))]


def main():
    """Fly all conditions, and write the file."""
    blank, _ = trials.run(partial(flight, target=False), EMPTY, seed=SEED, workers=1)
    existence, away = trials.run(partial(flight, target=True), RUNS, seed=SEED, workers=1)
    found, white = [], blank[:, 0, 0]
    for c, name in enumerate(CONDITIONS):
        for k, case in enumerate(("stored", "recorded")):
            if not np.isnan(blank[:, c, k]).all():
                values = shares(blank[:, c, k], existence[:, c, k], away[:, c, k], white)
                found.append((name, case, *values, RUNS, EMPTY))
    columns = ["condition", "case", "false", "false_se", "found", "found_se", "runs", "empty"]
    head = "# python -m benchmarks.mm_pf_tbd_limits\n"
    table = products.csv(pd.DataFrame(found, columns=columns))
    products.write(paths.claims().parent, {"mm_pf_tbd_limits.csv": head.encode() + table})


if __name__ == "__main__":
    main()
