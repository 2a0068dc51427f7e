"""Checks of arguments that no kernel's own test reaches."""

import pydoc
import subprocess
import sys
import warnings
from typing import Annotated

import numpy as np
import pytest

import tbdcore
from tbdcore import checks, kernel, score
from tbdcore.checks import ArrayLike, Integer, Number, Numbers, checked
from tbdcore.kernels import dp_tbd, mm_pf_tbd


@pytest.mark.parametrize("check", [checks.array, checks.numbers, checks.integers])
def test_a_masked_array_is_refused_and_not_stripped_of_its_mask(check):
    z, shape = np.ma.masked_greater(np.arange(3), 1), [] if check is checks.array else [3]
    for given in (z, [z, z], (z.filled(0), z)):
        with pytest.raises(ValueError, match="^frames: a masked array; fill it, or leave out what"):
            check("frames", given, *shape)
    assert np.array_equal(check("frames", z.filled(0), *shape), [0, 1, 0])


def test_integers_have_the_limits_of_their_type():
    assert checks.integers("n", [2**63 - 1], 1, low=0) == 2**63 - 1
    with pytest.raises(ValueError, match=r"^n\[1\]: -1 is not in \[0, 9.22337e\+18\]$"):
        checks.integers("n", [0, -1], "N", low=0)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.int8, float])
def test_a_number_of_any_type_is_compared_with_limits_beyond_its_own(kind):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checks.number("x", kind(5), 0.0, 1e50)
    with pytest.raises(ValueError, match="is no number in"):
        checks.number("x", kind(5), 6.0, 1e50)


@kernel
def _sum(x, n):
    return x.sum() + n


@checked(inside=_sum)
def total(x: Annotated[ArrayLike, Numbers("N", low=0.0)], n: int = 0) -> float:
    """Sum of x and n."""
    return _sum(x, n)


@kernel
def total_inside(x):
    return total(x, 1)


def test_a_kernel_calls_the_compiled_function_without_the_checks():
    assert total_inside(np.array([-2.0])) == -1.0
    with pytest.raises(ValueError, match=r"total: x\[0\]: -2 is not in"):
        total(np.array([-2.0]))


def test_values_are_checked_again_when_types_and_shapes_are_known():
    assert total(np.ones(3)) == total(np.ones(3), n=0) == 3.0
    for wrong, words in ((-np.ones(3), "x"), (np.full(3, np.nan), "x"), (np.ones((3, 1)), "shape")):
        with pytest.raises(ValueError, match=words):
            total(wrong)


@checked
def scaled(
    x: Annotated[ArrayLike, Numbers(..., low=0.0)],
    by: Annotated[float, Number(0.0, 9.0)] = 2.0,
    n: Annotated[int, Integer(0)] = 1,
) -> float:
    """The sum of x, n times by."""
    assert isinstance(x, np.ndarray)
    assert type(by) is float
    return float(x.sum()) * by**n


@pytest.mark.parametrize("x", [3, np.float64(3), np.float32(3), np.ones(3), np.ones(3)[::-1]])
def test_numbers_of_any_type_are_converted_and_checked_in_every_call(x):
    for _ in range(3):
        assert scaled(x) == scaled(x, 2) == scaled(x, np.float32(2), np.int32(1)) == 6.0
        for wrong in ((-x,), (x, 10), (x, np.float32(10)), (x, 2, np.int32(-1))):
            with pytest.raises(ValueError, match=r"scaled: (x|by|n)\b"):
                scaled(*wrong)
    for none in ((), (x, 2, 1, 0)):
        with pytest.raises(TypeError):
            scaled(*none)


def test_help_shows_the_rules():
    text = pydoc.render_doc(total, renderer=pydoc.plaintext)
    assert "total(x: Numbers(N, low=0), n: Rule() = 0) -> float" in text
    assert "Sum of x and n." in text


def test_modules_load_when_they_are_used():
    code = (
        "import sys, tbdcore; assert 'tbdcore.score' not in sys.modules; print(tbdcore.score.Z99)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(ran.stdout) == score.Z99
    assert {"kalman", "kernel", "page"} <= set(dir(tbdcore))
    assert not any(name.startswith("_") for name in dir(tbdcore))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        tbdcore.nothing  # noqa: B018


def test_a_refusal_of_single_precision_does_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ValueError, match=r"^x\[1\]: nan is not finite$"):
            checks.numbers("x", np.array([1, np.nan], np.float32), 2, low=-checks.MOST)


def test_the_limit_of_memory_is_that_of_the_array_that_is_made(monkeypatch):
    monkeypatch.setattr(checks, "LARGEST", 81)
    frames = np.zeros((1, 5, 5))
    assert dp_tbd.margin(frames, 2).size == 81
    with pytest.raises(ValueError, match=r"^dp_tbd.margin: width: 1 x 11 x 11 numbers are more"):
        dp_tbd.margin(frames, 3)
    assert mm_pf_tbd.blob_image(np.ones(9), np.ones(9), 1.0, 1.0, (3, 3)).size == 81
    with pytest.raises(ValueError, match=r"blob_image: shape: 9 x 3 x 4 numbers are more"):
        mm_pf_tbd.blob_image(np.ones(9), np.ones(9), 1.0, 1.0, (3, 4))


@pytest.mark.parametrize(
    ("P", "said"),
    [
        ([[4.0, 2.0], [2.0, 1.0]], None),  # a correlation of one
        ([[0.0, 0.0], [0.0, 0.0]], None),
        ([[1e8, 9e-5], [9e-5, 0.0]], None),  # below the rounding of the larger one
        ([[4.0, 2.0], [2.0 + 1.9e-9, 1.0]], None),
        ([[4.0, 2.0], [2.0 + 2.1e-9, 1.0]], "a matrix is not symmetric"),
        ([[4.0, 2.0 + 3e-9], [2.0 + 3e-9, 1.0]], "a matrix has a negative eigenvalue"),
        ([[1e8, 1.0], [1.0, 0.0]], "a matrix has a negative eigenvalue"),
        ([[4.0, 0.0], [0.0, -1e-300]], "a variance is negative"),
        (np.eye(3) * 2 - 1.0, "a matrix has a negative eigenvalue"),
    ],
)
def test_covariances_are_refused_beyond_rounding(P, said):
    stack = np.array([np.eye(len(P)), P])
    assert checks.DEFECTS[checks._defect(stack)] == (said or "none")
