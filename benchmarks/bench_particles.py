"""Particles: the kernels of a particle filter on 4000 particles, and whole trials of 60 frames of
30 x 20 cells.

The peer of the kernels is vectorised NumPy, written as one would without a compiler: all patches
gathered in one array, masks for the regimes, a sorted search for the resampling, indices for the
copies.  The trials are those of the page ``mm_pf_tbd``; their peer is the same page with these
functions in the place of the kernels, so that both columns draw the same random numbers and do the
same work.  Asked are 10 and 25 ms for a trial.
"""

from dataclasses import replace
from unittest.mock import patch

import numpy as np

import tbdcore
from benchmarks.timing import Row, best
from tbdcore import particles
from tbdcore.kernels import mm_pf_tbd

N, PI = 4000, np.array([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])
PEAK, BLUR, NOISE = mm_pf_tbd.blob_peak(18.0, 0.6), 0.6, 2.3


def log_ratio(z, S, r, peak, blur, noise):
    """Vectorised NumPy: every patch of 5 x 5 cells gathered at once."""
    x, y = S[:, 0], S[:, 2]
    on = np.flatnonzero(
        (r > 0) & (x >= 0.5) & (x < z.shape[0] + 0.5) & (y >= 0.5) & (y < z.shape[1] + 0.5)
    )
    x, y, m = x[on], y[on], np.arange(-2, 3)
    i, j = (np.floor(v + 0.5).astype(int)[:, None] + m for v in (x, y))
    gx, gy = (np.exp(-((c - v[:, None]) ** 2) / (2 * blur**2)) for c, v in ((i, x), (j, y)))
    gx *= (i >= 1) & (i <= z.shape[0])
    gy *= (j >= 1) & (j <= z.shape[1])
    h = peak * gx[:, :, None] * gy[:, None, :]
    cells = z[
        np.clip(i - 1, 0, z.shape[0] - 1)[:, :, None], np.clip(j - 1, 0, z.shape[1] - 1)[:, None, :]
    ]
    out = np.zeros(len(r))
    out[on] = (h * (2 * cells - h)).sum(axis=(1, 2)) / (2 * noise**2)
    return out


def transition(r, S, Pi, T, u, a, turns, redraw):
    """Vectorised NumPy: the chain by one comparison, both regimes at once, sin and cos of whole
    columns.
    """
    C = np.cumsum(Pi, axis=1)
    after, born = (u[:, None] >= C[r, :-1]).sum(axis=1), np.empty(0, np.int64)
    live = after > 0
    if redraw:
        born = np.flatnonzero((r == 0) & live)
        live[born] = False
    begins = (r == 1) & (after == 2)
    (low, left), (right, width) = turns
    v = low + (u[begins] - C[1, 1]) / (1 - C[1, 1]) * (left + width)
    S[begins, 4] = v + (right - low - left) * (v > low + left)
    on = np.flatnonzero(live)
    x, vx, y, vy, w = S[on].T
    h = 0.5 * T * np.where(after[on] == 2, w, 0.0)
    f = T * np.sinc(h / np.pi)
    along, aside, c, s = f * np.cos(h), f * np.sin(h), np.cos(2 * h), np.sin(2 * h)
    ax, ay = a[on].T
    columns = (x + along * vx - aside * vy + T * T / 2 * ax, c * vx - s * vy + T * ax)
    columns += (y + aside * vx + along * vy + T * T / 2 * ay, s * vx + c * vy + T * ay, w)
    S[on] = np.column_stack(columns)
    return after, born, S


def resample(r, S, W, M, u):
    """Vectorised NumPy: a sorted search, indices, means."""
    ancestors = particles.systematic_spec(W, M, u)
    r, S = r[ancestors], S[ancestors]
    alive = r > 0
    mean = S[alive].mean(axis=0) if alive.any() else np.full(S.shape[1], np.nan)
    counts, distinct = np.bincount(r, minlength=3), np.unique(ancestors[alive]).size
    return mm_pf_tbd.Resampled(ancestors, r, S, counts, mean, distinct)


