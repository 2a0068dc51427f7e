"""Checks of what a caller passes: a wrong argument is a ValueError of one line that names it.

A public function has the rule of each argument in its annotation, and ``checked`` applies them:

    Frame = Annotated[ArrayLike, Numbers("n_x", "n_y", low=0.0)]
    States = Annotated[ArrayLike, Numbers("N", 5)]

    @checked
    @kernel
    def log_ratio(z: Frame, S: States, noise: Annotated[float, Number(0.0, 1e9)]) -> Array: ...

Rules for arrays take what NumPy makes an array of: lists, DataFrames, any memory order and real
type.  A word in a shape is any size, the same for all arguments of a call; "N+1" is one more, and a
leading ``...`` stands for any axes.  Text, complex numbers, masks that hide cells and, unless a
rule says otherwise, NaN and infinity are refused.  The function gets arrays in C order that it may
write to, floats and ints.  ``number``, ``numbers``, ``integer`` and ``integers`` apply one rule to
one value.
"""

import functools
import inspect
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, overload

import numpy as np
from numba import typeof

from tbdcore.jit import kernel

if TYPE_CHECKING:  # of an array by its rule, in the body of the function
    ArrayLike: TypeAlias = Any
else:
    from numpy.typing import ArrayLike

__all__ = ["Array", "ArrayLike", "Flag", "Integer", "Integers", "Number", "Numbers", "Random"]
__all__ += ["Rule", "array", "checked", "integer", "integers", "number", "numbers"]

MOST = float(np.finfo(float).max)
_DOUBLE, _SINGLE, _INT = np.dtype(float), np.dtype(np.float32), np.dtype(np.int64)
Array = np.ndarray
Function = TypeVar("Function", bound=Callable)


@overload
def checked(function: Function) -> Function: ...
@overload
def checked(*, inside: Callable) -> Callable[[Function], Function]: ...
def checked(function=None, *, inside=None):
    """Apply the rules in the annotations of a function, compiled or not, to its arguments.

    Kernels that call it get the compiled function without these checks: ``inside``, if given.
    """
    if function is None:
        return functools.partial(checked, inside=inside)
    plain = getattr(function, "py_func", function)
    compiled = inside or function
    compiled = compiled if hasattr(compiled, "py_func") else None  # nor is it without Numba
    signature = inspect.signature(plain)
    where = f"{plain.__module__}.{plain.__name__}".removeprefix("tbdcore.")
    found = [p.replace(annotation=_rule_of(p.annotation)) for p in signature.parameters.values()]
    rules = [(p.annotation, f"{where}: {p.name}") for p in found]
    defaults = [p.default for p in found if p.default is not p.empty]
    known: dict = {}  # by the types and shapes of calls that fit: what their values still need

    @functools.wraps(plain)
    def call(*args, **named):
        if named or len(args) != len(rules):
            args = _completed(signature, defaults, args, named)
        kinds = tuple(
            [(a.dtype, a.shape) if type(a) is Array and a.flags.carray else type(a) for a in args]
        )
        needs = known.get(kinds)
        if needs is None:
            args, needed = _fitted(rules, args, kinds)
            if len(known) > 1000:
                known.clear()
            if needed:
                known[kinds] = needed
            return function(*args)
        scalars, limits = needs
        if scalars:
            args = list(args)
            for n, rule, name in scalars:
                args[n] = rule(name, args[n], {})
        for n, limit, name in limits:
            limit(name, args[n])
        return function(*args)

    call.__signature__ = signature.replace(parameters=found)  # help shows the rules
    if compiled:
        call.stats, call._numba_type_ = compiled.stats, typeof(compiled)
    if function is not plain:
        call.py_func = plain
    return call


def _completed(signature, defaults, args, named):
    """The arguments by position, with the defaults of those left out."""
    missing = len(signature.parameters) - len(args)
    if not named and 0 < missing <= len(defaults):
        return (*args, *defaults[-missing:])
    bound = signature.bind(*args, **named)  # a TypeError if that is no call of the function
    bound.apply_defaults()
    return bound.args


def _fitted(rules, args, kinds):
    """The arguments after all rules, and what a later call of these kinds needs.

    That is (scalars, limits): numbers of another type, whose rules convert them, and the limits of
    the arguments that fit as they are.  None where an array had to be converted.
    """
    sizes: dict = {}
    fitting = [rule(name, a, sizes) for (rule, name), a in zip(rules, args, strict=True)]
    scalars, limits = [], []
    for n, (rule, name) in enumerate(rules):
        if fitting[n] is not args[n]:
            scalars.append((n, rule, name))
        elif rule.limited:
            limits.append((n, rule.limit, name))
    if Array in kinds or not all(
        isinstance(args[n], int | float | np.generic) for n, *_ in scalars
    ):
        return fitting, None
    return fitting, (scalars, limits)


