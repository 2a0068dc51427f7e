"""A few trials of every paper, by the algorithm cells of its notebook: simulate, run, return
everything that comes out.
"""

from dataclasses import replace

import numpy as np

import tbdcore
from tbdcore.kernels import dp_tbd as kernels
from tbdcore.repro import trials

SEED = 7


def streams(paper, seed, i):
    return (
        trials.generator(seed, paper, "determinism", i, purpose)
        for purpose in ("truth", "noise", "filter")
    )


def dp_tbd(seed, i):
    """Cells and energies of the three algorithms, in single precision as in the experiments."""
    page, (truth, noise, _) = tbdcore.page("dp_tbd"), streams("dp_tbd", seed, i)
    p = page.Scenario()
    cells = page.truth(0.2, page.first_state(p, truth), p, truth)[1]
    frames = noise.standard_normal((p.K, *p.grid), dtype=np.float32)
    z = kernels.point_frames(frames, cells, kernels.point_amplitude(9.0))
    tracks = page.best_tracks(z, p)
    return np.array([t.cells for t in tracks]), np.array([t.value for t in tracks])


def mm_pf_tbd(seed, i):
    """Every curve of the proposed filter."""
    page, (_, noise, choice) = tbdcore.page("mm_pf_tbd"), streams("mm_pf_tbd", seed, i)
    return numbers(
        page.run(page.simulate(page.Scene(), noise), page.Scenario(M=500, M_new=500), choice)
    )


def mda_tbd(seed, i):
    """Existence, state, intensity, effective size and founders over the frames."""
    page, (truth, noise, choice) = tbdcore.page("mda_tbd"), streams("mda_tbd", seed, i)
    z = page.simulate(page.Scene(scans=60), truth, noise)
    return numbers(page.run(z, page.Filter(N=400, B=200), choice))


def track_cfar(seed, i):
    """A flight by the compiled recursion, and the tracks of the page's own functions among 40 false
    plots a frame.
    """
    page, (_, noise, choice) = tbdcore.page("track_cfar"), streams("track_cfar", seed, i)
    p = page.Scenario()
    z = page.truth(p)
    scene = page.simulate(z, p, noise)
    died, hit, eta = page.fly(scene, z, page.design(p))
    false = z[2:, None] + p.cell * (6 * choice.random((p.frames, 40, 2)) - 3)
    plots = z + np.sqrt(page.variances(z[:, 0], p)) * scene.e
    target = np.column_stack([plots, np.append([np.inf, np.inf], scene.lam)])[:, None]
    power = choice.standard_exponential((p.frames, 40, 1))
    scans = [
        *target[:2],
        *np.concatenate([target[2:], np.concatenate([false, power], axis=-1)], axis=1),
    ]
    tracks = page.run(scans[:32], replace(p, miss_limit=40))
    return (
        float(died),
        hit,
        np.nan_to_num(eta),
        np.array([t.x for t in tracks]),
        np.array([t.P for t in tracks]),
    )


def ljipda_ai(seed, i):
    """States and existences of the three tracks, for every way of association."""
    page, p = tbdcore.page("ljipda_ai"), tbdcore.page("ljipda_ai").Scenario()
    plots = page.simulate(p, next(streams("ljipda_ai", seed, i)))
    found = [
        page.states(plots, page.setup(p, list(streams("ljipda_ai", seed, i))[2]), method)
        for method in page.METHODS
    ]
    return tuple(map(np.array, zip(*found, strict=True)))


def numbers(record):
    """The fields of a named tuple, but for the state after a run, as a tuple of arrays."""
    fields = record._asdict()
    fields.pop("state", None)
    return tuple(np.asarray(field, float) for field in fields.values())


TRIALS = {trial.__name__: trial for trial in (dp_tbd, mm_pf_tbd, mda_tbd, track_cfar, ljipda_ai)}


def results(paper, n, **plumbing):
    """Some trials of a paper."""
    return trials.run(TRIALS[paper], n, seed=SEED, **plumbing)
