"""Every folder of the repository, each written once.

The repository is the folder above this package (it is installed in place).  ``TBDCORE_FIGURES`` in
the environment moves the products of default runs elsewhere: the tests use it, so that checking the
committed figures never rewrites them.
"""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "notebooks"  # NN_<paper>.ipynb, committed executed
DATA = ROOT / "data"  # papers.toml: bibliography
CLAIMS = DATA / "claims"  # <paper>.csv: what the papers publish
LONGER = DATA / "longer"  # <paper>/verdicts.csv: of a run that a notebook has no time for
PACKAGE = ROOT / "tbdcore"
PRODUCTS = ROOT / "figures"  # <paper>/fig05.pdf and its kin: the committed products
LOCK = ROOT / "environment.txt"
README = ROOT / "README.md"
CITATION = ROOT / "CITATION.cff"
BUILD = ROOT / "build"  # everything that is neither source nor product


def figures():
    """The folder of the committed products, or the one that TBDCORE_FIGURES names."""
    return Path(os.environ.get("TBDCORE_FIGURES") or PRODUCTS).resolve()
