"""``mm_pf_tbd`` beside their specifications: (name, function, specification, arguments).

Those of ``blob_log_ratio`` and ``resample`` stand on the page.
"""

import numpy as np

import tbdcore
from tbdcore.kernels import mm_pf_tbd

PI = np.array([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])


def cloud(n, seed=1):
    rng = np.random.default_rng(seed)
    S = rng.normal(0.0, 2.0, (n, 5))
    S[::7, 4] = 0.0  # a turn that does not turn
    S[::11, 4] = 1e-9
    return S, rng.integers(0, 3, n), rng


TURNS = np.array([[-0.4, 0.2], [0.2, 0.1]])


def step(n, accel=0.1, T=1.0, redraw=True):
    S, r, rng = cloud(n)
    return r, S, PI, T, rng.random(n), accel * rng.standard_normal((n, 2)), TURNS, redraw


def edges():
    """Draws on the edges of the chain's intervals, from every regime."""
    S, _, _ = cloud(12)
    u = np.tile([0.0, 0.9, 0.1, np.nextafter(1.0, 0.0)], 3)
    return np.repeat([0, 1, 2], 4), S, PI, 1.0, u, np.zeros((12, 2)), TURNS, True


CASES = [
    ("transition", mm_pf_tbd.transition, mm_pf_tbd.transition_spec, args)
    for args in (
        lambda: step(500),
        lambda: step(200, accel=0.0, T=0.25),
        lambda: step(200, redraw=False),
        lambda: step(0),
        edges,
    )
]


def box(n, turns=TURNS):
    """Uniform draws, the first two at the ends of their interval."""
    u = np.random.default_rng(3).random((5, n))
    u[:, :2] = 0.0, np.nextafter(1.0, 0.0)
    return u, np.array([[0.0, 30.0], [-2.0, 4.0], [0.0, 25.0], [-2.0, 0.0], *turns])


CASES += [
    ("box_states", mm_pf_tbd.box_states, mm_pf_tbd.box_states_spec, args)
    for args in (
        lambda: box(300),
        lambda: box(50, np.array([[0.5, 0.0], [0.5, 0.0]])),
        lambda: (np.empty((5, 0)), box(2)[1]),
    )
]


def certain(regime, redraw):
    """Chains that always go to one regime, from every regime, absent particles without a state."""
    S, r, rng = cloud(30)
    S[r == 0] = np.nan if redraw or regime == 0 else 0.0
    Pi = np.tile(np.eye(3)[regime], (3, 1))
    return r, S, Pi, 0.5, rng.random(30), rng.normal(size=(30, 2)), TURNS, redraw


CASES += [
    ("transition", mm_pf_tbd.transition, mm_pf_tbd.transition_spec, lambda a=args: certain(*a))
    for args in ((0, True), (1, True), (2, True), (1, False), (2, False))
]


def blob_case(n, shape=(30, 20), blur=0.6, seed=4):
    """Particles inside, on the edges and corners, half a cell outside and far outside, and absent
    ones.
    """
    rng = np.random.default_rng(seed)
    S = rng.uniform(-3, max(shape) + 3, (n, 5))
    corners = [
        (0.5, 0.5),
        (shape[0] + 0.5, 1.0),
        (1.0, shape[1] + 0.4999),
        (0.4999, 3.0),
        (1e9, -1e9),
        (2.5, 3.5),
    ]
    for row, (x, y) in zip(S, corners, strict=False):
        row[[0, 2]] = x, y
    return rng.normal(0, 2.3, shape), S, rng.integers(0, 3, n), 8.0, blur, 2.3


CASES += [
    ("blob_log_ratio", mm_pf_tbd.blob_log_ratio, tbdcore.page("mm_pf_tbd").log_ratios, args)
    for args in (
        lambda: blob_case(500),
        lambda: blob_case(100, blur=0.9),
        lambda: blob_case(60, shape=(3, 2)),  # the patch is wider than the frame
        lambda: blob_case(0),
        lambda: blob_case(20, shape=(0, 4)),
        lambda: blob_case(50, shape=(1, 1)),
        lambda: blob_case(50, blur=0.02),
    )
]


def generation(n, M, regimes=3, seed=2, weights=None, u=0.3):
    """Particles with a few of most of the weight, or with the weights."""
    rng = np.random.default_rng(seed)
    r, S = rng.integers(0, regimes, n), rng.normal(size=(n, 5))
    W = rng.random(n) ** 6 if weights is None else np.array(weights, float)
    return r, S, W, M, u


LAST = np.nextafter(1.0, 0.0)
CASES += [
    ("resample", mm_pf_tbd.resample, tbdcore.page("mm_pf_tbd").resample, args)
    for args in (
        lambda: generation(400, 200),
        lambda: generation(20, 70),
        lambda: generation(9, 5, regimes=1),
        lambda: generation(5, 0),
        lambda: generation(50, 1000, u=0.999),
        lambda: generation(3, 5, weights=[0, 1, 0], u=0.0),
        lambda: generation(10, 10, weights=[0.1] * 10, u=0.5),  # the sum rounds below one
        lambda: generation(4, 4, weights=[0.5, 0.5, 0, 0], u=LAST),
        lambda: generation(1, 3, weights=[1.0], u=0.7),
        lambda: generation(3, 9, weights=[0, 0, 1e-190], u=0.0),
        lambda: generation(3, 9, weights=[1e190] * 3, u=0.5),
        lambda: generation(9, 4, weights=[0] * 8 + [1], u=LAST),
    )
]
