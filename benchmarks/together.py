"""Finding a target with the methods of page 06: ``.venv/bin/python -m benchmarks.together [PART]``.

A part is one of the five tables; without a part all are written, which takes an hour.

``data/together_finding.csv``: for each method and scene the SNR at which half of the targets are
declared at the right place, with its error, and the shares declared at each SNR.  Thresholds come
from 1000 scenes without a target, of which each method declares 5 %.  The rows "known path" are the
bound.

``data/together_seeds.csv``: the same SNR with five other seeds, for the bound, for
the methods that are within a decibel of the lowest in both scenes of ``together_finding`` and take
less than 10 ms for a scene, and for Tonissen (a).

``data/together_false.csv``: for these methods the share of 5000 other empty scenes, of other seeds,
that is declared with the thresholds of ``together_finding``; its error contains the threshold's.

``data/together_noise.csv``: for some methods and two other kinds of noise, the share of steady
targets that is declared at 5.5 dB with thresholds from noise of that kind, and the share of empty
scenes of that kind that is declared with the thresholds of ``together_finding``, of white noise.

``data/together_tracks.csv``: with five other seeds the share of empty scenes of other noise that is
declared as above (table "noise"), the mean distance of tracks at 6 dB, in cells ("holding"), and
the share of scenes in which both targets are kept at 12 dB ("crossing").
"""

import math
import sys
import types
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

import tbdcore
from benchmarks.rows import definitions
from tbdcore import noise as noise_laws
from tbdcore import recording, score
from tbdcore.repro import paths, products, trials

SHARE, EMPTY, SEED, FIVE = 0.05, 1000, 46, range(47, 52)
FRESH = range(47, 52)  # seeds of other empty scenes
SNR_DB, BOUND_DB = [1.0, 2.5, 4.0, 5.5, 7.0, 9.0], [-3.0, -1.5, 0.0, 1.5]
AGAIN_DB = [-0.5, *SNR_DB]  # so that half of few scenes lies between
SCENES = {"steady": {}, "turning": {"swerling": True, "turn": 0.15}}
AGAIN = [("conventional", "b"), ("conventional", "c"), ("Tonissen", "a"), ("Tonissen", "b")]
AGAIN += [("Tonissen", "c"), ("weighted", "c"), ("price 1", "c"), ("recursive maximum", "b")]
AGAIN += [("recursive maximum", "c"), ("grid filter", "b"), ("grid filter", "c")]
NOISY = [("Tonissen", "a"), ("Tonissen", "b"), ("Tonissen", "c"), ("recursive maximum", "c")]
NOISY += [("grid filter", "c"), ("averaged", "b"), ("multiple model", "c"), ("plots, IPDA", "b")]
KINDS = ("K, shape 3", "correlated")
NOISE_DB = 5.5  # of a steady target in other noise
TRACKS = ("follow", "meet", "HELD", "PLAIN", "AMPLITUDES", "LIMITS")  # of the page, as its scenes:
HELD = {"K": 15, "enters": 0, "leaves": 15, "swerling": True, "turn": 0.1}
TWO = {"n": 64, "K": 24, "enters": 0, "leaves": 24, "swerling": True, "crossing": math.radians(40)}
TRACKS_DB, SCENES_EACH = {"holding": 6.0, "crossing": 12.0}, 60


def six():
    """The algorithms of page 06."""
    return tbdcore.page("together") if six.page is None else six.page


six.page = None


class Noise:
    """A generator of complex noise, "white" and normal or of one of KINDS."""

    def __init__(self, kind, rng):
        self.kind, self.rng = kind, rng

    def standard_normal(self, shape, dtype):
        """Real and imaginary part, (2, K, n, n)."""
        if self.kind == "correlated":
            both = [noise_laws.correlated(shape[1:], (0.3, 0.3, 0.3), self.rng) for _ in range(2)]
            return np.array(both, dtype)
        v = self.rng.standard_normal(shape, dtype=dtype)
        if self.kind == "K, shape 3":  # a texture for each cell
            v *= np.sqrt(self.rng.standard_gamma(3.0, shape[1:], dtype=dtype) / 3)
        return v


def scores(seed, i, what, change, kind, methods):
    """Scores (m,) of methods in scene i: the largest near its target, or, without one, of all."""
    six.page = six()

    def stream(purpose, name=""):
        rng = trials.generator(seed, "together", what + name, i, purpose)
        return Noise(kind, rng) if purpose == "noise" else rng

    page = six.page
    look = page.scores_near if "snr_db" in change else page.largest_scores
    return look(replace(page.Scene(), **change), page.Setup(), stream, methods)


def flown(seed, n, what, methods, kind="white", **change):
    """Scores (n, m) of n scenes."""
    one = partial(scores, what=what, change=change, kind=kind, methods=methods)
    return trials.run(one, n, seed=seed, label=what)


