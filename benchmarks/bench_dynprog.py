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
from tbdcore.kernels import dp_tbd

K, GRID, M = 11, (50, 50), 3
EQUAL = np.array([0.95, 1.0, 0.95])
LITERAL = np.array([[0.95 ** (abs(m - r) + abs(r)) for r in (-1, 0, 1)] for m in (-1, 0, 1)])
SPEEDS = (1 - M, M)
SETS = {  # transition, looks per state and frame
    "conventional": (dp_tbd.box_transition(np.ones(2 * M + 1), (0, 0), M), 12),
    "Tonissen": (dp_tbd.box_transition([0, 1, 1], SPEEDS, M + 1), 4),
    "weighted": (dp_tbd.weighted_transition(EQUAL, EQUAL, SPEEDS, M + 1), 12),
    "weighted, literal": (dp_tbd.coupled_transition(LITERAL, SPEEDS, M + 1), 18),
    "penalised": (dp_tbd.penalised_transition(1 - EQUAL, 1 - EQUAL, SPEEDS, M + 1), 12),
}
ASKED = {"conventional": 60e-6, "Tonissen": 1.3e-3, "weighted": 3e-3}  # seconds of a whole trial


def trial(frames, forward, path, transition):
    """One trial: margin, forward pass, largest final state, path."""
    I = forward(dp_tbd.margin(frames, transition.setting[0]), transition)
    return path(I, np.unravel_index(I[-1].argmax(), I[-1].shape), transition)


def seconds_per_look():
    """One load and compare, from a loop of three of them per element over data in the first-level
    cache.
    """
    looked, out = np.random.default_rng(0).normal(size=2400), np.empty(800)
    return best(repeated_maximum, out, looked, 1000) / (1000 * looked.size)


@loop
def repeated_maximum(out, looked, times):
    for _ in range(times):
        dp_tbd._largest(out, 0, looked, (0, 800, 1600), 800, out[:0], 0)


def filters(z):
    """The conventional forward pass with SciPy."""
    I = z[0]
    for frame in z[1:]:
        I = frame + ndimage.maximum_filter(I, size=2 * M + 1, mode="constant", cval=-np.inf)
    return I


def rows():
    frames = np.random.default_rng(1).normal(size=(K, *GRID))
    look = seconds_per_look()
    for name, (transition, looks) in SETS.items():
        seconds = best(trial, frames, dp_tbd.forward, dp_tbd.path, transition)
        plain = dp_tbd.forward_spec, dp_tbd.path_spec
        spec = best(trial, frames, *plain, transition, repeat=1)
        _, lowest, highest = transition.setting[:3]
        states = (highest - lowest + 1) ** 2 * GRID[0] * GRID[1]
        limit = looks * states * (K - 1) * look
        peer = ("", None)
        if name == "conventional":
            peer = "scipy maximum_filter", best(filters, frames)
        work = f"trial of {K} frames, {states} states"
        yield Row(f"dp_tbd.forward ({name})", work, seconds, spec, limit, *peer, ASKED.get(name))
