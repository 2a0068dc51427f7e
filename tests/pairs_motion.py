"""Kernels of ``motion`` beside their specifications: (name, kernel, specification, arguments)."""

import numpy as np

from tbdcore import motion

PI = np.array([[0.9, 0.05, 0.05], [0.1, 0.8, 0.1], [0.1, 0.1, 0.8]])


def cloud(n, seed=1):
    rng = np.random.default_rng(seed)
    S = rng.normal(0.0, 2.0, (n, 5))
    S[::7, 4] = 0.0  # a turn that does not turn
    S[::11, 4] = 1e-9
    return S, rng.integers(0, 3, n), rng


def step(n, accel, T):
    S, r, rng = cloud(n)
    before = rng.integers(0, 3, n)
    a = accel * rng.standard_normal((np.count_nonzero(r), 2))
    born = rng.normal(size=(np.count_nonzero((before == 0) & (r > 0)), 5))
    return S, before, r, a, born, rng.uniform(-0.4, 0.4, np.count_nonzero((before == 1) & (r == 2))), T


CASES = [
    ("advance", motion.advance, motion.advance_spec, lambda: step(300, 0.1, 1.0)),
    ("advance", motion.advance, motion.advance_spec, lambda: step(40, 0.0, 0.25)),
    ("advance", motion.advance, motion.advance_spec, lambda: step(0, 0.1, 1.0)),
    ("regimes", motion.regimes, motion.regimes_spec, lambda: (cloud(500)[1], PI, np.random.default_rng(3).random(500))),
    ("regimes", motion.regimes, motion.regimes_spec, lambda: (np.array([0, 0, 1, 2]), PI, np.array([0.0, 0.9, 0.1, 0.2]))),
    ("regimes", motion.regimes, motion.regimes_spec, lambda: (np.zeros(0, np.int64), PI, np.zeros(0))),
    ("regimes", motion.regimes, motion.regimes_spec, lambda: (np.array([0, 1]), np.eye(2), np.array([0.5, 0.999]))),
]
