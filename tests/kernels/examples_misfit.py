"""A valid call of each public function of ``misfit``, for the contract of arguments."""

import numpy as np

FREE = {("fit", "frames"), ("warn_misfit", "frames")}


def frames():
    return 2.0 * np.random.default_rng(1).standard_normal((2, 12, 14)) + 3.0


EXAMPLES = {
    "fit": lambda: {"frames": frames(), "law": "gaussian", "mean": 3.0, "std": 2.0},
    "warn_misfit": lambda: {"frames": frames(), "law": "gaussian", "mean": 3.0, "std": 2.0},
}
