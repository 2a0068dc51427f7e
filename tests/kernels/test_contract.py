"""One contract for the arguments of every public function of the core.

``examples_<module>.py`` has a valid call of each: EXAMPLES[function]() are its arguments by name.
FREE lists the arguments in which NaN or infinity has a meaning, which the docstring states.
"""

import importlib
import inspect
import itertools
import re
import warnings

import numpy as np
import pandas as pd
import pytest

import tbdcore
from tbdcore.checks import Covariance
from tbdcore.kernels import mda_tbd

MODULES = ["baseline", "detection", "kalman", "kernels.dp_tbd", "kernels.ljipda_ai"]
MODULES += ["kernels.mda_tbd", "kernels.mm_pf_tbd", "kernels.track_cfar", "motion", "noise"]
MODULES += ["particles", "recording", "recording.misfit", "score"]
# They take text and dates, or tables of several sizes: tests/recording/test_scans.py, the last test
UNCHECKED = {"scans", "contradiction", "noise_level"}


def public_functions():
    for name in MODULES:
        module = importlib.import_module(f"tbdcore.{name}")
        for function in module.__all__:
            if inspect.isfunction(getattr(module, function)) and function not in UNCHECKED:
                yield f"{name}.{function}"


FUNCTIONS = list(public_functions())
FILES = {
    module: importlib.import_module(f"examples_{module.rpartition('.')[2]}") for module in MODULES
}


def function_and_example(name):
    module, _, function = name.rpartition(".")
    found = getattr(importlib.import_module(f"tbdcore.{module}"), function)
    return found, FILES[module].EXAMPLES[function]


def free(name, argument):
    module, _, function = name.rpartition(".")
    return (function, argument) in FILES[module].FREE


def flat(result):
    """Everything a function returned, as a list of arrays."""
    parts = result if isinstance(result, tuple) else (result,)
    return [np.asarray(part) for part in parts]


def same(ours, theirs, **tolerance):
    pairs = zip(flat(ours), flat(theirs), strict=True)
    return all(
        a.shape == b.shape and np.allclose(a, b, equal_nan=True, **tolerance) for a, b in pairs
    )


def outcome(function, arguments):
    """The result, or the message of one line; after a refusal all arrays are as they were."""
    arrays = {k: v for k, v in arguments.items() if isinstance(v, np.ndarray)}
    before = {k: v.copy() for k, v in arrays.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return function(**arguments), None
        except ValueError as error:
            message = str(error)
    assert len(message.splitlines()) == 1, message
    for key, value in arrays.items():
        np.testing.assert_array_equal(value, before[key], err_msg=f"{key} was changed: {message}")
    return None, message


def arguments_of(example, kind):
    """Names and values of the arguments of one kind."""
    return [(k, v) for k, v in example().items() if isinstance(v, kind)]


def names(message, argument):
    """Whether it is a refusal that names the argument."""
    return message is not None and re.search(rf"\b{argument}\b", message)


def numeric(value):
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool)


def test_every_public_function_has_an_example():
    named = [name.rpartition(".")[2] for name in FUNCTIONS]
    assert sorted(named) == sorted(f for file in FILES.values() for f in file.EXAMPLES)
    refuse = {"checks", "scenario", "kernels"}  # rules themselves; a room
    for module in set(tbdcore.__all__) - {"begin", "page", "kernel", "jit"} - refuse:
        assert module in MODULES or not hasattr(getattr(tbdcore, module), "__all__"), module


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_help_shows_rules_and_no_addresses(name):
    assert " at 0x" not in str(inspect.signature(function_and_example(name)[0]))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_keywords_and_fresh_memory_do_not_matter(name):
    function, example = function_and_example(name)
    expected, message = outcome(function, example())
    assert message is None
    arguments = example()
    junk = [np.full(size, np.nan) for size in (2, 4, 16, 64, 256, 1024, 4096) for _ in range(20)]
    del junk  # what NumPy hands out next is not zero
    given = [arguments[parameter] for parameter in inspect.signature(function).parameters
             if parameter in arguments]  # fmt: skip
    assert same(function(*given), expected, rtol=0, atol=0)


def strided(a):
    """The values in every second place of a larger array."""
    wide = np.full((*a.shape[:-1], 2 * a.shape[-1]), np.zeros(1, a.dtype)[0])
    wide[..., ::2] = a
    return wide[..., ::2]