class Rule:
    """What an argument must be, which this one leaves to the function; applied by a call."""

    limited, about = False, ""

    def __call__(self, name, value, sizes=None):
        return value

    def __repr__(self):
        return f"{type(self).__name__}({self.about})"


def _rule_of(annotation):
    return getattr(annotation, "__metadata__", [Rule()])[0]


def _limits_of(low, high):
    """Limits as they are written in a rule; nothing for finite numbers."""
    if low is None:
        return ["low=None"]
    limits = [f"low={low:g}"] if low != -MOST else []
    return limits if high in (MOST, 2**63, 2**63 - 1) else [*limits, f"high={high:g}"]


class Numbers(Rule):
    """Rule: an array of real numbers in [low, high]; float64, or float32 where ``single``.

    low=None takes any value, infinity and NaN too; ``nan`` takes NaN beside [low, high].
    ``in_place``: the function writes to the array, which is never a copy.
    """

    dtype, kinds, wanted = _DOUBLE, "fiu", "real numbers"

    def __init__(self, *shape, low=-MOST, high=MOST, nan=False, single=False, in_place=False):
        self.any_axes = shape[:1] == (...,)
        self.shape = [_size(size) for size in shape[self.any_axes :]]
        sizes = ["..." if size is ... else str(size) for size in shape]
        self.words = ", ".join(sizes) + "," * (len(shape) == 1)
        self.about = ", ".join(sizes + _limits_of(low, high))
        self.low, self.high, self.nan = None if low is None else float(low), float(high), nan
        self.single, self.in_place, self.limited = single, in_place, low is not None

    def __call__(self, name, values, sizes):
        a = values
        if type(a) is not Array or not (
            a.dtype == self.dtype or (self.single or self.in_place) and a.dtype == _SINGLE
        ):
            a = self._converted(name, values)
        if not a.flags.carray:
            a = self._in_order(name, a)
        found = a.shape[len(a.shape) - len(self.shape) :] if self.any_axes else a.shape
        if len(found) != len(self.shape) or not self._fits(found, sizes):
            known = ", ".join(f"{k} = {v}" for k, v in sizes.items() if k in self.words)
            known = f" with {known}" if known else ""
            raise ValueError(
                f"{name}: shape {a.shape} is not ({self.words}){known}; "
                "reshape or transpose the array"
            )
        if self.limited:
            self.limit(name, a)
        return a

    def limit(self, name, a):
        """ValueError unless all elements are in [low, high]."""
        if _outside(a.ravel(), self.low, self.high, self.nan):
            self._refuse(name, a)

    def _converted(self, name, values):
        """The values as an array of the rule's type."""
        if self.in_place:
            raise ValueError(f"{name}: changed in place; give an array of floats")
        a = array(name, values)
        if a.size and a.dtype.kind not in self.kinds:
            raise ValueError(f"{name}: values of type {a.dtype}; give {self.wanted}")
        if a.dtype == self.dtype or self.single and a.dtype == _SINGLE:
            return a
        with np.errstate(over="ignore"):  # of a wider type: infinity, which is refused
            converted = a.astype(self.dtype)
        if a.dtype.kind == "u" and (converted != a).any():
            raise ValueError(f"{name}: an integer above 2**63; give smaller ones")
        return converted

    def _in_order(self, name, a):
        if not self.in_place:
            return np.array(a, order="C")
        if not a.flags.writeable:
            raise ValueError(f"{name}: changed in place, but read-only; give a copy")
        return a

    def _fits(self, found, sizes):
        for size, (word, more) in zip(found, self.shape, strict=True):
            if size != (sizes.setdefault(word, size - more) + more if word else more):
                return False
        return True

    def _refuse(self, name, a):
        wide = a.astype(float)  # in float32 the limits would overflow
        inside = (wide >= self.low) & (wide <= self.high) | (self.nan & (wide != wide))
        at = np.argwhere(~inside)[0].tolist()
        limits = "finite" if self.high == -self.low == MOST else f"in [{self.low:g}, {self.high:g}]"
        raise ValueError(f"{name}{at or ''}: {a[tuple(at)]:g} is not {limits}")


