"""Dynamic programming: one trial of 11 frames of 50 x 50 cells, double precision, forward pass, argmax and back-trace.

The specification is the vectorised NumPy recursion (whole planes shifted, one maximum per predecessor); the peer, for the
conventional set, is ``scipy.ndimage.maximum_filter``.  The limit is what this machine needs to load and compare: every state must
look at 14, 4 or 12 candidates in each of ten frames, and the time of one look is measured on a loop that does nothing else
with data that stay in the first-level cache.
"""

import numpy as np
from scipy import ndimage

from benchmarks.timing import Row, best
from tbdcore import dynprog, kernel

K, GRID, M = 11, (50, 50), 3
ONE, ASIDE = np.ones(1), np.array([0.95, 1.0, 0.95])
WINDOW, SLACK = np.ones(2 * M + 1), np.array([0.0, 1.0, 1.0])
LITERAL = np.array([[0.95 ** (abs(m - r) + abs(r)) for r in (-1, 0, 1)] for m in (-1, 0, 1)])
SETS = {  # stage, weights, velocities, slowest, longest step, looks per state and frame
    "conventional": ("box_stage", (WINDOW,), 1, 0, M, 14),
    "Tonissen": ("box_stage", (SLACK,), 2 * M, 1 - M, M + 1, 4),
    "weighted": ("weighted_stage", (ASIDE, ASIDE), 2 * M, 1 - M, M + 1, 12),
    "weighted, literal": ("coupled_stage", (LITERAL,), 2 * M, 1 - M, M + 1, 18),
    "penalised": ("penalised_stage", (1 - ASIDE, 1 - ASIDE), 2 * M, 1 - M, M + 1, 12),
}


def trial(z, stage, weights, I, slowest, reach, back):
    """One trial into the workspace I: forward pass, largest final state, path."""
    I[0] = z[0]
    for k in range(1, K):
        stage(I[k - 1], z[k], *weights, slowest, reach, I[k])
    path = [np.unravel_index(I[-1].argmax(), I[-1].shape)]
    for k in range(K - 2, -1, -1):
        path.append(back(I[k], path[-1]))
    return path


def step_back(name, weights, slowest):
    """The back-trace that belongs to a stage."""
    if name == "box_stage":
        return lambda I, x: dynprog.weighted_predecessor(I, x, *weights, ONE, slowest)
    back = getattr(dynprog, name.replace("stage", "predecessor"))
    return lambda I, x: back(I, x, *weights, slowest)


def seconds_per_look():
    """One load and compare, from a loop of three of them per element over data in the first-level cache."""
    a, b, c, out = np.random.default_rng(0).normal(size=(4, 800))
    return best(repeated_top, out, a, b, c, 1000) / (1000 * 3 * a.size)


@kernel
def repeated_top(out, a, b, c, times):
    for _ in range(times):
        dynprog._top(out, a, b, c)


def filters(z):
    """The conventional forward pass with SciPy."""
    I = z[0]
    for frame in z[1:]:
        I = frame + ndimage.maximum_filter(I, size=2 * M + 1, mode="constant", cval=-np.inf)
    return I


def rows():
    frames = np.random.default_rng(1).normal(size=(K, *GRID))
    look = seconds_per_look()
    for name, (stage, weights, V, slowest, reach, looks) in SETS.items():
        z = dynprog.margin(frames, reach)
        I = np.empty((K, V, V, *z.shape[1:]))
        arguments = weights, I, slowest, reach, step_back(stage, weights, slowest)
        seconds = best(trial, z, getattr(dynprog, stage), *arguments)
        spec = best(trial, z, getattr(dynprog, f"{stage}_spec"), *arguments, repeat=1)
        limit = looks * V * V * GRID[0] * GRID[1] * (K - 1) * look
        peer = ("scipy maximum_filter", best(filters, frames)) if name == "conventional" else ("", None)
        yield Row(
            f"dynprog.{stage} ({name})", f"trial of {K} frames, {V * V * GRID[0] * GRID[1]} states", seconds, spec, limit, *peer
        )
