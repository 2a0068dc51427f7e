"""Kernels of ``sensor`` beside their specifications: (name, kernel, specification, arguments)."""

import numpy as np

from tbdcore import sensor


def blob_case(n, shape=(30, 20), blur=0.6, seed=4):
    """Particles inside, on the edges and corners, half a cell outside and far outside, and absent ones."""
    rng = np.random.default_rng(seed)
    S = rng.uniform(-3, max(shape) + 3, (n, 5))
    corners = [(0.5, 0.5), (shape[0] + 0.5, 1.0), (1.0, shape[1] + 0.4999), (0.4999, 3.0), (1e9, -1e9), (2.5, 3.5)]
    for row, (x, y) in zip(S, corners, strict=False):
        row[[0, 2]] = x, y
    return rng.normal(0, 2.3, shape), S, rng.integers(0, 3, n), 8.0, blur, 2.3


CASES = [
    ("blob_log_ratio", sensor.blob_log_ratio, sensor.blob_log_ratio_spec, args)
    for args in (
        lambda: blob_case(500),
        lambda: blob_case(100, blur=0.9),
        lambda: blob_case(60, shape=(3, 2)),  # the patch is wider than the frame
        lambda: blob_case(0),
    )
]
