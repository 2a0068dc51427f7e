"""A valid call of each public function of ``motion``, for the contract of arguments."""

FREE = set()
EXAMPLES = {
    "cv": lambda: {"T": 2.0},
    "white_acceleration": lambda: {"T": 2.0, "q": 3.0},
    "step_acceleration": lambda: {"T": 2.0, "a": 3.0},
    "coordinated_turn": lambda: {"omega": 0.5, "T": 2.0},
}
