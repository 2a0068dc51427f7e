"""The filters of chapter 03 beside their plain rivals: ``python -m benchmarks.mda_tbd_methods``.

It takes a quarter of an hour and writes ``data/mda_tbd_methods.csv``, a row for each data model,
power, method and group of seeds: mean OSPA, first declared frame, and root mean square error of the
intensity over all frames after the 150th, each with its standard error.  The scenes are the
paper's, of six seeds in turn, the notebook's own first; a sentence that compares two methods holds
for the five other seeds (``lead``).

A method declares above the level that 1 % of its frames without a target exceed.  The errors
contain that of this level: trials of both kinds are drawn again.  ``told 3 dB too little`` and the
independent cells are a control: with them the echo is as the likelihood assumes it.

Trials are kept in ``build/mda_tbd_methods`` until the file is written: a study that was ended goes
on with the next command.
"""

import functools
import io
import math
import shutil
from copy import deepcopy
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from scipy import fft

import tbdcore
from tbdcore import baseline
from tbdcore.kernels import mda_tbd
from tbdcore.repro import paths, products, trials

page = tbdcore.page("mda_tbd")
SEEDS = range(20, 26)
EMPTY, AT_SIX, ELSEWHERE = 66, 30, 12  # trials, of all seeds together
ALARMS, CUT, LATE, DRAWS = 0.01, 200.0, slice(150, None), 200
DECIBELS = 3, 6, 9, 12
GRID, ONE, LESS = "grid filter, averaged", "one frame, averaged", "told 3 dB too little"
SHOWN = ["optimum", "proposed", "mainstream", "averaged", GRID]
METHODS = ["optimum", "proposed", "mainstream", "mainstream, P_max = 10", "mainstream, walk 1"]
METHODS += ["averaged", GRID, ONE]
CONTROL = ["optimum", LESS]


def kept():
    """Folder of the trials that were flown."""
    return paths.build() / "mda_tbd_methods"


def filters(R):
    """The settings of the particle filters, by name: the paper's, but for what the name says."""
    base = page.Filter(R=float(R))
    state = replace(base, source="state")
    return {
        "optimum": replace(base, source="known"),
        LESS: replace(base, source="known", R=R - 3.0),
        "proposed": base,
        "mainstream": state,
        "mainstream, P_max = 10": replace(state, P_max=10.0 / page.NOISE),
        "mainstream, walk 1": replace(state, P_walk=1.0 / page.NOISE),
        "averaged": replace(base, source="averaged"),
    }


@functools.cache
def transforms(p):
    """Size of the Fourier transforms; those of s / (1 + s) of the page's LEVELS, s = level h^2; and
    the sums of ln(1 + s) over the patch of each cell (levels, nr, na).
    """
    (lr, la, hr, ha), (nr, na) = p.psf, p.grid[4:]
    i, j = np.ogrid[-hr : hr + 1, -ha : ha + 1]
    s = page.LEVELS[:, None, None] * np.exp(-lr * i**2 - la * j**2)
    size = [fft.next_fast_len(n, real=True) for n in (nr + 2 * hr, na + 2 * ha)]
    ones = fft.rfft2(np.ones((nr, na)), size)
    penalty = fft.irfft2(ones * fft.rfft2(np.log1p(s), size), size)
    return size, fft.rfft2(s / (1 + s), size), penalty[:, hr : hr + nr, ha : ha + na]


def cell_ratios(frame, p):
    """Log-ratio (17) of a target in the middle of each cell, averaged over the page's LEVELS, and
    the mean of these levels given the frame, in noise powers; each (nr, na).

    The sum over a patch is a convolution of the frame, taken by Fourier transform.
    """
    (_, _, hr, ha), (nr, na) = p.psf, frame.shape
    size, kernel, penalty = transforms(p)
    both = fft.irfft2(fft.rfft2(frame / p.noise, size) * kernel, size)
    each = both[:, hr : hr + nr, ha : ha + na] - penalty
    most = each.max(axis=0)
    share = np.exp(each - most)
    total = share.sum(axis=0)
    return most + np.log(total / len(each)), np.tensordot(page.LEVELS, share, axes=1) / total


