"""What decides no row of chapter 05: ``python -m benchmarks.ljipda_ai_boats``, five minutes.

It writes ``data/ljipda_ai_boats.csv``: the share of pairs, or of tracks, that methods keep, and its
standard error, both in percent, for the page's seed and for five others.  Studies: ``angles``, the
angle at which two boats cross, or the distance at which they sail side by side; ``amplitudes``, K
clutter and what is told of it; ``causes``, whose track gets the amplitude of a shared plot;
``fleet``, boats in one cluster.
"""

import itertools
import math
import types
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from benchmarks import ljipda_ai_limits as limits
from benchmarks import readings_ljipda_ai as ways
from benchmarks import rows
from benchmarks.seeds import FIVE
from tbdcore import score
from tbdcore.repro import paths, products, trials

NAMES = "page p d stream scene crossing parallel flown ends outcomes"
NAMES += " share_error pd_of RIVALS ONE SNR SEA_PFA LAST NEAR COUNTED"
USES = tuple(f"{NAMES} loss_distance loss_scans seed many".split())
COLUMNS = ["study", "case", "x", "method", "seed", "kept", "se", "n"]
ANGLES, GAPS = (3, 6, 10, 20), (20, 30, 40, 60)
SHAPES = (math.inf, 3.0, 1.0, 0.5, 0.3)
AIDED, BARE = ("JIPDA-AI", "LJIPDA-AI, largest prior"), ("JIPDA", "LJIPDA")
GETS = ("nobody", "both", "one: coin", "always A", "always B", "largest prior")
BOATS = 18
OTHERS = 60  # trials of each other seed


def equal(page):
    """Levels of two boats with the geometric mean of those of the page."""
    return np.full(2, math.sqrt(page.SNR.prod()))


def sailings(page):
    """The encounters of ``angles``: (case, x, function that makes the scene, levels, by track)."""
    crossings = [(angle, partial(page.crossing, angle)) for angle in ANGLES]
    for case, levels in (("equal levels", equal(page)), ("12.5 to 1", page.SNR)):
        yield from ((case, angle, sailed, levels, False) for angle, sailed in crossings)
    yield "P_D and level by track", 6, partial(page.crossing, 6), page.SNR, True
    for gap in GAPS:
        yield "side by side", gap, partial(page.parallel, gap), page.SNR, False


def angles(seed, i, page):
    """Kept (encounter, method) in percent."""
    each = [
        page.outcomes(sailed, seed, i, page.RIVALS, *told) for _, _, sailed, *told in sailings(page)
    ]
    return 100.0 * (np.array(each) == 0)


def in_three_ways(page, plots, quiet, tails, level, fly):
    """States (shape, told, method, ...): told Rayleigh, told the law; amplitudes dropped."""
    dropped, found = [fly(plots, name) for name in BARE], []
    for tail in tails:
        stored = limits.in_clutter(plots, quiet, tail)
        for told in (stored, limits.as_told(stored, tail, level)):
            found += [fly(told, name) for name in AIDED]
        found += dropped
    return np.array(found)


def amplitudes(seed, i, page):
    """Kept (scene, shape, told, method) in percent: pairs of boats, tracks of the scene cross."""
    rates = page.SEA_PFA, limits.false_alarm(page)
    tails = [[limits.tail_of(nu, rate) for nu in SHAPES] for rate in rates]
    X, plots, quiet, s = page.crossing(6, seed, i)
    states = in_three_ways(
        page, plots, quiet, tails[0], page.ONE, lambda z, name: page.flown(z, s, name)
    )
    boats = page.ends(X, states) == 0
    alg, draw = page.page(), partial(page.stream, i, experiment="heavy", seed=seed)
    plots = alg.simulate(page.p, draw("noise"))
    quiet = alg.simulate(replace(page.p, snr_db=-math.inf), draw("noise"))
    told = alg.setup(page.p, draw("filter"))
    states = in_three_ways(
        page, plots, quiet, tails[1], page.d, lambda z, name: alg.states(z, told, name)[0]
    )
    errors = (states - alg.course(page.p)[0])[..., ::2]
    onset = score.loss_onsets(errors, page.loss_distance, page.loss_scans, after=page.COUNTED)
    shares = (onset == page.p.frames).mean(axis=1)
    return 100.0 * np.array([each.reshape(len(SHAPES), 3, 2) for each in (boats, shares)])


