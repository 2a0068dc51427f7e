"""Chapter 02's filters beside their plain rivals, with six seeds:
``python -m benchmarks.mm_pf_tbd_methods``, half an hour.

It writes ``data/mm_pf_tbd_methods.csv``, a row for each study, method, intensity, speed and group
of seeds: the share of the frames with a target that are declared within two cells of it (held),
and the delay of the first such declaration, each with its standard error.  The first group is the
notebook's own seed, the other one five other seeds; a sentence that compares two methods holds for
these (``lead``).

methods : the paper's scene, at the printed and at half the intensity.
speed : a larger frame, in which faster targets stay; particles and births grow with its area.

In each group of seeds every method has its own threshold, which ten of 1000 frames without a
target exceed, 102 of 10200; its error, from parts of these frames that are left out in turn, is
part of each error.
"""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from scipy import sparse

import tbdcore
from tbdcore import baseline
from tbdcore.repro import paths, products, trials

page = tbdcore.page("mm_pf_tbd")
SEEDS = {"20": [20], "21 to 25": [21, 22, 23, 24, 25]}
RUNS, EMPTY, PARTS = 100, 170, 10  # runs of a group, those without a target, parts of these
RATE, RADIUS = 0.01, 2.0  # false declarations in a frame; cells
INTENSITIES = {"printed": 1.0, "half": 0.5}
SPEEDS = 0.4, 0.9, 1.4  # cells per frame
LARGE = {"nx": 44, "ny": 40}  # the path at the highest speed stays in it
ONE, TWO = (np.full((n, n), 1 / n**2) for n in (3, 5))  # walks of one and two cells per axis
HEADINGS = 24


def particles(z, p, rng, **change):
    """Existence probability and place of the page's filter."""
    found = page.recursion(z, replace(p, **change), rng)
    return found.existence, found.s[:, [0, 2]]