def walk(p, n=100):
    """Probabilities (9, 3) of the steps of a newborn target between two frames, in cells, from its
    uniform velocities and a uniform place in its cell, at 45 degrees.
    """
    v = p.birth_speed * (2 * (np.arange(n) + 0.5) / n - 1)
    offset = (np.arange(n) + 0.5) / n - 0.5
    radial = np.add.outer(v, v).ravel() / np.sqrt(2) * p.T
    steps = []
    for move, most in ((radial / p.dr, 4), (radial / (p.r_min * p.da), 1)):
        cells = np.rint(np.add.outer(move, offset)).astype(int).ravel()
        steps.append(np.bincount(np.clip(cells, -most, most) + most, minlength=2 * most + 1))
    table = np.outer(*steps).astype(float)
    return table / table.sum()


@functools.cache
def middles(grid):
    """Places (cells, 2) of the cells in m."""
    i, j = (axis.ravel() + 0.5 for axis in np.indices(grid[4:]))
    r, theta = grid.r_min + grid.dr * i, grid.a_min + grid.da * j
    return np.stack((r * np.cos(theta), r * np.sin(theta)), axis=1)


def one_frame(ratios, snr, p):
    """The largest log-ratio (K,) of each frame, its place (K, 2) and its intensity (K,)."""
    flat, k = ratios.reshape(len(ratios), -1), np.arange(len(ratios))
    best = flat.argmax(axis=1)
    return flat[k, best], middles(p.grid)[best], p.noise * snr.reshape(flat.shape)[k, best]


def grid_filter(ratios, snr, p):
    """Existence (K,), mean place (K, 2) and mean intensity (K,) of Bayes' rule on the cells."""
    W = baseline.grid_filter(ratios, walk(p), p.p_survive, p.p_birth).reshape(len(ratios), -1)
    existence = W.sum(axis=1)
    share = W / np.maximum(existence, 1e-300)[:, None]
    return existence, share @ middles(p.grid), p.noise * (share * snr.reshape(W.shape)).sum(axis=1)


def fly(names, z, R, rng):
    """Statistic (K,), place (K, 2) and intensity (K,) on frames z, by method."""
    found, on_cells = {}, {GRID: grid_filter, ONE: one_frame}
    if on_cells.keys() & set(names):
        p = page.Filter(source="averaged")
        cells = map(np.array, zip(*(cell_ratios(frame, p) for frame in z), strict=True))
        cells = [*cells, p]
    for name in names:
        if name in on_cells:
            found[name] = on_cells[name](*cells)
        else:
            track = page.recursion(z, filters(R)[name], deepcopy(rng))
            found[name] = track.existence, track.x[:, ::2], track.P
    return found