def causes(seed, i, page):
    """Kept (levels, who gets the amplitude) in percent, at 6 degrees."""
    found = []
    for snr in (equal(page), page.SNR):
        X, plots, _, s = page.crossing(6, seed, i, snr)
        coin = page.stream(i, "filter", "coin", seed)
        tracks = [page.flown(plots, s, name) for name in ("LJIPDA", "LJIPDA-AI")]
        for who in (ways.COIN, ways.FIRST, ways.LAST):
            way = ways.Way(ways.VISIBLE, who, by_track=False, amplitude=True)
            tracks.append(ways.track(page, plots, s, way, coin))
        tracks.append(page.flown(plots, s, "LJIPDA-AI, largest prior"))
        found.append(page.ends(X, np.array(tracks)) == 0)
    return 100.0 * np.array(found)


def linear(page):
    """The methods that list no joint events."""
    alg = page.page()
    return [name for name in page.RIVALS if alg.METHODS[name][0] != alg.EXACT]


def fleet(seed, i, page, names):
    """Tracks that end on their own boats, by method, in percent; courses 3 degrees apart."""
    courses = [math.radians(3.0 * (n - (BOATS - 1) / 2)) for n in range(BOATS)]
    levels = np.tile(page.SNR, BOATS // 2)
    X, plots, _, s = page.scene(courses, f"{BOATS} in a cluster", seed, i, levels)
    tracks = np.array([page.flown(plots, s, name) for name in names])[:, -page.LAST :, :, None, ::2]
    final = np.linalg.norm(tracks - X[-page.LAST :, None, :, ::2], axis=-1).mean(axis=1)
    own = final.argmin(axis=-1) == np.arange(BOATS)
    return 100.0 * (own & (final.min(axis=-1) < page.NEAR)).mean(axis=-1)


def refuses(page, name):
    """Whether a method refuses the first trial of the fleet."""
    try:
        fleet(page.seed, 0, page, [name])
    except ValueError:
        return True
    return False


def labels(page):
    """For each study the function, and (case, x, method) of each number that it gives."""
    told = itertools.product(
        ("boats", "cross"), SHAPES, ("told Rayleigh", "told the law", "dropped"), (0, 1)
    )
    amplitude = [
        (f"{where}, {how}", shape, (BARE if how == "dropped" else AIDED)[m])
        for where, shape, how, m in told
    ]
    names = linear(page)
    return {
        angles: [(*it[:2], name) for it in sailings(page) for name in page.RIVALS],
        amplitudes: amplitude,
        causes: [*itertools.product(("equal levels", "12.5 to 1"), (6,), GETS)],
        partial(fleet, names=names): [("fleet", BOATS, name) for name in names],
    }


def lines(page, seed):
    """Rows of the file for one seed."""
    for function, cells in labels(page).items():
        study = getattr(function, "func", function).__name__
        n = page.many if seed == page.seed else OTHERS
        values = trials.run(partial(function, page=page), n, seed=seed, label=f"{study} {seed}")
        values = np.reshape(values, (n, -1))
        pairs = study != "fleet"
        counts = page.share_error(values.sum(axis=0) / 100, n)
        errors = counts if pairs else values.std(axis=0) / math.sqrt(n)
        for cell, value, error in zip(cells, values.mean(axis=0), errors, strict=True):
            yield study, *cell, seed, round(value, 2), round(float(error), 2), n


def main():
    """Fly all studies with all seeds, and write the file."""
    page = types.SimpleNamespace(**rows.definitions("ljipda_ai", USES))
    found = [line for seed in (page.seed, *FIVE) for line in lines(page, seed)]
    for name in page.RIVALS:
        if name not in linear(page) and refuses(page, name):
            found.append(("fleet", "fleet", BOATS, name, page.seed, "refused", "", 1))
    table = pd.DataFrame(found, columns=COLUMNS)
    head = f"# python -m benchmarks.ljipda_ai_boats; seeds {page.seed}, {FIVE[0]} to {FIVE[-1]}\n"
    file = paths.claims().parent / "ljipda_ai_boats.csv"
    products.write(file.parent, {file.name: head.encode() + products.csv(table)})


if __name__ == "__main__":
    main()
