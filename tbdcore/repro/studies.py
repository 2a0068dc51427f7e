"""Offline studies that a page shows: ``data/<name>.csv``, made by a program of ``benchmarks/``."""

import pandas as pd

from tbdcore.repro import paths


def read(name):
    """A study as a table; ValueError, in one line, where the file is missing or no table."""
    file = paths.claims().parent / f"{name}.csv"
    try:
        return pd.read_csv(file, comment="#", keep_default_na=False, na_values=["nan"])
    except (OSError, ValueError) as error:
        advice = f"no table ({error}); make it anew: python -m benchmarks.{name}"
        raise ValueError(f"{file}: {advice}") from None


def cost(paper, methods):
    """CPU times of a trial, in milliseconds, of some methods of a paper, from
    ``data/<paper>_cost.csv``; ValueError, in one line, for a method that it does not have.
    """
    name = f"{paper}_cost"
    table, again = read(name), f"python -m benchmarks.{name}"
    if not {"method", "cpu_ms"} <= {*table}:
        raise ValueError(f"data/{name}.csv: no columns method, cpu_ms; make it anew: {again}")
    times = dict(zip(table["method"], table["cpu_ms"], strict=True))
    for method in methods:
        if method not in times:
            raise ValueError(f"data/{name}.csv: no CPU time of {method!r}; add it to: {again}")
    return [float(times[method]) for method in methods]
