"""A valid call of each public function of ``score``, for the contract of arguments."""

import numpy as np

FREE = {
    ("crossing", "y"),
    ("crossings", "curves"),
    ("loss_onsets", "error"),
    ("kept_rmse", "error"),
}
FREE |= {("ospa_bernoulli", "x"), ("ospa_bernoulli", "truth")}
X, CURVE = np.array([0.0, 1.0, 2.0]), np.array([1.0, 0.5, 0.0])
EXAMPLES = {
    "proportion": lambda: {"k": np.array([1.0, 2.0]), "n": np.array([4.0, 8.0])},
    "crossing": lambda: {"x": X.copy(), "y": CURVE.copy(), "level": 0.25},
    "crossings": lambda: {"x": X.copy(), "curves": np.array([CURVE, CURVE / 2]), "level": 0.25},
    "ospa_bernoulli": lambda: {
        "x": np.array([[1.0, 2.0], [3.0, 4.0]]),
        "existence": np.array([1.0, 0.0]),
        "truth": np.array([[4.0, 6.0], [5.0, 5.0]]),
        "c": 8.0,
        "threshold": 0.5,
    },
    "loss_onsets": lambda: {
        "error": np.array([0.0, 8.0, 8.0])[:, None, None] * np.ones(2),
        "distance": 4.0,
        "scans": 2,
        "after": 0,
    },
    "kept_rmse": lambda: {
        "error": np.arange(8.0).reshape(2, 2, 1, 2),
        "kept": np.array([[True], [True]]),
    },
    "column_test": lambda: {
        "measured": np.array([1.0, 2.0]),
        "printed": np.array([1.5, 2.5]),
        "covariance": np.array([[1.0, 0.25], [0.25, 2.0]]),
        "ratio": 0.5,
        "half": 0.25,
    },
}
