"""Which cells a claim needs, by hand."""

import nbformat
import pytest

from benchmarks import rows


def cells(*sources):
    return [nbformat.v4.new_code_cell(source) for source in sources]


NOTEBOOK = cells(
    "import numpy as np",  # 0
    "def fly(n):\n    return scale * np.ones(n)",  # 1: uses what stands below
    "scale = 2.0",  # 2
    "flown = fly(3)",  # 3
    "other = fly(300)",  # 4: not needed
    "flown[0] = 7.0",  # 5: changes
    "total = [x for x in flown]",  # 6
    'portfolio.save(fig, "fig1", claims=["a.b"])',  # 7: draws
    'ledger.check("a.b", sum(total))',  # 8
    'total = other\nledger.check("c.d", total[0])',  # 9
)


@pytest.mark.parametrize(
    ("ids", "found"),
    [(["a.b"], [0, 1, 2, 3, 5, 6, 8]), (["c.d"], [0, 1, 2, 4, 9]), (["no.such"], [])],
)
def test_a_claim_needs_the_cells_that_make_and_change_its_names(ids, found):
    assert rows.needed(NOTEBOOK, ids) == found


def test_a_name_comes_from_the_last_cell_that_makes_it():
    again = cells("x = 1", "x = 2", 'ledger.check("a", x)', "x = 3")
    assert rows.needed(again, ["a"]) == [1, 2]


def test_a_name_that_is_stored_first_is_not_needed():
    assert rows.names("x = 1\ny = x + z") == ({"x", "y"}, set(), {"z"})
    assert rows.names("x += 1") == ({"x"}, set(), {"x"})
    assert rows.names("a.b[0] = c").changed == {"a"}
