"""Every filter of chapter 03 on the scenes of its page: ``python -m benchmarks.mda_filters``.

The page flies what it judges; the rest of its filters fly here, on the same scenes (seed 20, trials
0 to 29), so that the differences from the page's filters are paired.

``data/mda_filters.csv`` has a line per filter and power that the page does not fly: detection
frame, mean OSPA, bias and root mean square of the intensity, share of the late frames that are
declared, with standard errors; and the OSPA less that of the proposed filter at the same power,
paired.
``data/mda_filters_plain.csv`` has a line per filter of Section 5.5 at 6 dB: frames without a target
that are declared above one half, runs with one, OSPA declared above one half, and above the level
that 1 % of the filter's frames without a target exceed, and the gain over the proposed filter.
``data/mda_filters_paths.csv`` has a line per trial of Section 5.4: in how many late declared frames
the ancestors of all survivors were looked up, which share of the target's power their cells hold,
which was read there, and which was put out in these frames and in all.

A file that is there is not made again; all of them take half an hour on two cores.  The number of
processes may follow the command.
"""

import sys
from copy import deepcopy
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

import tbdcore
from benchmarks import mda_map
from tbdcore.kernels import mda_tbd
from tbdcore.repro import paths, products, trials

N, FEW, SEED, CUT, LATE = 30, 10, 20, 200.0, slice(150, None)
ONE_AMPLITUDE = {"likelihood": "coherent", "half_r": 1, "half_a": 4}
HEAD = f"# python -m benchmarks.mda_filters: seed {SEED}, the scenes of the page's default run\n"


def measured(page):
    """Filters of the table of measures, by (filter, dB); those of one power begin with the
    default filter.
    """
    base, nine = page.Filter(), page.Filter(R=9.0)
    found = {("proposed, own-cell", 6): base}
    for half_r, half_a in ((1, 3), (2, 6), (3, 9)):
        name = f"mainstream, wide PSF, patch {2 * half_r + 1} x {2 * half_a + 1}"
        found[name, 6] = replace(base, source="state", sharp=0.1, half_r=half_r, half_a=half_a)
    found["mainstream, half as sharp", 6] = replace(base, source="state", sharp=0.5)
    found["proposed, own-cell", 9] = nine
    for R_T in (0, 1, 2, 3, 4):
        name = f"proposed, per-sample, R_T = {R_T} dB"
        found[name, 9] = replace(nine, R_T=float(R_T), reading="per-sample")
    return found


def flown(cases, seed, i):
    """Existence, OSPA and intensity (cases, 3, K) on a scene of the page."""
    page, found = tbdcore.page("mda_tbd"), []
    draws = partial(trials.generator, seed, "mda_tbd", "scenes", i)
    rng, base = draws("noise"), page.Scene()
    empty = mda_tbd.noise_power((base.scans, *base.grid[4:]), rng)
    scenes = {R: page.simulate(replace(base, R=R), draws("truth"), deepcopy(rng), empty)
              for R in sorted({p.R for p in cases})}  # fmt: skip
    for p in cases:
        track, path = page.recursion(scenes[p.R], p, draws("filter")), page.target(base)
        ospa = mda_tbd.ospa_bernoulli(track.x[:, ::2], track.existence, path[:, ::2], CUT)
        found.append((track.existence, ospa, track.P))
    return np.array(found)


def error(values):
    """Standard error of a mean."""
    return values.std(ddof=1) / np.sqrt(len(values))


def of_measures(workers):
    """The table of measures."""
    page = tbdcore.page("mda_tbd")
    cases = measured(page)
    options = {"seed": SEED, "workers": workers, "label": "measures"}
    every = trials.run(partial(flown, list(cases.values())), N, **options)
    rng, default, lines = trials.generator(SEED, "mda_tbd", "map", N, "filter"), {}, []
    for ((name, R), p), (existence, ospa, P) in zip(
        cases.items(), np.moveaxis(every, 0, 2), strict=True
    ):
        scene = page.Scene(R=p.R)
        alive = slice(scene.appears - 1, None)
        metres, late = ospa[:, alive].mean(axis=1), (existence[:, LATE] > 0.5).mean(axis=1)
        more = metres - default.setdefault(R, metres)
        values = mda_map.measures(scene, existence, ospa, P, rng)
        values += [late.mean(), error(late), more.mean(), error(more)]
        lines.append([name, R, N, *(float(f"{value:.4g}") for value in values)])
    names = [*mda_map.NAMES, "late", "late_se", "more_ospa", "more_ospa_se"]
    return pd.DataFrame(lines, columns=["filter", "dB", "n", *names])


def plain(page):
    """Filters of Section 5.5 by name."""
    base = page.Filter()
    sources = {"proposed": "history", "averaged": "averaged", "mainstream": "state"}
    sources |= {"told right": "known"}
    cases = {name: replace(base, source=source) for name, source in sources.items()}
    for d in (-6.0, -3.0, 3.0, 6.0):
        cases[f"told {d:+.0f} dB"] = replace(base, source="known", R=base.R + d)
    for name in ("proposed", "averaged", "told right"):
        cases[f"{name}, births by power"] = replace(cases[name], births="power")
    cases["proposed, averaged start"] = replace(base, likelihood="averaged")
    for name in ("proposed", "told right", "told -3 dB", "proposed, births by power"):
        cases[f"{name}, one amplitude"] = replace(cases[name], **ONE_AMPLITUDE)
    return cases


