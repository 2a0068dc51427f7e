"""Rows of chapter 02 under what its paper does not print, for ``benchmarks/readings.py``: the state
of a particle that is born, the process noise, the window of the average, the spread of the new
particles, and the number of particles of the classic filter.
"""

import functools
from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks import readings as driver
from tbdcore.repro import claims

USES = ("Outcome", "prior", "classic", "improved", "present", "regime")
USES += ("mended", "monte_carlo", "declared_share", "correct", "scored", "per_run")
USES += ("output_rmse", "seeded", "never_reset")
USES += ("straight", "fades", "losses", "blank", "saved_after", "last_frame")
SPREADS = {"half a cell": (0.5, 0.3), "one cell": (1.0, 0.6)}  # cells, cells per second
RUNS = 150  # of each filter
COPIES = 200  # runs of abs.cause
GAPS = 400  # runs with a blanked frame
PLACED = 100  # runs of each filter that starts at the target
LEDGER = claims.Ledger("mm_pf_tbd", strict=False)
PAGE = []  # the page's names, for the flights that rows share


def filters(reading):
    """The classic and the improved filter under a reading; what a row does not name is default."""
    page = PAGE[0]
    accel = float(reading.get("process noise", page.prior.accel))
    change = {
        "births": reading.get("births", page.classic.births),
        "N": int(reading.get("window", page.improved.N)),
        "spread": SPREADS[reading.get("spread", "half a cell")],
        "prior": replace(page.prior, accel=accel),
    }
    M = int(reading.get("M of the classic filter", page.classic.M))
    return replace(page.classic, **change, M=M), replace(page.improved, **change)


@functools.cache
def flown(p):
    """The runs of one filter on the scenes of the page."""
    return PAGE[0].monte_carlo([p], RUNS)


def own(reading):
    """The classic filter under a reading; window and spread do not concern it."""
    p, default = filters(reading)[0], PAGE[0].classic
    return replace(p, N=default.N, spread=default.spread)


def pair(reading):
    """The runs of both filters under a reading, the classic one first, and their settings."""
    p, q = own(reading), filters(reading)[1]
    parts = zip(flown(p), flown(q), strict=True)
    return PAGE[0].Outcome(*(np.concatenate(both, axis=1) for both in parts)), p, q


def of_pair(reading):
    """What the rows of the main runs are judged by, for each run."""
    page, (o, p, q) = PAGE[0], pair(reading)
    P, wait = page.declared_share(o), page.scored(page.correct(o))[0]
    R = [page.output_rmse(o, v)[1] for v in (0, 1)]
    rows = page.per_run(o, 0, 1, p, q) | {"s4.pd": P[:, 1] - P[:, 0]}
    rows |= {"s4.earlier": wait[:, 0] - wait[:, 1], "s4.accuracy": R[0] - R[1]}
    part, level = (LEDGER.number("abs.detects", name) for name in ("part", "level"))
    rows["abs.detects"] = (page.correct(o)[:, 1].mean(axis=1) > part) - level
    return rows | {"f2.delay": LEDGER.number("f2.delay", "limit") - wait[:, 1]}


def cause(reading):
    """Margin of abs.cause, for each run."""
    page, (p, _) = PAGE[0], filters(reading)
    part, lost = LEDGER.number("abs.cause", "part"), []
    for share in (0.0, 1.0):
        o = page.monte_carlo([p], COPIES, method=partial(page.mended, share=share))
        lost.append(1 - page.declared_share(o)[:, 0])
    return (1 - part) * lost[0] - lost[1]


@functools.cache
def unreset(p):
    """Effective shares (run, frame) of a classic filter whose weights are never reset."""
    return PAGE[0].never_reset(p, RUNS)


def unavoidable(reading):
    """Margin of s0.degeneracy.unavoidable, for each run."""
    level, frame = (LEDGER.number("s0.degeneracy.unavoidable", it) for it in ("level", "frame"))
    return level - unreset(own(reading))[:, int(frame) - 1]


def waste(reading):
    """Margin of s0.degeneracy.waste, for each run."""
    level, frame = (LEDGER.number("s0.degeneracy.waste", it) for it in ("level", "frame"))
    return 1 - unreset(own(reading))[:, int(frame) - 1] - level


def relieves(reading):
    """Margin of s0.resampling.relieves, for each run."""
    p = own(reading)
    gain = np.log10(flown(p).n_eff[:, 0] / p.M / unreset(p))
    return gain[:, PAGE[0].present].mean(axis=1) - LEDGER.number("s0.resampling.relieves", "level")


@functools.cache
def blanked(p):
    """The runs of one filter that starts at the target, which is blanked in one frame."""
    page = PAGE[0]
    return page.monte_carlo([p], GAPS, page.last_frame, method=page.seeded, fade=page.blank)


def mitigated(reading):
    """Margin of s2.miss.mitigated, for each run."""
    q = filters(reading)[1]
    parts = zip(blanked(replace(q, N=1)), blanked(q), strict=True)
    both = PAGE[0].Outcome(*(np.concatenate(each, axis=1) for each in parts))
    return PAGE[0].saved_after(both)


@functools.cache
def placed(p, fade=None):
    """The runs of one filter that starts at the target."""
    return PAGE[0].monte_carlo([p], PLACED, method=PAGE[0].seeded, fade=fade)


def degraded(id, reading):
    """Margins of a row on what degrades the placed classic filter, (run, 2)."""
    page, p, frames = PAGE[0], own(reading), PAGE[0].present
    hard = easy = placed(p)
    if id == "abs.degrade.weak":
        factor = LEDGER.number(id, "factor")
        hard = placed(replace(p, scene=replace(p.scene, amplitude=factor * p.scene.amplitude)))
    elif id == "abs.degrade.fluctuation":
        hard = placed(p, page.fades)
    else:
        easy, frames = placed(replace(p, scene=page.straight)), np.flatnonzero(page.regime == 2)
    return page.losses(hard, 0, easy, 0, frames) - LEDGER.number(id, "limit")


def study(make):
    """A study of one row from what it is judged by in each run under a reading."""

    def options(page, readings):
        PAGE[:] = [page]
        return driver.compared([make(reading) for reading in readings])

    return options


def of_row(id, reading):
    """One row of the main runs."""
    return of_pair(reading)[id]


MAIN = ("s0.diversity", "s2.diversity", "s2.effectiveness", "f3.regime")
MAIN += ("abs.detects", "s4.pd", "s4.earlier", "s4.accuracy", "f2.delay")
ROWS = {id: study(partial(of_row, id)) for id in MAIN}
ROWS |= {"s0.degeneracy.unavoidable": study(unavoidable), "s0.resampling.relieves": study(relieves)}
ROWS |= {"s0.degeneracy.waste": study(waste), "s2.miss.mitigated": study(mitigated)}
ROWS["abs.cause"] = study(cause)
DEGRADED = ("abs.degrade.weak", "abs.degrade.manoeuvre", "abs.degrade.fluctuation")
ROWS |= {id: study(partial(degraded, id)) for id in DEGRADED}
