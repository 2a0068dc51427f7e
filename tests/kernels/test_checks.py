"""Checks of arguments that no kernel's own test reaches."""

import warnings

import numpy as np
import pytest

from tbdcore import checks


@pytest.mark.parametrize("check", [checks.plain, checks.reals, checks.integers])
def test_a_masked_array_is_refused_and_not_stripped_of_its_mask(check):
    z, shape = np.ma.masked_greater(np.arange(3), 1), [] if check is checks.plain else [3]
    for given in (z, [z, z], (z.filled(0), z)):
        with pytest.raises(ValueError, match="^frames: a masked array; fill it, or leave out what"):
            check("frames", given, *shape)
    assert np.array_equal(check("frames", z.filled(0), *shape), [0, 1, 0])


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.int8, float])
def test_a_number_of_any_type_is_compared_with_limits_beyond_its_own(kind):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checks.number("x", kind(5), 0.0, 1e50)
    with pytest.raises(ValueError, match="is no number in"):
        checks.number("x", kind(5), 6.0, 1e50)
