"""Exact marginals against Stone Soup's JPDA on one scan; skipped where that library is not
installed.
"""

import numpy as np
import pytest
from peer_jpda import our_marginals, peer_marginals, scan

pytest.importorskip(
    "stonesoup", reason="the peer library Stone Soup is not installed (pip install stonesoup)"
)


@pytest.mark.parametrize(("T", "M"), [(1, 3), (2, 2), (2, 4), (3, 4), (3, 0)])
def test_marginals_equal_those_of_the_peer(T, M):
    where, plots = scan(10 * T + M, T, M)
    np.testing.assert_allclose(
        our_marginals(where, plots), peer_marginals(where, plots), rtol=1e-6, atol=1e-9
    )