def flight(names, scene, i):
    """Statistic, distance and intensity (names, 3, K) of each method on scene i, whose seed is one
    of SEEDS; scene None: frames without a target, where the distances have no meaning.
    """
    kind = "methods, target" if scene else "methods, empty"
    stream = partial(trials.generator, SEEDS[i % len(SEEDS)], "mda_tbd", kind, i // len(SEEDS))
    world = scene or page.Scene()
    if scene:
        z = page.simulate(scene, stream("truth"), stream("noise"))
    else:
        z = world.noise * mda_tbd.noise_power((world.scans, *world.grid[4:]), stream("noise"))
    path = page.target(world)[:, ::2]
    each = fly(names, z, world.R, stream("filter")).values()
    return np.array([(statistic, np.hypot(*(place - path).T), P) for statistic, place, P in each])


def flown(part, names, scene, n):
    """Trials 0 to n - 1 of a part of the study (n, names, 3, K); some have been kept."""
    found = []
    for i in range(n):
        file = kept() / f"{part}, {i}.npy"
        if not file.is_file():
            products.write(kept(), {file.name: saved(flight(names, scene, i))})
        found.append(np.load(file))
    print(part, flush=True)
    return np.array(found)


def saved(array):
    """The bytes of an array's file."""
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def measures(quiet, statistic, away, P, P_tar):
    """OSPA, first declared frame, r.m.s. of the intensity of one method, at the level that ALARMS
    of `quiet` exceed; arrays (trials, K), the target is there from frame 15 on.
    """
    alive = slice(page.Scene().appears - 1, None)
    on = statistic[:, alive] > np.quantile(quiet[:, alive], 1.0 - ALARMS)
    ospa = np.where(on, np.minimum(away[:, alive], CUT), CUT).mean()
    first = np.where(on.any(axis=1), on.argmax(axis=1), on.shape[1]).mean() + alive.start + 1
    return np.array([ospa, first, math.sqrt(np.square(P[:, LATE] - P_tar).mean())])


def with_errors(quiet, fields, P_tar, rng):
    """The measures, each followed by its error, from trials of both kinds that are drawn again."""
    again = []
    for _ in range(DRAWS):
        a, b = (rng.integers(len(it), size=len(it)) for it in (quiet, fields[0]))
        again.append(measures(quiet[a], *(field[b] for field in fields), P_tar))
    value = measures(quiet, *fields, P_tar)
    return np.column_stack([value, np.std(again, axis=0)]).ravel()


def rows(scene, names, n, quiet):
    """The rows of one scene; quiet: by method, its statistic in frames without a target."""
    data = "one amplitude" if scene.common else "independent cells"
    each = flown(f"{data}, {scene.R:g} dB", names, scene, n)
    rng = trials.generator(SEEDS[0], "mda_tbd", "methods", int(scene.R), "filter")
    for j, name in enumerate(names):
        for seeds, first in (("20 to 25", 0), ("21 to 25", 1)):
            part, blank = (np.arange(len(it)) % len(SEEDS) >= first for it in (each, quiet[name]))
            fields = np.moveaxis(each[part, j], 1, 0)
            values = with_errors(quiet[name][blank], fields, scene.P_tar, rng)
            counted = [float(f"{value:.4g}") if value > 1e-9 else 0.0 for value in values]
            yield data, scene.R, name, seeds, int(part.sum()), *counted


def lead(table, column, method, other, dB=6, data="one amplitude"):
    """By how much a method's measure exceeds another's with the five other seeds, and its error."""
    chosen = table[(table["seeds"] == "21 to 25") & (table["dB"] == dB) & (table["data"] == data)]
    one, two = (chosen.set_index("method").loc[name] for name in (method, other))
    return one[column] - two[column], math.hypot(one[f"{column}_se"], two[f"{column}_se"])


def main():
    """Fly all methods, and write the file."""
    names, scene = [*METHODS, LESS], page.Scene()
    blank = flown("empty", names, None, EMPTY)[:, :, 0]
    quiet = dict(zip(names, np.moveaxis(blank, 1, 0), strict=True))
    found = [*rows(scene, names, AT_SIX, quiet)]
    found += rows(replace(scene, common=False), CONTROL, AT_SIX, quiet)
    for R in sorted(set(DECIBELS) - {6}):
        found += rows(replace(scene, R=float(R)), SHOWN, ELSEWHERE, quiet)
    columns = ["data", "dB", "method", "seeds", "n", "ospa", "ospa_se", "first", "first_se"]
    table = pd.DataFrame(found, columns=[*columns, "rms", "rms_se"])
    order = {"by": ["data", "dB"], "ascending": [False, True], "kind": "stable"}
    table = table.sort_values(**order, ignore_index=True)
    head = f"# python -m benchmarks.mda_tbd_methods: levels from {EMPTY} trials without a target\n"
    content = head.encode() + products.csv(table)
    products.write(paths.claims().parent, {"mda_tbd_methods.csv": content})
    shutil.rmtree(kept())


if __name__ == "__main__":
    main()
