"""CPU time of one block for each method of chapter 01: ``python -m benchmarks.dp_tbd_cost``."""

from functools import partial

import numpy as np

from benchmarks import rows, timing
from tbdcore import baseline


def search(make, z, page, p):
    """A search from frames to the best path."""
    return page["track"](page["prepare"](z, p), make(p, z.dtype), p)


def main():
    """Time the methods and write the file."""
    page = rows.definitions("dp_tbd", ("p", "RIVALS", "track", "prepare"))
    p = page["p"]
    z = np.random.default_rng(1).standard_normal((p.K, *p.grid), dtype=np.float32)
    trials = {name: partial(search, make, z, page, p) for name, make in page["RIVALS"].items()}
    trials["brightest cell of all frames"] = partial(baseline.brightest, z)
    print(timing.write_costs("dp_tbd", trials))


if __name__ == "__main__":
    main()
