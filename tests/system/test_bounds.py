"""The pair test once more with Numba's bounds checks, which an ordinary run does not have."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PAIRS = Path(__file__).parents[1] / "kernels" / "test_pairs.py"
OUTSIDE = """
import numpy as np
from tbdcore import kernel
read = kernel(lambda a, n: a[n])
print(read(np.zeros(3), 3))
"""


@pytest.fixture
def checked(tmp_path):
    """An environment in which compiled code checks its bounds, with a cache of its own."""
    return os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path / "numba")}


def test_the_flag_is_on(checked, tmp_path):
    script = tmp_path / "outside.py"
    script.write_text(OUTSIDE)
    done = subprocess.run([sys.executable, script], env=checked, capture_output=True, text=True)
    assert done.returncode == 1
    assert "IndexError" in done.stderr


def test_no_kernel_leaves_its_arrays(checked):
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", PAIRS]
    done = subprocess.run(
        command, env=checked, cwd=PAIRS.parents[2], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-2000:]
