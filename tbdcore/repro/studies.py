"""Offline studies that a page shows: ``data/<name>.csv``, made by a program of ``benchmarks/``."""

import pandas as pd

from tbdcore.repro import paths


def read(name):
    """A study as a table; ValueError, in one line, where the file is missing or no table."""
    file = paths.CLAIMS.parent / f"{name}.csv"
    try:
        return pd.read_csv(file, comment="#", keep_default_na=False, na_values=["nan"])
    except (OSError, ValueError) as error:
        advice = f"no table ({error}); make it anew: python -m benchmarks.{name}"
        raise ValueError(f"{file}: {advice}") from None
