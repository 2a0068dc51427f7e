"""Constant track-false-alarm detection: one flight of 80 frames, filter and event-level detection,
of either detector.

The specification is ``run``, the page's executable equations, on the target's plots alone.  The
peers are the same flight in vectorised NumPy, all flights at once, and with an extended Kalman
filter object of filterpy for each flight (without false alarms); both must delete every track in
the frame in which the compiled flight does.  Asked are 60 us proposed and 30 us traditional.  A
scene is drawn once and flown by both detectors, so drawing and seeding have rows of their own.
"""

import importlib.util
import math
from functools import partial

import numpy as np

import tbdcore
from benchmarks.timing import Row, best
from tbdcore import kalman, motion
from tbdcore.kernels import track_cfar
from tbdcore.repro import trials

FLIGHTS, SLOW = 1000, 10  # flights of a timing; of one by Python objects
ASKED = {"proposed": 60e-6, "traditional": 30e-6}


def start(plots, var, d):
    """Tracks from the first two plots of every flight: x (n, 4), P (n, 4, 4)."""
    (p1, p2), C = kalman.cartesian(plots[:, :2]).swapaxes(0, 1), []
    for k in range(2):
        c, s, r = np.cos(plots[:, k, 1]), np.sin(plots[:, k, 1]), plots[:, k, 0]
        J = np.stack([np.stack([c, -r * s], -1), np.stack([s, r * c], -1)], -2)
        C.append(J * var[k][:, None] @ J.swapaxes(-1, -2))
    x, P = np.empty((len(plots), 4)), np.empty((len(plots), 4, 4))
    x[:, ::2], x[:, 1::2] = p2, (p2 - p1) / d.T
    P[:, ::2, ::2], P[:, ::2, 1::2], P[:, 1::2, ::2] = C[1], C[1] / d.T, C[1] / d.T
    P[:, 1::2, 1::2] = (C[0] + C[1]) / d.T**2
    return x, P


def false_plots(u, v, zhat, half, P_f, d):
    """All false plots of one gate, as residuals (m, 2)."""
    found = []
    while (plot := track_cfar.false_plot(u, v, zhat, half, d.cell, P_f, len(found)))[0]:
        found.append(plot[1:])
    return np.reshape(found, (-1, 2))


def fly_many(scene, z, d):
    """All flights at once; the frame in which each track was deleted."""
    var = np.array(d.var)
    plots = z + np.sqrt(var) * (z[:, :1] / d.r0) ** 2 * scene.e
    x, P = start(plots, [(plots[:, k, :1] / d.r0) ** 4 * var for k in range(2)], d)
    n, K = scene.u.shape
    died, misses, alive, F, Q = (
        np.full(n, K),
        np.zeros(n, int),
        np.arange(n),
        motion.cv(d.T),
        motion.white_acceleration(d.T, d.q),
    )
    for k in range(K):
        x, P = kalman.predict(x, P, F, Q)
        zhat, H = kalman.polar(x), kalman.polar_jacobian(x)
        R = ((zhat[:, :1] / d.r0) ** 4 * var)[:, None] * np.eye(2)
        D = kalman.innovation_covariance(P, H, R)
        half = kalman.gate_half_widths(d.g, D)
        cells = np.prod(2 * half, axis=1) / math.prod(d.cell)
        P_f = np.full(len(x), d.p_cell) if d.p_cell else np.minimum(d.P_Z / cells, 1.0)
        y = kalman.residual(plots[alive, k + 2], zhat)
        found = (scene.lam[alive, k] > -np.log(P_f)) & (abs(y) <= half).all(axis=1)
        for i in np.flatnonzero(scene.u[alive, k] < P_f * cells):
            false = false_plots(
                scene.u[alive[i], k],
                scene.v[alive[i], k],
                tuple(zhat[i]),
                tuple(half[i]),
                P_f[i],
                d,
            )
            both = np.vstack([y[i : i + 1], false]) if found[i] else false
            if len(both):
                found[i], y[i] = True, both[np.argmin(kalman.mahalanobis(both, D[i]))]
        x[found], P[found] = kalman.update(x[found], P[found], y[found], H[found], R[found])
        misses = np.where(found, 0, misses + 1)
        died[alive[misses == d.M]] = k
        keep = misses < d.M
        x, P, misses, alive = x[keep], P[keep], misses[keep], alive[keep]
    return died


