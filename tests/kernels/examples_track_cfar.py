"""A valid call of each public function of ``kernels.track_cfar``, for the contract of arguments."""

import numpy as np

FREE = set()
X, P = np.array([3e4, 16.0, 4e4, -8.0]), np.diag([128.0, 2.0, 64.0, 4.0]) + 0.5


def one_track():
    return {"x": X.copy(), "P": P.copy()}


EXAMPLES = {
    "radar_equation": lambda: {"r": np.array([1.0, 2.0]), "snr0": 3.0, "r0": 4.0},
    "false_plot": lambda: {
        "u": 0.25,
        "v": np.array([0.5, 0.25]),
        "centre": np.array([100.0, 0.5]),
        "half": np.array([50.0, 0.25]),
        "cell": np.array([10.0, 0.125]),
        "p_false": 0.125,
        "nth": 0,
    },
    "predict_cv": lambda: one_track() | {"T": 2.0, "q": 0.5},
    "gate_polar": lambda: one_track() | {"var_r": 16.0, "var_a": 0.5},
    "update_polar": lambda: one_track() | {"y_r": 8.0, "y_a": 0.5, "var_r": 16.0, "var_a": 0.5},
}
