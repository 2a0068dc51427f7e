"""A valid call of each public function of ``dynprog``, for the contract of arguments."""

import numpy as np

from tbdcore import dynprog


def cells():
    return np.arange(60.0).reshape(3, 5, 4) % 7.0 - 2.0


def frames():
    return {"z": dynprog.margin(cells(), 2)}


def moving():
    return {"velocities": np.array([0, 1]), "width": 2}


def weights():
    return {"position": np.array([0.5, 1.0, 0.25]), "velocity": np.array([0.5, 1.0, 0.75])}


def table():
    return {"table": np.array([[0.5, 0.75, 0.5], [1.0, 1.0, 0.25], [0.5, 0.25, 0.75]])}


def last():
    I = np.arange(2 * 3 * 3 * 6 * 5.0).reshape(2, 3, 3, 6, 5) % 11.0
    return {"I": I, "state": np.array([1, 2, 3, 2])}


FREE = {(f"{family}_path", "I") for family in ("weighted", "penalised", "coupled")}
FREE |= {("penalised_forward", "position"), ("penalised_forward", "velocity")}
FREE |= {("penalised_path", "position"), ("penalised_path", "velocity")}
FREE |= {(f"{family}_forward", "z") for family in ("box", "weighted", "penalised", "coupled")}
EXAMPLES = {
    "margin": lambda: {"frames": cells(), "width": 2},
    "box_forward": lambda: frames() | {"position": np.array([0.0, 1.0, 1.0])} | moving(),
    "weighted_forward": lambda: frames() | weights() | moving(),
    "penalised_forward": lambda: frames() | weights() | moving(),
    "coupled_forward": lambda: frames() | table() | moving(),
    "weighted_path": lambda: last() | weights() | {"lowest": -1},
    "penalised_path": lambda: last() | weights() | {"lowest": -1},
    "coupled_path": lambda: last() | table() | {"lowest": -1},
}
