r"""Scenarios: frozen dataclasses whose fields carry letter, unit, source and limits.

    @dataclass(frozen=True)
    class Scenario:
        K: int = given(11, "K", "frames", low=1)
        a: float = given(0.95, "a", low=ABOVE_ZERO, high=1)
        grid: tuple[int, int] = given((50, 50), r"N_x \times N_y", "cells", low=2)
        snr_db: tuple[float, ...] = given((3, 4, 5), r"\mathrm{SNR}", "dB")
        metric: str = given("chebyshev", r"|\cdot|", choices=("chebyshev", "euclidean"))
        __post_init__ = check

The annotation says what a field takes: int, float (any real number), bool, str, another class, or
several of them joined by ``|``.  A tuple has the shape of its default, with ``...`` any length; of
an empty default, any shape.  ``np.ndarray`` takes numbers of any shape.  None is accepted where it
is the default.  Limits are inclusive; an open interval ends at the next number, such as ABOVE_ZERO
or BELOW_ONE.  A number without limits is finite; an infinite limit admits infinity.
"""

import dataclasses
import functools
import math
import reprlib
import types
import typing
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

import numpy as np

from tbdcore.checks import MOST, Integers, Numbers

__all__ = ["ABOVE_ZERO", "BELOW_ONE", "check", "given"]

ABOVE_ZERO, BELOW_ONE = math.ulp(0.0), 1 - 2**-53  # the numbers next to 0 and to 1


class _Field(typing.NamedTuple):
    """A field and what it takes: the rule of each kind of number that its annotation joins, None
    of a kind that is no number.
    """

    name: str
    rules: dict
    default: object
    low: float
    high: float
    choices: tuple


def given(
    default: Any = dataclasses.MISSING,
    symbol: str = "",
    unit: str = "",
    row: str = "open",
    low: float | None = None,
    high: float | None = None,
    choices: Iterable[str] = (),
) -> Any:
    """A field of a scenario: its default, its letter in the paper (TeX without dollars), its unit,
    the id of the claim that prints it ("open" where the paper is silent), and what it may be:
    numbers from `low` to `high`, words of `choices`.
    """
    about: dict[str, Any] = {"symbol": symbol, "unit": unit, "row": row}
    about |= {"low": low, "high": high, "choices": tuple(choices)}
    return dataclasses.field(default=default, metadata=about)


def check(scenario: object) -> None:
    """Raise ValueError, in one line, for the first field that is not what :func:`given` allows.

    A default that is outside its own limits is refused too, when the class is first used.
    """
    kind: Any = type(scenario)
    for field in _fields(kind):
        value = getattr(scenario, field.name)
        if not _allowed(value, field):
            raise ValueError(f"{kind.__name__}.{field.name}: {_complaint(value, field)}")
        if dataclasses.is_dataclass(value):
            check(value)


@functools.cache
def _fields(kind):
    """The fields of a class that were made by `given`; ValueError for a default that is wrong."""
    hints, fields = typing.get_type_hints(kind), []
    for field in dataclasses.fields(kind):
        if "choices" not in field.metadata:
            continue
        hint, about = hints[field.name], field.metadata
        kinds = hint.__args__ if isinstance(hint, types.UnionType) else (hint,)
        low, high = about["low"], about["high"]
        rules = {kind: _rule(kind, field.default, low, high) for kind in kinds}
        made = _Field(field.name, rules, field.default, low, high, about["choices"])
        if made.default is not dataclasses.MISSING and not _allowed(made.default, made):
            wrong = _complaint(made.default, made)
            raise ValueError(f"{kind.__name__}.{field.name}: its default {wrong}")
        fields.append(made)
    return fields


def _rule(kind, default, low, high):
    """The rule for numbers of a kind, None for another kind."""
    shape, parts = np.shape(default), typing.get_args(kind)
    if kind in (int, float):
        shape = ()
    elif kind is not np.ndarray and tuple not in (kind, typing.get_origin(kind)):
        return None
    elif kind is np.ndarray or np.size(default) == 0:
        shape = (...,)
    elif ... in parts:
        shape = ("n", *shape[1:])
    rule, most = (Integers, 2.0**63) if int in (kind, *parts) else (Numbers, MOST)
    return rule(*shape, low=-most if low is None else low, high=most if high is None else high)


def _allowed(value, field):
    if value is None and field.default is None:
        return True
    return any(_fits(value, kind, rule, field.choices) for kind, rule in field.rules.items())


def _fits(value, kind, rule, choices):
    """Whether a value is of a kind, and within the limits or choices of its field."""
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind is str:
        return isinstance(value, str) and (value in choices or not choices)
    if rule is None:
        return isinstance(value, kind)
    no = np.ndarray if kind in (int, float) else np.ma.MaskedArray  # its mask would be lost
    if isinstance(value, no):
        return False
    try:
        a = rule("", value, {})
    except ValueError:
        return False
    return a.ndim > 0 if rule.any_axes else a.size > 0


def _complaint(value, field):
    """What a value is, and what to give instead."""
    shown = " ".join(reprlib.repr(value).split())
    if isinstance(value, str) and str in field.rules:
        near = get_close_matches(value, field.choices, n=1, cutoff=0.0)
        return f"{shown} is unknown; the nearest is {near[0]!r} of {', '.join(field.choices)}"
    words = [_words(kind, rule, field) for kind, rule in field.rules.items()]
    return f"{shown}; give {' or '.join(words)}"


def _words(kind, rule, field):
    """What a field of a kind takes, in words."""
    if kind is bool:
        return "True or False"
    if kind is str:
        return f"one of {', '.join(field.choices)}" if field.choices else "a text"
    if rule is None:
        return f"a {kind.__name__}"
    noun = "integer" if isinstance(rule, Integers) else "number"
    limits = _limits(field.low, field.high)
    if kind in (int, float):
        return f"a{'n' if noun == 'integer' else ''} {noun} {limits}"
    if rule.any_axes or "n" in rule.words:
        return f"{noun}s {limits}"
    return f"{' x '.join(map(str, np.shape(field.default)))} {noun}s {limits}"


def _limits(low, high):
    if low is high is None:
        return "that is finite"
    left = "(0" if low == ABOVE_ZERO else "(-inf" if low is None else f"[{low:g}"
    if high is None:
        return f"in {left}, inf)"
    is_open = float(f"{high:.15g}") > high  # just below a short number
    return f"in {left}, {high:g}{')' if is_open else ']'}"