def plain_trial(name, seed, i):
    """Existence, distance, and existence without a target (3, K) of a filter."""
    page = tbdcore.page("mda_tbd")
    p, scene = plain(page)[name], page.Scene()
    draws = partial(trials.generator, seed, "mda_tbd")
    shape, hiss = (scene.scans, *scene.grid[4:]), draws("scenes", i, "noise")
    noise = mda_tbd.noise_power(shape, hiss)
    empty = mda_tbd.noise_power(shape, draws("empty", i, "noise")) * scene.noise
    quiet = page.recursion(empty, p, draws("empty", i, "filter")).existence
    z = page.simulate(scene, draws("scenes", i, "truth"), hiss, noise)
    track = page.recursion(z, p, draws("scenes", i, "filter"))
    away = np.hypot(*(track.x - page.target(scene))[:, ::2].T)
    return np.array((track.existence, away, quiet))


def plain_measures(name, workers):
    """OSPA above one half and above the filter's level, frames without a target that are declared
    above one half (trials,), and whether there is one.
    """
    n = FEW if "amplitude" in name else N
    options = {"seed": SEED, "workers": workers, "label": name}
    found = trials.run(partial(plain_trial, name), n, **options)
    alive = slice(tbdcore.page("mda_tbd").Scene().appears - 1, None)
    existence, away, quiet = np.moveaxis(found[..., alive], 0, 1)
    ospa = [
        np.where(existence > level, np.minimum(away, CUT), CUT).mean(axis=1)
        for level in (0.5, np.quantile(quiet, 0.99))
    ]
    return *ospa, (quiet > 0.5).mean(axis=1), (quiet > 0.5).any(axis=1)


def of_plain(workers):
    """The lines of all filters of Section 5.5 at 6 dB."""
    lines, default = [], None
    for name in plain(tbdcore.page("mda_tbd")):
        half, strict, share, some = plain_measures(name, workers)
        default = strict if default is None else default
        values = [share.mean(), some.mean(), half.mean(), error(half), strict.mean(), error(strict)]
        gain = default[: len(strict)] - strict
        values += [gain.mean(), error(gain)]
        lines.append([name, len(strict), *(float(f"{value:.4g}") for value in values)])
    names = ["ospa", "ospa_se", "ospa_strict", "ospa_strict_se", "gain", "gain_se"]
    return pd.DataFrame(lines, columns=["filter", "n", "empty", "empty_run", *names])


def looked_up(page):
    """Scenes of Section 5.4 by their data."""
    cases = {f"{R} dB": page.Scene(R=float(R)) for R in (6, 9, 12)}
    return cases | {"6 dB, independent cells": page.Scene(common=False)}


def cells_read(H, scan, p):
    """Cells (2, n), from 1, that the samples H (n,) come from; found by their values."""
    flat = (scan / p.noise).ravel() - 1.0
    order = flat.argsort()
    place = np.searchsorted(flat[order], H - 1e-6 * (1.0 + abs(H)))
    return np.array(np.divmod(order[np.minimum(place, flat.size - 1)], scan.shape[1])) + 1


def share_seen(H, k, data, spot, p):
    """Mean h^2 of the true target in the cells that the samples H (window, n) come from."""
    total = number = 0
    for t in range(k - p.window + 1, k + 1):
        row = H[t % p.window]
        i, j = cells_read(row, data[t], p)
        d, a = i - spot[0, t], j - spot[1, t]
        h2 = np.exp(-p.psf.lr * d * d - p.psf.la * a * a)
        total, number = total + h2[row != 0.0].sum(), number + np.count_nonzero(row)
    return total / max(number, 1)


def paths_trial(scene, seed, i):
    """Number of frames, and shares: of the cells read, of the samples, put out then, put out."""
    page, draws = tbdcore.page("mda_tbd"), partial(trials.generator, seed, "mda_tbd", "scenes", i)
    data, own = page.simulate(scene, draws("truth"), draws("noise")), draws("filter")
    spot = mda_tbd.polar_cells(*page.target(scene)[:, ::2].T, scene.grid)
    p = page.Filter(R=scene.R)
    state, found, P = page.start(p, own), [], []
    for k, scan in enumerate(data):
        state, estimate = page.update(state, scan / p.noise, p, own)
        P.append(estimate.P)
        if k >= LATE.start and k % 10 == 0 and estimate.existence > 0.5:
            H = state.memory[0][:, 0, : p.N]
            seen = share_seen(H, k, data, spot, p)
            found.append((seen, H.mean() * p.noise / p.P_tar, estimate.P / p.P_tar))
    shares = np.mean(found, axis=0) if found else np.zeros(3)
    return np.array([len(found), *shares, np.mean(P[scene.appears - 1 :]) / p.P_tar])


def of_paths(workers):
    """The lines of Section 5.4."""
    lines, options = [], {"seed": SEED, "workers": workers, "label": "paths"}
    for name, scene in looked_up(tbdcore.page("mda_tbd")).items():
        for i, (n, *shares) in enumerate(trials.run(partial(paths_trial, scene), N, **options)):
            lines.append([name, i, int(n), *(float(f"{share:.6g}") for share in shares)])
    return pd.DataFrame(
        lines, columns=["data", "trial", "frames", "cells", "samples", "late", "all"]
    )


def write(end, table):
    """Write a file of the study."""
    name = f"mda_filters{end and '_'}{end}.csv"
    products.write(paths.claims().parent, {name: HEAD.encode() + products.csv(table)})


def main():
    """Fly what the files lack."""
    workers, folder = int((sys.argv[1:] or [0])[0]), paths.claims().parent
    made = {"paths": of_paths, "": of_measures, "plain": of_plain}
    for end, make in made.items():
        if not (folder / f"mda_filters{end and '_'}{end}.csv").is_file():
            write(end, make(workers))


if __name__ == "__main__":
    main()
