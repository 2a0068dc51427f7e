"""The methods of page 06 on its scenes: CPU time, numbers of particles, noise not as told.

``.venv/bin/python -m benchmarks.together`` writes four tables.  The first three are of steady,
straight targets at 5 dB, with a false share of 5 % of empty scenes.

``data/together_cost.csv``: for each method and level, for each filter with several numbers of
particles, the share of targets that is declared at the right place, and the CPU time per frame.
Exact Bayes sums the likelihood ratio of a straight, steady target of known strength over a grid of
starts (half a cell) and velocities (an eighth of a cell per frame); it is flown at more SNRs.

``data/together_particles.csv``: the number of particles at which the detection of a filter has
risen by nine tenths of its rise, interpolated over the logarithm of the number.

``data/together_noise.csv``: for some methods and four kinds of noise, the same share, thresholds
from noise of that kind; and the share of empty scenes that is declared with thresholds from white
noise.  Two more conditions have white noise and a target that turns or fades.

``data/together_caps.csv``: the share of crossings after which both targets are kept, at 18 dB, when
the log ratio of an amplitude is at most a cap.

It takes some minutes.  Shares are the same on every machine; times are those of this machine,
which the first line names: the least CPU time of ten scenes, one process, one thread.
"""

import math
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

import tbdcore
from benchmarks import timing
from tbdcore import detection as amplitudes
from tbdcore import noise as noise_laws
from tbdcore import recording, score
from tbdcore.repro import paths, trials

N_TRIALS, SEED, SHARE, NEAR, SNR_DB, TIMED = 100, 46, 0.05, 3.0, 5.0, 10
PARTICLES = (62, 250, 1000, 4000)
BAYES_DB = (-3.0, -1.0, 1.0, 3.0, 5.0)
STEP = 0.125  # of the grid of velocities, cells per frame


def six():
    """The algorithms of page 06."""
    return tbdcore.page("together") if six.page is None else six.page


six.page = None


def plans(page):
    """What is measured: (methods, N)."""
    filters = [m for m in page.METHODS if page.USES[m[0]] in ("b", "c")]
    plain = [m for m in page.METHODS if m not in filters]
    more = [([m], n) for m in filters for n in PARTICLES if n < 4000 or m[0] != "multiple model"]
    return [(plain, 500), *more]


