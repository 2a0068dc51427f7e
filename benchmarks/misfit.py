"""What is noticed in frames that are not what a filter is told, and what it does to false alarms.

``.venv/bin/python -m benchmarks.misfit [RUNS]`` prints, for 200 runs or RUNS,

* in what share of recordings each condition gives a ``Misfit`` warning, for normal frames as
  chapters 01 (11 x 50 x 50) and 02 (60 x 30 x 20) take them and for power as chapter 03 does
  (60 x 64 x 48);
* what a condition of some size does to the false alarms of chapter 01 (``tonissen``, 5 % per block)
  and to the share of empty frames that chapters 02 and 03 declare: the tolerances are where these
  double;
* what thresholds from 200 blocks of a recording deliver at a nominal 5 %, over 40 recordings.

It takes some minutes and is no test.
"""

import sys
import warnings

import numpy as np
from scipy import stats

import tbdcore
from tbdcore import misfit, noise, recording

SHAPES = {
    "01": ("gaussian", (11, 50, 50)),
    "02": ("gaussian", (60, 30, 20)),
    "03": ("exponential", (60, 64, 48)),
}


def clean(law, shape, rng):
    """Frames of the chapter's own law."""
    return (noise.gaussian if law == "gaussian" else noise.exponential)(shape, rng)


def by_law(law, normal):
    """Standard normal frames as the law's, with the same neighbours."""
    return normal if law == "gaussian" else noise.as_power(normal)


def k_noise(law, shape, nu, rng):
    """K-distributed noise: power of mean 1, or standardised to mean 0 and variance 1."""
    z = noise.k_power(shape, nu, rng)
    return z if law == "exponential" else (z - 1) / np.sqrt(1 + 2 / nu)


def target(law, shape, decibels, rng):
    """Frames with a target that crosses them, of a given ratio of peak power to noise power."""
    path = np.linspace([0.2 * shape[1], 0.3 * shape[2]], [0.8 * shape[1], 0.7 * shape[2]], shape[0])
    blur = 0.6 if law == "gaussian" else 1.5
    strength = 10 ** (decibels / (20 if law == "gaussian" else 10))
    return recording.inject(clean(law, shape, rng), path, strength, blur, rng, law)


