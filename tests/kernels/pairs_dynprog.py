"""Kernels of ``dynprog`` beside their specifications: (name, kernel, spec, arguments)."""

import numpy as np

from tbdcore import dynprog

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


def forward(weights, lowest=LOWEST, width=4, V=2 * M, **about):
    """Arguments of a forward pass of new maps."""
    return frames(width=width, **about), *weights, (lowest, lowest + V - 1), width


def again(name, weights, cells, lowest=LOWEST, width=4, V=2 * M):
    """Arguments of a forward pass that updates the maps of frames which differ in some cells."""
    arguments = forward(weights, lowest, width, V, K=5, shape=(26, 7), lost=0.1)
    maps = getattr(dynprog, f"{name}_forward_spec")(*arguments)
    maps = maps._replace(frames=maps.frames.copy())
    z = arguments[0].copy()
    for k, i, j in cells:
        z[k, width + i, width + j] = 3.0 if z[k, width + i, width + j] < 0.0 else -3.0
    return z, *arguments[1:], maps


def back(weights, state, lowest=LOWEST, V=2 * M, **about):
    """Arguments of a path back through four value maps that need not come from any forward pass."""
    I = frames(K=4 * V * V, **about)
    return I.reshape(4, V, V, *I.shape[1:]), state, *weights, lowest


DATA = (
    *({}, {"shift": -5.0}, {"shape": (1, 1), "lost": 0.0}, {"lost": 1.0}, {"K": 1}),
    {"K": 2, "shape": (50, 50), "lost": 0.0},
)
BOXES = (
    (np.ones(7), 0, 1, 3),
    (np.ones(1), 0, 1, 2),
    (np.array([0.0, 1, 1]), LOWEST, 6, 4),
    (np.ones(3), LOWEST, 6, 5),
)
BOXES += tuple((np.ones(n), 0, 1, n // 2) for n in (9, 11, 29)) + (
    (np.array([0.0, 1, 1, 1, 1]), LOWEST, 6, 5),
)
FAMILIES = (
    ("weighted", (EQUAL, EQUAL)),
    ("weighted", (LEFT_OUT, np.array([0.0, 1.0, 0.0]))),
    ("weighted", (np.ones(3), LEFT_OUT)),
    ("penalised", (PRICE, np.array([0.2, 0.0, 0.2]))),
    ("coupled", (LITERAL,)),
)
CHANGES = (  # frame and cell: an end of the frames, a track, far apart, nothing
    *([(0, 12, 3)], [(0, 0, 0)], [(0, 25, 6)], [(4, 12, 3)], [(2, 20, 0)]),
    *([(k, 3 + 2 * k, 3) for k in range(5)], [(0, 2, 2), (3, 25, 5)], []),
)
STATES = ((0, 0, 4, 4), (5, 5, 12, 10), (2, 3, 8, 7), (5, 0, 6, 5), (0, 0, 0, 0), (5, 5, 16, 14))


def pair(name):
    """A kernel and its specification."""
    return getattr(dynprog, name), getattr(dynprog, f"{name}_spec")


CASES = [
    (
        "box_forward",
        *pair("box_forward"),
        lambda w=w, v=v, V=V, r=r, about=about: forward((w,), v, r, V, **about),
    )
    for number, (w, v, V, r) in enumerate(BOXES)
    for about in (DATA if number < 3 else DATA[:1])
]
CASES += [
    (
        f"{name}_forward",
        *pair(f"{name}_forward"),
        lambda weights=weights, about=about: forward(weights, **about),
    )
    for name, weights in FAMILIES
    for about in DATA
]
CASES += [
    (
        f"{name}_forward",
        *pair(f"{name}_forward"),
        lambda name=name, weights=weights, cells=cells, more=more: again(
            name, weights, cells, *more
        ),
    )
    for name, weights, *more in [
        *(("box", (w,), v, r, V) for w, v, V, r in BOXES),
        *FAMILIES,
    ]
    for cells in (CHANGES if name != "box" else CHANGES[::3])
]
CASES += [
    (
        f"{name}_path",
        *pair(f"{name}_path"),
        lambda w=weights, state=state, about=about: back(w, state, **about),
    )
    for name, weights in FAMILIES
    for state in STATES
    for about in ({"shift": -5.0}, {"lost": 1.0})
]
CASES += [
    (
        "weighted_path",
        *pair("weighted_path"),
        lambda V=V, v=v, w=w: back((w, np.ones(1)), (0, 0, 6, 6), v, V=V),
    )
    for w, v, V, _ in BOXES
]