def fly_filterpy(scene, z, d):
    """One flight without false alarms with filterpy's extended Kalman filter."""
    from filterpy.kalman import ExtendedKalmanFilter

    var = np.array(d.var)
    plots = z + np.sqrt(var) * (z[:, :1] / d.r0) ** 2 * scene.e
    ekf, misses = ExtendedKalmanFilter(dim_x=4, dim_z=2), 0
    ekf.x, ekf.P = kalman.two_point(
        plots[0], plots[1], *(tuple((plots[k, 0] / d.r0) ** 4 * var) for k in range(2)), d.T
    )
    ekf.F, ekf.Q = motion.cv(d.T), motion.white_acceleration(d.T, d.q)
    for k in range(scene.u.size):
        ekf.predict()
        zhat, H = kalman.polar(ekf.x), kalman.polar_jacobian(ekf.x)
        ekf.R = np.diag((zhat[0] / d.r0) ** 4 * var)
        half = kalman.gate_half_widths(d.g, kalman.innovation_covariance(ekf.P, H, ekf.R))
        P_f = d.p_cell or min(d.P_Z * math.prod(d.cell) / np.prod(2 * half), 1.0)
        y = kalman.residual(plots[k + 2], zhat)
        if scene.lam[k] > -math.log(P_f) and (abs(y) <= half).all():
            ekf.update(plots[k + 2], kalman.polar_jacobian, kalman.polar, residual=kalman.residual)
            misses = 0
        else:
            misses += 1
            if misses == d.M:
                return k
    return scene.u.size


def plots_only(scene, z, page, p):
    """Scans that hold the target's plot alone, for `run`."""
    plots = z + np.sqrt(page.variances(z[:, 0], p)) * scene.e
    return [
        np.array([[*plot, lam]])
        for plot, lam in zip(plots, [np.inf, np.inf, *scene.lam], strict=True)
    ]


def each(function, scenes):
    """What a function makes of every scene."""
    return [function(scene) for scene in scenes]


def agree(name, ours, theirs):
    """Raise unless a peer deletes every track in the frame in which the kernel does."""
    if list(ours) != list(theirs):
        raise ValueError(
            f"{name} deletes tracks in other frames than the compiled flight: "
            f"{ours[:5]} and {theirs[:5]}"
        )


def rows():
    page = tbdcore.page("track_cfar")
    p = page.Scenario()
    z = page.truth(p)
    rngs = [trials.generator(20, "track_cfar", "benchmark", i, "noise") for i in range(FLIGHTS)]
    scenes = [page.simulate(z, p, rng) for rng in rngs]
    stacked = page.Scene(*map(np.array, zip(*scenes, strict=True)))
    quiet = [scene._replace(u=np.ones(p.frames)) for scene in scenes[:SLOW]]
    scans = [plots_only(scene, z, page, p) for scene in quiet]
    for name, p_cell in (("proposed", None), ("traditional", p.cell_pfa)):
        d = page.design(p, p_cell or 0.0)
        fly = partial(lambda scene, d: page.fly(scene, z, d)[0], d=d)
        seconds = best(each, fly, scenes, repeat=3) / FLIGHTS
        spec = best(each, partial(page.run, p=p, p_cell=p_cell), scans, repeat=1) / SLOW
        agree("NumPy", each(fly, scenes), fly_many(stacked, z, d).tolist())
        batched = best(fly_many, stacked, z, d, repeat=2) / FLIGHTS
        peer = "NumPy, batched", batched
        yield Row(
            f"track_cfar.fly ({name})",
            f"flight of {p.frames} frames",
            seconds,
            spec,
            None,
            *peer,
            ASKED[name],
        )
        if importlib.util.find_spec("filterpy"):
            theirs = partial(fly_filterpy, z=z, d=d)
            agree("filterpy", each(fly, quiet), each(theirs, quiet))
            alone, peer = best(each, fly, quiet) / SLOW, best(each, theirs, quiet, repeat=1) / SLOW
            yield Row(
                f"track_cfar.fly ({name})",
                "the same without false alarms",
                alone,
                None,
                None,
                "filterpy",
                peer,
            )
    seeding = best(trials.generator, 20, "track_cfar", "benchmark", 0, "noise")
    yield Row(
        "track_cfar.simulate", "scene of a flight, to draw", best(page.simulate, z, p, rngs[0])
    )
    yield Row("trials.generator", "stream of a flight, to seed", seeding)
