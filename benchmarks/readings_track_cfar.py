"""Rows of Figures 5, 6 and 7 of chapter 04 under every reading, for ``benchmarks/readings.py``.

Both detectors are flown under each combination of readings on common scenes.  Equation (12) in the
place of (13) is the largest P_Z that it may give, -ln(1 - P_Z); it concerns the proposed one alone.
"""

import functools
import itertools
import math
from dataclasses import replace

import numpy as np

from tbdcore import score
from tbdcore.repro import trials
from tbdcore.repro.claims import Option

USES = ("page", "scene_of", "detector", "p", "true", "seed", "S_dB", "km", "vanish_frame", "M")
FLIGHTS, LEVEL, FEWEST = 20000, 0.50, 300  # FEWEST: tracks for a conditional share
ALARMS = {"everywhere": {}, "none with a target": {"quiet": True}}
ALARMS |= {"none in the target's cell": {"spared": True}}
PLOTS = {"nearest": {}, "strongest": {"strongest": True}}
ERRORS = {"mean SNR": 0, "own statistic": 1, "own statistic and known": 2}
FLOWN = ("false alarms", "association", "plot errors", "power of sigma_p", "cell probability")
EVERY = [*itertools.product(ALARMS, PLOTS, ERRORS, ("2", "1"), ("(13)", "(12)"))]


def numbers(page, choice, traditional):
    """A detector under a combination of readings."""
    alarms, plots, errors, power, cell = choice
    q = page.p if power == "2" else replace(page.p, sigma_p=page.p.sigma_p**0.5)
    options = ALARMS[alarms] | PLOTS[plots] | {"instant": ERRORS[errors]}
    d = list(page.detector(q, page.p.cell_pfa if traditional else 0.0, **options))
    d[1] = -math.log1p(-d[1]) if cell == "(12)" else d[1]
    return tuple(d)


def flight(seed, i, page, designs):
    """Deaths, hits and deaths of those that lose their target, of each design on one scene."""
    scene, cfar = page.scene_of(seed, i, "quiet", page.p, page.true), page.page()
    gone = np.array([page.vanish_frame])
    each = [cfar.lives(scene, page.true, cfar.Design(*d), gone) for d in designs]
    return tuple(np.array(part) for part in zip(*each, strict=True))


@functools.cache
def flights(traditional):
    """The flights of every combination, by combination: deaths, hits, deaths without a target."""
    page = PAGE[0]
    choices = [it for it in EVERY if not traditional or it[-1] == "(13)"]
    designs = [numbers(page, choice, traditional) for choice in choices]
    fly = functools.partial(flight, page=page, designs=designs)
    parts = trials.run(fly, FLIGHTS, seed=page.seed, workers=1, label="readings")
    each = [[part[:, j] for part in parts] for j in range(len(choices))]
    return dict(zip(choices, each, strict=True))


PAGE = []  # the page's names, for the flights, which all rows share


def crossing(x, happened, of):
    """Where a share of the flights `of` falls through one half, and each flight's shift of it."""
    few = of.sum(axis=0) < FEWEST
    y = np.where(few, 0.0, happened.mean(axis=0) / np.where(few, 1.0, of.mean(axis=0)))
    at, down = score.crossing(x, y, LEVEL), np.flatnonzero((y[:-1] >= LEVEL) & (y[1:] < LEVEL))
    if not down.size:
        return math.nan, np.full(len(happened), math.nan)
    i = down[-1]
    w, pair = (at - x[i]) / (x[i + 1] - x[i]), slice(i, i + 2)
    off = (happened[:, pair] - y[pair] * of[:, pair]) / of[:, pair].mean(axis=0)
    return float(at), off @ [1 - w, w] * (x[i + 1] - x[i]) / (y[i] - y[i + 1])


def half(page, reading, kind, traditional):
    """SNR (kind "snr") or range at one half under a reading."""
    choice = [reading.get(name, first) for name, first in zip(FLOWN, EVERY[0], strict=True)]
    choice[-1] = "(13)" if traditional else choice[-1]
    died, hit, _ = flights(traditional)[tuple(choice)]
    frames = np.arange(len(page.km))
    if kind == "snr":
        alive = died[:, None] >= frames
        given = reading["detection probability"] == "conditional"
        return crossing(page.S_dB, hit, alive if given else np.ones_like(alive))
    late = reading["maintained to a range"] == "after the decision"
    alive = died[:, None] >= frames + late
    return crossing(page.km, alive, np.ones_like(alive))


def row(kind, who):
    """A study of one row of Figure 5 or 6."""

    def study(page, readings):
        PAGE[:] = [page]
        values = []
        for reading in readings:
            pair = [half(page, reading, kind, it) for it in (True, False)]
            values.append(of_pair(kind, who, *pair))
        return options(values)

    return study


def of_pair(kind, who, traditional, proposed):
    """The value of a row, and its shifts by flight, from those of both detectors."""
    (at0, off0), (at1, off1) = traditional, proposed
    if who != "gain":
        return traditional if who == "traditional" else proposed
    if kind == "snr":
        return at0 - at1, off0 - off1
    return 100 * (at1 / at0 - 1), 100 * (off1 - at1 / at0 * off0) / at0


def options(values):
    """Options of (value, shift by flight) of each reading, the default first; None: no crossing."""
    (first, shift0), n = values[0], len(values[0][1])
    found = []
    for value, shift in values:
        errors = [float(np.std(x)) / math.sqrt(n) for x in (shift - shift0, shift)]
        found.append(Option(value, value - first, errors[0], errors[1], n))
    return [it if math.isfinite(it.measured) else None for it in found]


def exists(page, readings):
    """f7.exist12.mc: the share of tracks that exist M frames after the target has vanished."""
    PAGE[:] = [page]
    last, values = page.vanish_frame + page.M - 1, []
    for reading in readings:
        ends = flights(False)[tuple(reading[name] for name in FLOWN)][2][:, 0]
        alive = (ends > last).astype(float)
        values.append((alive.mean(), alive - alive.mean()))
    return options(values)


ROWS = {f"f5.snr50.{who}": row("snr", who) for who in ("traditional", "proposed", "gain")}
ROWS |= {f"f6.range50.{who}": row("km", who) for who in ("traditional", "proposed", "gain")}
ROWS["f7.exist12.mc"] = exists
