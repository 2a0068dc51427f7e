"""A valid call of each public function of ``kernels.mm_pf_tbd``, for the contract of arguments."""

import numpy as np

FREE = {("blob_image", "x"), ("blob_image", "y"), ("blob_log_ratio", "S"), ("box_states", "u")}
FREE |= {("transition", "S"), ("transition", "a"), ("resample", "S"), ("resample", "W")}
TURNS = np.array([[-0.5, 0.25], [0.25, 0.25]])
PI = np.array([[0.5, 0.25, 0.25], [0.25, 0.5, 0.25], [0.0, 0.0, 1.0]])
EXAMPLES = {
    "blob_peak": lambda: {"intensity": 18.0, "blur": 0.5, "delta": 2.0},
    "blob_image": lambda: {
        "x": np.array([2.0, 3.5]),
        "y": np.array([1.0, 2.5]),
        "peak": 4.0,
        "blur": 0.5,
        "shape": np.array([5, 4]),
    },
    "blob_log_ratio": lambda: {
        "z": np.arange(1.0, 49.0).reshape(8, 6) / 16.0,
        "S": np.array([[2.0, 0.5, 3.0], [4.25, 1.0, 5.0], [7.0, 0.0, 1.5]]),
        "r": np.array([1, 2, 0]),
        "peak": 4.0,
        "blur": 0.5,
        "noise": 2.0,
    },
    "check_transitions": lambda: {"Pi": PI.copy()},
    "box_states": lambda: {
        "u": np.full((5, 2), 0.5),
        "law": np.concatenate([[[0.0, 1.0]] * 4, TURNS]),
    },
    "transition": lambda: {
        "r": np.array([0, 1, 2]),
        "S": np.arange(15.0).reshape(3, 5),
        "Pi": PI.copy(),
        "T": 2.0,
        "u": np.array([0.75, 0.875, 0.5]),
        "a": np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]),
        "turns": TURNS.copy(),
        "redraw": True,
    },
    "resample": lambda: {
        "r": np.array([0, 1, 2]),
        "S": np.arange(15.0).reshape(3, 5),
        "W": np.array([0.25, 0.5, 1.0]),
        "M": 5,
        "u": 0.5,
    },
}
