"""Checks of what a caller passes: real numbers, their shape, their range.

Every function that hands arrays to a compiled loop calls these first.  A wrong argument is a
ValueError of one line that names the argument; a compiled loop would read outside its arrays, or
raise Numba's own error of many lines.
"""

import operator

import numpy as np

from tbdcore import kernel


def reals(name, values, *shape):
    """Array of real numbers of the given shape, in which a word stands for any size.

    float32 and float64 are kept, other real numbers become float64.  Raises ValueError.
    """
    a = np.asarray(values)
    if a.dtype.kind not in "fiu":
        raise ValueError(f"{name}: values of type {a.dtype}; give real numbers")
    _fit(name, a.shape, shape)
    return a if a.dtype in (np.float64, np.float32) else a.astype(float)


def integers(name, values, *shape):
    """Array of integers (int64) of the given shape, as in :func:`reals`."""
    a = np.asarray(values)
    if a.dtype.kind not in "iu" and a.size:
        raise ValueError(f"{name}: values of type {a.dtype}; give integers")
    _fit(name, a.shape, shape)
    return a if a.dtype == np.int64 else a.astype(np.int64)


def _fit(name, found, wanted):
    if len(found) != len(wanted) or any(
        w != n for n, w in zip(found, wanted, strict=True) if not isinstance(w, str)
    ):
        size = ", ".join(map(str, wanted)) + "," * (len(wanted) == 1)
        raise ValueError(f"{name}: shape {found} is not ({size}); reshape or transpose the array")


def integer(name, value, low):
    """An integer of at least `low`; ValueError otherwise."""
    try:
        number = operator.index(value)
    except TypeError:
        number = None
    if number is None or number < low:
        raise ValueError(f"{name}: {value!r} is no integer of at least {low}")
    return number


def number(name, value, low, high):
    """Raise ValueError unless value is a real number in [low, high]."""
    if not (isinstance(value, (float, int, np.floating, np.integer)) and low <= value <= high):
        raise ValueError(f"{name}: {value!r} is no number in [{low:g}, {high:g}]")


def within(name, a, low, high):
    """Raise ValueError, naming the first, unless all elements of a lie in [low, high]."""
    flat = a.reshape(a.size)
    if _outside(flat, low, high):
        n = int(np.flatnonzero(~((flat >= low) & (flat <= high)))[0])
        at = ", ".join(str(int(i)) for i in np.unravel_index(n, a.shape))
        raise ValueError(f"{name}: element ({at}) is {flat[n]}, not in [{low:g}, {high:g}]")


@kernel
def _outside(flat, low, high):
    """How many elements are not in [low, high]; NaN is not."""
    inside = 0
    for n in range(flat.size):
        inside += (flat[n] >= low) & (flat[n] <= high)
    return flat.size - inside
