"""What is noticed in data that are not what a chapter is told, and what it does to false alarms.

``.venv/bin/python -m benchmarks.misfit [RUNS]`` prints, for 200 runs or RUNS,

* in what share of recordings each condition is noticed, by a ``Misfit`` warning or a refusal:
  frames as chapters 01 (normal, 11 x 50 x 50), 02 (normal, 60 x 30 x 20) and 03 (power,
  60 x 64 x 48) take them, and scans of plots as chapters 04 and 05 do;
* what a condition of some size does to the false alarms of chapter 01 (``tonissen``, 5 % per block)
  and to the share of empty frames that chapters 02 and 03 declare: the tolerances are where these
  double;
* what thresholds from a recording deliver: of 01 from 200 blocks at a nominal 5 %, of 02 and
  03 from 1,000 frames at 10 and 5 false declarations per 1,000 frames; 40 recordings each.

It takes half an hour and is no test.  ``.venv/bin/python -m benchmarks.misfit 200 matrix`` prints
one part: matrix, plots, doubling, delivered, scores (02) or frames (03).
"""

import sys
import warnings

import numpy as np
from scipy import stats

import tbdcore
from tbdcore import motion, noise, recording
from tbdcore.recording import misfit

SHAPES = {
    "01": ("gaussian", (11, 50, 50)),
    "02": ("gaussian", (60, 30, 20)),
    "03": ("exponential", (60, 64, 48)),
}


def clean(law, shape, rng):
    """Frames of the chapter's own law."""
    return (noise.gaussian if law == "gaussian" else noise.exponential)(shape, rng)


def with_gaps(frames, share, rng):
    """A copy in which each frame is missing (all NaN) with probability ``share``."""
    return np.where(rng.random(len(frames))[:, None, None] < share, np.nan, frames)


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
    "half of the frames missing": lambda law, s, rng: with_gaps(clean(law, s, rng), 0.5, rng),
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


def noticed(run, runs):
    """Share of runs that warn or refuse, and the words of the most frequent one."""
    said = []
    for i in range(runs):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", misfit.Misfit)
            try:
                run(np.random.default_rng([i, 43]))
            except ValueError:
                said.append("refused")
        said += [words(str(w.message)) for w in caught if w.category is misfit.Misfit]
    most = max(set(said), key=said.count) if said else ""
    return len(said) / runs, most


def words(line):
    """What a warning names first."""
    return line.removeprefix("frames: ").partition(" of the noise")[0][:40]


def matrix(runs):
    """The table condition x chapter, of frames."""
    print(f"{'noticed in a share of runs':<28}" + "".join(f"{name:<24}" for name in SHAPES))
    for name, make in CONDITIONS.items():
        found = [
            noticed(lambda rng, at=at, make=make: misfit.warn_misfit(make(*at, rng), at[0]), runs)
            for at in SHAPES.values()
        ]
        print(
            f"{name:<28}" + "".join(f"{share:<7.3f}{most:<17}" for share, most in found), flush=True
        )


# Scans of plots

ACCURACY = (10.0, 0.002)  # m, rad


def scans_of_one(rng, decibels=0.0, nu=None, error=1.0):
    """Chapter 04: 40 scans of a fading target in 1,000 cells, plots above a strength of 3."""
    k = np.arange(40)
    truth = np.c_[20e3 - 400.0 * k, 0.5 + 0.002 * k]
    seen = truth + error * rng.normal(0.0, ACCURACY, truth.shape)
    power = np.r_[30.0, 30.0, 31.0 * rng.standard_exponential(38)]
    scans = [np.r_[z, s][None] for z, s in zip(seen, power, strict=True)]
    for i in range(2, 40):
        cells = (
            noise.exponential(1000, rng)
            if nu is None
            else noise.k_power((1000, 1, 1), nu, rng).ravel()
        )
        cells = cells[cells * 10 ** (decibels / 10) > 3.0] * 10 ** (decibels / 10)
        place = truth[i] + rng.uniform([-1e3, -0.2], [1e3, 0.2], (len(cells), 2))
        scans[i] = np.r_[scans[i][scans[i][:, 2] > 3.0], np.c_[place, cells]]
    return scans