def two_targets(law, shape, decibels, rng):
    """Frames with a second target, which crosses them the other way."""
    first, second = target(law, shape, decibels, rng), target(law, shape, decibels, rng)
    return np.where(np.arange(shape[1])[:, None] < shape[1] // 2, first, second[:, ::-1, ::-1])


CONDITIONS = {
    "clean": clean,
    "target of 11 dB": lambda law, shape, rng: target(law, shape, 11.0, rng),
    "target of 20 dB": lambda law, shape, rng: target(law, shape, 20.0, rng),
    "two targets of 15 dB": lambda law, shape, rng: two_targets(law, shape, 15.0, rng),
    "half of the frames missing": lambda law, s, rng: noise.with_gaps(clean(law, s, rng), 0.5, rng),
    "level +0.5 dB": lambda law, shape, rng: noise.louder(clean(law, shape, rng), 0.5, law),
    "level +1 dB": lambda law, shape, rng: noise.louder(clean(law, shape, rng), 1.0, law),
    "level +3 dB": lambda law, shape, rng: noise.louder(clean(law, shape, rng), 3.0, law),
    "level -1 dB": lambda law, shape, rng: noise.louder(clean(law, shape, rng), -1.0, law),
    "mean +0.4 std": lambda law, shape, rng: clean(law, shape, rng) + 0.4,
    "slope 0.67": lambda law, shape, rng: noise.sloped(clean(law, shape, rng), 0.67),
    "K, nu = 3": lambda law, shape, rng: k_noise(law, shape, 3.0, rng),
    "K, nu = 1": lambda law, shape, rng: k_noise(law, shape, 1.0, rng),
    "space 0.3": lambda law, s, rng: by_law(law, noise.correlated(s, (0, 0.3, 0.3), rng)),
    "space 0.5": lambda law, s, rng: by_law(law, noise.correlated(s, (0, 0.5, 0.5), rng)),
    "time 0.3": lambda law, s, rng: by_law(law, noise.correlated(s, (0.3, 0, 0), rng)),
    "time 0.5": lambda law, s, rng: by_law(law, noise.correlated(s, (0.5, 0, 0), rng)),
    "counts": lambda law, s, rng: np.round(100 + 20 * noise.gaussian(s, rng)),
    "dB": lambda law, s, rng: 10 * np.log10(noise.exponential(s, rng)),
    "amplitude": lambda law, s, rng: np.sqrt(noise.exponential(s, rng)),
}


def noticed(make, law, shape, runs):
    """Share of runs with a warning, and the condition that is named most often."""
    named = []
    for i in range(runs):
        frames = make(law, shape, np.random.default_rng([i, 43]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", misfit.Misfit)
            try:
                named += misfit.warn_misfit(frames, law).exceeded()[:1]
            except ValueError:
                named.append("refused")
    most = max(set(named), key=named.count) if named else ""
    return len(named) / runs, most


def matrix(runs):
    """The table condition x chapter."""
    print(f"{'noticed in a share of runs':<28}" + "".join(f"{name:<24}" for name in SHAPES))
    for name, make in CONDITIONS.items():
        found = [noticed(make, law, shape, runs) for law, shape in SHAPES.values()]
        print(f"{name:<28}" + "".join(f"{share:<7.3f}{most:<17}" for share, most in found))


def peaks(page, p, blocks):
    """Largest energy of the best path in each block."""
    find = page.tonissen(p, np.dtype(np.float64))
    return np.array([page.track(page.prepare(z, p), find, p).value for z in blocks])


def mixed(z, rho, *axes):
    """White normal frames made first-order autoregressions along some axes."""
    for axis in axes:
        y = np.moveaxis(z, axis, 0).copy()
        for k in range(1, len(y)):
            y[k] = rho * y[k - 1] + np.sqrt(1 - rho * rho) * y[k]
        z = np.moveaxis(y, 0, axis)
    return z


def student(z, df):
    """Normal frames with the tail of Student's law, of variance 1."""
    return stats.t.isf(stats.norm.sf(z), df) / np.sqrt(df / (df - 2))


# a fault is a function of white normal frames z of a chapter's law, and a size
FAULTS = {
    "level, std or dB": (
        lambda law, z, x: z + x if law == "gaussian" else noise.louder(by_law(law, z), x, law),
        (0.03, 0.05, 0.1, 0.2),
    ),
    "spread, dB": (lambda law, z, x: noise.louder(z, x), (0.1, 0.2, 0.3, 0.5)),
    "slope": (
        lambda law, z, x: (
            z + x * np.linspace(-0.5, 0.5, z.shape[1])[:, None]
            if law == "gaussian"
            else noise.sloped(by_law(law, z), x)
        ),
        (0.05, 0.1, 0.2, 0.3, 0.5),
    ),
    "time": (lambda law, z, x: by_law(law, mixed(z, x, 0)), (0.03, 0.06, 0.1, 0.2)),
    "space": (lambda law, z, x: by_law(law, mixed(z, x, 1, 2)), (0.03, 0.06, 0.1, 0.2)),
    "Student, freedom": (lambda law, z, x: student(z, x), (100, 30, 10, 5)),
    "K, nu": (
        lambda law, z, x: noise.k_power(z.shape, x, np.random.default_rng(len(z))),
        (100, 30, 10, 3),
    ),
}
ONE_LAW = {"spread, dB": "gaussian", "Student, freedom": "gaussian", "K, nu": "exponential"}


def false_01(white):
    """Share of blocks with a path above the threshold of these blocks of white noise."""
    page = tbdcore.page("dp_tbd")
    p = page.Scenario()
    told = recording.threshold(peaks(page, p, white), 0.05)
    return lambda frames: (peaks(page, p, frames) > told.value).mean()


def false_02(white):
    """Share of frames that are declared."""
    page = tbdcore.page("mm_pf_tbd")
    p = page.Scenario()
    streams = [np.random.default_rng([i, 2]) for i in range(len(white))]
    return lambda frames: np.mean(
        [
            page.recursion(p.scene.noise * z, p, rng).declared
            for z, rng in zip(frames, streams, strict=True)
        ]
    )


def false_03(white):
    """Share of frames in which the existence is above one half."""
    page = tbdcore.page("mda_tbd")
    p = page.scenario(64, 48, 5.0, 0.01, 2000.0, sd_r=1.0, sd_a=1.5)
    streams = [np.random.default_rng([i, 2]) for i in range(len(white))]
    return lambda frames: np.mean(
        [page.recursion(z, p, rng).existence > 0.5 for z, rng in zip(frames, streams, strict=True)]
    )


def doubling(n):
    """What the false alarms become under conditions of several sizes."""
    for chapter, false in (("01", false_01), ("02", false_02), ("03", false_03)):
        law, shape = SHAPES[chapter]
        many = range(10 * n if chapter == "01" else n)  # of a decision per block, not per frame
        white = [noise.gaussian(shape, np.random.default_rng([i, 1])) for i in many]
        rate = false(white)
        clean = rate([by_law(law, z) for z in white])
        print(f"\nfalse alarms of chapter {chapter}; clean: {clean:.4f}")
        for name, (fault, sizes) in FAULTS.items():
            if ONE_LAW.get(name, law) == law:
                row = [f"{x:g}: {rate([fault(law, z, x) for z in white]):.4f}" for x in sizes]
                print(f"{name:<20}" + "   ".join(row))


SMALL = (5, 24, 24)
NOISES = {
    "white": lambda shape, rng: noise.gaussian(shape, rng),
    "K, nu = 1": lambda shape, rng: noise.k_power(shape, 1.0, rng) - 1,
    "K, nu = 3, texture 0.5": lambda s, rng: noise.k_power(s, 3.0, rng, (0.5, 0.5, 0.5)) - 1,
    "time 0.5": lambda shape, rng: noise.correlated(shape, (0.5, 0.0, 0.0), rng),
    "space 0.5": lambda shape, rng: noise.correlated(shape, (0.0, 0.5, 0.5), rng),
    "time and space 0.7": lambda shape, rng: noise.correlated(shape, (0.7, 0.7, 0.7), rng),
}


def delivered(recordings=40, n=200, trials=400):
    """Delivered false alarms of thresholds from n blocks of each recording."""
    page = tbdcore.page("dp_tbd")
    p = page.Scenario(K=SMALL[0], grid=SMALL[1:], M=2)
    print(f"\ndelivered at 0.05 per search, thresholds from {n} blocks, {recordings} recordings")
    for name, draw in NOISES.items():
        shares, covered = [], []
        for i in range(recordings):
            rng = np.random.default_rng([i, 44])
            cut = recording.blocks(draw((n * SMALL[0], *SMALL[1:]), rng), SMALL[0])
            found = recording.threshold(peaks(page, p, cut), 0.05)
            fresh = recording.blocks(draw((trials * SMALL[0], *SMALL[1:]), rng), SMALL[0])
            shares.append((peaks(page, p, fresh) > found.value).mean())
            covered.append(found.low <= shares[-1] <= found.high)
        error = np.std(shares) / recordings**0.5
        spread = f"5 % to 95 % {np.quantile(shares, 0.05):.3f} to {np.quantile(shares, 0.95):.3f}"
        mean = f"{name:<24}{np.mean(shares):.4f} ± {error:.4f}"
        print(f"{mean}, {spread}; within the interval {np.mean(covered):.2f}")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    matrix(count)
    doubling(max(count // 4, 20))
    delivered()
