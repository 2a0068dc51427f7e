"""What chapter 02 says of its own figures, with five other seeds:
``python -m benchmarks.mm_pf_tbd_seeds``, minutes.

It writes ``data/mm_pf_tbd_seeds.csv``, a row for each comparison: by how much the first exceeds the
second in the mean of the paired runs of all seeds, the standard error, and the number of runs.
A sentence holds where that is more than 2.6 errors.  The thresholds are the printed ones.
"""

import types
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from benchmarks import rows
from tbdcore.baseline import mean_se
from tbdcore.repro import paths, products, trials

USES = ("Outcome", "compare", "classic", "fair", "improved", "mended", "seeded", "straight")
USES += ("declared_share", "correct", "scored", "balanced_accuracy", "present", "regime")
USES += ("losses", "with_jackknife")
SEEDS = range(21, 26)
N = 40  # runs of a seed
WEAK, EMPTY = 400, 170  # runs of a seed with a weak target and without one, as on the page
SHARES = 0.0, 1 / 64, 1 / 16, 1.0  # of the copies that draw a velocity
CV_ONLY = ((0.9, 0.1, 0.0), (0.1, 0.9, 0.0), (0.1, 0.9, 0.0))


def fly(page, filters, n=N, **options):
    """The runs of all seeds, n of each, an Outcome."""
    filters = [replace(p, scene=replace(p.scene, frames=p.scene.t_f)) for p in filters]
    job = partial(page.compare, filters=filters, **options)
    each = [trials.run(job, n, seed=seed, workers=1) for seed in SEEDS]
    return page.Outcome(*map(np.concatenate, zip(*each, strict=True)))


def printed(page):
    """The three filters at the printed intensity."""
    o = fly(page, [page.classic, page.fair, page.improved])
    (late, held), declared = page.scored(page.correct(o)), page.declared_share(o)
    for column, name in enumerate(("classic, 2000", "classic, 4000")):
        yield "correct", "improved", name, held[:, 2] - held[:, column]
    for what, gain in (("declared", declared), ("delay", -late)):
        small, equal = gain[:, 2] - gain[:, 0], gain[:, 2] - gain[:, 1]
        yield what, "half of the gain", "the gain at equal cost", small / 2 - equal


def half(page):
    """The same at half the intensity."""
    dim = replace(page.classic.scene, amplitude=page.classic.scene.amplitude / 2)
    o = fly(page, [replace(p, scene=dim) for p in (page.classic, page.fair, page.improved)])
    held, declared = page.scored(page.correct(o))[1], page.declared_share(o)
    for column, name in enumerate(("classic, 2000", "classic, 4000")):
        yield "correct, half", name, "improved", held[:, column] - held[:, 2]
    yield "declared, half", "classic, 2000", "improved", declared[:, 0] - declared[:, 2]


def noisy(page):
    """Frames with a declaration at the other reading of the process noise, 0.5."""
    trio = (page.classic, page.fair, page.improved)
    o = fly(page, [replace(p, prior=replace(p.prior, accel=0.5)) for p in trio])
    declared = page.declared_share(o)
    for column, name in enumerate(("classic, 2000", "classic, 4000")):
        yield "declared, noisy", "improved", name, declared[:, 2] - declared[:, column]


def causes(page):
    """Frames that the classic filter loses while copies draw new velocities."""
    lost = {"before": [], "after": []}
    for share in SHARES:
        o = fly(page, [page.classic], method=partial(page.mended, share=share))
        hits, silent = page.correct(o)[:, 0], ~o.declared[:, 0, page.present]
        found = np.maximum.accumulate(hits, axis=1)
        lost["before"].append((silent & ~found).mean(axis=1))
        lost["after"].append((silent & found).mean(axis=1))
    for when, shares in lost.items():
        yield f"lost {when}", "half of what is lost", "all draw", shares[0] / 2 - shares[-1]
    total = np.add(*lost.values())
    for n, names in enumerate((("none draws", "1/64"), ("1/64", "1/16"), ("1/16", "all draw"))):
        yield "lost", *names, total[n] - total[n + 1]


def turns(page):
    """The classic filter that starts at the target: its regimes, and its fall in the turns."""
    p, frames = page.classic, np.flatnonzero(page.regime == 2)
    right = page.balanced_accuracy(fly(page, [p], method=page.seeded).turning[:, 0])
    yield "balanced accuracy", "0.75", "classic, placed", 0.75 - right
    pair = [replace(p, scene=scene) for scene in (page.straight, p.scene)]
    o = fly(page, pair, method=page.seeded)
    share, rise = page.losses(o, 1, o, 0, frames).T
    yield "error in turns", "turning", "straight", rise
    yield "declared in turns", "straight", "turning", share
    beliefs = {"less process noise": replace(p.prior, accel=p.prior.accel / 5)}
    beliefs["no turning particles"] = replace(p.prior, Pi=CV_ONLY)
    beliefs["both changes"] = replace(p.prior, Pi=CV_ONLY, accel=p.prior.accel / 5)
    falls = {}
    for name, prior in beliefs.items():
        pair = [replace(p, prior=prior, scene=scene) for scene in (page.straight, p.scene)]
        share = page.declared_share(fly(page, pair, method=page.seeded), frames)
        falls[name] = share[:, 0] - share[:, 1]
    for name in list(beliefs)[:2]:
        yield "fall in turns", "both changes", name, falls["both changes"] - falls[name]


def weak(page):
    """Lines of the file for half the intensity: by how much the improved filter errs and misses
    more than the classic one of the same M.
    """
    scene = replace(page.classic.scene, amplitude=page.classic.scene.amplitude / 2)
    pair = [replace(p, scene=scene) for p in (page.classic, page.improved)]
    o = fly(page, pair, WEAK)
    blank = fly(page, pair, EMPTY, fade=lambda rng, i: 0.0, experiment="empty").existence
    names = "RMSE at equal shares", "RMSE at equal false rates", "misses at equal false rates"
    for name, margin, se in zip(names, *page.with_jackknife(o, blank), strict=True):
        yield f"weak target: {name}", "improved", "classic, 2000", -margin, se, len(o.error)


def main():
    """Make the study and write the file."""
    page, found = types.SimpleNamespace(**rows.definitions("mm_pf_tbd", USES)), []
    for part in (printed, half, noisy, causes, turns):
        for what, one, other, gap in part(page):
            found.append((what, one, other, *mean_se(gap), len(gap)))
            print(*found[-1], flush=True)
    found += weak(page)
    table = pd.DataFrame(found, columns=["what", "one", "other", "gap", "se", "n"])
    head = f"# python -m benchmarks.mm_pf_tbd_seeds; seeds {SEEDS[0]} to {SEEDS[-1]}\n"
    text = head.encode() + products.csv(table)
    products.write(paths.claims().parent, {"mm_pf_tbd_seeds.csv": text})


if __name__ == "__main__":
    main()