def changed(scans, factors=(1.0, 1.0, 1.0), strength=lambda s: s):
    """Scans with columns times factors, and another strength."""
    return [np.c_[z[:, :2] * factors[:2], strength(z[:, 2])] for z in scans]


def run_04(scans, start=None):
    """Follow the track."""
    page = tbdcore.page("track_cfar")
    p = page.Scenario(scan=4.0, bandwidth=5.0, beamwidth=1.5, sigma_p=1.0)
    return page.run(scans, p, accuracy=ACCURACY, start=start)


LOST = np.array([5e3, 0.0, 15e3, 0.0]), np.diag([1e4, 1e2, 1e4, 1e2])
OF_04 = {
    "clean": lambda rng: run_04(scans_of_one(rng)),
    "level +0.5 dB": lambda rng: run_04(scans_of_one(rng, 0.5)),
    "level +1 dB": lambda rng: run_04(scans_of_one(rng, 1.0)),
    "level +3 dB": lambda rng: run_04(scans_of_one(rng, 3.0)),
    "K, nu = 3": lambda rng: run_04(scans_of_one(rng, nu=3.0)),
    "K, nu = 1": lambda rng: run_04(scans_of_one(rng, nu=1.0)),
    "dB for power": lambda rng: run_04(
        changed(scans_of_one(rng), strength=lambda s: 10 * np.log10(s))
    ),
    "amplitude for power": lambda rng: run_04(changed(scans_of_one(rng), strength=np.sqrt)),
    "kilometres": lambda rng: run_04(changed(scans_of_one(rng), (1e-3, 1.0, 1.0))),
    "degrees": lambda rng: run_04(changed(scans_of_one(rng), (1.0, 180 / np.pi, 1.0))),
    "errors three times as told": lambda rng: run_04(scans_of_one(rng, error=3.0)),
    "no plot ever in a gate": lambda rng: run_04(scans_of_one(rng), LOST),
}


def boats(rng, seen=lambda z: z, clutter=1e-5, told=1e-5, apart=300.0, start=None, error=1.0):
    """Chapter 05: 60 scans of two boats and clutter, tracked by JIPDA."""
    page = tbdcore.page("ljipda_ai")
    x = np.array([[5000.0, 10, 0, 5], [5000.0, 10, apart, -5 * (apart > 0)]])
    x[1, 3] = 5.0 if apart == 0 else x[1, 3]
    scans = []
    for k in range(60):
        z = x[: 1 if apart == 0 else 2, ::2] + k * x[: 1 if apart == 0 else 2, 1::2]
        z = z + error * 20.0 * rng.standard_normal(z.shape)
        box = np.array([[4700.0, -500], [6000, 900]])
        n = rng.poisson(clutter * np.prod(box[1] - box[0]))
        scans.append(seen(np.r_[z[rng.random(len(z)) < 0.95], rng.uniform(*box, (n, 2))]))
    motions = motion.cv(1.0), motion.white_acceleration(1.0, 0.01)
    x = x if start is None else start
    setup = page.Setup(x, np.diag([400.0, 1, 400, 1]), *motions, 20.0, 0.2, 0.95, clutter=told)
    return page.run(scans, setup, method="JIPDA" if apart else "IPDA")


