"""``dp_tbd`` beside their specifications: (name, kernel, spec, arguments)."""

import numpy as np

from tbdcore.kernels import dp_tbd

M = 3
LOWEST = 1 - M
EQUAL = np.array([0.95, 1.0, 0.95])
LEFT_OUT = np.array([0.0, 1.0, 0.9])
PRICE = np.array([0.3, 0.0, np.inf])
LITERAL = np.array([[0.95 ** (abs(m - r) + abs(r)) for r in (-1, 0, 1)] for m in (-1, 0, 1)])


def frames(K=3, shape=(9, 7), width=4, shift=0.0, lost=0.3, seed=3):
    """Frames in their margin; some cells, and so the states that pass through them, at -inf; all
    negative where shift says so.
    """
    rng = np.random.default_rng(seed)
    z = np.full((K, shape[0] + 2 * width, shape[1] + 2 * width), -np.inf)
    values = rng.normal(shift, 1.0, (K, *shape))
    z[:, width : width + shape[0], width : width + shape[1]] = np.where(
        rng.random(values.shape) < lost, -np.inf, values
    )
    return z


def transition(family, weights, lowest=LOWEST, width=4, V=2 * M):
    return getattr(dp_tbd, f"{family}_transition")(*weights, (lowest, lowest + V - 1), width)


def forward(family, weights, lowest=LOWEST, width=4, V=2 * M, **about):
    """Arguments of a forward pass of new maps."""
    return frames(width=width, **about), transition(family, weights, lowest, width, V)


def back(family, weights, state, lowest=LOWEST, V=2 * M, **about):
    """Arguments of a path back through four value maps that need not come from any forward pass."""
    I = frames(K=4 * V * V, **about)
    way = transition(family, weights, lowest, 40, V)
    return I.reshape(4, V, V, *I.shape[1:]), state, way


DATA = (
    *({}, {"shift": -5.0}, {"shape": (1, 1), "lost": 0.0}, {"lost": 1.0}, {"K": 1}),
    {"K": 2, "shape": (50, 50), "lost": 0.0},
)
BOXES = (  # position, lowest velocity, width of the margin, number of velocities
    (np.ones(7), 0, 3, 1),
    (np.ones(1), 0, 2, 1),
    (np.array([0.0, 1, 1]), LOWEST, 4, 6),
    (np.ones(3), LOWEST, 5, 6),
    *((np.ones(n), 0, n // 2, 1) for n in (9, 11, 29)),
    (np.array([0.0, 1, 1, 1, 1]), LOWEST, 5, 6),
)
FAMILIES = (
    ("weighted", (EQUAL, EQUAL)),
    ("weighted", (LEFT_OUT, np.array([0.0, 1.0, 0.0]))),
    ("weighted", (np.ones(3), LEFT_OUT)),
    ("penalised", (PRICE, np.array([0.2, 0.0, 0.2]))),
    ("coupled", (LITERAL,)),
)
STATES = ((0, 0, 4, 4), (5, 5, 12, 10), (2, 3, 8, 7), (5, 0, 6, 5), (0, 0, 0, 0), (5, 5, 16, 14))


FORWARD = "forward", dp_tbd.forward, dp_tbd.forward_spec
PATH = "path", dp_tbd.path, dp_tbd.path_spec
CASES = [
    (*FORWARD, lambda w=w, more=more, about=about: forward("box", (w,), *more, **about))
    for number, (w, *more) in enumerate(BOXES)
    for about in (DATA if number < 3 else DATA[:1])
]
CASES += [
    (*FORWARD, lambda family=family, w=w, about=about: forward(family, w, **about))
    for family, w in FAMILIES
    for about in DATA
]
CASES += [
    (*PATH, lambda family=family, w=w, state=state, about=about: back(family, w, state, **about))
    for family, w in FAMILIES
    for state in STATES
    for about in ({"shift": -5.0}, {"lost": 1.0})
]
CASES += [
    (*PATH, lambda w=w, v=v, V=V: back("box", (w,), (0, 0, 6, 6), v, V)) for w, v, _, V in BOXES
]
