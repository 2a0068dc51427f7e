"""A valid call of each public function of ``kernels.ljipda_ai``, for the contract of arguments."""

import numpy as np

X, P = np.array([3e4, 16.0, 4e4, -8.0]), np.diag([128.0, 2.0, 64.0, 4.0]) + 0.5
F, R = np.kron(np.eye(2), [[1.0, 2.0], [0.0, 1.0]]), np.array([[16.0, 1.0], [1.0, 8.0]])
LOG_RATIO = np.array([[1.0, -np.inf, 0.5], [-2.0, 3.0, 0.0]])


def scene():
    chances = {"existence": np.array([0.5, 0.75]), "detect": np.array([0.875, 0.5])}
    return {"log_ratio": LOG_RATIO.copy()} | chances


def two(a):
    """The same for two tracks."""
    return np.array([a, a])


def tracks():
    return {"x": two(X), "P": two(P)}


FREE = {(f, "log_ratio") for f in ("ipda", "prior_odds", "visibility", "modulated_log_ratio")}
FREE |= {("jipda", "log_ratio"), ("ljipda", "log_ratio"), ("gate", "z"), ("kept_rmse", "error")}
FREE |= {("clustered_jipda", "log_ratio")}
EXAMPLES = {
    "look": lambda: {
        "z": np.array([[1.0, 2.0], [9.0, 9.0], [3.0, 1.0]]),
        "gated": np.array([0, 2]),
        "zhat": np.array([[1.0, 1.0], [2.0, 2.0]]),
        "S": np.array([[[4.0, 1.0], [1.0, 2.0]], [[2.0, 0.0], [0.0, 1.0]]]),
        "beta": np.array([[0.5, 0.25, 0.25], [0.25, 0.5, 0.25]]),
        "expected": np.array([0.5, 0.75]),
        "gamma": 9.0,
    },
    "gate": lambda: {
        "z": np.array([[1.0, 2.0], [9.0, 9.0], [3.0, 1.0]]),
        "zhat": np.array([[0.0, 0.0], [2.0, 2.0]]),
        "S": np.array([[[4.0, 1.0], [1.0, 2.0]], [[2.0, 0.0], [0.0, 1.0]]]),
        "gamma": 4.0,
        "p_gate": 0.5,
    },
    "ipda": scene,
    "prior_odds": scene,
    "visibility": scene,
    "modulated_log_ratio": scene,
    "jipda": scene,
    "clustered_jipda": scene,
    "other_order": lambda: {"x": two(X), "F": np.eye(4)},
    "ljipda": lambda: scene() | {"log_amplitude": np.array([[0.5, 0.25, 0.0], [1.0, -1.0, 2.0]])},
    "kept_rmse": lambda: {
        "error": np.arange(8.0).reshape(2, 2, 1, 2),
        "kept": np.array([[True], [True]]),
    },
    "amplitude_ratio": lambda: {"excess": np.array([0.0, 0.5, 2.0]), "snr": np.array([3.0, 4.0])},
    "predict_tracks": lambda: tracks() | {"F": two(F), "Q": np.eye(4)},
    "gate_tracks": lambda: tracks() | {"var_r": 16.0, "var_a": 0.5},
    "update_mixture": lambda: (
        tracks()
        | {"D": two(R), "z": X[None, ::2] + 8.0, "beta": np.array([[0.25, 0.75], [1.0, 0.0]])}
    ),
    "position_bound": lambda: {"F": two(F)[None], "R": two(two(R)), "P": two(P), "p_detect": 0.5},
}