ELSEWHERE = np.array([[9000.0, 10, 9000, 5], [9000.0, 10, 9300, -5]])
OF_05 = {
    "clean": boats,
    'clean, clutter="estimate"': lambda rng: boats(rng, told="estimate"),
    "kilometres": lambda rng: boats(rng, lambda z: z / 1e3),
    "[y, x]": lambda rng: boats(rng, lambda z: z[:, ::-1]),
    "ten times the clutter told": lambda rng: boats(rng, clutter=1e-4),
    "a tenth of the clutter told": lambda rng: boats(rng, told=1e-4),
    "a hundredth of the clutter told": lambda rng: boats(rng, told=1e-3),
    "errors three times as told": lambda rng: boats(rng, error=3.0),
    "errors a tenth of those told": lambda rng: boats(rng, error=0.1),
    "no plot ever in a gate": lambda rng: boats(rng, start=ELSEWHERE),
    "two tracks coincide": lambda rng: boats(rng, apart=0.0),
}


def plots(runs):
    """The rows of scans of plots."""
    for chapter, conditions in (("04", OF_04), ("05", OF_05)):
        for name, run in conditions.items():
            share, most = noticed(run, runs)
            print(f"{chapter} {name:<34}{share:<7.3f}{most}", flush=True)


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


def scores(recordings=40, n=1000):
    """False declarations of chapter 02 per 1,000 frames, with a threshold from n frames."""
    page = tbdcore.page("mm_pf_tbd")
    p = page.Scenario(scene=page.Scene(nx=30, ny=20, noise=1.0, amplitude=18 / 2.3))
    print(f"\n02: false declarations per 1,000 frames, 10 set, {recordings} recordings")
    for name, draw in NOISES.items():
        at = []
        for i in range(recordings):
            rng = np.random.default_rng([i, 47])
            z = draw((2 * n, 30, 20), rng)
            if name.startswith("K"):
                z = recording.normal_scores(z, recording.empirical_law(z[:n]))
            existence = page.recursion(z, p, rng).existence
            level = recording.threshold(existence[:n], 10 / 1000, independent=200)
            at.append(1000 * (existence[n:] > level.value).mean())
        print(f"{name:<24}{np.mean(at):.1f} ± {np.std(at, ddof=1) / recordings**0.5:.1f}")


BLOCK, PER_THOUSAND = 20, 5


def declarations(existence, level):
    """Blocks of 20 frames with a declaration, per 1,000 frames."""
    return (largest(existence) > level).sum() * 1000 / len(existence)


def largest(existence):
    """Largest existence in each block of 20 frames."""
    return recording.blocks(existence[:, None, None], BLOCK).max(axis=(1, 2, 3))


def frames(recordings=40, n=1000):
    """False declarations of chapter 03 per 1,000 frames, with a level from n frames."""
    page = tbdcore.page("mda_tbd")
    p = page.scenario(48, 32, 5.0, 0.01, 2000.0, sd_r=1.0, sd_a=1.5, N=3000, B=1000)
    nominal = PER_THOUSAND * BLOCK / 1000
    print(f"\n03: false declarations per 1,000 frames, {PER_THOUSAND} set, {recordings} recordings")
    for name, draw in NOISES.items():
        at = []
        for i in range(recordings):
            rng = np.random.default_rng([i, 46])
            z = draw((2 * n + BLOCK, 48, 32), rng)
            z = z + 1.0 if name.startswith("K") else noise.as_power(z)
            existence = page.recursion(z, p, rng).existence[BLOCK:]
            level = recording.threshold(largest(existence[:n]), nominal)
            at.append([declarations(existence[n:], x) for x in (level.value, 0.5)])
        mean, error = np.mean(at, axis=0), np.std(at, axis=0) / recordings**0.5
        print(f"{name:<24}{mean[0]:.2f} ± {error[0]:.2f}; at 0.5 {mean[1]:.1f} ± {error[1]:.1f}")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    parts = {"matrix": lambda: matrix(count), "plots": lambda: plots(count)}
    parts |= {"doubling": lambda: doubling(max(count // 4, 20)), "delivered": delivered}
    parts |= {"scores": scores, "frames": frames}
    for name in sys.argv[2:] or parts:
        parts[name]()
