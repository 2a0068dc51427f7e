"""Every compiled kernel against its plain specification, and no kernel without one."""

import ast
import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pytest

import tbdcore

MODULES = sorted(path.stem for path in Path(__file__).parent.glob("pairs_*.py"))
CASES = [case for module in MODULES for case in importlib.import_module(module).CASES]


def _flat(result):
    """Everything a function returned, as a list of arrays."""
    return (
        [np.asarray(part) for part in result] if isinstance(result, tuple) else [np.asarray(result)]
    )


@pytest.mark.parametrize(
    ("kernel", "spec", "arguments"), [case[1:] for case in CASES], ids=[case[0] for case in CASES]
)
def test_kernel_equals_its_specification(kernel, spec, arguments):
    ours, theirs = _flat(kernel(*arguments())), _flat(spec(*arguments()))
    assert len(ours) == len(theirs)
    for our, their in zip(ours, theirs, strict=True):
        assert our.shape == their.shape
        scale = np.max(np.abs(their[np.isfinite(their)]), initial=0.0)
        np.testing.assert_allclose(our, their, rtol=1e-12, atol=1e-15 * scale)


def _modules():
    """All modules of the core; the harness has no kernels."""
    for about in pkgutil.walk_packages(tbdcore.__path__, "tbdcore."):
        if not about.name.startswith(("tbdcore.repro", "tbdcore.__main__")):
            yield importlib.import_module(about.name)


def _kernels():
    """All public kernels of the package."""
    for module in _modules():
        for name, value in vars(module).items():
            if (
                hasattr(value, "py_func")
                and value.__module__ == module.__name__
                and not name.startswith("_")
            ):
                yield module, name, value


def _specified():
    """All functions that have a specification beside them."""
    for module in _modules():
        names = vars(module)
        yield from (names[name.removesuffix("_spec")] for name in names if name.endswith("_spec"))


def _on_page(module, name):
    """Whether the page of a paper shows the plain form of a kernel, under the same name."""
    room, _, paper = module.__name__.rpartition(".")
    return room == "tbdcore.kernels" and hasattr(tbdcore.page(paper), name)


def test_every_kernel_has_a_specification_and_a_case():
    tested = {case[1] for case in CASES}
    untested = [function.__name__ for function in _specified() if function not in tested]
    assert set(untested) <= {"coherent_log_ratio"}  # in test_mda_tbd, within the step's error
    for module, name, kernel in _kernels():
        assert hasattr(module, f"{name}_spec") or _on_page(module, name), (
            f"{module.__name__}.{name} has no {name}_spec beside it and no {name} on its page"
        )
        assert kernel in tested, f"{module.__name__}.{name} has no case in a tests/pairs_*.py"


def _spec_calls(tree):
    """Names of the functions that call a specification, other specifications apart."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef) and not function.name.endswith("_spec"):
            for node in ast.walk(function):
                called = getattr(node, "func", None) if isinstance(node, ast.Call) else None
                name = getattr(called, "id", getattr(called, "attr", ""))
                if (
                    name.endswith("_spec") and name != "get_kernel_spec"
                ):  # Jupyter's word for a kernel's description
                    yield function.name


def test_no_specification_is_used_in_production():
    for path in Path(tbdcore.__path__[0]).rglob("*.py"):
        assert not list(_spec_calls(ast.parse(path.read_text(encoding="utf-8")))), path.name
