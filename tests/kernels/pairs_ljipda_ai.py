"""Cases for association, amplitude and steps of several tracks: sizes down to nothing, empty gates,
extreme probabilities.
"""

import numpy as np

from tbdcore.kernels import ljipda_ai


def _scene(seed, T, M, outside=0.3, spread=3.0):
    rng = np.random.default_rng(seed)
    log_ratio = rng.normal(0.0, spread, (T, M))
    log_ratio[rng.random((T, M)) < outside] = -np.inf
    return log_ratio, rng.uniform(0.05, 0.99, T), rng.uniform(0.3, 0.97, T)


def _scene_with_amplitude(seed, T, M):
    log_ratio, existence, detect = _scene(seed, T, M)
    return log_ratio, np.random.default_rng(seed + 100).normal(0.0, 2.0, (T, M)), existence, detect


def _gates(seed, T, M):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(T, 2, 2)) * 100.0
    return (
        rng.uniform(-900, 900, (M, 2)),
        rng.uniform(-500, 500, (T, 2)),
        A @ np.swapaxes(A, 1, 2) + 50.0 * np.eye(2),
        16.0,
        0.9997,
    )


def _tracks(seed, T):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(T, 4, 4)) * np.array([[50.0], [1.0], [50.0], [1.0]])
    return rng.uniform(-3e4, 3e4, (T, 4)), A @ np.swapaxes(A, 1, 2) + np.diag(
        [10.0, 1.0, 10.0, 1.0]
    )


def _prediction(seed, T):
    F = np.random.default_rng(seed + 1).normal(size=(T, 4, 4))
    return (*_tracks(seed, T), F, np.diag([0.3, 0.2, 0.3, 0.2]))


def _weighted(seed, T, M):
    x, P = _tracks(seed, T)
    rng = np.random.default_rng(seed + 2)
    weights = rng.dirichlet(np.ones(M + 1), T).reshape(T, M + 1)
    return x, P, P[:, ::2, ::2] + 400.0 * np.eye(2), rng.uniform(-3e4, 3e4, (M, 2)), weights


def _seen(seed, T, M):
    z, zhat, S, gamma, _ = _gates(seed, T, M)
    rng, gated = np.random.default_rng(seed + 3), np.arange(0, M, 2)
    return z, gated, zhat, S, rng.random((T, len(gated) + 1)), rng.random(T), gamma


SIZES = [(1, 0), (1, 1), (2, 5), (4, 3)]
AMPLITUDE = ljipda_ai.amplitude_ratio, ljipda_ai.amplitude_ratio_spec
CLUSTERED = ljipda_ai.clustered_jipda, ljipda_ai.clustered_jipda_spec
ASSOCIATORS = [
    ljipda_ai.ipda,
    ljipda_ai.prior_odds,
    ljipda_ai.visibility,
    ljipda_ai.modulated_log_ratio,
    ljipda_ai.jipda,
    ljipda_ai.clustered_jipda,
]

