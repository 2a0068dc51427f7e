"""The committed picture of the harbour is that of the example."""

import pandas as pd

from benchmarks import harbour
from tbdcore.repro import paths


def test_the_picture_shows_what_the_example_finds():
    committed = pd.read_csv(paths.products() / "recorded" / "harbour.csv")
    pd.testing.assert_frame_equal(harbour.table(), committed, atol=0.02, rtol=0)
    names = {file.name for file in (paths.products() / "recorded").iterdir()}
    assert names == {f"harbour.{end}" for end in ("csv", "pdf", "png", "svg")}