NUMPY = {
    "blob_log_ratio": log_ratio,
    "transition": transition,
    "box_states": mm_pf_tbd.box_states_spec,
    "systematic": particles.systematic_spec,
    "resample": resample,
}
BY_NAME = {"blob_log_ratio"}  # the page imports it by name
OF_MODULE = {
    name: function
    for name, function in NUMPY.items()
    if hasattr(mm_pf_tbd, name) and name not in BY_NAME
}
OF_PARTICLES = {name: function for name, function in NUMPY.items() if hasattr(particles, name)}
OF_PAGE = {name: NUMPY[name] for name in NUMPY.keys() - OF_MODULE.keys() - OF_PARTICLES.keys()}


def cloud():
    """4000 living particles around a target, a frame, and the draws of one step."""
    rng = np.random.default_rng(1)
    S = np.array([15.2, 0.4, 10.3, 0.1, 0.3]) + 0.4 * rng.normal(size=(N, 5))
    return rng, S, rng.integers(1, 3, N), rng.normal(0.0, NOISE, (30, 20))


def kernels():
    """The kernels, their specifications and arguments."""
    rng, S, r, z = cloud()
    u, a, turns = rng.random(N), rng.normal(0.0, 0.1, (N, 2)), np.array([[-0.4, 0.2], [0.2, 0.2]])
    lw = mm_pf_tbd.blob_log_ratio(z, S, r, PEAK, BLUR, NOISE)
    W, _ = particles.normalise(lw)
    law = np.array([[0.0, 30.0], [-2.0, 4.0], [0.0, 25.0], [-2.0, 4.0], *turns])
    page = tbdcore.page("mm_pf_tbd")
    yield mm_pf_tbd.blob_log_ratio, page.log_ratios, (z, S, r, PEAK, BLUR, NOISE)
    yield (
        mm_pf_tbd.transition,
        mm_pf_tbd.transition_spec,
        (r, S.copy(), PI, 1.0, u, a, turns, True),
    )
    yield mm_pf_tbd.box_states, mm_pf_tbd.box_states_spec, (rng.random((5, N)), law)
    yield particles.systematic, particles.systematic_spec, (W, N // 2, 0.3)
    yield mm_pf_tbd.resample, page.resample, (r, S, W, N // 2, 0.3)


def trials():
    """Filters of the page and the seconds that a trial of theirs may take."""
    page = tbdcore.page("mm_pf_tbd")
    improved = page.Scenario()
    z = page.simulate(page.Scene(), np.random.default_rng(2))
    yield "classic, 2000", page, page.recursion, replace(improved, M_new=0), z, 10e-3
    yield "improved, 2000 + 2000", page, page.recursion, improved, z, 25e-3
    mapped = replace(improved, M_new=500)
    yield "Bernoulli, 2000 + 500", page, page.bernoulli_recursion, mapped, z, None


def rows():
    """The rows of the table: kernels, then whole trials."""
    for kernel, spec, args in kernels():
        peer = best(NUMPY[kernel.__name__], *args)
        where = kernel.__module__.rpartition(".")[2]
        yield Row(
            f"{where}.{kernel.__name__}",
            f"{N} particles",
            best(kernel, *args),
            best(spec, *args, repeat=1),
            None,
            "vectorised NumPy",
            peer,
        )
    for name, page, run, p, z, asked in trials():
        of_core = patch.multiple(mm_pf_tbd, **OF_MODULE), patch.multiple(particles, **OF_PARTICLES)
        with patch.multiple(page, **OF_PAGE), of_core[0], of_core[1]:
            peer = best(run, z, p, np.random.default_rng(3))
        seconds = best(run, z, p, np.random.default_rng(3), repeat=20)
        yield Row(name, "60 frames", seconds, None, None, "vectorised NumPy", peer, asked)