CASES = [
    (
        f"{kernel.__name__} {T}x{M}",
        kernel,
        getattr(ljipda_ai, f"{kernel.__name__}_spec"),
        lambda T=T, M=M: _scene(T + 10 * M, T, M),
    )
    for kernel in ASSOCIATORS
    for T, M in SIZES
]
CASES += [
    (
        f"{kernel.__name__} {name}",
        kernel,
        getattr(ljipda_ai, f"{kernel.__name__}_spec"),
        arguments,
    )
    for kernel in ASSOCIATORS
    for name, arguments in (
        ("no plot in any gate", lambda: _scene(7, 3, 4, outside=1.1)),
        ("all plots shared", lambda: _scene(8, 3, 4, outside=-1.0)),
        ("strong evidence", lambda: _scene(9, 3, 4, spread=40.0)),
        (
            "track almost dead",
            lambda: (_scene(10, 3, 4)[0], np.array([1e-200, 0.5, 1.0]), np.array([0.9, 0.5, 0.1])),
        ),
    )
]
CASES += [
    (
        f"ljipda {T}x{M}",
        ljipda_ai.ljipda,
        ljipda_ai.ljipda_spec,
        lambda T=T, M=M: _scene_with_amplitude(T + 10 * M, T, M),
    )
    for T, M in SIZES
]
CASES += [
    (
        f"gate {T}x{M}",
        ljipda_ai.gate,
        ljipda_ai.gate_spec,
        lambda T=T, M=M: _gates(T + M, T, M),
    )
    for T, M in ((1, 0), (1, 1), (3, 200), (2, 40))
]
CASES += [
    (
        f"look {T}x{M}",
        ljipda_ai.look,
        ljipda_ai.look_spec,
        lambda T=T, M=M: _seen(T + M, T, M),
    )
    for T, M in ((0, 3), *SIZES)
]
CASES += [
    (
        "amplitude_ratio",
        *AMPLITUDE,
        lambda: (np.linspace(0, 900, 40), np.array([0.0, 10.0])),
    ),
    ("amplitude_ratio, no plot", *AMPLITUDE, lambda: (np.empty(0), np.array([3.0]))),
]
CASES += [
    case
    for T in (1, 3)
    for case in (
        (
            f"predict_tracks {T}",
            ljipda_ai.predict_tracks,
            ljipda_ai.predict_tracks_spec,
            lambda T=T: _prediction(T, T),
        ),
        (
            f"gate_tracks {T}",
            ljipda_ai.gate_tracks,
            ljipda_ai.gate_tracks_spec,
            lambda T=T: (*_tracks(T, T), 1e4, 1e-7),
        ),
        (
            f"update_mixture {T}",
            ljipda_ai.update_mixture,
            ljipda_ai.update_mixture_spec,
            lambda T=T: _weighted(T, T, 5),
        ),
        (
            f"update_mixture {T}, no plot",
            ljipda_ai.update_mixture,
            ljipda_ai.update_mixture_spec,
            lambda T=T: _weighted(T, T, 0),
        ),
    )
]


def _degenerate():
    """Certain detection, certain and dead tracks, tracks without a plot, no track at all."""
    inf, one, sure = np.inf, np.array([1.0, 1.0]), np.array([0.5, 1.0])
    plots = np.array([[0.5, 1.0, -inf], [2.0, -inf, -3.0]])
    yield "certain detection", plots, sure, one
    yield "certain tracks and detection", plots, one, one
    yield "certain detection, empty gate", np.array([[1.0], [-inf]]), np.array([1.0, 0.5]), one
    yield "dead and never detected", plots, np.array([0.0, 0.7]), np.array([0.9, 0.0])
    yield "no track", np.empty((0, 3)), np.empty(0), np.empty(0)


CASES += [
    (f"{name}, {about}", getattr(ljipda_ai, name), getattr(ljipda_ai, f"{name}_spec"), args)
    for about, *scene in _degenerate()
    for name in ("ipda", "jipda", "clustered_jipda")
    for args in [lambda scene=scene: scene]
]


def _chain():
    """Six tracks in three clusters: 0, 3 and 4 share plots through 3; 1 and 5 share one; 2 none."""
    gates = np.array([[1, 0, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1]] * 2, bool)
    gates[3], gates[4] = [1, 1, 0, 0, 0], [0, 1, 0, 1, 0]
    gates[5] = [0, 0, 1, 0, 0]
    log_ratio, existence, detect = _scene(11, 6, 5, outside=-1.0)
    return np.where(gates, log_ratio, -np.inf), existence, detect


CASES += [("clustered_jipda, three clusters", *CLUSTERED, _chain)]
CASES += [
    (
        f"gate, {about}",
        ljipda_ai.gate,
        ljipda_ai.gate_spec,
        lambda z=z: (np.array(z), np.zeros((2, 2)), np.array([np.eye(2)] * 2), 4.0, 1.0),
    )
    for about, z in (
        ("on its edge", [[2.0, 0.0], [0.0, -2.0], [np.nextafter(2.0, 3.0), 0.0]]),
        ("every plot outside", [[5.0, 5.0], [-9.0, 0.0]]),
        ("an infinite plot", [[np.inf, 0.0], [1.0, 1.0]]),
    )
]
CASES += [
    (f"{k.__name__}, no track", k, s, args)
    for k, s, args in (
        (ljipda_ai.gate, ljipda_ai.gate_spec, lambda: _gates(1, 0, 3)),
        (ljipda_ai.predict_tracks, ljipda_ai.predict_tracks_spec, lambda: _prediction(1, 0)),
        (ljipda_ai.gate_tracks, ljipda_ai.gate_tracks_spec, lambda: (*_tracks(1, 0), 1e4, 1e-7)),
        (ljipda_ai.update_mixture, ljipda_ai.update_mixture_spec, lambda: _weighted(1, 0, 2)),
        (*AMPLITUDE, lambda: (np.ones(3), np.empty(0))),
    )
]
