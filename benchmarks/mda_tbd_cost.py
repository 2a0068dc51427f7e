"""CPU time of a trial of each method of chapter 03: ``python -m benchmarks.mda_tbd_cost``.

A trial is 200 frames of the paper's scene at 6 dB; simulating them is not counted.
"""

from functools import partial

import numpy as np

import tbdcore
from benchmarks import mda_filters, timing

NAMES = {"optimum": "told right", "optimum, told 3 dB too little": "told -3 dB"}
NAMES |= {name: name for name in ("proposed", "mainstream", "averaged")}
NAMES |= {
    f"{name}, births by power": f"{NAMES[name]}, births by power"
    for name in ("optimum", "proposed", "averaged")
}


def fly(page, z, p):
    """One trial."""
    return page.recursion(z, p, np.random.default_rng(3))


def main():
    """Time the methods, and write the file."""
    page = tbdcore.page("mda_tbd")
    z = page.simulate(page.Scene(), np.random.default_rng(1), np.random.default_rng(2))
    filters = mda_filters.plain(page)
    trials = {name: partial(fly, page, z, filters[key]) for name, key in NAMES.items()}
    timing.write_costs("mda_tbd", trials, repeat=2)


if __name__ == "__main__":
    main()
