"""CPU time of one run of 60 frames by each method of chapter 02's table:
``python -m benchmarks.mm_pf_tbd_cost``.
"""

from functools import partial

import numpy as np

from benchmarks import timing
from benchmarks.mm_pf_tbd_methods import METHODS, page


def main():
    """Time the methods on one run, and write the file."""
    p = page.Scenario()
    z, rng = page.simulate(p.scene, np.random.default_rng(1)), np.random.default_rng(2)
    times = {name: partial(method, z, p, rng) for name, method in METHODS.items()}
    print(timing.write_costs("mm_pf_tbd", times))


if __name__ == "__main__":
    main()
