"""A valid call of each public function of ``kernels.mda_tbd``, for the contract of arguments."""

import numpy as np

from tbdcore.kernels import mda_tbd

SPREAD = mda_tbd.Spread(1.5, 0.25, 1, 2)
GRID = mda_tbd.PolarGrid(1000.0, 0.5, 10.0, 0.125, 8, 6)


def power():
    return np.arange(1.0, 49.0).reshape(8, 6) / 16.0


def particles():
    return {"z": power(), "rho": np.array([2.25, 4.0, 7.5]), "alpha": np.array([1.0, 3.25, 5.5])}


def intense():
    return particles() | {"snr": np.array([4.0, 0.0, 2.5]), "spread": SPREAD}


FREE = {("cell_power", "z"), ("inherit", "H"), ("ospa_bernoulli", "x"), ("ospa_bernoulli", "truth")}
FREE |= {("add_target", name) for name in ("rho", "alpha", "power")}
FREE |= {("polar_cells", "x"), ("polar_cells", "y")}
for function in ("power_log_ratio", "coherent_log_ratio", "patch_fit", "cell_power"):
    FREE |= {(function, "rho"), (function, "alpha")}
EXAMPLES = {
    "polar_grid": lambda: {
        **{"r_min": 1000.0, "r_max": 1080.0, "a_min": 0.5, "a_max": 1.25},
        **{"dr": 10.0, "da": 0.125},
    },
    "polar_cells": lambda: {
        "x": np.array([800.0, 600.0]),
        "y": np.array([600.0, 850.0]),
        "grid": GRID,
    },
    "spread_power": lambda: {"rho": 2.25, "alpha": 3.0, "spread": SPREAD, "shape": [4, 6]},
    "spread_area": lambda: {"spread": SPREAD},
    "noise_power": lambda: {"shape": [2, 3, 4], "rng": np.random.default_rng(1)},
    "add_target": lambda: {
        "z": np.stack((power(), power())),
        "rho": np.array([2.0, 3.5]),
        "alpha": np.array([1.0, 4.5]),
        "power": np.array([4.0, 2.0]),
        "spread": SPREAD,
        "rng": np.random.default_rng(1),
    },
    "power_log_ratio": intense,
    "coherent_log_ratio": lambda: intense() | {"step": 0.5},
    "cell_power": particles,
    "patch_fit": lambda: particles() | {"spread": SPREAD},
    "inherit": lambda: {
        "H": np.arange(12.0).reshape(2, 2, 3),
        "age": np.array([1, 2, 3]),
        "ancestors": np.array([0, 2, 2]),
        "births": 2,
    },
    "ospa_bernoulli": lambda: {
        "x": np.array([[1.0, 2.0], [3.0, 4.0]]),
        "existence": np.array([1.0, 0.0]),
        "truth": np.array([[4.0, 6.0], [5.0, 5.0]]),
        "c": 8.0,
        "threshold": 0.5,
    },
    "column_test": lambda: {
        "measured": np.array([1.0, 2.0]),
        "printed": np.array([1.5, 2.5]),
        "covariance": np.array([[1.0, 0.25], [0.25, 2.0]]),
        "ratio": 0.5,
        "half": 0.25,
    },
}
