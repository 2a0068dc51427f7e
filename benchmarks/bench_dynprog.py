"""Dynamic programming: one trial of 11 frames of 50 x 50 cells, double precision, as the page runs
it.

A trial puts the frames into their margin, runs the forward pass, finds the largest final state and
follows its path back.  The specification is the vectorised NumPy recursion (whole planes shifted,
one maximum per predecessor); the peer, for the conventional set, is
``scipy.ndimage.maximum_filter`` (its forward pass alone).  The limit is what this machine needs to
load and compare: every state must look at 12, 4 or 18 candidates in each of ten frames, and the
time of one look is measured on a loop that does nothing else with data that stay in the first-level
cache.
"""

import numpy as np
from scipy import ndimage

from benchmarks.timing import Row, best, loop
from tbdcore import dynprog

K, GRID, M = 11, (50, 50), 3
ONE, ASIDE = np.ones(1), np.array([0.95, 1.0, 0.95])
WINDOW, SLACK = np.ones(2 * M + 1), np.array([0.0, 1.0, 1.0])
LITERAL = np.array([[0.95 ** (abs(m - r) + abs(r)) for r in (-1, 0, 1)] for m in (-1, 0, 1)])
# family of kernels, weights, velocities, lowest velocity, longest step, looks per state and frame
SETS = {
    "conventional": ("box", (WINDOW,), 1, 0, M, 12),
    "Tonissen": ("box", (SLACK,), 2 * M, 1 - M, M + 1, 4),
    "weighted": ("weighted", (ASIDE, ASIDE), 2 * M, 1 - M, M + 1, 12),
    "weighted, literal": ("coupled", (LITERAL,), 2 * M, 1 - M, M + 1, 18),
    "penalised": ("penalised", (1 - ASIDE, 1 - ASIDE), 2 * M, 1 - M, M + 1, 12),
}
ASKED = {"conventional": 60e-6, "Tonissen": 1.3e-3, "weighted": 3e-3}  # seconds of a whole trial


def trial(frames, forward, path, weights, back, I, lowest_velocity, reach):
    """One trial into the workspace I: margin, forward pass, largest final state, path."""
    z = dynprog.margin(frames, reach)
    forward(z, *weights, lowest_velocity, reach, I, np.full_like(z, np.nan))
    last = np.unravel_index(I[-1].argmax(), I[-1].shape)
    return path(I, last, *back, lowest_velocity)


def seconds_per_look():
    """One load and compare, from a loop of three of them per element over data in the first-level
    cache.
    """
    looked, out = np.random.default_rng(0).normal(size=2400), np.empty(800)
    return best(repeated_top, out, looked, 1000) / (1000 * looked.size)


@loop
def repeated_top(out, looked, times):
    for _ in range(times):
        dynprog._top(out, 0, looked, (0, 800, 1600), 800, out[:0], 0)


def filters(z):
    """The conventional forward pass with SciPy."""
    I = z[0]
    for frame in z[1:]:
        I = frame + ndimage.maximum_filter(I, size=2 * M + 1, mode="constant", cval=-np.inf)
    return I


def rows():
    frames = np.random.default_rng(1).normal(size=(K, *GRID))
    look = seconds_per_look()
    for name, (family, weights, V, lowest_velocity, reach, looks) in SETS.items():
        I = np.empty((K, V, V, *(n + 2 * reach for n in GRID)))
        forward, path = f"{family}_forward", f"{family.replace('box', 'weighted')}_path"
        path_weights = weights if family != "box" else (*weights, ONE)
        arguments = weights, path_weights, I, lowest_velocity, reach
        seconds = best(trial, frames, getattr(dynprog, forward), getattr(dynprog, path), *arguments)
        spec = best(
            trial,
            frames,
            getattr(dynprog, f"{forward}_spec"),
            getattr(dynprog, f"{path}_spec"),
            *arguments,
            repeat=1,
        )
        limit = looks * V * V * GRID[0] * GRID[1] * (K - 1) * look
        peer = (
            ("scipy maximum_filter", best(filters, frames))
            if name == "conventional"
            else ("", None)
        )
        work = f"trial of {K} frames, {V * V * GRID[0] * GRID[1]} states"
        yield Row(f"dynprog.{forward} ({name})", work, seconds, spec, limit, *peer, ASKED.get(name))