def setup(page, n):
    return page.Setup(N=n, births=max(4, n // 2))


class Noise:
    """A generator of complex noise that is not white and normal, of one of KINDS."""

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
        return v * dtype(10**0.05 if self.kind == "1 dB louder" else 1.0)


def flight(seed, i, what, snr_db, look, noise, change):
    """One scene, seen by look(x, z, scene, stream)."""
    six.page = six()
    scene = replace(six.page.Scene(), snr_db=snr_db, **change)

    def stream(kind, name=""):
        return trials.generator(seed, "together", what + name, i, kind)

    x, z = six.page.simulate(scene, stream("truth"), Noise(noise, stream("noise")))
    return look(x, z, scene, stream)


def all_flights(look, snr_db, what, noise="white", **change):
    one = partial(flight, what=what, snr_db=snr_db, look=look, noise=noise, change=change)
    return trials.run(one, N_TRIALS, seed=SEED, label=what)


def peaks(x, z, scene, stream, methods, n):
    return six.page.observe(z, setup(six.page, n), stream, methods)[0].max(axis=1)


def declared(x, z, scene, stream, methods, n, V, tau):
    """Whether each method declares the target at the right place."""
    said, place = six.page.observe(z, setup(six.page, n), stream, methods, tau)
    with np.errstate(invalid="ignore"):
        near = np.hypot(*np.moveaxis(place - x[0][:, ::2], -1, 0)) < NEAR
    return (near & (said > V[:, None])).any(axis=1)


def thresholds(methods, n, noise="white"):
    """Thresholds (m,), those of the reference by level, and the peaks of the empty scenes."""
    found = all_flights(partial(peaks, methods=methods, n=n), -math.inf, "cost noise", noise)
    V = recording.threshold(found, SHARE).value
    tau = {level: V[m] for m, (name, level) in enumerate(methods) if name == "reference"}
    return np.where([name == "reference" for name, _ in methods], 0.0, V), tau, V, found


def detection(methods, n, noise="white", **change):
    """Number of scenes (m,) in which each method declares the target, and the empty peaks."""
    V, tau, _, found = thresholds(methods, n, noise)
    look = partial(declared, methods=methods, n=n, V=V, tau=tau)
    return all_flights(look, SNR_DB, "cost", noise, **change).sum(axis=0), found


FEW = [("Tonissen", "a"), ("Tonissen", "b"), ("Tonissen", "c"), ("single frames", "c")]
FEW += [("reference", "c"), ("plots, IPDA", "c"), ("averaged", "b"), ("Bernoulli", "c")]
FEW += [("multiple model", "c")]
KINDS = ("white", "K, shape 3", "1 dB louder", "correlated")
CHANGES = {"white, turning": {"turn": 0.15}, "white, Swerling 1": {"swerling": True}}


def noise_rows():
    """For each kind of noise and method: targets declared, empty scenes declared as in white."""
    fresh = all_flights(partial(peaks, methods=FEW, n=500), -math.inf, "cost fresh noise")
    white = told = None
    for kind in KINDS:
        found, each = detection(FEW, 500, kind)
        white = recording.threshold(each, SHARE).value if white is None else white
        false = (fresh if kind == "white" else each) > white
        told = false.sum(axis=0) if kind == "white" else told
        for m, method in enumerate(FEW):
            yield *method, kind, found[m], false[:, m].sum()
        print(kind, found, false.sum(axis=0), flush=True)
    for kind, change in CHANGES.items():
        found, _ = detection(FEW, 500, **change)
        for m, method in enumerate(FEW):
            yield *method, kind, found[m], told[m]
        print(kind, found, flush=True)


def fields(z, page, blur, snr):
    """Log ratios (K, 2 n, 2 n) of a steady target at each half cell."""
    side, (K, n, _) = np.arange(-2, 3), z.shape
    root = np.sqrt(np.pad(z, ((0, 0), (2, 2), (2, 2))))
    cells = np.lib.stride_tricks.sliding_window_view(root, (5, 5), axis=(1, 2))
    out = np.empty((K, 2 * n, 2 * n))
    for i in (0, 1):
        for j in (0, 1):
            h = np.exp(-np.add.outer((side - i / 2) ** 2, (side - j / 2) ** 2) / (2 * blur**2))
            u = (2 * math.sqrt(snr)) * cells * h.astype(np.float32)
            out[:, i::2, j::2] = page.log_bessel(u).sum(axis=(3, 4)) - snr * (h * h).sum()
    return out


def velocities():
    """Velocities (m, 2) of the grid and the logarithms of their prior weights."""
    side = np.arange(-9, 10) * STEP
    v = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    speed = np.hypot(*v.T)
    v, speed = v[(speed > 0.45) & (speed < 1.05)], speed[(speed > 0.45) & (speed < 1.05)]
    return v, -np.log(speed) - np.log((1 / speed).sum())


def bayes(x, z, scene, stream, snr_db):
    """Log-likelihood ratio of a straight, steady target of unknown start and velocity."""
    f = fields(z[scene.enters : scene.leaves], six.page, scene.blur, 10 ** (snr_db / 10))
    ago = np.arange(scene.enters, scene.leaves) - (scene.enters + scene.leaves) // 2
    low, each = scene.n // 2, []
    v, prior = velocities()
    for shift in np.rint(2 * ago[:, None] * v[:, None]).astype(int):
        rows = zip(f, low + shift, strict=True)
        each.append(sum(a[i : i + scene.n, j : j + scene.n] for a, (i, j) in rows))
    total = np.array(each) + prior[:, None, None]
    return np.logaddexp.reduce(total.ravel()) - math.log(scene.n**2)


def bayes_rows():
    for snr_db in BAYES_DB:
        look = partial(bayes, snr_db=snr_db)
        noise = all_flights(look, -math.inf, "cost noise")
        k = (all_flights(look, snr_db, "cost") > recording.threshold(noise, SHARE).value).sum()
        yield "exact Bayes on a grid", "", 0, snr_db, k, timed(look)


CAPS, JOINT = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 256.0), ("LM-AI", "JIPDA-AI")


def crossing(seed, i):
    """Whether both targets are kept, (methods, caps)."""
    page = six.page = six()
    scene = page.Scene(n=64, K=24, enters=0, leaves=24, swerling=True, snr_db=18.0)

    def stream(kind, name=""):
        return trials.generator(seed, "together", "caps" + name, i, kind)

    crossed = replace(scene, crossing=math.radians(40))
    x, z = page.simulate(crossed, stream("truth"), stream("noise"))
    plots, told = page.scans(z, z), np.array([page.Setup().snr])
    start = page.told_start(x, stream)

    def law(a, cap):
        return np.minimum(amplitudes.amplitude_ratio(a**2 / 2 - page.TAU, told)[0], cap)

    ends = [
        page.ljipda(plots, start, page.Setup(), JOINT, law=partial(law, cap=cap))[:, :, -1]
        for cap in CAPS
    ]
    return (page.cells_off(np.array(ends), x[:, -1]) < NEAR).all(axis=2)


def cap_rows():
    kept = trials.run(crossing, N_TRIALS, seed=SEED, label="caps").sum(axis=0)
    for c, m in np.ndindex(kept.shape):
        yield JOINT[m], CAPS[c], kept[c, m]


def nine_tenths(table):
    """For each filter: particles at nine tenths of its rise, least and most detection, time."""
    rows = []
    for (method, level), own in table[table["particles"] > 0].groupby(["method", "level"]):
        rise, log_n = np.maximum.accumulate(own["found"].to_numpy()), np.log(own["particles"])
        at = np.interp(rise[0] + 0.9 * (rise[-1] - rise[0]), rise, log_n)
        us = np.interp(at, log_n, own["us_per_frame"])
        rows.append((method, level, math.exp(at), own["found"].iloc[0], rise[-1], us))
    columns = ["method", "level", "particles", "found with least", "found with most"]
    few = pd.DataFrame(rows, columns=[*columns, "us_per_frame"])
    rounded = {c: [float(f"{v:.2g}") for v in few[c]] for c in ("particles", "us_per_frame")}
    return few.assign(**rounded)


def timed(look):
    """Least CPU time per frame, in microseconds."""
    used = []
    for i in range(TIMED + 1):
        scene = six.page.Scene(snr_db=SNR_DB)
        stream = partial(lambda i, kind, name="": trials.generator(i, "t", name, 0, kind), i)
        x, z = six.page.simulate(scene, stream("truth"), stream("noise"))
        start = time.process_time()
        look(x, z, scene, stream)
        used.append(time.process_time() - start)
    return 1e6 * min(used[1:]) / six.page.Scene().K


def observed(x, z, scene, stream, method, n, tau):
    """One method alone, with the filter of its level."""
    name, level = method
    f = six.page.filtered(z, setup(six.page, n), level)
    six.page.one_method(name, level, z, f, setup(six.page, n), stream, tau)


def rows():
    six.page = six()
    tau = {"a": 5.6, "b": 5.0, "c": 3.5}  # near those of 5 % of empty scenes
    for methods, n in plans(six.page):
        found, _ = detection(methods, n)
        for method, k in zip(methods, found, strict=True):
            us = timed(partial(observed, method=method, n=n, tau=tau))
            number = n if six.page.USES[method[0]] in ("b", "c") else 0
            yield *method, number, SNR_DB, k, us
            print(method, number, k, round(us), flush=True)
    yield from bayes_rows()


def write(name, table, counts=()):
    """A study as a file, of a table whose columns `counts` become shares with their errors."""
    for column in counts:
        share, se = score.proportion(table[column], N_TRIALS)
        table = table.assign(**{column: share, f"{column}_se": se, "n": N_TRIALS})
    said = f"{N_TRIALS} trials, seed {SEED}; times on {timing.machine()}"
    head = f"# python -m benchmarks.together: {said}\n"
    text = table.round(4).to_csv(index=False, lineterminator="\n")
    (paths.claims().parent / f"{name}.csv").write_text(head + text, encoding="utf-8")
    return table


def main():
    six.page = six()
    write("together_caps", pd.DataFrame([*cap_rows()], columns=["method", "cap", "kept"]), ["kept"])
    columns = ["method", "level", "condition", "found", "empty"]
    write("together_noise", pd.DataFrame([*noise_rows()], columns=columns), ["found", "empty"])
    columns = ["method", "level", "particles", "snr_db", "found", "us_per_frame"]
    table = pd.DataFrame([*rows()], columns=columns)
    table["us_per_frame"] = [float(f"{us:.3g}") for us in table["us_per_frame"]]
    write("together_particles", nine_tenths(write("together_cost", table, ["found"])))


if __name__ == "__main__":
    main()
