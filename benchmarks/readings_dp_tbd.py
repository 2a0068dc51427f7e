"""Rows of chapter 01 under the readings of its words, for ``benchmarks/readings.py``.

The deviations of (10) change what is flown; the bars of (22) and (23), and P_D in the place of P_d,
how it is scored.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from tbdcore.repro import claims

USES = ("p", "n_fifth", "ALGORITHMS", "conventional", "weighted", "unweighted", "simulate")
USES += ("found", "followed", "falls", "long_falls", "leads", "levels", "errors_of", "grown")
USES += ("at_seven", "sided", "near_half", "extremes", "saving", "passage", "sampled", "small_base")
USES += ("NAMED", "RATES", "window", "shares")
USES += ("without_weight", "large_base", "straight", "weak", "strong", "CONV", "SW", "n_trials")
RUNS = {}  # by what was flown: one run serves many rows


def flown(page, name, deviations):
    """A run of the page and its scenario, by name and deviations of (10)."""
    key = name, deviations
    if key not in RUNS:
        q = replace(page.p, reading=deviations)
        coarse = replace(q, snr_db=page.sampled("abs.along_path"))
        both = page.conventional, page.weighted
        RUNS[key] = {
            "main": lambda: (page.simulate(q, page.ALGORITHMS, page.n_fifth), q),
            "long": lambda: page.extremes(q, 1),
            "weak": lambda: page.near_half(q, page.weak, 5, 11, both, 1),
            "strong": lambda: page.near_half(q, page.strong, 7, 12, both, 1),
            "fifth": lambda: (page.simulate(coarse, page.ALGORITHMS, page.n_fifth), coarse),
            "free": lambda: (page.simulate(coarse, (page.unweighted,), page.n_fifth), coarse),
        }[name]()
    return RUNS[key]


def scored(page, name, reading):
    """A run, and its scenario with the bars of a reading."""
    run, q = flown(page, name, reading.get("eq. (10)", page.p.reading))
    return run, replace(q, metric=reading.get("bars of (22)", q.metric))


def of_main(page, reading):
    """Margins of the rows of the main run."""
    run, q = scored(page, "main", reading)
    margins = page.falls(run, q) | page.leads(run, q) | page.levels(run, q)
    if page.p.reading == reading.get("eq. (10)", page.p.reading):
        margins |= page.long_falls(*scored(page, "long", reading))
    return margins


def of_errors(page, reading):
    """Margins of the rows on position errors."""
    run, q = scored(page, "main", reading)
    near, close = scored(page, "strong", reading)
    error, at_end = page.errors_of(run, q), page.errors_of(near, close)
    at7 = page.at_seven(error, at_end, q, close)
    sided = {key: page.sided(key, x) for key, x in at7.items()}
    margins = page.grown(error, q) | {f"f4.err7.{key}": [x] for key, x in sided.items()}
    margins["f4.sw_better_conv"] = [sided[f"conv.{rate}"] for rate in ("w0", "w02", "w04")]
    return margins


def of_halves(page, reading):
    """The SNRs and gains at one half, from P_d or from P_D."""
    measure = page.followed if reading.get("SNR at 50 %") == "P_D" else page.found
    at = {}
    for name in ("weak", "strong"):
        run, q = scored(page, name, reading)
        hits = measure(run, q)[:, 0]
        at[name] = [page.passage(q.snr_db, hits[:, :, alg]) for alg in (0, 1)]
    gains = {name: one - two for name, (one, two) in at.items()}
    return {
        "f2.snr50.conv.w04": [at["strong"][0]],
        "f2.gain.sw_conv.w02": [gains["weak"]],
        "f2.gain.sw_conv.w04": [gains["strong"]],
    }


def of_order(page, reading):
    """The order of the gains in both turns, from the main run."""
    run, q = scored(page, "main", reading)
    measure = page.followed if reading.get("SNR at 50 %") == "P_D" else page.found
    hits = measure(run, q)
    gains = [page.saving(q.snr_db, hits, o, page.CONV, page.SW) for o in (page.weak, page.strong)]
    return {"f2.gain.order": [gains[0] - gains[1]]}


def of_low_snr(page, reading):
    """Margins of s5.sw_low_snr: gains in P_d of longer runs."""
    found = of_halves(page, reading)
    return {"s5.sw_low_snr": found["f2.gain.sw_conv.w04"] + found["f2.gain.sw_conv.w02"]}


def of_low_snr_followed(page, reading):
    """Margins of s5.sw_low_snr: gains in P_D of the main run."""
    run, q = scored(page, "main", reading)
    hits = page.followed(run, q)
    return [page.saving(q.snr_db, hits, o, page.CONV, page.SW) for o in (page.weak, page.strong)]


def of_base(page, reading):
    """Margins of the rows on the extended set without a weight."""
    (run, q), (other, _) = (scored(page, name, reading) for name in ("fifth", "free"))
    main = page.large_base(*scored(page, "main", reading))
    return page.without_weight(run, other, q, main)


def of_small_base(page, reading):
    """Margin of s3.2.a_small."""
    _, q = scored(page, "fifth", reading)
    return {"s3.2.a_small": [page.small_base(q)]}


def row(make, id, page, readings):
    """Options of a row of one run under all its readings."""
    parts = [make(page, reading)[id] for reading in readings]
    return list(map(option, parts, [parts[0]] * len(parts)))


def option(parts, default):
    """What is measured under a reading, and the least of its paired differences from the default.

    Margins may come from runs of different lengths, so each has its own error and difference.
    """
    gaps = [new - old for new, old in zip(parts, default, strict=True)]
    values, errors = [x.value for x in parts], [x.se for x in parts]
    n = min(len(x.influence) for x in parts)
    if len(parts) == 1:
        return claims.Option(values[0], gaps[0].value, gaps[0].se, errors[0], n)
    differences, scatter = [x.value for x in gaps], [x.se for x in gaps]
    return claims.Option(values, differences, scatter, errors, n)


def low_snr(page, readings):
    """Options of s5.sw_low_snr, whose margins come from two runs."""
    parts = [
        of_low_snr(page, it)["s5.sw_low_snr"] + of_low_snr_followed(page, it) for it in readings
    ]
    return [option(each, parts[0]) for each in parts]


def low(id, page, readings):
    """Options of a row on a share P_D: below a level up to 7 dB, or at the highest SNR."""
    bound = id.startswith("f3.low_below7")
    name, rate = id.split(".")[-2:] if bound else ("toni", id.split(".")[-1])
    ledger, flown_ = claims.Ledger("dp_tbd", strict=False), []
    alg, o = page.NAMED[name], page.RATES[rate]
    at = page.window(id) if bound else [-1]
    for reading in readings:
        run, q = scored(page, "main", reading)
        flown_.append(page.followed(run, q)[:, o, at, alg] * 1.0)
    options = []
    for kept in flown_:
        y, se = page.shares(kept)
        gap = kept - flown_[0]
        level = ledger.number(id, "level") - y if bound else float(y[0])
        error = gap.std(axis=0) / np.sqrt(len(gap))
        size = (slice(None),) if bound else (0,)
        parts = (x[size] for x in (gap.mean(axis=0), error, se))
        options.append(claims.Option(level, *parts, len(kept)))
    return options


NAMES = {
    of_main: "f2.drop.conv f3.drop.conv f2.conv_small_effect f2.sw_sensitivity s4.2.expect_w0 "
    "s2.2.toni_noise f2.best_sw_over_conv f2.best_sw_over_toni f3.best_sw_over_conv "
    "f3.best_sw_over_toni s5.sw_best abs.sw_improves f2.w0.sw_over_toni f3.w0.sw_over_toni "
    "s5.toni_over_conv s2.2.conv_noise s5.conv_snr s1.conv_high_snr "
    + " ".join(
        f"{figure}.drop.{name}"
        for figure in ("f2", "f3")
        for name in ("toni", "sw", "max_toni", "min_conv", "mid_sw")
    ),
    of_errors: "f4.grow.conv f4.grow.toni f4.grow.sw f4.sw_better_conv "
    + " ".join(f"f4.err7.{n}.{r}" for n in ("conv", "toni", "sw") for r in ("w0", "w02", "w04")),
    of_halves: "f2.snr50.conv.w04 f2.gain.sw_conv.w02 f2.gain.sw_conv.w04",
    of_order: "f2.gain.order",
    of_base: "abs.along_path s1.extend_more_noise s3.2.a_large",
    of_small_base: "s3.2.a_small",
}
ROWS = {id: partial(row, make, id) for make, ids in NAMES.items() for id in ids.split()}
ROWS["s5.sw_low_snr"] = low_snr
SHARES = [f"f3.low_below7.{n}.{r}" for n in ("conv", "toni") for r in ("w0", "w02", "w04")]
SHARES = [
    *SHARES[:-1],
    "f3.toni_zero.w02",
]  # that of Tonissen's set in the strong turn is a theorem
ROWS |= {id: partial(low, id) for id in SHARES}
