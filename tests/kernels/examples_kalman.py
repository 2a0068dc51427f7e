"""A valid call of each public function of ``kalman``, for the contract of arguments."""

import numpy as np

FREE = set()
X, P = np.array([3e4, 16.0, 4e4, -8.0]), np.diag([128.0, 2.0, 64.0, 4.0]) + 0.5
H, R, Z = np.eye(4)[::2].copy(), np.array([[16.0, 1.0], [1.0, 8.0]]), np.array([5e4, 0.5])
F = np.kron(np.eye(2), [[1.0, 2.0], [0.0, 1.0]])


def one_track():
    return {"x": X.copy(), "P": P.copy()}


EXAMPLES = {
    "predict": lambda: one_track() | {"F": F.copy(), "Q": np.eye(4)},
    "polar": lambda: {"x": X.copy()},
    "polar_jacobian": lambda: {"x": X.copy()},
    "cartesian": lambda: {"z": Z.copy()},
    "residual": lambda: {"z": Z.copy(), "zhat": np.array([4e4, 0.25])},
    "innovation_covariance": lambda: {"P": P.copy(), "H": H.copy(), "R": R.copy()},
    "update": lambda: one_track() | {"y": np.array([8.0, -4.0]), "H": H.copy(), "R": R.copy()},
    "mahalanobis": lambda: {"y": np.array([8.0, -4.0]), "D": R.copy()},
    "gate_half_widths": lambda: {"g": 4.0, "D": R.copy()},
    "gate_volume": lambda: {"g": 4.0, "D": R.copy()},
    "polar_noise": lambda: {"z": Z.copy(), "R": R.copy()},
    "two_point": lambda: {
        "z1": Z.copy(),
        "z2": np.array([51200.0, 0.5]),
        "var1": np.array([16.0, 1.0]),
        "var2": np.array([8.0, 1.0]),
        "T": 2.0,
    },
}
