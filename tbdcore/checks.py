"""Checks of what a caller passes: a wrong argument is a ValueError of one line that names it.

A public function has the rule of each argument in its annotation, and ``checked`` applies them:

    Frame = Annotated[ArrayLike, Numbers("n_x", "n_y", low=0.0)]
    States = Annotated[ArrayLike, Numbers("N", 5)]

    @checked
    @kernel
    def log_ratio(z: Frame, S: States, noise: Annotated[float, Number(0.0, 1e9)]) -> Array: ...

Rules for arrays take what NumPy makes an array of: lists, DataFrames, any memory order and real
type.  A word in a shape is any size, the same for all arguments of a call; "N+1" is one more.  A
leading ``...`` is any stack, which all arguments of a call share as NumPy broadcasts: n states
take one covariance or n.  Text, True and False, complex numbers, masks that hide cells and, unless
a rule says otherwise, NaN and infinity are refused.  The function gets arrays in C order that it
may write to, floats and ints.  ``number``, ``numbers``, ``integer`` and ``integers`` apply one rule
to one value.
"""

import functools
import inspect
import math
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

__all__ = ["Array", "ArrayLike", "Covariance", "Flag", "Integer", "Integers", "LARGEST", "Number"]
__all__ += ["Numbers", "Random", "Rule", "Sizes", "array", "checked", "fits_memory", "integer"]
__all__ += ["integers", "number", "numbers"]

MOST = float(np.finfo(float).max)
TINY, ROUNDING = float(np.finfo(float).tiny), 1e-9
LARGEST = 2**30  # numbers in one array, 8 GB
DEFECTS = ["none", "a variance is negative", "a matrix is not symmetric"]
DEFECTS += ["a matrix has a negative eigenvalue"]
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
    parameters = [
        p.replace(annotation=_rule_of(p.annotation)) for p in signature.parameters.values()
    ]
    rules = [(n, p.annotation.__call__, f"{where}: {p.name}") for n, p in enumerate(parameters)]
    defaults = [p.default for p in parameters if p.default is not p.empty]

    @functools.wraps(plain)
    def call(*args, **named):
        if named or len(args) != len(rules):
            args = _completed(signature, defaults, args, named)
        sizes = {}
        return function(*[rule(name, args[n], sizes) for n, rule, name in rules])

    call.__signature__ = signature.replace(parameters=parameters)  # help shows the rules
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


class Rule:
    """What an argument must be, which this one leaves to the function; applied by a call."""

    about = ""

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
        last = shape[self.any_axes :]
        self.axes = [(k - len(last), *_size(size)) for k, size in enumerate(last)]
        sizes = ["..." if size is ... else str(size) for size in shape]
        self.words = ", ".join(sizes) + "," * (len(shape) == 1)
        self.about = ", ".join(sizes + _limits_of(low, high))
        self.low, self.high, self.nan = None if low is None else float(low), float(high), nan
        self.in_place = in_place
        self.dtypes = (self.dtype, _SINGLE) if single or in_place else (self.dtype,)

    def __call__(self, name, values, sizes):
        a = values
        if type(a) is not Array or a.dtype is not self.dtype:
            a = self._converted(name, values)
        if not a.flags.carray:
            a = self._in_order(name, a)
        shape = a.shape
        if len(shape) != len(self.axes):
            self._stack(name, shape, sizes)
        for axis, word, more in self.axes:
            size = shape[axis] - more
            if size != (sizes.setdefault(word, size) if word else 0):
                raise self._misfit(name, shape, sizes)
        if self.low is not None:
            self.limit(name, a)
        return a

    def _misfit(self, name, shape, sizes):
        so_far = ", ".join(f"{k} = {v}" for k, v in sizes.items() if k in self.words and k != "...")
        so_far = f" with {so_far}" if so_far else ""
        words = f"shape {shape} is not ({self.words}){so_far}; reshape or transpose the array"
        return ValueError(f"{name}: {words}")

    def _stack(self, name, shape, sizes):
        """Note the leading axes of an array, which those before it must fit; or ValueError."""
        many = len(shape) - len(self.axes)
        if many < 0 or not self.any_axes:
            raise self._misfit(name, shape, sizes)
        stack = shape[:many]
        others = sizes.setdefault("...", stack)
        if stack == others:
            return
        try:
            sizes["..."] = np.broadcast_shapes(stack, others)
        except ValueError:
            words = f"a stack of {stack}, but of {others} before it; give one, or as many"
            raise ValueError(f"{name}: {words}") from None

    def limit(self, name, a):
        """ValueError unless all elements are in [low, high]."""
        if _outside(a, self.low, self.high, self.nan):
            self._refuse(name, a)

    def _converted(self, name, values):
        """The values as an array of the rule's type."""
        if type(values) is Array and values.dtype in self.dtypes:
            return values
        if self.in_place:
            raise ValueError(f"{name}: changed in place; give an array of floats")
        a = array(name, values)
        if a.size and a.dtype.kind not in self.kinds:
            raise ValueError(f"{name}: values of type {a.dtype}; give {self.wanted}")
        if a.dtype in self.dtypes:
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

    def _refuse(self, name, a):
        wide = a.astype(float)  # in float32 the limits would overflow
        inside = (wide >= self.low) & (wide <= self.high) | (self.nan & (wide != wide))
        at = np.argwhere(~inside)[0].tolist()
        limits = "finite" if self.high == -self.low == MOST else f"in [{self.low:g}, {self.high:g}]"
        raise ValueError(f"{name}{at or ''}: {a[tuple(at)]:g} is not {limits}")


