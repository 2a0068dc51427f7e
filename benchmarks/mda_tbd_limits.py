"""Chapter 03's averaged filter where a promise breaks: ``python -m benchmarks.mda_tbd_limits``.

It takes minutes and writes ``data/mda_tbd_limits.csv``: the share of frames without a target that
are declared, and the share of the last fifty frames with a target of 6 dB in which it is declared
within the cut-off distance of the OSPA, for the averaged filter with births by power at a threshold
of one half, on a hundred frames of the paper's scene.  `stored`: with the condition; `recorded`:
after ``tbdcore.recording`` has prepared the frames, where it can.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

import tbdcore
from tbdcore import baseline, noise, recording, score
from tbdcore.kernels import mda_tbd
from tbdcore.repro import paths, products, trials

page = tbdcore.page("mda_tbd")
SEED, RUNS, FRAMES, LAST, CUT = 20, 8, 100, 50, 200.0
LEVEL_DB, WIDER, NU, CORRELATION, GAPS, SIZE = 1.5, 2.0, 3.0, 0.5, 0.5, 25
SCENE = page.Scene(scans=FRAMES, leaves=FRAMES + 1, noise=1.0)
TOLD = page.Filter(source="averaged", births="power", noise=1.0)
CONDITIONS = {  # remedy
    "as told": "none",
    f"noise {LEVEL_DB:g} dB stronger than told": "level",
    f"noise {LEVEL_DB:g} dB weaker than told": "level",
    f"echo told {WIDER:g} times too wide": "none",
    f"K-distributed noise, nu = {NU:g}": "scores",
    f"noise correlated by {CORRELATION:g} with its neighbours": "level",
    f"{GAPS:.0%} of the frames missing": "none",
}


def power(condition, shape, rng):
    """Noise power under a condition, in units of the power that is told."""
    if "K-distributed" in condition:
        return noise.k_power(shape, NU, rng)
    if "correlated" in condition:
        return noise.as_power(noise.correlated(shape, [0.0, CORRELATION, CORRELATION], rng))
    sign = ("stronger" in condition) - ("weaker" in condition)
    return noise.exponential(shape, rng) * 10 ** (sign * LEVEL_DB / 10)


def prepared(z, remedy, blank):
    """Frames after ``recording``; `blank` (1, nr, na): a frame without a target."""
    if remedy == "level":
        return recording.normalise(z, recording.clipped(z, "exponential", SIZE), "exponential")
    return noise.as_power(recording.normal_scores(z, recording.empirical_law(blank)))


def flight(condition, seed, i):
    """Shares of frames declared without a target and found with one, as stored and as recorded;
    (2, 2), NaN where no remedy is known.
    """
    remedy, found = CONDITIONS[condition], np.full((2, 2), math.nan)
    p = replace(TOLD, sharp=WIDER**-2, half_r=4, half_a=12) if "wide" in condition else TOLD
    path, shape = page.target(SCENE)[:, ::2], (FRAMES, *SCENE.grid[4:])
    place = mda_tbd.polar_cells(*path.T, SCENE.grid)
    for there in (0, 1):
        stream = partial(trials.generator, seed, "mda_tbd", f"limits, {condition}, {there}", i)
        rng, truth = stream("noise"), stream("truth")
        z = power(condition, shape, rng).astype(float)
        if there:
            echo = SCENE.P_tar * truth.standard_exponential(FRAMES)
            mda_tbd.add_target(z, *place, echo, SCENE.psf, rng)
        if "missing" in condition:
            z[truth.random(FRAMES) < GAPS] = math.nan
        frames = [z]
        if remedy != "none":
            frames.append(prepared(z, remedy, power(condition, (1, *shape[1:]), truth)))
        for case, scans in enumerate(frames):
            track = page.recursion(scans, p, stream("filter"))
            on = track.existence > 0.5
            near = np.hypot(*(track.x[:, ::2] - path).T) < CUT
            found[there, case] = (on & near)[-LAST:].mean() if there else on.mean()
    return found


def main():
    """Fly all conditions, and write the file."""
    lines = []
    for condition in CONDITIONS:
        each = trials.run(partial(flight, condition), RUNS, seed=SEED, workers=1, label=condition)
        for case, name in enumerate(("stored", "recorded")):
            if np.isfinite(each[0, 0, case]):
                (false, false_se), found = (baseline.mean_se(each[:, k, case]) for k in (0, 1))
                least = score.proportion(round(false * RUNS * FRAMES), RUNS * FRAMES)[1]
                values = false, max(false_se, least), *found
                lines.append((condition, name, RUNS, *(float(f"{v:.3g}") for v in values)))
        print(*lines[-1], flush=True)
    names = ["condition", "case", "n", "false", "false_se", "found", "found_se"]
    head = f"# python -m benchmarks.mda_tbd_limits: runs of {FRAMES} frames\n"
    content = head.encode() + products.csv(pd.DataFrame(lines, columns=names))
    products.write(paths.claims().parent, {"mda_tbd_limits.csv": content})


if __name__ == "__main__":
    main()
