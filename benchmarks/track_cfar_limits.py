"""Chapter 04 where a promise breaks: ``python -m benchmarks.track_cfar_limits``, minutes.

It writes ``data/track_cfar_limits.csv``: the share of the proposed detector's tracks that are alive
on arrival at 370 km, and the share of these that exist M frames after the target has vanished
there, on the paper's course.  Every cell around the target is drawn in every frame, and the page's
rule follows the track, compiled.  A case is a law of the noise and a remedy.  20 recordings of
20,000 cells without a target serve 200 flights each; errors are the scatter of these groups.

``python -m benchmarks.track_cfar_limits seeds`` does so with five other seeds and a quarter of the
flights, and writes ``data/track_cfar_limits_seeds.csv``; there also the proposed rule on flights of
the page under louder noise, at the six ranges of vanishing.
"""

import functools
import math
import sys
from functools import partial

import numpy as np
import pandas as pd

import tbdcore
from benchmarks import timing
from benchmarks import track_cfar_tuned as tuned
from benchmarks.seeds import FIVE
from tbdcore import noise, recording, score
from tbdcore.kernels.track_cfar import gate_polar, predict_cv, update_polar
from tbdcore.repro import paths, products, trials

page = tbdcore.page("track_cfar")
two_plots, far = page.two_plots, page.far
GROUPS, FLIGHTS, SEED = 20, 200, 104
FEWER, BY_RANGE = 50, 6000  # with each other seed: flights of a recording, and of the page
VANISH = 54  # frame in which the target vanishes, at 370 km
ROWS, COLUMNS, SIDE, AROUND = 12, 6, 8, 32  # cells beside the target's, of a mean
NU, CORRELATION, LOUDER = 3.0, 0.7, 10**0.1
FADING = 0.9  # correlation of the echo's amplitude from scan to scan
CASES = [  # name, law, remedy
    ("as told", "white", "none"),
    ("noise 1 dB stronger", "louder", "none"),
    ("noise 1 dB stronger", "louder", "mean"),
    ("K", "K", "none"),
    ("K", "K", "law"),
    ("K", "K", "moments"),
    ("correlated", "correlated", "none"),
    ("correlated", "correlated", "mean"),
    ("correlated", "correlated", "effective mean"),
    ("fading", "fading", "none"),
]


def power_of(law, shape, rng):
    """Noise power (K, n_r, n_a), mean 1 (louder: 1 dB above); frames are independent."""
    if law == "K":
        return noise.k_power(shape, NU, rng)
    if law == "correlated":
        return noise.as_power(noise.correlated(shape, [0.0, CORRELATION, CORRELATION], rng))
    return rng.standard_exponential(shape) * (LOUDER if law == "louder" else 1.0)


def echoes(law, n, rng):
    """Complex echoes of power 1 in n scans; those of a fading target are correlated."""
    a = math.sqrt(0.5) * rng.standard_normal((n, 2)) @ [1, 1j]
    rho = FADING if law == "fading" else 0.0
    for k in range(1, n):
        a[k] = rho * a[k - 1] + math.sqrt(1 - rho**2) * a[k]
    return a


def around(cells):
    """Means (K,) of the 32 cells before and behind the gate, in the two middle columns."""
    middle = cells[:, :, COLUMNS : COLUMNS + 2]
    return np.concatenate([middle[:, :SIDE], middle[:, -SIDE:]], axis=1).mean(axis=(1, 2))


@timing.loop
def follow(plots, where, strengths, law, d):
    """Frames that one track lives among the plots of each frame, and its misses at the end: the
    proposed rule of the page.

    plots : (K + 2, 2) of the target, the first two start the track; where : (K, n, 2) places of all
    plots, m and rad; strengths : (K, n); law : (2, m) of -ln P_f, and the thresholds there
    """
    x, P = two_plots(plots, d)
    misses = 0
    for k in range(len(where)):
        predict_cv(x, P, d.T, d.q)
        r4 = ((x[0] * x[0] + x[2] * x[2]) / (d.r0 * d.r0)) ** 2
        var_r, var_a = r4 * d.var[0], r4 * d.var[1]
        r, a, D11, D12, D22 = gate_polar(x, P, var_r, var_a)
        half_r, half_a = d.g * math.sqrt(D11), d.g * math.sqrt(D22)
        P_f = min(d.P_Z * d.cell[0] * d.cell[1] / (4 * half_r * half_a), 1.0)
        eta = np.interp(np.array([-math.log(P_f)]), law[0], law[1])[0]
        least, nearest = np.inf, -1
        for i in range(where.shape[1]):
            y_r, y_a = where[k, i, 0] - r, where[k, i, 1] - a
            if abs(y_r) <= half_r and abs(y_a) <= half_a and strengths[k, i] > eta:
                square = far((y_r, y_a, 0.0), (D11, D12, D22))
                if square < least:
                    least, nearest = square, i
        misses = 0 if nearest >= 0 else misses + 1
        if misses == d.M:
            return k + 1, misses
        if nearest >= 0:
            y_r, y_a = where[k, nearest, 0] - r, where[k, nearest, 1] - a
            update_polar(x, P, y_r, y_a, var_r, var_a)
    return len(where), misses


def threshold_of(remedy, blank):
    """What a remedy does to the strengths (K, n), and its thresholds: an array (2, m) of -ln P_f
    and thresholds; `blank` are the cells of a recording without a target.
    """
    exponent = np.linspace(0.0, 30.0, 6001)
    if remedy == "law":
        law = recording.empirical_law(blank[None])
        scores = partial(recording.normal_scores, law=law)
        return lambda x: noise.as_power(scores(x[None]))[0], np.array([exponent, exponent])
    if remedy == "moments":
        level = blank.mean()
        excess = (blank**2).mean() / (2 * level**2) - 1
        nu = min(1 / max(excess, 0.01), 100.0)
        eta = np.linspace(0.0, 200.0, 20001)
        return lambda x: x / level, np.array([-np.log(noise.k_survival(eta, nu)), eta])
    if "mean" in remedy:
        W = AROUND if remedy == "mean" else effective()
        return lambda x: x, np.array([exponent, W * np.expm1(exponent / W)])
    return lambda x: x, np.array([exponent, exponent])


