"""Rows of chapter 05 under the readings of its lost equations, for ``benchmarks/readings.py``.

The indicator (19), the prior (12), the visibility (16) to (18) and what is told of the detection
probability are combined.  A prior over the tracks of a plot has its own visibility, so these two
are not combined.
"""

import math
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks import readings as driver
from tbdcore import kernel
from tbdcore.kernels import ljipda_ai
from tbdcore.repro import claims, trials

USES = (
    "page",
    "crossing",
    "ends",
    "error_of",
    "pd_of",
    "ONE",
    "SNR",
    "SEA_PFA",
    "seed",
    "n_trials",
)
VISIBLE, STRICT, SQUARED, BY_PLOT = range(4)  # prior and visibility
EVERY, LARGEST, LONE, COIN, FIRST, LAST = range(6)  # whose track gets the amplitude of a plot
SHARING = {  # by prior and visibility
    ("over the plots of a track", "less the shares of the others"): VISIBLE,
    ("over the plots of a track", "strict"): STRICT,
    ("over the plots of a track", "squared"): SQUARED,
    ("over the tracks of a plot", "less the shares of the others"): BY_PLOT,
}
INDICATORS = {"every gated plot": EVERY, "largest prior": LARGEST, "one gate": LONE}


class Way(NamedTuple):
    """How tracks are flown: how plots are shared, who gets an amplitude, and what is told."""

    sharing: int
    who: int
    by_track: bool  # P_D and level of the own boat, else one for all
    amplitude: bool


@kernel
def omega(who, log_ratio, existence, detect, rng):
    """The indicator (T, M) of (19); the generator tosses the coin."""
    odds = ljipda_ai.prior_odds(log_ratio, existence, detect)
    found = np.zeros(log_ratio.shape)
    for m in range(log_ratio.shape[1]):
        near = np.flatnonzero(log_ratio[:, m] > -np.inf)
        if len(near) == 0 or (who == LONE and len(near) > 1):
            continue
        if who == EVERY:
            for t in near:
                found[t, m] = 1.0
            continue
        which = len(near) - 1 if who == LAST else 0
        if who == COIN:
            which = int(len(near) * rng.random())
        if who == LARGEST:
            which = np.argmax(odds[:, m][near])
        found[near[which], m] = 1.0
    return found


@kernel
def shared(how, log_p, S, existence, sensor, detect):
    """ln of the densities (21) over that of clutter, with the visibility of the plots (T, M)."""
    log_ratio = log_p - math.log(sensor[2])
    if how == STRICT:  # 1 / (1 + sum of the others' odds)
        odds = ljipda_ai.prior_odds(log_ratio, existence, detect)
        return log_ratio - np.log(1.0 + sum(odds[1:], odds[0]) - odds)
    if how == BY_PLOT:  # a prior that is shared among the tracks of a plot, without existence
        if log_ratio.size == 0:
            return log_ratio
        share = np.exp(log_ratio - log_ratio.max())
        odds = 1.0 / (1.0 - detect.reshape(-1, 1) * share / sum(share[1:], share[0])) - 1.0
        return log_ratio + np.log((1.0 + odds) / (1.0 + sum(odds[1:], odds[0])))
    visible = ljipda_ai.visibility(log_ratio, existence, detect)
    if how == SQUARED:  # n = sum of P_V less P_D P_W P (1 - product of (1 - P_V))
        for t in range(len(S)):
            seen = visible[t][log_p[t] > -np.inf]
            n = max(seen.sum() - detect[t] * existence[t] * (1.0 - np.prod(1.0 - seen)), 1e-9)
            volume = math.pi * sensor[3] * math.sqrt(np.linalg.det(S[t]))
            log_ratio[t] = log_p[t] + 2.0 * np.log(visible[t]) + math.log(volume / n)
        return log_ratio
    return log_ratio + np.log(visible)