def bernoulli(z, p, rng):
    """The same of the Bernoulli filter of Appendix F, with half of the particles."""
    found = page.bernoulli_recursion(z, replace(p, M=p.M // 2, M_new=p.M // 8), rng)
    return found.existence, found.s[:, [0, 2]]


def most_likely(cells, score):
    """A score, and the cell with the largest value, counted from 1."""
    return score, baseline.brightest(cells)[0] + 1.0


def grid_filter(z, p, rng, walk=ONE):
    """The grid filter, told the printed chain: a target stays with 0.9 and appears with 0.1."""
    stay, birth = 1 - p.prior.Pi[1][0], 1 - p.prior.Pi[0][0]
    W = baseline.grid_filter(page.cell_ratios(z, p), walk, stay, birth)
    return most_likely(W, W.sum(axis=(1, 2)))


def recursive_maximum(z, p, rng):
    """The recursive maximum with the printed probability of staying as its memory."""
    V = baseline.recursive_maximum(page.cell_ratios(z, p), 1, 1 - p.prior.Pi[1][0])
    return most_likely(V, V.max(axis=(1, 2)))


def one_frame(z, p, rng):
    """The matched filter on each frame."""
    match = baseline.matched_filter(z / p.scene.noise, p.scene.blur)
    return most_likely(match, match.max(axis=(1, 2)))


def one_axis(n, step):
    """Matrix (n, n) of a step along an axis: two cells share the mass, off the frame it is lost."""
    low = int(np.floor(step))
    return (low + 1 - step) * sparse.eye(n, k=-low) + (step - low) * sparse.eye(n, k=-low - 1)


def moves(s):
    """Motion at the scene's speed on half cells, one block for each heading."""
    angles = 2 * np.pi * np.arange(HEADINGS) / HEADINGS
    steps = 2 * s.speed * s.T * np.column_stack([np.cos(angles), np.sin(angles)])
    axes = [map(one_axis, (2 * s.nx, 2 * s.ny), step) for step in steps]
    return sparse.block_diag([sparse.kron(*pair) for pair in axes]).tocsr()


def known_speed(z, p, rng):
    """Bayes' rule on half cells and headings, told the speed and how long the target stays.

    In each frame the heading turns by one step to either side with probability 0.1 each.
    """
    s = p.scene
    shape = 2 * s.nx, 2 * s.ny
    W, dead, found, move = np.zeros((HEADINGS, 4 * s.nx * s.ny)), 1.0, [], moves(s)
    S, r = np.zeros((W.shape[1], 5)), np.ones(W.shape[1], int)
    S[:, [0, 2]] = 0.75 + np.indices(shape).reshape(2, -1).T / 2
    ends, appears = 1 / (s.t_f - s.appear + 1), 1 - p.prior.Pi[0][0]
    for frame in z:
        W = 0.8 * W + 0.1 * (np.roll(W, 1, axis=0) + np.roll(W, -1, axis=0))
        W = (1 - ends) * (move @ W.ravel()).reshape(W.shape) + dead * appears / W.size
        dead = 1 - W.sum()
        W *= np.exp(page.log_weights(frame, r, S, p))
        W, dead = W / (dead + W.sum()), dead / (dead + W.sum())
        found.append((1 - dead, *S[W.sum(axis=0).argmax(), [0, 2]]))
    found = np.array(found)
    return found[:, 0], found[:, 1:]


METHODS = {  # the table of methods; each tells its existence or score, and the place
    "classic, 2000": partial(particles, M_new=0),
    "improved, 2000 + 2000": particles,
    "Bernoulli, 1000 + 250": bernoulli,
    "grid filter, one cell": grid_filter,
    "grid filter, two cells": partial(grid_filter, walk=TWO),
    "recursive maximum": recursive_maximum,
    "one frame": one_frame,
    "exact Bayes, speed known": known_speed,
}
VARIANTS = {
    "classic, 4000": lambda z, p, rng: particles(z, replace(p, M=2 * p.M), rng, M_new=0),
    "improved, new ones weigh 1/4": partial(particles, weight=0.25),
    "improved, N = 1": partial(particles, N=1),
}
FAST = ("improved, 2000 + 2000", "Bernoulli, 1000 + 250")
FAST += ("grid filter, one cell", "recursive maximum")


def flight(seed, i, methods, p, target):
    """Score (method, K) and distance (method, K) from the target, NaN where there is none."""
    stream = partial(trials.generator, seed, "mm_pf_tbd", f"methods {p.scene.nx}, {target}", i)
    s = p.scene
    z, states = page.simulate(s, stream("noise"), float(target)), page.path(s)[0]
    each = [method(z, p, stream("filter")) for method in methods.values()]
    scores, places = map(np.array, zip(*each, strict=True))
    return scores, np.hypot(places[..., 0] - states[:, 0], places[..., 1] - states[:, 2])


def fly(seeds, methods, p, target, n):
    """Flights (n, method, K) with or without a target, equally many of each seed."""
    job = partial(flight, methods=methods, p=p, target=target)
    each = [trials.run(job, n // len(seeds), seed=seed, workers=1) for seed in seeds]
    return [np.concatenate(parts) for parts in zip(*each, strict=True)]


def measures(score, away, empty):
    """Held and delay of one method, each with its error, from scores (n, K), distances, and scores
    of frames without a target (m, K).
    """
    s = page.Scene()
    there = slice(s.appear - 1, s.t_f)

    def at(blank):
        level = np.quantile(blank, 1 - RATE, method="higher")
        hits = ((score > level) & (away < RADIUS))[:, there]
        return np.array([hits.mean(axis=1), baseline.delay(hits)])

    each = at(empty)
    parts = np.array_split(np.arange(len(empty)), PARTS)
    others = np.array([at(np.delete(empty, part, axis=0)).mean(axis=1) for part in parts])
    level = (PARTS - 1) * others.var(axis=0)  # delete-a-group jackknife
    errors = np.sqrt(each.var(axis=1, ddof=1) / each.shape[1] + level)
    return [it for pair in zip(each.mean(axis=1), errors, strict=True) for it in pair]


def rows(study, group, methods, scene, speeds, M):
    """The rows of one group of seeds."""
    for name, factor in INTENSITIES.items():
        s = replace(scene, amplitude=factor * scene.amplitude)
        p = page.Scenario(M=M, M_new=M, scene=s)
        empty = fly(SEEDS[group], methods, p, False, EMPTY)[0]
        for speed in speeds:
            q = replace(p, scene=replace(s, speed=speed))
            score, away = fly(SEEDS[group], methods, q, True, RUNS)
            for m, method in enumerate(methods):
                found = measures(score[:, m], away[:, m], empty[:, m])
                yield study, group, method, name, speed, *found, RUNS


def lead(table, column, method, other, **where):
    """By how much a method's measure exceeds another's with the five other seeds, and its error;
    `where` has the study, the intensity, the speed.
    """
    chosen = table[table["seeds"] == list(SEEDS)[1]]
    for name, value in where.items():
        chosen = chosen[chosen[name] == value]
    one, two = (chosen[chosen["method"] == name] for name in (method, other))
    if (len(one), len(two)) != (1, 1):
        raise ValueError(f"lead: no single rows of {method!r} and {other!r}; give all of `where`")
    gap = one[column].item() - two[column].item()
    return gap, math.hypot(one[f"{column}_se"].item(), two[f"{column}_se"].item())


def main():
    """Make the study and write the file."""
    found, scene = [], page.Scene()
    large = replace(scene, **LARGE)
    more = round(2000 * large.nx * large.ny / 750)
    fast = {name: METHODS[name] for name in FAST}
    for group in SEEDS:
        found += rows("methods", group, METHODS | VARIANTS, scene, [scene.speed], 2000)
        print("methods", group, flush=True)
        found += rows("speed", group, fast, large, SPEEDS, more)
        print("speed", group, flush=True)
    columns = ["study", "seeds", "method", "intensity", "speed"]
    columns += ["held", "held_se", "delay", "delay_se", "n"]
    head = "# python -m benchmarks.mm_pf_tbd_methods\n"
    table = products.csv(pd.DataFrame(found, columns=columns))
    products.write(paths.claims().parent, {"mm_pf_tbd_methods.csv": head.encode() + table})


if __name__ == "__main__":
    main()
