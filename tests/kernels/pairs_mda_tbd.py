"""``mda_tbd`` beside its specifications: (name, function, specification, arguments)."""

import functools

import numpy as np

from tbdcore.kernels import mda_tbd

CASES = []


def polar_case(spread, n=200, shape=(60, 40), seed=6):
    """Power frame, places in it, on its edges and off it, and intensities, a tenth of them zero."""
    rng = np.random.default_rng(seed)
    rho, alpha = rng.uniform(-3, shape[0] + 4, n), rng.uniform(-3, shape[1] + 4, n)
    corners = [
        (0.5, 0.5),
        (shape[0] + 0.4999, 1.0),
        (1.0, shape[1] + 0.4999),
        (0.4999, 3.0),
        (np.nan, 2.0),
        (2.5, 3.5),
    ]
    for k, corner in enumerate(corners[:n]):
        rho[k], alpha[k] = corner
    snr = rng.exponential(5.0, n) * (rng.random(n) > 0.1)
    return (
        rng.standard_exponential(shape, dtype=np.float32),
        rho,
        alpha,
        snr,
        mda_tbd.Spread(*spread),
    )


TRUE, WIDE, NARROW = (1.44, 0.1112, 2, 6), (0.144, 0.01112, 4, 12), (14.4, 1.112, 1, 3)
for spread, options in (
    (TRUE, {}),
    (WIDE, {}),
    (NARROW, {}),
    ((0.3, 0.05, 5, 30), {}),  # the patch is wider than the frame
    (TRUE, {"shape": (3, 5)}),
    (TRUE, {"n": 0}),
    (TRUE, {"shape": (1, 1)}),
    (TRUE, {"shape": (0, 7)}),
    ((1.44, 0.1112, 0, 0), {}),
):
    make = functools.partial(polar_case, spread, **options)
    CASES += [
        ("power_log_ratio", mda_tbd.power_log_ratio, mda_tbd.power_log_ratio_spec, make),
        ("cell_power", mda_tbd.cell_power, mda_tbd.cell_power_spec, lambda make=make: make()[:3]),
        (
            "patch_fit",
            mda_tbd.patch_fit,
            mda_tbd.patch_fit_spec,
            lambda make=make: (*make()[:3], make()[4]),
        ),
    ]


def histories(window, samples, n, M, births, seed=3):
    rng = np.random.default_rng(seed)
    H, age = rng.random((window, samples, n)), rng.integers(0, window + 1, n)
    return H, age, np.sort(rng.integers(0, max(n, 1), M)), births


CASES += [
    ("inherit", mda_tbd.inherit, mda_tbd.inherit_spec, args)
    for args in (
        lambda: histories(8, 1, 90, 60, 30),
        lambda: histories(3, 2, 9, 20, 1),
        lambda: histories(0, 1, 9, 7, 2),
        lambda: histories(4, 1, 5, 5, 0),
        lambda: histories(2, 1, 0, 0, 3),
        lambda: histories(2, 0, 4, 3, 0),
    )
]
