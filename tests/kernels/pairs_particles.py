"""``particles`` beside its specifications: (name, function, specification, arguments)."""

import numpy as np

from tbdcore import particles


def weights(n, seed=0):
    return np.random.default_rng(seed).random(n) ** 6


def ends_at_arrows(M, u):
    """Weights whose cumulative sums are the arrows, to rounding, and a last one."""
    return np.diff(np.append(0.0, np.append(np.arange(M) + u, M)))


CASES = [
    ("systematic", particles.systematic, particles.systematic_spec, args)
    for args in (
        lambda: (weights(400), 200, 0.3),
        lambda: (weights(50), 1000, 0.999),
        lambda: (np.array([0.0, 1.0, 0.0]), 5, 0.0),
        lambda: (np.full(10, 0.1), 10, 0.5),  # the sum rounds below one
        lambda: (np.array([0.5, 0.5, 0.0, 0.0]), 4, np.nextafter(1.0, 0.0)),
        lambda: (np.array([1.0]), 3, 0.7),
        lambda: (np.array([0.0, 0.0, 1e-190]), 9, 0.0),
        lambda: (np.full(3, 1e190), 9, 0.5),
        lambda: (np.zeros(9) + (np.arange(9) == 8), 4, np.nextafter(1.0, 0.0)),
        lambda: (ends_at_arrows(300, 0.3), 300, 0.3),  # a particle that ends there is not chosen
        lambda: (ends_at_arrows(300, 2.0**-53), 300, 2.0**-53),
    )
]


def log_weights(n, seed=1):
    """Log-ratios as a filter has them: absent particles exactly 0, far ones hopeless, a few very
    good.
    """
    rng = np.random.default_rng(seed)
    return np.where(rng.random(n) < 0.4, 0.0, rng.normal(-5.0, 8.0, n))


def normalised(lw):
    return particles.normalise(lw)[0]


CASES += [
    ("systematic, log-weights", particles.systematic, particles.systematic_spec, args)
    for args in (
        lambda: (normalised(log_weights(400)), 200, 0.3),
        lambda: (normalised(log_weights(50) - 1000.0), 300, 0.999),
        lambda: (normalised(np.array([-np.inf, 700.0, 700.5, -np.inf])), 7, 0.0),
        lambda: (normalised(np.zeros(10)), 10, 0.5),
        lambda: (normalised(np.array([-2.0])), 3, 0.7),
        lambda: (normalised(np.array([-1e308, 1e308])), 3, 0.3),
    )
]
