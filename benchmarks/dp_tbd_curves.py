"""Curves of chapter 01 beyond its paper, with six seeds: ``python -m benchmarks.dp_tbd_curves``.

It writes ``data/dp_tbd_curves.csv``, a row for each study, seed, method, scene and x: a mean y and
its standard error, empty where one half is never reached.  The first seed is the notebook's own; a
sentence that compares two curves holds for the other five pooled (``lead``).

frames : SNR at P_d = 0.5 (dB) against the number of frames, two motions.
turns : P_D against lateral acceleration (cells per frame squared) at 7 and at 9 dB.
fading : decibels that the search saves at P_d = 0.5 against the brightest cell of all frames, by
    turn rate (rad/s), for a steady target and one that fades from frame to frame.
"""

import types
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from benchmarks import rows
from tbdcore import baseline
from tbdcore.kernels import dp_tbd
from tbdcore.repro import paths, products, trials

USES = ("p", "RIVALS", "flights", "scene", "add_target", "passage", "prepare", "track")
SEEDS = range(20, 26)
N = 10  # trials of a seed
LENGTHS = 3, 6, 11, 22, 40
SNR = np.arange(0, 14, 2)  # dB; of seven, three steps of halving find the two around one half
PULLS = 0.0, 0.1, 0.15, 0.2, 0.3, 0.4  # cells per frame squared
STEPS = (
    (lambda rng: (1.5 + 0.5 * rng.random(2), 0.2), "weak turn"),
    (lambda rng: (0.5 + 0.1 * rng.random(2), 0.0), "straight"),
)


def page():
    """What the study uses of the page."""
    return types.SimpleNamespace(**rows.definitions("dp_tbd", USES))


def methods(page, *names):
    return {name: page.RIVALS[name] for name in names}


def frames(page, seed):
    """SNR at one half against the number of frames."""
    sets = methods(page, "conventional", "Tonissen", "weighted", "price 1")
    for K in LENGTHS:
        for (name, kind), x in at_half(page, seed, K, sets).items():
            yield "frames", seed, name, kind, K, *x.pair, N


def at_half(page, seed, K, sets):
    """SNR at one half by method and motion, found in three steps of halving."""
    motions = tuple(draw for draw, _ in STEPS)
    at, seen = np.full((len(sets), len(motions), 1), len(SNR) // 2), []
    for step in (2, 1, 0):
        job = partial(
            page.flights,
            p=replace(page.p, K=K),
            name=f"frames {K}",
            motions=motions,
            snr=SNR[at],
            sets=tuple(sets.values()),
        )
        near = trials.run(job, N, seed=seed).away[..., -1] <= page.p.tolerance
        seen.append((SNR[at], near))
        at = at + np.where(near.mean(axis=0) < 0.5, step, -step)
    snr, hits = (np.concatenate(x, axis=-1) for x in zip(*seen, strict=True))
    order = snr.argsort(axis=-1, kind="stable")
    return {
        (name, kind): page.passage(snr[a, o][order[a, o]], hits[:, a, o][:, order[a, o]])
        for a, name in enumerate(sets)
        for o, (_, kind) in enumerate(STEPS)
    }


def bend(rng, pull, speed=2.4):
    """Velocity and turn rate of a course in any heading."""
    heading = 2 * np.pi * rng.random()
    return speed * np.array([np.cos(heading), np.sin(heading)]), pull / speed


def turns(page, seed):
    """P_D against lateral acceleration."""
    sets = methods(page, "Tonissen", "weighted", "price 0.5", "price 1")
    motions = [partial(bend, pull=pull) for pull in PULLS]
    job = partial(
        page.flights,
        p=page.p,
        name="turns",
        motions=motions,
        snr=(7.0, 9.0),
        sets=tuple(sets.values()),
    )
    kept = (trials.run(job, N, seed=seed).away <= page.p.tolerance).all(axis=-1)
    y, se = baseline.mean_se(kept * 1.0)
    for (a, name), (o, pull), (s, snr) in every(sets, PULLS, ("7 dB", "9 dB")):
        yield "turns", seed, name, snr, pull, y[a, o, s], se[a, o, s], N


def every(*lists):
    """All combinations of the numbered members of some lists."""
    for index in np.ndindex(*map(len, lists)):
        yield [(i, list(each)[i]) for i, each in zip(index, lists, strict=True)]


def fades(seed, i, page, sets):
    """Whether each method is right, (steady or fading, turn rate, SNR, method)."""
    p, k = page.p, np.arange(page.p.K)
    targets, w = page.scene(seed, i, p)
    power = trials.generator(seed, "dp_tbd", "fading", i, "truth").standard_exponential(p.K)
    framed, transitions = page.prepare(w, p), [make(p, w.dtype) for make in sets]
    (where, value), right = baseline.brightest(w), []
    for fade in (np.ones(p.K), np.sqrt(power)):
        for cells in targets:
            for A in dp_tbd.point_amplitude(p.snr_db, p.sigma2**0.5):
                z = page.add_target(framed, w, cells, A * fade, p)
                last = [page.track(z, t, p).cells[-1] for t in transitions]
                right += [abs(cell - cells[-1]).max() <= p.tolerance for cell in last]
                own = (w[k, *cells.T] + A * fade).astype(w.dtype)
                away = np.where(own > value, 0, abs(where - cells).max(axis=1))
                right.append(away[np.maximum(own, value).argmax()] <= p.tolerance)
    return np.reshape(right, (2, len(targets), len(p.snr_db), len(sets) + 1))


def fading(page, seed):
    """What eleven frames save, for a steady and a fading target."""
    sets = methods(page, "Tonissen", "weighted", "price 1")
    job = partial(fades, page=page, sets=tuple(sets.values()))
    hits = trials.run(job, N, seed=seed)
    for (a, name), (f, kind), (o, omega) in every(sets, ("steady", "fading"), page.p.turn_rates):
        single, own = (page.passage(page.p.snr_db, hits[:, f, o, :, b]) for b in (-1, a))
        yield "fading", seed, name, kind, omega, *(single - own).pair, N


def lead(table, study, scene, x, method, other):
    """By how much one method's y exceeds another's over the seeds but the first, and its error."""
    rows_ = table[(table["study"] == study) & (table["scene"] == scene) & (table["x"] == x)]
    rows_ = rows_[rows_["seed"] != SEEDS[0]]
    one, two = (rows_[rows_["method"] == name].set_index("seed") for name in (method, other))
    error = np.hypot(one["se"], two["se"])
    return float((one["y"] - two["y"]).mean(skipna=False)), float(np.sqrt((error**2).sum())) / len(
        one
    )


def main():
    """Make the study and write the file."""
    used, found = page(), []
    for study in (frames, turns, fading):
        for seed in SEEDS:
            found += study(used, seed)
            print(study.__name__, seed, flush=True)
    columns = ["study", "seed", "method", "scene", "x", "y", "se", "n"]
    table = pd.DataFrame(found, columns=columns)
    head = "# python -m benchmarks.dp_tbd_curves\n"
    file = {"dp_tbd_curves.csv": head.encode() + products.csv(table)}
    products.write(paths.claims().parent, file)


if __name__ == "__main__":
    main()
