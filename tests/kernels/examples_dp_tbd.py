"""A valid call of each public function of ``kernels.dp_tbd``, for the contract of arguments."""

import numpy as np

from tbdcore.kernels import dp_tbd


def cells():
    return np.arange(60.0).reshape(3, 5, 4) % 7.0 - 2.0


def moving():
    return {"velocities": np.array([0, 1]), "width": 2}


def weights():
    return {"position": np.array([0.5, 1.0, 0.25]), "velocity": np.array([0.5, 1.0, 0.75])}


def table():
    return {"table": np.array([[0.5, 0.75, 0.5], [1.0, 1.0, 0.25], [0.5, 0.25, 0.75]])}


def way():
    return {"transition": dp_tbd.weighted_transition(**weights(), **moving())}


FREE = {("path", "I"), ("forward", "z")}
FREE |= {("penalised_transition", "position"), ("penalised_transition", "velocity")}
EXAMPLES = {
    "margin": lambda: {"frames": cells(), "width": 2},
    "box_transition": lambda: {"position": np.array([0.0, 1.0, 1.0])} | moving(),
    "weighted_transition": lambda: weights() | moving(),
    "penalised_transition": lambda: weights() | moving(),
    "coupled_transition": lambda: table() | moving(),
    "forward": lambda: {"z": dp_tbd.margin(cells(), 2)} | way(),
    "path": lambda: {
        "I": np.arange(2 * 2 * 2 * 6 * 5.0).reshape(2, 2, 2, 6, 5) % 11.0,
        "state": np.array([1, 0, 3, 2]),
        **way(),
    },
    "point_amplitude": lambda: {"snr_db": np.array([0.0, 6.0]), "sigma": 2.0},
    "point_frames": lambda: {
        "noise": np.arange(24.0).reshape(2, 4, 3),
        "cells": np.array([[0, 2], [3, 1]]),
        "amplitude": np.array([2.0, 3.0]),
    },
}