def empty_scenes(seed, methods, kind="white"):
    """Largest scores (EMPTY, m) without a target."""
    return flown(seed, EMPTY, "finding empty", methods, kind)


def targets(seed, n, methods, scene, levels=SNR_DB):
    """Scores (SNR, n, m) near the target; the same noise and paths at each SNR."""
    change = SCENES[scene]
    return np.array([flown(seed, n, "finding", methods, snr_db=v, **change) for v in levels])


def halves(seed, near, empty, levels=SNR_DB):
    """SNR (m,) with half of the targets declared, and its error."""
    rng = trials.generator(seed, "together", "resample", 0, "filter")
    V = recording.threshold(empty, SHARE).value
    page = six()
    return page.half(levels, near, V), page.half_error(levels, near, empty, SHARE, rng), V


def ratio(seed, i, change):
    """Log-likelihood ratio of the bound in scene i."""
    page = six.page = six()
    rngs = [trials.generator(seed, "together", "finding", i, kind) for kind in ("truth", "noise")]
    scene = replace(page.Scene(), **change)
    x, z = page.simulate(scene, *rngs)
    return page.known_path(z, x[0], scene)


def bound(seed, scene, n=200):
    """SNR with half of the targets declared by the bound, its error, and the shares declared."""
    page, rng = six(), trials.generator(seed, "together", "resample", 1, "filter")
    changes = [{"snr_db": snr_db, **SCENES[scene]} for snr_db in BOUND_DB]
    ratios = np.array([trials.run(partial(ratio, change=it), n, seed=seed) for it in changes])
    picks = rng.integers(n, size=(200, n))
    each = [page.bound_half(BOUND_DB, ratios[:, pick], SHARE) for pick in picks]
    found = page.within_bound(ratios, SHARE).mean(axis=1)
    return page.bound_half(BOUND_DB, ratios, SHARE), np.std(each), found


def label(method):
    """A method and what it is told, as page and tables name it."""
    return f"{method[0]} ({method[1]})"


def finding(n=100):
    """The first table."""
    methods, rows = six().METHODS, []
    empty = empty_scenes(SEED, methods)
    for scene in SCENES:
        near = targets(SEED, n, methods, scene)
        half, se, V = halves(SEED, near, empty)
        found = (near > V).mean(axis=1).T
        for m, method in enumerate(methods):
            shares = {f"{v:g} dB": share for v, share in zip(SNR_DB, found[m], strict=True)}
            rows.append({"method": label(method), "scene": scene, "half_db": half[m], **shares})
            rows[-1] |= {"half_db_se": se[m], "n": n, "threshold": V[m]}
        half, se, found = bound(SEED, scene)
        shares = {f"{v:g} dB": share for v, share in zip(BOUND_DB, found, strict=True)}
        rows.append({"method": "known path", "scene": scene, "half_db": half, "half_db_se": se})
        rows[-1] |= {"n": 200, **shares}
    columns = ["method", "scene", "half_db", "half_db_se", "threshold", "n"]
    levels = [f"{v:g} dB" for v in sorted({*BOUND_DB, *SNR_DB})]
    write("finding", pd.DataFrame(rows)[columns + levels], f"seed {SEED}")


def white_thresholds(methods):
    """Thresholds from the first table."""
    first = pd.read_csv(file("finding"), comment="#").drop_duplicates("method")
    return first.set_index("method")["threshold"][list(map(label, methods))].to_numpy()


def again(seed, n, empty):
    """Rows (row, column, seed, value, se) of another seed: AGAIN and the bound in both scenes."""
    rows = []
    for scene in SCENES:
        near = targets(seed, n, AGAIN, scene, AGAIN_DB)
        half, se, _ = halves(seed, near, empty, AGAIN_DB)
        for m, method in enumerate(AGAIN):
            rows.append((label(method), scene, seed, half[m], se[m]))
        half, se, _ = bound(seed, scene, 2 * n)
        rows.append(("known path", scene, seed, half, se))
    return rows


def false():
    """The share of other empty scenes that is declared."""
    empty = np.concatenate([empty_scenes(seed, AGAIN) for seed in FRESH])
    share, se = score.proportion((empty > white_thresholds(AGAIN)).sum(axis=0), len(empty))
    se = np.hypot(se, math.sqrt(SHARE * (1 - SHARE) / EMPTY))  # and of the threshold
    table = pd.DataFrame({"method": map(label, AGAIN), "share": share, "se": se, "n": len(empty)})
    write("false", table, f"seeds {FRESH[0]} to {FRESH[-1]}")


