"""A valid call of each public function of ``noise``, for the contract of arguments."""

import numpy as np

FRAMES = np.arange(24.0).reshape(2, 3, 4)
FREE = {("louder", "frames"), ("sloped", "frames")}
FREE |= {("k_survival", "power"), ("as_power", "normal")}


def rng():
    return np.random.default_rng(1)


EXAMPLES = {
    "gaussian": lambda: {"shape": (2, 3, 4), "rng": rng()},
    "exponential": lambda: {"shape": (2, 3, 4), "rng": rng()},
    "k_power": lambda: {
        "shape": (2, 3, 4),
        "nu": 2.0,
        "rng": rng(),
        "correlation": np.array([0.5, 0.0, 0.25]),
    },
    "k_survival": lambda: {"power": np.array([0.0, 1.0, 5.0]), "nu": 2.0},
    "correlated": lambda: {
        "shape": (2, 3, 4),
        "correlation": np.array([0.5, 0.0, 0.25]),
        "rng": rng(),
    },
    "as_power": lambda: {"normal": np.array([-1.0, 0.0, 2.0])},
    "louder": lambda: {"frames": FRAMES.copy(), "decibels": 3.0},
    "sloped": lambda: {"frames": FRAMES.copy(), "change": 0.5, "axis": 2},
}
