"""A valid call of each public function of ``score``, for the contract of arguments."""

import numpy as np

FREE = {("crossing", "y"), ("crossings", "curves"), ("loss_onsets", "error")}
X, CURVE = np.array([0.0, 1.0, 2.0]), np.array([1.0, 0.5, 0.0])
EXAMPLES = {
    "proportion": lambda: {"k": np.array([1.0, 2.0]), "n": np.array([4.0, 8.0])},
    "crossing": lambda: {"x": X.copy(), "y": CURVE.copy(), "level": 0.25},
    "crossings": lambda: {"x": X.copy(), "curves": np.array([CURVE, CURVE / 2]), "level": 0.25},
    "loss_onsets": lambda: {
        "error": np.array([0.0, 8.0, 8.0])[:, None, None] * np.ones(2),
        "distance": 4.0,
        "scans": 2,
        "after": 0,
    },
}
