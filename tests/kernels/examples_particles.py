"""A valid call of each public function of ``particles``, for the contract of arguments."""

import numpy as np

FREE = {("normalise", "lw"), ("systematic", "W")}
FREE |= {("existence_update", "log_ratio")}
EXAMPLES = {
    "normalise": lambda: {"lw": np.array([0.0, 1.5, -2.0])},
    "existence_predict": lambda: {"P": 0.5, "p_birth": 0.25, "p_survive": 0.75},
    "existence_update": lambda: {"P": 0.5, "log_ratio": 1.5},
    "systematic": lambda: {"W": np.array([0.25, 0.5, 1.0]), "M": 5, "u": 0.5},
}