def seeds(n=50):
    """The second table, with the columns of ``data/tables_seeds.csv``."""
    empties = [empty_scenes(seed, AGAIN) for seed in FIVE]
    rows = [row for it in zip(FIVE, empties, strict=True) for row in again(it[0], n, it[1])]
    table = pd.DataFrame(rows, columns=["row", "column", "seed", "value", "se"])
    table.insert(0, "table", "methods")
    table.insert(0, "paper", "together")
    said = f"seeds {FIVE[0]} to {FIVE[-1]}, {n} scenes at each SNR, {2 * n} of the bound"
    write("seeds", table, said)


def noise(n=200):
    """The third table."""
    rows, white = [], white_thresholds(NOISY)
    for kind in KINDS:
        empty = empty_scenes(SEED, NOISY, kind)
        own = recording.threshold(empty, SHARE).value
        near = flown(SEED, n, "finding", NOISY, kind, snr_db=NOISE_DB)
        share, share_se = score.proportion((near > own).sum(axis=0), n)
        false, false_se = score.proportion((empty > white).sum(axis=0), EMPTY)
        rng = trials.generator(SEED, "together", "resample", 2, "filter")
        share_se = np.hypot(share_se, threshold_error(near, empty, rng))
        for m, method in enumerate(NOISY):
            numbers = share[m], share_se[m], false[m], false_se[m]
            rows.append((label(method), kind, *numbers))
        print(kind, share, false, flush=True)
    columns = ["method", "condition", "found", "found_se", "empty", "empty_se"]
    write("noise", pd.DataFrame(rows, columns=columns), f"{NOISE_DB:g} dB, {n} scenes, seed {SEED}")


def threshold_error(near, empty, rng, n=200):
    """Standard error (m,) of shares declared, by the chance of the thresholds alone."""
    drawn = (empty[rng.integers(len(empty), size=len(empty))] for _ in range(n))
    V = [recording.threshold(own, SHARE).value for own in drawn]
    return np.std([(near > v).mean(axis=0) for v in V], axis=0)


def track(seed, i, look, scene, what):
    """What `look` of the page returns of scene i."""

    def stream(purpose, name=""):
        return trials.generator(seed, "together", what + name, i, purpose)

    six.page = six()
    x, z = six.page.simulate(scene, stream("truth"), stream("noise"))
    return look(x, z, scene, six.page.Setup(), stream)


def noise_again(seed):
    """Rows (table, row, column, seed, value, se) of empty scenes of other noise."""
    for kind in KINDS:
        empty = flown(seed, 100, "finding empty", NOISY, kind)
        share, se = score.proportion((empty > white_thresholds(NOISY)).sum(axis=0), len(empty))
        for m, method in enumerate(NOISY):
            yield ("noise", label(method), kind, seed, share[m], se[m])


def tracks_again(seed, table, look, change, names):
    """The same rows of one of the page's figures of tracks, at one SNR."""
    scene = six().Scene(**change, snr_db=TRACKS_DB[table])
    one = partial(track, look=look, scene=scene, what=table)
    each = trials.run(one, SCENES_EACH, seed=seed, label=table)
    if table == "holding":
        each = np.minimum(each, six().NEAR).mean(axis=2)
    se = each.std(axis=0) / math.sqrt(len(each))
    for m, name in enumerate(names):
        yield (table, name, f"{TRACKS_DB[table]:g} dB", seed, each[:, m].mean(), se[m])


def tracks():
    """The last table, with the columns of ``data/tables_seeds.csv``."""
    page, found = types.SimpleNamespace(**definitions("together", TRACKS)), []
    crossing = [*page.PLAIN, *page.AMPLITUDES, *page.LIMITS]
    for seed in FIVE:
        found += noise_again(seed)
        found += tracks_again(seed, "holding", page.follow, HELD, page.HELD)
        found += tracks_again(seed, "crossing", page.meet, TWO, crossing)
    table = pd.DataFrame(found, columns=["table", "row", "column", "seed", "value", "se"])
    table.insert(0, "paper", "together")
    write("tracks", table, f"seeds {FIVE[0]} to {FIVE[-1]}, {SCENES_EACH} scenes of tracks")


def file(name):
    """The file of a table."""
    return paths.claims().parent / f"together_{name}.csv"


def write(name, table, said):
    """A table as a file."""
    head = f"# python -m benchmarks.together {name}: {EMPTY} empty scenes, {said}\n"
    products.write(file(name).parent, {file(name).name: head.encode() + products.csv(table)})


PARTS = {"finding": finding, "false": false, "seeds": seeds, "noise": noise, "tracks": tracks}


def main():
    """Make the parts that are named, or all."""
    for word in sys.argv[1:] or PARTS:
        if word not in PARTS:
            sys.exit(f"benchmarks.together: no part {word!r}; give {', '.join(PARTS)}")
        PARTS[word]()


if __name__ == "__main__":
    main()
