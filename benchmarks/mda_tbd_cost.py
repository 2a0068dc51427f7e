"""CPU time of a trial of each method of chapter 03: ``python -m benchmarks.mda_tbd_cost``.

A trial is 200 frames of the paper's scene at 6 dB; simulating them is not counted.
"""

from functools import partial

import numpy as np

from benchmarks import mda_tbd_methods, timing


def main():
    """Time the methods, and write the file."""
    page = mda_tbd_methods.page
    z = page.simulate(page.Scene(), np.random.default_rng(1), np.random.default_rng(2))
    fly = partial(mda_tbd_methods.fly, z=z, R=6.0, rng=np.random.default_rng(3))
    trials = {name: partial(fly, [name]) for name in mda_tbd_methods.METHODS}
    timing.write_costs("mda_tbd", trials, repeat=2)


if __name__ == "__main__":
    main()
