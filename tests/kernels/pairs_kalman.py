"""``two_point`` beside its specification: (name, function, specification, arguments)."""

import numpy as np

from tbdcore import kalman

CASES = [
    (
        "two_point",
        kalman.two_point,
        kalman.two_point_spec,
        lambda: (
            np.array([9e4, 0.8]),
            np.array([9.5e4, 0.81]),
            np.array([9.0, 5e-7]),
            np.array([10.0, 6e-7]),
            10.0,
        ),
    ),
    (
        "two_point, plots without error",
        kalman.two_point,
        kalman.two_point_spec,
        lambda: (np.array([9e4, 0.8]), np.array([9.5e4, -3.0]), np.zeros(2), np.zeros(2), 0.5),
    ),
]
