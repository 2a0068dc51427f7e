"""What breaks promises of chapter 05: ``python -m benchmarks.ljipda_ai_limits``, five minutes.

LJIPDA-AI in the paper's own scene with one thing wrong at a time.  It writes
``data/ljipda_ai_limits.csv``: the share of tracks on nothing that still exist in scan 20, and of
tracks that are kept with a target, with standard errors, all in percent, for the page's seed and
for five others.  *Stored*: nothing is corrected; *recorded*: by what a recording tells.
"""

import math
import types
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from benchmarks import rows
from benchmarks.seeds import FIVE
from tbdcore import noise, score
from tbdcore.repro import paths, products, trials

NAMES = "page p d stream share_error seed COUNTED loss_distance loss_scans"
USES = tuple(NAMES.split())
COLUMNS = ["condition", "remedy", "seed", "false", "false_se", "kept", "kept_se", "n"]
OWN, OTHERS = 208, 60  # trials of the page's seed, of each other one
SHAPE = 0.5  # of the K clutter
CASES = (
    ("as told", "stored"),
    ("K clutter", "stored"),
    ("density", "stored"),
    ("P_D", "stored"),
    ("errors", "stored"),
    ("unit", "stored"),
    ("gaps", "stored"),
    ("K clutter", "recorded"),
    ("density", "recorded"),
    ("unit", "recorded"),
    ("gaps", "recorded"),
)


def tail_of(nu, false_alarm):
    """-ln of the probability that K clutter above the threshold exceeds it by x, and x (n,)."""
    x = np.append(np.linspace(0, 60, 601), np.geomspace(61, 5e3, 400))
    if nu == math.inf:
        return x, x
    low = -math.log(false_alarm)
    survival = noise.k_survival(low + x, nu) / noise.k_survival(np.array([low]), nu)
    return -np.log(np.maximum(survival, 1e-300)), x


def in_clutter(plots, quiet, tail):
    """Plots whose false ones have the powers of K clutter; quiet: the same without targets."""
    return plots._replace(u=np.where(plots.u > quiet.u, plots.u, np.interp(quiet.u, *tail)))


def as_told(plots, tail, level):
    """Plots whose Rayleigh ratio is the ratio of a target at a level to the law of a tail."""
    y, x = tail
    log_density = np.interp(plots.u, x, np.log(np.gradient(y, x)) - y)
    log_ratio = -plots.u / (1 + level) - math.log1p(level) - log_density
    log_ratio = np.clip(log_ratio, -50, 50)
    return plots._replace(u=(log_ratio + math.log1p(level)) * (1 + level) / level)


def false_alarm(page):
    """P_FA that (8) gives for the printed P_D and level."""
    return page.p.p_detect ** (1 + page.d)


def with_gaps(plots):
    """Plots without those of every third scan."""
    size = np.diff(plots.first)
    lost = np.arange(size.size) % 3 == 2
    keep = np.repeat(~lost, size)
    first = np.append(0, np.cumsum(np.where(lost, 0, size)))
    return plots._replace(z=plots.z[keep], u=plots.u[keep], first=first)


def flown(q, seed, i, page):
    """States and existences of the three tracks, in the order of CASES."""
    alg, draw = page.page(), partial(page.stream, i, experiment="limits", seed=seed)
    plots = alg.simulate(q, draw("noise"))
    quiet = alg.simulate(replace(q, snr_db=-math.inf), draw("noise"))
    s, tail = alg.setup(page.p, draw("filter")), tail_of(SHAPE, false_alarm(page))
    heavy, loud = in_clutter(plots, quiet, tail), plots._replace(u=4.0 * plots.u)
    unit = loud.u[plots.u == quiet.u].mean()  # of the false plots: 1 in the right unit
    sharp = {"sigma_r": s.sigma_r / 2, "sigma_theta_deg": s.sigma_theta_deg / 2}
    runs = [
        (plots, s),
        (heavy, s),
        (plots, replace(s, clutter=s.clutter / 10)),
        (plots, replace(s, p_detect=0.6)),
        (plots, replace(s, **sharp)),
        (loud, s),
        (with_gaps(plots), s),
        (as_told(heavy, tail, page.d), s),
        (plots, replace(s, clutter="estimate")),
        (loud._replace(u=loud.u / unit), s),
    ]
    found = [alg.states(*run, "LJIPDA-AI") for run in runs]
    scans = [plots if k % 3 != 2 else None for k in range(page.p.frames)]
    return [*found, alg.loop(scans, s, "LJIPDA-AI", None, None)[0][:3:2]]


def shares(seed, i, page):
    """Shares (case, 2) of tracks on nothing that still exist, and of tracks that are kept."""
    empty = replace(page.p, p_detect=1e-9)
    alone = [alive[19] > 0.5 for _, alive in flown(empty, seed, i, page)]
    errors = np.array([x for x, _ in flown(page.p, seed, i, page)]) - page.page().course(page.p)[0]
    rule = page.loss_distance, page.loss_scans
    onset = score.loss_onsets(errors[..., ::2], *rule, after=page.COUNTED)
    return np.column_stack([np.mean(alone, axis=1), (onset == page.p.frames).mean(axis=1)])


def lines(page, seed):
    """Rows of the file for one seed."""
    n = OWN if seed == page.seed else OTHERS
    values = trials.run(partial(shares, page=page), n, seed=seed, label=f"limits {seed}")
    values = 100.0 * values.mean(axis=0)
    errors = page.share_error(values * n / 100, n)
    for case, *numbers in zip(CASES, values, errors, strict=True):
        (false, kept), (false_se, kept_se) = numbers
        yield *case, seed, false, false_se, kept, kept_se, n


def main():
    """Fly all cases with all seeds, and write the file."""
    page = types.SimpleNamespace(**rows.definitions("ljipda_ai", USES))
    found = [line for seed in (page.seed, *FIVE) for line in lines(page, seed)]
    head = f"# python -m benchmarks.ljipda_ai_limits; seeds {page.seed}, {FIVE[0]} to {FIVE[-1]}\n"
    file = paths.claims().parent / "ljipda_ai_limits.csv"
    table = pd.DataFrame(found, columns=COLUMNS)
    products.write(file.parent, {file.name: head.encode() + products.csv(table)})


if __name__ == "__main__":
    main()