class Integers(Numbers):
    """Rule: an array of integers (int64) in [low, high]; low=None: any."""

    dtype, kinds, wanted = _INT, "iu", "integers"

    def __init__(self, *shape, low=None, high=2.0**63):
        super().__init__(*shape, low=low, high=high)


def _size(size):
    """A size as (word, more): ("N", 1) of "N+1", (None, 5) of 5."""
    if isinstance(size, int):
        return None, size
    word, sign, more = size.replace("-", "+-").partition("+")
    return word, int(more) if sign else 0


class Number(Rule):
    """Rule: a real number in [low, high]; a float."""

    limited = True

    def __init__(self, low=-MOST, high=MOST):
        self.low, self.high = low, high
        self.about = ", ".join(_limits_of(low, high))

    def __call__(self, name, value, sizes=None):
        x = value
        if type(x) is not float and isinstance(x, np.generic) or type(x) is Array and not x.ndim:
            x = x.item()  # float32 has other limits
        if isinstance(x, (float, np.floating)) or isinstance(x, int) and abs(x) <= MOST:
            self.limit(name, x)
            return x if type(x) is float else float(x)
        raise self._error(name, value)

    def limit(self, name, x):
        """ValueError unless x is in [low, high]."""
        if not self.low <= x <= self.high:
            raise self._error(name, x)

    def _error(self, name, value):
        return ValueError(f"{name}: {_short(value)} is no {self._wanted()}")

    def _wanted(self):
        finite = self.high == -self.low == MOST
        return "number that is finite" if finite else f"number in [{self.low:g}, {self.high:g}]"


class Integer(Number):
    """Rule: an integer in [low, high]; an int."""

    def __init__(self, low, high=2**63 - 1):
        super().__init__(low, high)

    def __call__(self, name, value, sizes=None):
        try:
            n = operator.index(value)
        except TypeError:
            raise self._error(name, value) from None
        self.limit(name, n)
        return n

    def _wanted(self):
        most = "" if self.high == 2**63 - 1 else f" and at most {self.high}"
        return f"integer of at least {self.low}{most}"


class Flag(Rule):
    """Rule: True or False."""

    def __call__(self, name, value, sizes=None):
        if not isinstance(value, (bool, np.bool_)):
            raise ValueError(f"{name}: {_short(value)} is neither True nor False")
        return bool(value)


class Random(Rule):
    """Rule: a numpy.random.Generator; None too where ``optional``."""

    def __init__(self, optional=False):
        self.optional = optional

    def __call__(self, name, value, sizes=None):
        if not (isinstance(value, np.random.Generator) or self.optional and value is None):
            raise ValueError(f"{name}: {_short(value)}; give a numpy.random.Generator")
        return value


def _short(value):
    """What a value looks like, in one line."""
    return " ".join(repr(value).split())[:60]


def array(name: str, values: Any) -> Array:
    """The values as an array; a mask that hides cells is a ValueError, since it would be lost."""
    if _hides(values):
        raise ValueError(f"{name}: a masked array; fill it, or leave out what is masked")
    try:
        return np.asarray(values)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: rows of several lengths, or no array; give numbers") from None


def _hides(values):
    if isinstance(values, (list, tuple)):
        return any(map(_hides, values))
    return isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values)


@functools.lru_cache(256)
def _rule(kind, *shape, **options):
    """A rule that is applied again and again."""
    return kind(*shape, **options)


def number(name: str, value: Any, low: float, high: float) -> float:
    """A real number in [low, high]; ValueError otherwise."""
    return _rule(Number, low, high)(name, value)


def integer(name: str, value: Any, low: int) -> int:
    """An integer of at least `low`; ValueError otherwise."""
    return _rule(Integer, low)(name, value)


def numbers(name: str, values: Any, *shape: Any, low: Any = None, high: float = MOST) -> Array:
    """Array of real numbers of the given shape, in which a word stands for any size.

    float32 and float64 are kept, other real numbers become float64.  low, high : limits, NaN is
    then a ValueError; without them any value passes.
    """
    return _rule(Numbers, *shape, low=low, high=high, single=True)(name, values, {})


def integers(name: str, values: Any, *shape: Any, low: Any = None, high: float = 2.0**63) -> Array:
    """Array of integers (int64) of the given shape, as in :func:`numbers`."""
    return _rule(Integers, *shape, low=low, high=high)(name, values, {})


@kernel
def _outside(flat, low, high, nan):
    """How many elements are not in [low, high]; NaN is not, unless ``nan``."""
    inside = 0
    for n in range(flat.size):
        v = flat[n]
        inside += ((v >= low) & (v <= high)) | (nan & (v != v))
    return flat.size - inside
