"""Cases for the false plots of a gate: in one cell, over four, over many; quiet, one alarm,
several, one in each cell.
"""

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
