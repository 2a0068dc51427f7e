"""Checks of what a caller passes: a wrong argument is a ValueError of one line that names it.

A compiled loop would read outside its arrays, or raise Numba's own error of many lines.
"""

import functools
import operator

import numpy as np
from numba import typeof
from numba.core.errors import NumbaError

from tbdcore import kernel

_FLOATS, _INT = (np.dtype(np.float64), np.dtype(np.float32)), np.dtype(np.int64)


def typed(compiled, inside=None):
    """The kernel; what Numba cannot compile is a ValueError.  Other kernels call ``inside``."""

    @functools.wraps(compiled.py_func)
    def call(a, b, *args):
        try:
            if type(a) is not list and type(b) is not list:  # on which Numba warns
                return compiled(a, b, *args)
        except (NumbaError, OverflowError):
            pass
        name = f"{call.__module__}.{call.__name__}".removeprefix("tbdcore.")
        raise ValueError(f"{name}: arguments of another type or shape; see help()")

    call.py_func, call.stats = compiled.py_func, compiled.stats
    call._numba_type_ = typeof(inside or compiled)
    return call


def plain(name, values):
    """The values as an array; a masked one is a ValueError, since its mask would be lost."""
    parts = values if isinstance(values, (list, tuple)) else (values,)
    if type(values) is not np.ndarray and any(isinstance(x, np.ma.MaskedArray) for x in parts):
        raise ValueError(f"{name}: a masked array; fill it, or leave out what is masked")
    return np.asarray(values)


def reals(name, values, *shape):
    """Array of real numbers of the given shape, in which a word stands for any size.

    float32 and float64 are kept, other real numbers become float64.
    """
    a = plain(name, values)
    if a.dtype not in _FLOATS:
        if a.dtype.kind not in "fiu":
            raise ValueError(f"{name}: values of type {a.dtype}; give real numbers")
        a = a.astype(float)
    _fit(name, a.shape, shape)
    return a


def integers(name, values, *shape):
    """Array of integers (int64) of the given shape, as in :func:`reals`."""
    a = plain(name, values)
    if a.dtype.kind not in "iu" and a.size:
        raise ValueError(f"{name}: values of type {a.dtype}; give integers")
    _fit(name, a.shape, shape)
    return a if a.dtype is _INT else a.astype(_INT)


def _fit(name, found, wanted):
    if len(found) == len(wanted):
        for i in range(len(found)):
            if found[i] != wanted[i] and type(wanted[i]) is not str:
                break
        else:
            return
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
    plain = value.item() if isinstance(value, np.generic) else value  # float32 has other limits
    if not (isinstance(plain, (float, int, np.floating)) and low <= plain <= high):
        raise ValueError(f"{name}: {value!r} is no number in [{low:g}, {high:g}]")


def within(name, a, low, high):
    """The array a; ValueError, naming the first, unless all elements lie in [low, high]."""
    if _outside(a.reshape(-1), low, high):
        at = np.argwhere(~((a >= low) & (a <= high)))[0].tolist()
        raise ValueError(f"{name}{at or ''}: {a[tuple(at)]:g} is not in [{low:g}, {high:g}]")
    return a


@kernel
def _outside(flat, low, high):
    """How many elements are not in [low, high]; NaN is not."""
    inside = 0
    for n in range(flat.size):
        inside += (flat[n] >= low) & (flat[n] <= high)
    return flat.size - inside
