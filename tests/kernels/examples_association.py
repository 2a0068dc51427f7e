"""A valid call of each public function of ``association``, for the contract of arguments."""

import numpy as np

LOG_RATIO = np.array([[1.0, -np.inf, 0.5], [-2.0, 3.0, 0.0]])


def scene():
    chances = {"existence": np.array([0.5, 0.75]), "detect": np.array([0.875, 0.5])}
    return {"log_ratio": LOG_RATIO.copy()} | chances


FREE = {(f, "log_ratio") for f in ("ipda", "prior_odds", "visibility", "modulated_log_ratio")}
FREE |= {("jipda", "log_ratio"), ("ljipda", "log_ratio"), ("gate", "z")}
EXAMPLES = {
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
    "ljipda": lambda: scene() | {"log_amplitude": np.array([[0.5, 0.25, 0.0], [1.0, -1.0, 2.0]])},
}
