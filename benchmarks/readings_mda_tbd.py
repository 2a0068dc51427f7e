"""Rows of chapter 03 under the readings of equation (12) and of the prior of the mainstream filter,
for ``benchmarks/readings.py``: all rows on the two filters, measured and calibrated, and those that
repeat them.  Scenes and numbers of trials are those of the page.
"""

import functools
from functools import partial

import numpy as np

from tbdcore.repro import claims

USES = ("CASES", "STATE", "PRIORS", "WRONG", "RAISED", "ROWS", "Link", "changed")
USES += ("ensemble", "n_trials", "side", "measured_row", "accuracy", "robustness", "convergence")
USES += ("mainstream",)
USES += ("experiment_1", "threshold_margin", "experiment_2", "longer", "experiment_3", "table_6")
USES += ("nine", "sooner", "twins")
LEDGER = claims.Ledger("mda_tbd", strict=False)
WAYS, PRIOR = LEDGER.readings["eq. (12)"], LEDGER.readings["prior"]
PAGE = []  # the page's names, for the flights that rows share


def flown(cases, way, n):
    """The ensembles of some cases of the page with a reading of (12)."""
    page = PAGE[0]

    def told(it):
        return page.changed(it, reading=way) if it.filter.source == "history" else it

    return page.ensemble({name: told(it) for name, it in cases.items()}, n)


@functools.cache
def links(way, prior):
    """The links of every row under one reading of (12) and one prior, by claim."""
    page, rows = PAGE[0], {}
    change = {} if prior == PRIOR.default else page.PRIORS[prior]
    state = {name: page.changed(it, **change) for name, it in page.STATE.items()}
    found = flown(page.CASES | state, way, page.n_trials)
    for id, name in (page.ROWS | {"t4.3": page.ROWS["t2.4"]}).items():
        row = page.measured_row(found[name], page.CASES[name])
        rows |= {f"{id}.{key}": [page.Link(*pair, page.n_trials)] for key, pair in row.items()}
    rows |= page.accuracy(found) | page.mainstream(found)
    rows |= page.robustness(found, flown(page.WRONG, way, page.side))
    rows |= page.convergence(found) | page.experiment_1(found) | page.experiment_2(found)
    rows |= page.experiment_3(found) | page.table_6(found) | {"f7.longer": page.longer(found)}
    rows["f7.cause"] = [page.threshold_margin(flown(page.RAISED, way, page.side))]
    rows["t46.optbeaten"] = [page.sooner(found, page.nine, page.ROWS["t6.o"])]
    level = LEDGER.number("t24.same", "level")
    return rows | {"t24.same": [page.Link(level - page.twins(found), 0.0, page.n_trials)]}


def option(each, default):
    """What `claims.Option` has of some links and those of the default; the error of a difference is
    that of independent runs, although both see the same scenes.
    """
    m, se, n = map(np.squeeze, zip(*each, strict=True))
    m0, se0, _ = map(np.squeeze, zip(*default, strict=True))
    return claims.Option(m, m - m0, np.hypot(se, se0), se, int(n.min()))


def options(id, page, readings):
    """A study of one row: an Option for each reading."""
    PAGE[:] = [page]
    words = [(it.get("eq. (12)", WAYS.default), it.get("prior", PRIOR.default)) for it in readings]
    each = [links(*pair)[id] for pair in words]
    return [option(it, each[0]) for it in each]


def rows():
    """The claims that a reading of (12) or of the prior touches, and that are judged."""
    each = [id for it in (WAYS, PRIOR) for id in LEDGER.claims if it.touches(id)]
    return [id for id in dict.fromkeys(each) if LEDGER.claims[id].rule]


ROWS = {id: partial(options, id) for id in rows()}