class Covariance(Numbers):
    """Rule: covariance matrices on the last two axes, symmetric, no variance negative.

    Of the matrix of correlations, entries may differ from those across the diagonal by 1e-9, and an
    eigenvalue may be as low as -1e-9: rounding.
    """

    def limit(self, name, a):
        super().limit(name, a)
        defect = _defect(a.reshape(-1, *a.shape[-2:])) if a.size else 0
        if defect:
            raise ValueError(f"{name}: {DEFECTS[defect]}; give covariances")


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

    def __init__(self, low=-MOST, high=MOST):
        self.low, self.high = low, high
        self.about = ", ".join(_limits_of(low, high))

    def __call__(self, name, value, sizes=None):
        x = value
        if type(x) is float and self.low <= x <= self.high:
            return x
        if type(x) is not float and isinstance(x, np.generic) or type(x) is Array and not x.ndim:
            x = x.item()  # float32 has other limits
        whole = isinstance(x, int) and not isinstance(x, bool) and abs(x) <= MOST
        if whole or isinstance(x, (float, np.floating)):
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
        if type(value) is int and self.low <= value <= self.high:
            return value
        try:
            n = operator.index(value)
        except TypeError:
            raise self._error(name, value) from None
        if isinstance(value, bool):
            raise self._error(name, value)
        self.limit(name, n)
        return n

    def _wanted(self):
        most = "" if self.high == 2**63 - 1 else f" and at most {self.high}"
        return f"integer of at least {self.low}{most}"


class Sizes(Integers):
    """Rule: the sizes of an array, which memory can hold: at most :data:`LARGEST` numbers."""

    def __init__(self, *shape, low=0):
        super().__init__(*shape, low=low)

    def limit(self, name, a):
        super().limit(name, a)
        fits_memory(name, *a.tolist())


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


def fits_memory(name: str, *shape: int) -> None:
    """ValueError if an array of this shape has more numbers than :data:`LARGEST`."""
    if math.prod(shape) > LARGEST:
        many = " x ".join(map(str, shape))
        raise ValueError(f"{name}: {many} numbers are more than memory holds; give fewer")


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
def _outside(a, low, high, nan):
    """How many elements are not in [low, high]; NaN is not, unless ``nan``."""
    flat, inside = a.ravel(), 0
    for n in range(flat.size):
        v = flat[n]
        inside += ((v >= low) & (v <= high)) | (nan & (v != v))
    return flat.size - inside


@kernel
def _defect(stack):
    """What is wrong with a stack of covariances (n, d, d), an index of DEFECTS.

    Eigenvalues are those of the correlations, by Cholesky's method.  A variance below 1e-15 of the
    largest one counts as that: what is lost in rounding.
    """
    d = stack.shape[1]
    sd, L = np.empty(d), np.empty((d, d))
    for P in stack:
        least = TINY
        for i in range(d):
            if not P[i, i] >= 0.0:
                return 1
            least = max(least, 1e-15 * P[i, i])
        for i in range(d):
            sd[i] = math.sqrt(max(P[i, i], least))
        for i in range(d):
            for j in range(i + 1):
                if abs(P[i, j] - P[j, i]) > ROUNDING * sd[i] * sd[j]:
                    return 2
                rest = P[i, j] / sd[i] / sd[j] + (ROUNDING if i == j else 0.0)
                for l in range(j):
                    rest -= L[i, l] * L[j, l]
                if i == j and not rest > 0.0:
                    return 3
                L[i, j] = math.sqrt(rest) if i == j else rest / L[j, j]
    return 0
