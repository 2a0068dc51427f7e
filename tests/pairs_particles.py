"""Kernels of ``particles`` beside their specifications: (name, kernel, specification, arguments)."""

import numpy as np

from tbdcore import particles


def weights(n, seed=0):
    return np.random.default_rng(seed).random(n) ** 6


CASES = [
    ("systematic", particles.systematic, particles.systematic_spec, args)
    for args in (
        lambda: (weights(400), 200, 0.3),
        lambda: (weights(50), 1000, 0.999),
        lambda: (np.array([0.0, 1.0, 0.0]), 5, 0.0),
        lambda: (np.full(10, 0.1), 10, 0.5),  # the sum rounds below one
        lambda: (np.array([0.5, 0.5, 0.0, 0.0]), 4, np.nextafter(1.0, 0.0)),
        lambda: (np.array([1.0]), 3, 0.7),
    )
]
