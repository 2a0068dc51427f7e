"""A valid call of each public function of ``recording``, for the contract of arguments."""

from typing import NamedTuple

import numpy as np
from scipy import stats

from tbdcore.recording import Level, background, threshold

FREE = {(f, "frames") for f in ("background", "clipped", "normalise", "normal_scores", "blocks")}
FREE |= {(f, "frames") for f in ("plots", "blur_of", "bin_cells", "inject")}
FREE |= {(f, "frames") for f in ("kept", "outcome", "windows")}
FREE |= {("empirical_law", "noise"), ("inject", "path")}


def frames(*shape):
    return np.random.default_rng(1).standard_normal(shape or (12, 6, 7)) + 3.0


class State(NamedTuple):
    """Of a tracker that only predicts."""

    x: np.ndarray
    P: np.ndarray
    existence: np.ndarray


def started(x, P):
    return State(x, P, np.full(len(x), 0.5))


def predicted(state, scan, T):
    weights = np.zeros((len(state.x), 1 + (0 if scan is None else len(scan))))
    return state._replace(x=state.x + T * np.roll(state.x * [0, 1, 0, 1], -1, axis=1)), weights


EXAMPLES = {
    "cartesian": lambda: {"scan": np.array([[1000.0, 0.5, 12], [2000, -3.0, 9]])},
    "follow": lambda: {
        "scans": [np.array([[3.0 * k, 100.0], [500.0, -40 * k]]) for k in range(5)],
        "t": np.arange(5.0),
        "fastest": 4.0,
        "sigma": 0.5,
        "start": started,
        "step": predicted,
        "low_scans": 3,
    },
    "background": lambda: {"frames": frames()},
    "clipped": lambda: {"frames": frames(), "law": "gaussian", "size": 5},
    "normalise": lambda: {"frames": frames(), "at": Level(3.0, 1.0)},
    "empirical_law": lambda: {"noise": frames(3, 30, 30), "tail": 0.125},
    "normal_scores": lambda: {"frames": frames(), "law": stats.norm(3.0, 1.0)},
    "blocks": lambda: {"frames": frames(40, 3, 3), "K": 4, "step": 1},
    "threshold": lambda: {
        "peaks": np.arange(80.0).reshape(40, 2),
        "p_false": 0.125,
        "independent": 30,
        "tail": "gumbel",
    },
    "windows": lambda: {
        "frames": frames(20, 12, 12),
        "K": 4,
        "side": np.array([4.0, 3.0]),
    },
    "suspects": lambda: {
        "peaks": np.array([3.0, 4.0, 19.0]),
        "white": np.linspace(3.0, 4.0, 12),
    },
    "outcome": lambda: {
        "frames": frames(20, 12, 12) - 3.0,
        "level": threshold(np.linspace(3.0, 4.0, 40), 0.1),
        "peaks": np.linspace(3.0, 4.0, 40),
        "white": np.linspace(3.0, 4.5, 40),
        "control": np.linspace(3.0, 4.25, 40),
        "law": "gaussian",
    },
    "kept": lambda: {
        "frames": 100 * frames(40, 12, 12),
        "speed": 1.0,
        "strength": 900.0,
        "blur": 0.5,
        "prepare": background,
        "rng": np.random.default_rng(1),
    },
    "plots": lambda: {
        "frames": frames(1, 6, 7),
        "eta": 4.0,
        "law": "gaussian",
        "origin": np.array([1000.0, 0.5]),
        "cell": np.array([10.0, 0.25]),
        "level": True,
    },
    "merge_plots": lambda: {"scan": np.array([[0.0, 0, 1], [3, 0, 5], [9, 0, 2]]), "distance": 4.0},
    "noise_unit": lambda: {"amplitudes": np.linspace(3.0, 9.0, 40), "tau": 2.0, "told": 4.0},
    "starts": lambda: {
        "scans": [np.array([[0.0, 0], [9, 9]]), np.array([[1.0, 0]]), np.array([[2.0, 0], [5, 5]])],
        "t": np.array([0.0, 1.0, 2.0]),
        "fastest": 8.0,
        "sigma": 0.5,
    },
    "blur_of": lambda: {"frames": frames(20, 12, 12), "law": "gaussian", "eta": 4.0, "half": 2},
    "bin_cells": lambda: {"frames": frames(), "n": 2},
    "inject": lambda: {
        "frames": frames(3, 6, 7),
        "path": np.array([[1.0, 2.0], [2.0, 2.5], [3.0, 3.0]]),
        "strength": 4.0,
        "blur": 0.5,
        "rng": np.random.default_rng(1),
    },
}
