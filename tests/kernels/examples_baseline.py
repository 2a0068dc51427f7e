"""A valid call of each public function of ``baseline``, for the contract of arguments."""

import numpy as np

FRAMES = np.arange(60.0).reshape(3, 4, 5) % 7
FREE = {("grid_filter", "log_ratios"), ("recursive_maximum", "log_ratios")}
FREE |= {("matched_filter", "frames"), ("brightest", "frames"), ("masked_rmse", "error")}


def hits():
    return np.array([[True, False, True, True], [False, False, True, False]])


EXAMPLES = {
    "matched_filter": lambda: {"frames": FRAMES.copy(), "blur": np.array([0.5, 1.0])},
    "brightest": lambda: {"frames": FRAMES.copy()},
    "grid_filter": lambda: {
        "log_ratios": FRAMES / 4 - 1,
        "walk": np.array([[0.25, 0.5, 0.25]]),
        "stay": 0.75,
        "birth": 0.125,
    },
    "recursive_maximum": lambda: {"log_ratios": FRAMES / 4 - 1, "walk": 1, "memory": 0.75},
    "delay": lambda: {"hits": hits(), "start": 1},
    "mean_se": lambda: {"x": np.array([[1.0, 2.0], [3.0, 5.0], [4.0, 4.0]])},
    "masked_rmse": lambda: {
        "error": np.array([[1.0, 2.0], [3.0, 5.0]]),
        "mask": np.array([[True, False], [True, True]]),
    },
}
