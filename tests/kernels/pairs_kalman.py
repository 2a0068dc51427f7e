"""Cases for the compiled Kalman steps: tracks in three quadrants, without process noise, with an
empty residual.
"""

import numpy as np

from tbdcore import kalman
from tbdcore.kernels import track_cfar


def _track(seed, x):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4)) * np.array([[50.0], [1.0], [50.0], [1.0]])
    return np.array(x), A @ A.T + np.diag([10.0, 1.0, 10.0, 1.0])


TRACKS = [
    (1, [7.0e4, 350.0, 7.2e4, 360.0]),
    (2, [-3.0e5, 1.0, -10.0, 500.0]),
    (3, [0.0, 0.0, -2.0e5, -500.0]),
]

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
] + [
    case
    for seed, x in TRACKS
    for case in (
        (
            "predict_cv",
            track_cfar.predict_cv,
            track_cfar.predict_cv_spec,
            lambda s=seed, x=x: (*_track(s, x), 10.0, 0.01),
        ),
        (
            "predict_cv, no noise",
            track_cfar.predict_cv,
            track_cfar.predict_cv_spec,
            lambda s=seed, x=x: (*_track(s, x), 10.0, 0.0),
        ),
        (
            "gate_polar",
            track_cfar.gate_polar,
            track_cfar.gate_polar_spec,
            lambda s=seed, x=x: (*_track(s, x), 400.0, 1e-6),
        ),
        (
            "update_polar",
            track_cfar.update_polar,
            track_cfar.update_polar_spec,
            lambda s=seed, x=x: (*_track(s, x), 30.0, -1e-4, 400.0, 1e-6),
        ),
        (
            "update_polar, empty residual",
            track_cfar.update_polar,
            track_cfar.update_polar_spec,
            lambda s=seed, x=x: (*_track(s, x), 0.0, 0.0, 1.0, 1e-8),
        ),
    )
]
CASES += [
    (
        "two_point, plots without error",
        kalman.two_point,
        kalman.two_point_spec,
        lambda: (np.array([9e4, 0.8]), np.array([9.5e4, -3.0]), np.zeros(2), np.zeros(2), 0.5),
    ),
    (
        "predict_cv, no time and no covariance",
        track_cfar.predict_cv,
        track_cfar.predict_cv_spec,
        lambda: (np.array([1.0, 2.0, 3.0, 4.0]), np.zeros((4, 4)), 0.0, 0.0),
    ),
    (
        "update_polar, a certain track",
        track_cfar.update_polar,
        track_cfar.update_polar_spec,
        lambda: (np.array([1e4, 2.0, 3e4, 4.0]), np.zeros((4, 4)), 30.0, 1e-4, 400.0, 1e-6),
    ),
]
