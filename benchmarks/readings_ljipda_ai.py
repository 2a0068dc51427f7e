"""Rows of chapter 05 under the readings of its lost equations, for ``benchmarks/readings.py``.

The indicator (19) is combined with the prior (12) and the visibility (16) to (18).  A prior over
the tracks of a plot has its own visibility, so these two are not combined.
"""

import math
from functools import partial

import numpy as np

from benchmarks import readings as driver
from tbdcore.repro import claims, trials

USES = ("page", "scene", "ends", "error_of", "ONE", "seed", "n_trials")
INDICATORS = {"every gated plot": "", "largest prior": "LARGEST", "one gate": "LONE"}
SHARING = {  # by prior and visibility
    ("over the plots of a track", "less the shares of the others"): "VISIBLE",
    ("over the plots of a track", "strict"): "STRICT",
    ("over the plots of a track", "squared"): "SQUARED",
    ("over the tracks of a plot", "less the shares of the others"): "BY_PLOT",
}


def track(alg, plots, s, level, indicator, sharing):
    """States (K, 2, 4) of two tracks with one level: `alg.track`, of any indicator and sharing."""
    x, P, existence, F, Q, sensor, detect, *_ = alg.arguments(plots, s, "LM-AI")
    clutter, gamma, p_gate = sensor[2:5]
    snr, states = np.full(2, float(level)), [x]
    for k, (f, q) in enumerate(zip(F, Q, strict=True), start=1):
        x, P, existence, zhat, S = alg.predict(x, P, existence, f, q, sensor)
        near = slice(plots.first[k], plots.first[k + 1])
        far = alg.far_plots(zhat, S, gamma, plots.sea, k)
        z, u = np.concatenate((plots.z[near], far[:, :2])), np.append(plots.u[near], far[:, 2])
        meas, log_p = alg.ljipda_ai.gate(z, zhat, S, gamma, p_gate)
        loud = alg.ljipda_ai.amplitude_ratio(u[meas], snr)
        if indicator:
            ratio = log_p - math.log(clutter)
            loud = loud * alg.indicator_of(getattr(alg, indicator), ratio, existence, detect)
        how = getattr(alg, sharing)
        beta, existence = alg.weigh(log_p, loud, S, existence, sensor, detect, how)
        x, P = alg.ljipda_ai.update_mixture(x, P, S, z[meas], beta)
        states.append(x)
    return np.array(states)


def kept(seed, i, page, angle, methods):
    """Whether both tracks end on their own boats, by method: (level, indicator, sharing)."""
    X, plots, _, s = page.scene(angle, seed, i)
    return page.ends(X, np.array([track(page.page(), plots, s, *it) for it in methods])) == 0


def dense(page, readings):
    """con.dense: pairs kept by LJIPDA-AI less those by LJIPDA, in percent, on the page's trials."""
    ledger = claims.Ledger("ljipda_ai", strict=False)
    angle, share = (ledger.number("con.dense", name) for name in ("angle", "share"))
    sharing = [SHARING.get((it["prior"], it["visibility"])) for it in readings]
    indicators = [INDICATORS[it["indicator"]] for it in readings]
    pairs = [(how, which) for how, which in zip(sharing, indicators, strict=True) if how]
    methods = [it for how, which in pairs for it in ((page.ONE, which, how), (0.0, "", how))]
    fly = partial(kept, page=page, angle=int(angle), methods=methods)
    good = 100.0 * trials.run(fly, int(page.n_trials * share), seed=page.seed, label="con.dense").T
    flown = iter(driver.compared(good[::2] - good[1::2], partial(share_error, page)))
    return [next(flown) if how else None for how in sharing]


def share_error(page, percent):
    """Standard error of the mean of differences of shares, as the page has it."""
    return page.error_of("mtr", percent.mean(axis=0), percent)


ROWS = {"con.dense": dense}
