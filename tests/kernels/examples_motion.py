"""A valid call of each public function of ``motion``, for the contract of arguments."""

import numpy as np

FREE = {("box_states", "u"), ("transition", "S"), ("transition", "a")}
OMEGAS = np.array([[-0.5, -0.25], [0.25, 0.5]])
PI = np.array([[0.5, 0.25, 0.25], [0.25, 0.5, 0.25], [0.0, 0.0, 1.0]])
EXAMPLES = {
    "cv": lambda: {"T": 2.0},
    "white_acceleration": lambda: {"T": 2.0, "q": 3.0},
    "step_acceleration": lambda: {"T": 2.0, "a": 3.0},
    "coordinated_turn": lambda: {"omega": 0.5, "T": 2.0},
    "check_transitions": lambda: {"Pi": PI.copy()},
    "box_states": lambda: {
        "u": np.full((5, 2), 0.5),
        "low": np.zeros(4),
        "width": np.ones(4),
        "omegas": OMEGAS.copy(),
    },
    "transition": lambda: {
        "r": np.array([0, 1, 2]),
        "S": np.arange(15.0).reshape(3, 5),
        "Pi": PI.copy(),
        "T": 2.0,
        "u": np.array([0.75, 0.875, 0.5]),
        "a": np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]),
        "omegas": OMEGAS.copy(),
        "redraw": True,
    },
}
