"""A valid call of each public function of ``detection``, for the contract of arguments."""

import numpy as np

FREE = {
    (f, a)
    for f, a in (("to_db", "ratio"), ("from_db", "decibels"), ("detection_probability", "eta"))
}
EXAMPLES = {
    "to_db": lambda: {"ratio": np.array([0.5, 4.0])},
    "from_db": lambda: {"decibels": np.array([-3.0, 4.0])},
    "threshold": lambda: {"p_false": np.array([0.5, 0.25])},
    "detection_probability": lambda: {"eta": np.array([1.0, 2.0]), "snr": np.array([3.0, 4.0])},
    "required_snr": lambda: {"p_detect": np.array([0.5, 0.75]), "p_false": np.array([0.25, 0.125])},
}
