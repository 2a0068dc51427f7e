"""Rules of chapter 04 on the paper's course: ``python -m benchmarks.track_cfar_methods``, minutes.

Five methods fly on common scenes, none of which took part in the tuning of their thresholds.

``data/track_cfar_methods.csv`` has for each method the range to which half of the tracks live, the
SNR at which half of the targets are tracked and detected, the largest P_F of six ranges of
vanishing, and the life of a track; errors of tuned rules contain that of their tuning.  The page's
seed has more flights than the five others.  ``data/track_cfar_delivered.csv`` has, with the page's
seed, the tracks that are alive when the target vanishes at each range, and those of them that exist
M frames later; for three of the methods also under noise that is stronger than told.
"""

import math
from functools import partial

import numpy as np
import pandas as pd

from benchmarks import track_cfar_elsewhere as elsewhere
from benchmarks.readings_track_cfar import crossing
from benchmarks.seeds import FIVE
from benchmarks.track_cfar_tuned import GONE, page
from tbdcore import detection, score
from tbdcore.repro import paths, products, studies, trials

SEED, FLIGHTS, FEWER = 20, 100_000, 5_000  # the page's seed, its flights, those of each other seed
STRONGER, UNDER_NOISE = (0.5, 1.0), 30_000  # noise in dB above what is told, and its flights
P = page.Scenario()
TRUE = page.truth(P)
FRAMES, KM = np.arange(P.frames), TRUE[2:, 0] / 1e3
DESIGNS = elsewhere.designs(P)
CONSTANT = "best constant in the gate"
RULES = ["proposed", CONSTANT, "threshold tuned by range"]  # those that fly under stronger noise


def flight(seed, i, experiment, names, noise=1.0):
    """Deaths, hits, and deaths of those that lose their target, by some methods on one scene."""
    scene = page.simulate(
        TRUE, P, trials.generator(seed, "track_cfar", experiment, i, "noise"), noise
    )
    designs = (DESIGNS[name]._replace(noise=noise) for name in names)
    each = [page.lives(scene, TRUE, d, GONE) for d in designs]
    return tuple(np.array(part) for part in zip(*each, strict=True))


def fly(n, seed, experiment, names, noise=1.0):
    """The same of n scenes, each with a leading axis of n."""
    one = partial(flight, experiment=experiment, names=names, noise=noise)
    return trials.run(one, n, seed=seed, workers=1, label=experiment)


def counts(ends):
    """Tracks (methods, ranges) that lose their target, and those that exist M frames later."""
    return (ends >= GONE).sum(axis=0), (ends >= GONE + P.miss_limit).sum(axis=0)


def half(x, happened):
    """Where a share of flights (n, K) falls through one half, and the error of that."""
    at, shift = crossing(x, happened, np.ones_like(happened))
    return at, np.std(shift) / math.sqrt(len(shift))


def tuning():
    """Errors (methods, ranges) of the P_F that the tuning met; 0 for a rule that is not tuned."""
    table = studies.read("track_cfar_tuned").pivot(index="method", columns="km", values="P_F_se")
    return table.reindex([*DESIGNS]).fillna(0.0).to_numpy()


def with_tuning(at, se, errors):
    """Errors of crossings, by method, with those of P_F in the tuning: the slope is that between
    the search threshold and the constant.
    """
    at = dict(zip(DESIGNS, at, strict=True))
    lower = math.log(DESIGNS[CONSTANT].p_cell / P.cell_pfa)
    slope = (at[CONSTANT] - at["traditional"]) / lower
    return np.hypot(se, slope * errors / P.track_pfa)


def measures(died, hit, ends):
    """The measures of the methods and their errors, by name, from n flights."""
    n, errors = len(died), tuning()
    S_dB, every = detection.to_db(page.snr(TRUE[2:, 0], P)), range(died.shape[1])
    living = [half(KM, died[:, [j]] >= FRAMES) for j in every]
    seen = [half(S_dB, hit[:, j]) for j in every]
    alive, left = counts(ends)
    P_F, se = score.proportion(left, alive)
    top = np.nanargmax(P_F, axis=1)
    found = {}
    for name, crossings in (("range (km)", living), ("SNR (dB)", seen)):
        at, of = np.transpose(crossings)
        found[name] = at, with_tuning(at, of, errors[:, list(GONE).index(54)])
    found["largest P_F"] = P_F[every, top], np.hypot(se, errors)[every, top]
    found["life (frames)"] = died.mean(axis=0), died.std(axis=0, ddof=1) / math.sqrt(n)
    return found


def table(seed, flown):
    """The lines of the methods with one seed."""
    lines = {"seed": seed, "method": [*DESIGNS], "flights": len(flown[0])}
    for name, (value, se) in measures(*flown).items():
        lines |= {name: value, f"{name}_se": se}
    return pd.DataFrame(lines)


def delivered(dB, names, ends):
    """The counts of some methods, a line for each range of vanishing."""
    alive, left = counts(ends)
    for j, name in enumerate(names):
        for km, *pair in zip(KM[GONE], alive[j], left[j], strict=True):
            yield name, dB, km, len(ends), *pair


def main():
    """Fly all, and write both files."""
    flown = fly(FLIGHTS, SEED, "methods", [*DESIGNS])
    parts, lines = [table(SEED, flown)], [*delivered(0.0, [*DESIGNS], flown[2])]
    for dB in STRONGER:
        ends = fly(UNDER_NOISE, SEED, "noise", RULES, 10 ** (dB / 10))[2]
        lines += delivered(dB, RULES, ends)
    parts += [table(seed, fly(FEWER, seed, "methods", [*DESIGNS])) for seed in FIVE]
    columns = ["method", "noise_dB", "km", "flights", "alive", "exist"]
    made = {
        "methods": pd.concat(parts, ignore_index=True),
        "delivered": pd.DataFrame(lines, columns=columns),
    }
    head = b"# python -m benchmarks.track_cfar_methods\n"
    files = {f"track_cfar_{name}.csv": head + products.csv(it) for name, it in made.items()}
    products.write(paths.claims().parent, files)


if __name__ == "__main__":
    main()
