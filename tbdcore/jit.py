"""The decorator of every compiled loop."""

from collections.abc import Callable
from typing import Any, TypeVar

__all__ = ["kernel"]

Function = TypeVar("Function", bound=Callable)


def kernel(function: Function) -> Function:
    """Compile a function.  No disk cache in a notebook: it would not see that a callee changed."""
    from numba import njit

    cache = function.__module__ != "__main__"
    compiled: Any = njit(cache=cache, error_model="numpy")(function)
    return compiled
