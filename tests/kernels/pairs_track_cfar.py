"""Cases for the false plots of a gate: in one cell, over four, over many; quiet, one alarm,
several, one in each cell.  Then for the compiled Kalman steps: tracks in three quadrants, without
process noise, with an empty residual.
"""

import numpy as np

from tbdcore.kernels import track_cfar

CELL = (150.0, 0.0349)
GATES = {
    "in a cell": ((100075.0, 0.8), (20.0, 0.003)),
    "over four cells": ((100050.0, 0.8027), (90.0, 0.02)),
    "over many cells, negative azimuth": ((250010.0, -1.3), (900.0, 0.11)),
}


def _case(name, gate, u, p_false, nth):
    about = f"false_plot {name}, u = {u}, p_false = {p_false}, number {nth}"
    return (
        about,
        track_cfar.false_plot,
        track_cfar.false_plot_spec,
        lambda: (u, (0.3, 0.8), *gate, CELL, p_false, nth),
    )


DRAWS = ((0.999, 1e-6), (0.01, 0.02), (0.0001, 0.02), (0.5, 0.9), (0.7, 1.0))
CASES = [
    _case(name, gate, *draw, n % 2)
    for name, gate in GATES.items()
    for n, draw in enumerate(DRAWS, start=len(name) % 2)
]

CASES += [  # a gate on cell borders, an empty gate, certain and impossible false alarms
    _case("between borders", ((75.0, 0.01745), (75.0, 0.01745)), 0.3, 1.0, 0),
    _case("empty", ((75.0, 0.01), (0.0, 0.0)), 0.0, 0.5, 0),
    _case("no false alarm", GATES["over four cells"], 0.0, 0.0, 0),
    _case("every cell", GATES["over four cells"], 0.0, 1.0, 3),
    _case("after the last", GATES["over four cells"], 0.5, 0.02, 7),
]


def _track(seed, x):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(4, 4)) * np.array([[50.0], [1.0], [50.0], [1.0]])
    return np.array(x), A @ A.T + np.diag([10.0, 1.0, 10.0, 1.0])


TRACKS = [
    (1, [7.0e4, 350.0, 7.2e4, 360.0]),
    (2, [-3.0e5, 1.0, -10.0, 500.0]),
    (3, [0.0, 0.0, -2.0e5, -500.0]),
]

CASES += [
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
