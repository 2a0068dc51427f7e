"""Every benchmark in one table: ``python -m benchmarks [NAME ...]``, names as in
``bench_<name>.py``, all if none is given.

All times are of this machine in this run.  "spec" is how many times slower the plain NumPy
specification is, "limit" how many times longer the kernel takes than the machine's limit (the
module says which), "asked" how many times longer a whole trial takes than it was asked to, "peer"
how many times slower the other library is; a peer that is not installed is left out (``pip install
-e '.[peers]'``, best into an environment of its own).
"""

import importlib
import sys
from pathlib import Path

WIDTHS = (34, 34, 10, 10, 7, 7)
HEADER = ("kernel", "work", "time", "spec", "limit", "asked", "peer")


def names():
    """Names of the benchmarks."""
    return [
        path.stem.removeprefix("bench_")
        for path in sorted(Path(__file__).parent.glob("bench_*.py"))
    ]


def line(cells):
    """One line of the table."""
    return "  ".join(
        cell.ljust(width) for cell, width in zip(cells, (*WIDTHS, 0), strict=True)
    ).rstrip()


def seconds(value):
    """A time with its unit, three digits."""
    unit, size = next(
        (unit, size)
        for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 0.0))
        if value >= size
    )
    return f"{value / (size or 1e-9):.3g} {unit}"


def ratio(value, base):
    """How many times `base` a value is, or nothing where one of them does not apply."""
    return f"{value / base:.3g} x" if value and base else ""


def cells(row):
    """A row of the table."""
    peer = f"{ratio(row.peer_seconds, row.seconds)} {row.peer}" if row.peer_seconds else ""
    limit, asked = (ratio(row.seconds, base) for base in (row.limit_seconds, row.asked_seconds))
    return (
        row.kernel,
        row.work,
        seconds(row.seconds),
        ratio(row.spec_seconds, row.seconds),
        limit,
        asked,
        peer,
    )


def main(wanted):
    """Print the table; 0 when every benchmark ran, 1 when one failed, 2 for an unknown name."""
    unknown = set(wanted) - set(names())
    if unknown:
        print(
            f"benchmarks: {', '.join(sorted(unknown))}: no such benchmark; "
            f"there are {', '.join(names())}",
            file=sys.stderr,
        )
        return 2
    print(line(HEADER))
    failed = 0
    for name in wanted or names():
        try:
            for row in importlib.import_module(f"benchmarks.bench_{name}").rows():
                print(line(cells(row)), flush=True)
        except Exception as error:
            print(f"benchmarks: bench_{name}: {type(error).__name__}: {error}", file=sys.stderr)
            failed = 1
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