def drawn(seed, i, law, remedy):
    """Plots of a flight: the target's (K + 2, 2), places (K, n, 2) and strengths (K, n) of all,
    every cell drawn; the first of a frame is the target's, of strength 0 once it has vanished.
    """
    rng = trials.generator(seed, "track_cfar", f"limits, {law}", i, "noise")
    true = page.truth(P)[: VANISH + 2 + P.miss_limit]
    K = len(true) - 2
    plots = true + np.sqrt(page.variances(true[:, 0], P)) * rng.standard_normal(true.shape)
    echo = np.sqrt(page.snr(true[2:, 0], P)) * echoes(law, K, rng)
    own = np.sqrt(power_of(law, (K, 1, 1), rng)[:, 0, 0])  # its phase is the zero of the echo's
    cells = power_of(law, (K, 2 * ROWS + 1, 2 * COLUMNS + 1), rng)
    i = np.mgrid[-ROWS : ROWS + 1, -COLUMNS : COLUMNS + 1].reshape(2, -1).T
    corner = np.floor(true[2:] / P.cell)[:, None] + i
    where = (corner + rng.random(corner.shape)) * P.cell
    strengths = np.column_stack([np.abs(echo + own) ** 2, cells.reshape(K, -1)])
    if "mean" in remedy:
        strengths /= around(cells)[:, None]
    strengths[VANISH:, 0] = 0.0
    return plots, np.concatenate([plots[2:, None], where], axis=1), strengths


def flight(seed, i, law, remedy, remedies, each):
    """Whether the track is alive on arrival at 370 km, and whether it exists M frames later; `each`
    of the remedies, one for a recording, serves as many flights.
    """
    change, thresholds = remedies[i // each]
    plots, where, strengths = drawn(seed, i, law, remedy)
    lived, misses = follow(plots, where, change(strengths), thresholds, page.design(P))
    return float(lived > VANISH), float(lived > VANISH and misses < P.miss_limit)


def shares(alive, left):
    """Share alive and share of these that exist later, with the errors over the groups."""
    alive, left = (x.reshape(GROUPS, -1).mean(axis=1) for x in (alive, left))
    ratio = left.mean() / alive.mean()
    off = (left - ratio * alive) / alive.mean()
    errors = [x.std(ddof=1) / math.sqrt(GROUPS) for x in (alive, off)]
    return alive.mean(), errors[0], ratio, errors[1]


@functools.cache
def effective():
    """Of how many independent cells the mean of 32 correlated ones scatters alike."""
    rng = trials.generator(SEED, "track_cfar", "effective number", 0, "filter")
    shape = (2 * ROWS + 1, 2 * COLUMNS + 1)
    means = around(power_of("correlated", (20000, *shape), rng))
    return float(means.mean() ** 2 / means.var())


P = page.Scenario()


def cases(seed, each):
    """Rows (condition, remedy, alive, its error, P_F, its error) of all cases with one seed."""
    for name, law, remedy in CASES:
        remedies = []
        for j in range(GROUPS):
            rng = trials.generator(seed, "track_cfar", f"limits, {law}", j, "filter")
            remedies.append(threshold_of(remedy, power_of(law, (1, 200, 100), rng)[0]))
        fly = partial(flight, law=law, remedy=remedy, remedies=remedies, each=each)
        values = shares(*trials.run(fly, GROUPS * each, seed=seed, workers=1, label=name))
        print(name, remedy, *np.round(values, 4), flush=True)
        yield (name, remedy, *values)


def louder(seed):
    """The same rows of the proposed rule under louder noise, one for each range of vanishing."""
    true, gone = page.truth(P), tuned.GONE
    rngs = (trials.generator(seed, "track_cfar", "louder", i, "noise") for i in range(BY_RANGE))
    scenes = [page.simulate(true, P, rng, LOUDER) for rng in rngs]
    drawn = [np.array(part) for part in zip(*scenes, strict=True)]
    alive, left = tuned.counts(*drawn, true, page.design(P, noise=LOUDER), gone, P.miss_limit)
    values = zip(*score.proportion(alive, BY_RANGE), *score.proportion(left, alive), strict=True)
    for r, row in zip(true[2:, 0][gone], values, strict=True):
        yield (f"noise 1 dB stronger, {r / 1e3:g} km", "none", *row)


def main():
    """Fly all cases, and write the file."""
    columns = ["condition", "remedy", "alive", "alive_se", "P_F", "P_F_se"]
    if sys.argv[1:] == ["seeds"]:
        found = [(seed, *row) for seed in FIVE for row in (*cases(seed, FEWER), *louder(seed))]
        table, file = pd.DataFrame(found, columns=["seed", *columns]), "limits_seeds"
        words = f" seeds; seeds {FIVE[0]} to {FIVE[-1]}, {GROUPS * FEWER}"
    else:
        table = pd.DataFrame([*cases(SEED, FLIGHTS)], columns=columns)
        table, words, file = table.assign(effective=effective()), ": 4000", "limits"
    head = f"# python -m benchmarks.track_cfar_limits{words} flights in each case\n"
    content = {f"track_cfar_{file}.csv": head.encode() + products.csv(table)}
    products.write(paths.claims().parent, content)


if __name__ == "__main__":
    main()