def read_only(a):
    a = a.copy()
    a.flags.writeable = False
    return a


LAYOUTS = {
    "Fortran order": np.asfortranarray,
    "strided": strided,
    "read-only": read_only,
    "list": np.ndarray.tolist,
    "table": lambda a: pd.DataFrame(a) if a.ndim == 2 else a.tolist(),
    "mask that hides nothing": np.ma.array,
    "other byte order": lambda a: a.astype(a.dtype.newbyteorder()),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_any_layout_works(name):
    function, example = function_and_example(name)
    expected, _ = outcome(function, example())
    for argument, a in arguments_of(example, np.ndarray):
        for kind, layout in LAYOUTS.items():
            result, message = outcome(function, example() | {argument: layout(a.copy())})
            where = f"{argument} as {kind}: {message}"
            if message and "changed in place" in message:
                assert argument in message
                continue
            assert message is None, where
            assert same(result, expected, rtol=1e-12, atol=0), where


@pytest.mark.parametrize("name", FUNCTIONS)
def test_float32_and_integers_are_their_values(name):
    function, example = function_and_example(name)
    for argument, a in arguments_of(example, np.ndarray):
        if a.dtype == bool:
            continue
        kinds = [(np.float32, 1e-3)] if a.dtype.kind == "f" else [(np.int32, 0), (np.uint64, 0)]
        kinds += [(np.int32, 0)] * bool(a.dtype == float and np.isfinite(a).all())
        for kind, rtol in kinds:
            narrow = (a if kind == np.float32 else np.rint(a)).astype(kind)
            wide = narrow.astype(a.dtype)
            ours, message = outcome(function, example() | {argument: narrow})
            theirs, refusal = outcome(function, example() | {argument: wide})
            if message is None or refusal is None:
                in_place = message is not None and "changed in place" in message
                assert in_place or same(ours, theirs, rtol=rtol, atol=1e-6), (
                    argument,
                    kind,
                    message,
                )


def hiding(a):
    mask = np.zeros(a.shape, bool)
    mask.flat[:1] = True
    return np.ma.array(a, mask=mask)


ODD = {
    "mask": hiding,
    "text": lambda a: a.astype(str),
    "complex": lambda a: a.astype(complex),
    "nothing": lambda a: None,
    "ragged": lambda a: [[1.0], [2.0, 3.0]],
    "objects": lambda a: np.full(a.shape, None),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_is_no_array_of_numbers_is_refused(name):
    function, example = function_and_example(name)
    for argument, a in arguments_of(example, np.ndarray):
        for kind, odd in ODD.items():
            if a.size or kind in ("nothing", "ragged"):
                _, message = outcome(function, example() | {argument: odd(a)})
                assert names(message, argument), (argument, kind, message)


def any_axes(function, argument):
    """Whether leading axes of any number are stacks, so that one more is valid."""
    rule = inspect.signature(function).parameters[argument].annotation
    return getattr(rule, "any_axes", False)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_wrong_shapes_are_refused(name):
    function, example = function_and_example(name)
    for argument, a in arguments_of(example, np.ndarray):
        shapes = [] if any_axes(function, argument) else [a[None], a.reshape(-1)[:1].reshape(())]
        for wrong in shapes:
            _, message = outcome(function, example() | {argument: wrong})
            assert names(message, argument), (argument, wrong.shape)
        for axis in range(a.ndim):
            for longer in (np.concatenate([a, a], axis=axis), a.take([], axis=axis)):
                outcome(function, example() | {argument: longer})  # one line, or a result


@pytest.mark.parametrize("name", FUNCTIONS)
def test_nan_and_infinity_are_refused_or_documented(name):
    function, example = function_and_example(name)
    module = importlib.import_module(function.__module__)
    for argument, a in arguments_of(example, (np.ndarray, float)):
        if np.asarray(a).dtype.kind != "f" or not np.size(a):
            continue
        for value in (np.nan, np.inf, -np.inf):
            for place in {0, np.size(a) - 1}:
                b = np.array(a)
                b.flat[place] = value
                b = b if isinstance(a, np.ndarray) else float(b)
                _, message = outcome(function, example() | {argument: b})
                if free(name, argument):
                    text = f"{module.__doc__} {function.__doc__}"
                    assert re.search(r"NaN|inf|finite|anything", text), argument
                else:
                    assert names(message, argument), (
                        argument,
                        value,
                        message,
                    )


@pytest.mark.parametrize("name", FUNCTIONS)
def test_scalars(name):
    function, example = function_and_example(name)
    expected, _ = outcome(function, example())
    for argument, value in example().items():
        if isinstance(value, bool):
            for odd in ("True", None, 2, np.nan):
                _, message = outcome(function, example() | {argument: odd})
                assert names(message, argument), (argument, odd)
        if not numeric(value):
            continue
        for good in (np.array(value)[()], np.array(value)):
            result, message = outcome(function, example() | {argument: good})
            assert message is None
            assert same(result, expected, rtol=0, atol=0), argument
        for odd in (str(value), None, np.ma.masked, 1j, [value, value], {}, True):
            _, message = outcome(function, example() | {argument: odd})
            assert names(message, argument), (argument, odd, message)


# Leading axes that are no stack: trials, blocks, curves, one number for each frame; arguments that
# must have one shape
NO_STACK = {"mean_se", "threshold", "crossings", "point_frames", "add_target", "inject"}
NO_STACK |= {"matched_filter", "blob_image", "polar_cells", "ospa_bernoulli", "masked_rmse"}


def stackable(function, example):
    """Names and values of the arguments whose leading axes are a stack."""
    return [(k, a) for k, a in arguments_of(example, np.ndarray) if any_axes(function, k)]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_stack_gives_one_result_after_the_other(name):
    function, example = function_and_example(name)
    single, _ = outcome(function, example())
    arguments = stackable(function, example)
    if function.__name__ in NO_STACK:
        return
    for some in [arguments, *([each] for each in arguments)]:  # all of them, and each alone
        stacked = {k: np.stack([a, a, a]) for k, a in some}
        result, message = outcome(function, example() | stacked)
        assert message is None, stacked.keys()
        for ours, one in zip(flat(result), flat(single), strict=True):
            assert ours.shape in (one.shape, (3, *one.shape)), stacked.keys()
            np.testing.assert_allclose(ours, np.broadcast_to(one, ours.shape), rtol=1e-12)
        if some is arguments and arguments:
            assert flat(result)[0].shape == (3, *flat(single)[0].shape)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_stacks_of_different_length_are_refused(name):
    function, example = function_and_example(name)
    arguments = stackable(function, example)
    for (first, a), (second, b) in itertools.combinations(arguments, 2):
        stacks = {first: np.stack([a, a, a]), second: np.stack([b, b])}
        _, message = outcome(function, example() | stacks)
        assert names(message, second) or names(message, first), (first, second, message)
        assert function.__name__ in message


def covariances(function, example):
    """Names and values of the arguments that are covariance matrices."""
    rules = inspect.signature(function).parameters
    return [
        (k, a)
        for k, a in arguments_of(example, np.ndarray)
        if isinstance(rules[k].annotation, Covariance)
    ]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_covariance_is_symmetric_and_not_negative(name):
    function, example = function_and_example(name)
    for argument, a in covariances(function, example):
        lower, turned = np.tril(a), a.copy()
        deviations = np.sqrt(a[..., 0, 0] * a[..., 1, 1])
        turned[..., 0, 1] = turned[..., 1, 0] = 1.01 * deviations  # a correlation above one
        for wrong in (lower + np.triu(2 * a + 1, 1), turned, -a):
            _, message = outcome(function, example() | {argument: wrong})
            assert names(message, argument), (argument, message)
            assert function.__name__ in message
        rounded = a.copy()
        rounded[..., 0, 1] += 1e-12 * deviations
        _, message = outcome(function, example() | {argument: rounded})
        assert message is None, argument


HUGE = (10**9, 10**9)
TWO_SCANS = [np.array([[0.0, 0.0], [9.0, 9.0]])] * 2
NOT_NUMBER = {"z": np.full((1, 2), np.nan), "gated": np.array([0]), "zhat": np.ones((1, 2))}
NOT_NUMBER |= {"S": np.eye(2)[None], "beta": np.array([[0.5, 0.5]]), "expected": np.array([0.5])}


def contradicting(**changed):
    told = {"seen": [], "x": np.ones((1, 1, 4)), "P": np.eye(4)[None, None], "clutter": 1e-6}
    return told | {"existence": np.ones((1, 1)), "p_detect": np.array([0.5])} | changed


@pytest.mark.parametrize(
    ("name", "argument", "arguments"),
    [
        ("kernels.mm_pf_tbd.blob_image", "shape",
         {"x": 1.0, "y": 1.0, "peak": 1.0, "blur": 1.0, "shape": HUGE}),
        ("kernels.mm_pf_tbd.blob_image", "shape",
         {"x": np.ones(10**4), "y": np.ones(10**4), "peak": 1.0, "blur": 1.0,
          "shape": (10**3, 10**3)}),
        ("kernels.mda_tbd.spread_power", "shape",
         {"rho": 1.0, "alpha": 1.0, "spread": mda_tbd.Spread(1.0, 1.0, 1, 1), "shape": HUGE}),
        ("kernels.mda_tbd.noise_power", "shape",
         {"shape": HUGE, "rng": np.random.default_rng(1)}),
        ("noise.exponential", "shape", {"shape": HUGE, "rng": np.random.default_rng(1)}),
        ("noise.correlated", "shape",
         {"shape": HUGE, "correlation": (0.5, 0.5), "rng": np.random.default_rng(1)}),
        ("kernels.dp_tbd.margin", "width", {"frames": np.ones((1, 2, 2)), "width": 10**9}),
        ("particles.systematic", "M", {"W": np.ones(3), "M": 10**12, "u": 0.5}),
        ("particles.systematic", "M", {"W": np.ones(3), "M": True, "u": 0.5}),
        ("particles.systematic", "u", {"W": np.ones(3), "M": 3, "u": False}),
        ("kernels.mda_tbd.inherit", "births",
         {"H": np.ones((1, 1, 1)), "age": [1], "ancestors": [0], "births": 10**12}),
        ("recording.starts", "scans", {"scans": None, "t": (0, 1, 2), "fastest": 9, "sigma": 1}),
        ("recording.starts", "scans",
         {"scans": TWO_SCANS, "t": (0, 1, 2), "fastest": 9, "sigma": 1}),
        ("recording.normal_scores", "law",
         {"frames": np.ones((2, 3, 4)), "law": lambda z: np.full(5, 0.5)}),
        ("kernels.track_cfar.noise_level", "scans", {"scans": None}),
        ("kernels.track_cfar.noise_level", "scans", {"scans": [np.ones(3)]}),
        ("kernels.track_cfar.noise_level", "scans", {"scans": [np.ones((3, 2))]}),
        ("kernels.track_cfar.noise_level", "scans", {"scans": ["no plot"]}),
        ("kernels.ljipda_ai.look", "z", NOT_NUMBER | {"gamma": 9.0}),
        ("kernels.ljipda_ai.look", "z", NOT_NUMBER | {"z": "text", "gamma": 9.0}),
        ("kernels.ljipda_ai.look", "gated",
         NOT_NUMBER | {"z": np.ones((1, 2)), "gated": np.array([1]), "gamma": 9.0}),
        ("kernels.ljipda_ai.look", "gated",
         NOT_NUMBER | {"z": np.array([[1.0, np.inf]]), "gamma": 9.0}),
        ("kernels.ljipda_ai.look", "expected",
         NOT_NUMBER | {"z": np.ones((1, 2)), "expected": np.array([1.5]), "gamma": 9.0}),
        ("kernels.ljipda_ai.contradiction", "clutter", contradicting(clutter="estimated")),
        ("kernels.ljipda_ai.contradiction", "clutter", contradicting(clutter=-1.0)),
        ("kernels.ljipda_ai.contradiction", "seen", contradicting(seen=[None])),
        ("kernels.mm_pf_tbd.blob_log_ratio", "r",
         {"z": np.ones((3, 3)), "S": np.ones((1, 5)), "r": [7], "peak": 1.0, "blur": 1.0,
          "noise": 1.0}),
        ("kernels.mda_tbd.column_test", "covariance",
         {"measured": [1.0, 2.0], "printed": [1.0, 2.0], "covariance": [[1.0, 2.0], [2.0, 1.0]],
          "ratio": 1.0}),
        ("state.save", "file", {"file": 7, "state": (1,)}),
        ("state.load", "file", {"file": 7}),
    ],
)  # fmt: skip
def test_one_line_names_function_and_argument(name, argument, arguments):
    module, _, function = name.rpartition(".")
    _, message = outcome(getattr(importlib.import_module(f"tbdcore.{module}"), function), arguments)
    assert names(message, argument), message
    assert function in message
