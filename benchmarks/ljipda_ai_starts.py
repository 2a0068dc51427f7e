"""Section 5.2 of chapter 05 with five other seeds: ``python -m benchmarks.ljipda_ai_starts``.

It takes two minutes and writes ``data/ljipda_ai_starts.csv``, with the columns of the seeds' tables
(``benchmarks.seeds.lead``): the share of tracks that are lost, mean of the targets, in percent, in
the scenes and settings of the page's tables ``open_scenes`` and ``open_settings``; there also by
how much less of the same tracks a method loses than JIPDA.
"""

import types
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from benchmarks import rows
from benchmarks.seeds import FIVE, TABLE_COLUMNS
from tbdcore.repro import paths, products, trials

USES = ("page", "p", "errors", "Score", "se")
SCENES = {name: {"scenario": name} for name in ("cross", "fan", "common")}
SCENES["common, start 5 m/s"] = {"scenario": "common", "init_speed": 5.0}
SETTINGS = {"as chosen": {}, "start 100 m, 5 m/s": {"init_speed": 5.0}}
SETTINGS |= {f"clutter {c:g} per m^2": {"clutter": c} for c in (1e-5, 3e-6)}
SAVERS = ("IPDA-AI", "LJIPDA-AI")
OF_SCENE, OF_SETTING = 60, 100  # trials of each seed


def lost(page, change, methods, seed, n):
    """Mean share (n,) of lost tracks by method, in percent, in a scene with something changed."""
    q = replace(page.p, **change)
    found = trials.run(partial(page.errors, q, methods), n, seed=seed, label=f"starts {seed}")
    shares = [page.Score(each).lost.mean(axis=1) for each in np.moveaxis(found, 1, 0)]
    return dict(zip(methods, 100.0 * np.array(shares), strict=True))


def lines(page, seed):
    """Rows of the file for one seed."""
    for scene, change in SCENES.items():
        for method, share in lost(page, change, [*page.page().METHODS], seed, OF_SCENE).items():
            yield "open_scenes", method, scene, seed, share.mean(), page.se(share)
    for setting, change in SETTINGS.items():
        shares = lost(page, change, ["JIPDA", *SAVERS], seed, OF_SETTING)
        saved = {f"JIPDA less {name}": shares["JIPDA"] - shares[name] for name in SAVERS}
        for name, share in (shares | saved).items():
            yield "open_settings", setting, name, seed, share.mean(), page.se(share)


def main():
    """Fly all with each seed, and write the file."""
    page = types.SimpleNamespace(**rows.definitions("ljipda_ai", USES))
    found = [("ljipda_ai", *line) for seed in FIVE for line in lines(page, seed)]
    head = f"# python -m benchmarks.ljipda_ai_starts; seeds {FIVE[0]} to {FIVE[-1]}, "
    head += f"{OF_SCENE} trials of a scene, {OF_SETTING} of a setting\n"
    file = paths.claims().parent / "ljipda_ai_starts.csv"
    table = pd.DataFrame(found, columns=TABLE_COLUMNS).round(3)
    products.write(file.parent, {file.name: head.encode() + products.csv(table)})


if __name__ == "__main__":
    main()
