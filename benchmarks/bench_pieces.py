"""Kernels that are pieces of a trial and have no row elsewhere, called from Python on arrays of the
size that the notebooks use.

Python's own call, about half a microsecond, is in both times, so the ratio to the specification is
the least that can be said. The specification of ``coherent_log_ratio`` is a sum over 5,000 powers
for each particle.
"""

import numpy as np

from benchmarks.timing import Row, best
from tbdcore import motion
from tbdcore.kernels import ljipda_ai, mda_tbd, track_cfar


def rows():
    rng = np.random.default_rng(1)
    x = np.column_stack(
        (
            rng.uniform(1e4, 3e4, 3),
            rng.normal(0, 30, 3),
            rng.uniform(1e4, 3e4, 3),
            rng.normal(0, 30, 3),
        )
    )
    A = rng.normal(size=(3, 4, 4)) * np.array([50.0, 1.0, 50.0, 1.0])[:, None]
    P, F, Q = (
        A @ np.swapaxes(A, 1, 2),
        np.stack([motion.cv(1.0)] * 3),
        motion.step_acceleration(1.0, 1.0),
    )
    D, weights = ljipda_ai.gate_tracks(x, P, 400.0, 1e-7)[2], rng.dirichlet(np.ones(6), 3)
    plots = x[:1, ::2] + 50.0 * rng.normal(size=(5, 2))
    place, z = 10.0 + rng.random((2, 50)), rng.standard_exponential((20, 20))
    patch = z, *place, np.full(50, 4.0), mda_tbd.Spread(1.44, 0.11, 2, 6)
    gate = 0.01, (0.3, 0.8), (250010.0, -1.3), (900.0, 0.11), (150.0, 0.0349), 0.02, 0
    work = {
        "amplitude_ratio": (
            ljipda_ai,
            "3 tracks, 20 plots",
            (rng.standard_exponential(20), np.full(3, 10.0)),
        ),
        "false_plot": (track_cfar, "gate of 104 cells", gate),
        "predict_tracks": (ljipda_ai, "3 tracks", (x, P, F, Q)),
        "gate_tracks": (ljipda_ai, "3 tracks", (x, P, 400.0, 1e-7)),
        "update_mixture": (
            ljipda_ai,
            "3 tracks, 5 plots",
            (x, P, D, plots, weights),
        ),
        "look": (
            ljipda_ai,
            "3 tracks, 5 plots",
            (plots, np.arange(5), x[:, ::2], D, weights, np.full(3, 0.5), 16.0),
        ),
        "coherent_log_ratio": (mda_tbd, "50 particles, 5 x 13 cells", patch),
    }
    for name, (module, about, arguments) in work.items():
        kernel, spec = getattr(module, name), getattr(module, f"{name}_spec")
        where = module.__name__.removeprefix("tbdcore.").removeprefix("kernels.")
        yield Row(
            f"{where}.{name}", about, best(kernel, *arguments), best(spec, *arguments, repeat=2)
        )
