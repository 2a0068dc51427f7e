"""CPU time of a trial of each method of chapter 05: ``python -m benchmarks.ljipda_ai_cost``.

A trial is the crossing of two boats at 6 degrees, 150 scans; simulating the plots is not counted.
"""

from functools import partial

from benchmarks import rows, timing

USES = ("crossing", "flown", "RIVALS", "LABELS", "seed")


def main():
    """Time the methods, and write the file."""
    page = rows.definitions("ljipda_ai", USES)
    _, plots, _, setup = page["crossing"](6, page["seed"], 0)
    timing.write_costs(
        "ljipda_ai",
        {
            page["LABELS"][name]: partial(page["flown"], plots, setup, name)
            for name in page["RIVALS"]
        },
    )


if __name__ == "__main__":
    main()
