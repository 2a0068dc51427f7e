"""Kernels of ``dynprog`` beside their specifications: (name, kernel, specification, arguments)."""

import numpy as np

from tbdcore import dynprog

M = 3
SLOWEST = 1 - M
ASIDE = np.array([0.95, 1.0, 0.95])
LEFT_OUT = np.array([0.0, 1.0, 0.9])
PRICE = np.array([0.3, 0.0, np.inf])
LITERAL = np.array([[0.95 ** (abs(m - r) + abs(r)) for r in (-1, 0, 1)] for m in (-1, 0, 1)])


def maps(V=2 * M, shape=(9, 7), reach=4, shift=0.0, lost=0.3, seed=3):
    """A value map, a frame and a place for the result; some states unreachable, everything negative where shift says so."""
    rng = np.random.default_rng(seed)
    inside = (slice(reach, reach + shape[0]), slice(reach, reach + shape[1]))
    full = tuple(n + 2 * reach for n in shape)
    previous, frame = np.full((V, V, *full), -np.inf), np.full(full, -np.inf)
    values = rng.normal(shift, 1.0, (V, V, *shape))
    previous[(..., *inside)] = np.where(rng.random(values.shape) < lost, -np.inf, values)
    frame[inside] = rng.normal(shift, 1.0, shape)
    return previous, frame, np.full_like(previous, np.nan)


def stage(weights, slowest=SLOWEST, reach=4, **about):
    """Arguments of a forward stage."""
    previous, frame, out = maps(reach=reach, **about)
    return previous, frame, *weights, slowest, reach, out


def back(weights, state, slowest=SLOWEST, **about):
    """Arguments of a back-trace step."""
    return maps(**about)[0], state, *weights, slowest


DATA = ({}, {"shift": -5.0}, {"shape": (1, 1), "lost": 0.0}, {"lost": 1.0}, {"shape": (50, 50), "lost": 0.0})
BOXES = ((np.ones(7), 0, 1, 3), (np.ones(1), 0, 1, 2), (np.array([0.0, 1, 1]), SLOWEST, 6, 4), (np.ones(3), SLOWEST, 6, 5))
FAMILIES = (
    ("weighted", (ASIDE, ASIDE)),
    ("weighted", (LEFT_OUT, np.array([0.0, 1.0, 0.0]))),
    ("weighted", (np.ones(3), LEFT_OUT)),
    ("penalised", (PRICE, np.array([0.2, 0.0, 0.2]))),
    ("coupled", (LITERAL,)),
)
STATES = ((0, 0, 4, 4), (5, 5, 12, 10), (2, 3, 8, 7), (5, 0, 6, 5))


def pair(name):
    """A kernel and its specification."""
    return getattr(dynprog, name), getattr(dynprog, f"{name}_spec")


CASES = [
    ("box_stage", *pair("box_stage"), lambda w=w, v=v, V=V, r=r, about=about: stage((w,), v, r, V=V, **about))
    for w, v, V, r in BOXES
    for about in DATA
]
CASES += [
    (f"{name}_stage", *pair(f"{name}_stage"), lambda weights=weights, about=about: stage(weights, **about))
    for name, weights in FAMILIES
    for about in DATA
]
CASES += [
    (f"{name}_predecessor", *pair(f"{name}_predecessor"), lambda w=weights, state=state, about=about: back(w, state, **about))
    for name, weights in FAMILIES
    for state in STATES
    for about in ({}, {"shift": -5.0}, {"lost": 1.0})
]
CASES += [
    ("weighted_predecessor", *pair("weighted_predecessor"), lambda V=V, v=v, w=w: back((w, np.ones(1)), (0, 0, 6, 6), v, V=V))
    for w, v, V, _ in BOXES
]
