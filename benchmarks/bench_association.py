"""Association: single scans, and whole trials of 100 scans with 3 tracks and about 230 plots a
scan.

Asked are 8 ms for the plots of a trial and one tracker, and 1 ms for the exact marginals of 10
tracks that share 12 plots.  The specification of a trial is the same loop over scans with the dense
NumPy formulas; that of the exact marginals lists the joint events, which for 10 tracks nobody can,
so it is timed on 4 tracks and 6 plots.  The peer is Stone Soup's JPDA, where it is installed: whole
scans of tracks that share all plots, densities and its objects included, which must give the same
marginals first.
"""

import importlib.util
import math

import numpy as np

import tbdcore
from benchmarks.timing import Row, best
from tbdcore import motion
from tbdcore.kernels import ljipda_ai
from tests.kernels.peer_jpda import our_marginals, peer_marginals, scan

PEER = "Stone Soup JPDA"


def scene(T, M):
    """Log ratios of T tracks that all share M plots, existences, detection probabilities."""
    return np.random.default_rng(T).normal(size=(T, M)), np.full(T, 0.9), np.full(T, 0.9)


def numpy_trial(z, p, x, P, F, amplitude):
    """A whole trial with the specifications: JIPDA by its list of events would not end, so LJIPDA
    with amplitude.
    """
    Q, var_a = motion.step_acceleration(p.T, math.sqrt(p.q)), math.radians(p.sigma_theta_deg) ** 2
    existence, detect = np.full(3, p.p_start), np.full(3, p.p_detect * p.p_gate)
    for k in range(1, p.frames):
        scan = slice(z.first[k], z.first[k + 1])
        x, P = ljipda_ai.predict_tracks_spec(x, P, F[k - 1], Q)
        zhat, _, D = ljipda_ai.gate_tracks_spec(x, P, p.sigma_r**2, var_a)
        meas, log_p = ljipda_ai.gate_spec(z.z[scan], zhat, D, p.gamma, p.p_gate)
        log_a = ljipda_ai.amplitude_ratio_spec(z.u[scan][meas], amplitude)
        beta, existence = ljipda_ai.ljipda_spec(
            log_p - math.log(p.clutter), log_a, p.p11 * existence, detect
        )
        x, P = ljipda_ai.update_mixture_spec(x, P, D, z.z[scan][meas], beta)
    return x


def peer_rows():
    """Scans with their densities: ours, and the peer's where it is installed, once both have found
    the same marginals.
    """
    known = importlib.util.find_spec("stonesoup") is not None
    for T, M in ((2, 4), (3, 5), (4, 6)):
        where, plots = scan(1, T, M)
        if known and not np.allclose(
            our_marginals(where, plots), peer_marginals(where, plots), rtol=1e-6, atol=1e-9
        ):
            raise ValueError(f"{PEER} has other marginals for {T} tracks and {M} plots")
        seconds = best(our_marginals, where, plots)
        peer = best(peer_marginals, where, plots, repeat=2) if known else None
        yield Row(
            "ljipda_ai.gate, jipda",
            f"scan of {T} tracks, {M} plots",
            seconds,
            None,
            None,
            PEER,
            peer,
        )


def rows():
    """Marginals of one scan, then whole trials by every method."""
    yield Row(
        "ljipda_ai.jipda",
        "10 tracks share 12 plots",
        best(ljipda_ai.jipda, *scene(10, 12)),
        asked_seconds=1e-3,
    )
    small = scene(4, 6)
    yield Row(
        "ljipda_ai.jipda",
        "4 tracks, 6 plots",
        best(ljipda_ai.jipda, *small),
        best(ljipda_ai.jipda_spec, *small, repeat=2),
    )
    yield from peer_rows()
    for T in range(2, 11, 2):
        args = np.zeros((T, T + 2)), *scene(T, T + 2)[1:]
        listed = best(ljipda_ai.jipda_spec, *args, repeat=1) if T <= 4 else None
        yield Row(
            "ljipda_ai.jipda",
            f"{T} tracks share {T + 2} plots",
            best(ljipda_ai.jipda, *args),
            listed,
        )
        linear = args[0], *args
        yield Row(
            "ljipda_ai.ljipda",
            f"{T} tracks share {T + 2} plots",
            best(ljipda_ai.ljipda, *linear),
        )
    for name in ("ipda", "visibility", "modulated_log_ratio", "prior_odds"):
        kernel, spec = getattr(ljipda_ai, name), getattr(ljipda_ai, f"{name}_spec")
        yield Row(
            f"ljipda_ai.{name}",
            "10 tracks share 12 plots",
            best(kernel, *scene(10, 12)),
            best(spec, *scene(10, 12)),
        )
    log_ratio, existence, detect = scene(10, 12)
    args = log_ratio, np.zeros_like(log_ratio), existence, detect
    yield Row(
        "ljipda_ai.ljipda",
        "10 tracks share 12 plots",
        best(ljipda_ai.ljipda, *args),
        best(ljipda_ai.ljipda_spec, *args),
    )
    yield from trial_rows()


def trial_rows():
    """Plots, one tracker, and both."""
    page, p = tbdcore.page("ljipda_ai"), tbdcore.page("ljipda_ai").Scenario()
    z = page.simulate(p, np.random.default_rng(1))
    work = f"100 scans, {len(z.z) / p.frames:.0f} plots a scan"
    plots = best(lambda: page.simulate(p, np.random.default_rng(1)))
    yield Row("page ljipda_ai, plots", work, plots)
    (x, P), F = page.start_tracks(p, np.random.default_rng(2)), page.course(p)[1]
    for method in page.METHODS:
        s = page.setup(p, np.random.default_rng(2))
        seconds = best(page.states, z, s, method)
        spec = (
            best(numpy_trial, z, p, x, P, F, np.full(3, 10.0), repeat=1)
            if method == "LJIPDA-AI"
            else None
        )
        yield Row(
            f"page ljipda_ai, plots and {method}",
            f"3 tracks, {work}",
            plots + seconds,
            spec,
            asked_seconds=8e-3,
        )