@kernel
def loop(predict, far_plots, plots, x, P, existence, F, Q, sensor, detect, snr, way, rng):
    """States (K, T, 4): the page's `track` with the page's functions, any sharing, any indicator.

    plots : the page's, as (z, u, first, sea); way : (sharing, who)
    """
    z, u, first, sea = plots
    states = np.empty((len(F) + 1, *x.shape))
    states[0] = x
    for k in range(1, len(states)):
        x, P, existence, zhat, S = predict(x, P, existence, F[k - 1], Q[k - 1], sensor)
        far = far_plots(zhat, S, sensor[3], sea, k)
        z_k = np.concatenate((z[first[k] : first[k + 1]], far[:, :2]))
        u_k = np.concatenate((u[first[k] : first[k + 1]], far[:, 2]))
        meas, log_p = ljipda_ai.gate(z_k, zhat, S, sensor[3], sensor[4])
        log_ratio = shared(way[0], log_p, S, existence, sensor, detect)
        loud = ljipda_ai.amplitude_ratio(u_k[meas], snr)
        mine = omega(way[1], log_p - math.log(sensor[2]), existence, detect, rng)
        beta, existence = ljipda_ai.ipda(log_ratio + loud * mine, existence, detect)
        x, P = ljipda_ai.update_mixture(x, P, S, z_k[meas], beta)
        states[k] = x
    return states


def track(page, plots, s, way, rng=None):
    """States (K, 2, 4) of two tracks that are flown in a way."""
    alg, level = page.page(), page.SNR if way.by_track else np.full(2, float(page.ONE))
    told = replace(s, p_detect=page.pd_of(page.SEA_PFA, page.SNR)) if way.by_track else s
    known = alg.arguments(plots, told, "LM-AI")[:-2]
    rng = rng or np.random.default_rng(0)
    functions = alg.predict, alg.far_plots, tuple(plots)
    return loop(*functions, *known, level * way.amplitude, (way.sharing, way.who), rng)


def kept(seed, i, page, angle, ways):
    """Whether both tracks end on their own boats, by way."""
    X, plots, _, s = page.crossing(angle, seed, i)
    return page.ends(X, np.array([track(page, plots, s, way) for way in ways])) == 0


def flown(page, angle, ways, trials_of_row):
    """Pairs kept, 0 or 100, by way and trial of the page."""
    fly = partial(kept, page=page, angle=int(angle), ways=ways)
    return 100.0 * trials.run(fly, trials_of_row, seed=page.seed, label=f"{angle:g} degrees").T


def way_of(reading, amplitude):
    """The way of a reading, None where its parts cannot be combined."""
    sharing = reading["prior"], reading["visibility"]
    if sharing not in SHARING:
        return None
    who = INDICATORS[reading.get("indicator", "every gated plot")]
    by_track = reading["detection probability"] == "by track with the level"
    return Way(SHARING[sharing], who, by_track, amplitude)


def dense(page, readings):
    """con.dense: pairs kept by LJIPDA-AI less those by LJIPDA, in percent, on the page's trials."""
    ledger = claims.Ledger("ljipda_ai", strict=False)
    angle, share = (ledger.number("con.dense", name) for name in ("angle", "share"))
    aided = [way for it in readings if (way := way_of(it, amplitude=True))]
    bare = [way._replace(who=EVERY, amplitude=False) for way in aided]
    ways = list(dict.fromkeys([*aided, *bare]))
    good = dict(zip(ways, flown(page, angle, ways, int(page.n_trials * share)), strict=True))
    gains = [good[a] - good[b] for a, b in zip(aided, bare, strict=True)]
    options = iter(driver.compared(gains, partial(share_error, page)))
    return [next(options) if way_of(it, amplitude=True) else None for it in readings]


def close_loss(page, readings):
    """s0.closeloss: pairs that LJIPDA does not keep at the close angle less those at the wide."""
    ledger = claims.Ledger("ljipda_ai", strict=False)
    number = partial(ledger.number, "s0.closeloss")
    ways = [way for it in readings if (way := way_of(it, amplitude=False))]
    count = int(page.n_trials * number("share"))
    close, wide = (flown(page, number(f"{name} angle"), ways, count) for name in ("close", "wide"))
    options = iter(driver.compared(wide - close, partial(share_error, page)))
    return [next(options) if way_of(it, amplitude=False) else None for it in readings]


def share_error(page, percent):
    """Standard error of the mean of differences of shares, as the page has it."""
    return page.error_of("mtr", percent.mean(axis=0), percent)


ROWS = {"con.dense": dense, "s0.closeloss": close_loss}
