"""What no page, no study of a page, no other module and no documented use of own data calls is not
in the core.

The walk is that of the digests: names, followed from the code cells of all notebooks, from their
studies in benchmarks/, from the harness, and from what the guides show in blocks of code and
between back quotes.
"""

import ast
import functools
import json
import re
from pathlib import Path

import pytest

import tbdcore
from tbdcore.repro import pages, reach

ROOT = Path(__file__).parents[2]
PACKAGE = Path(tbdcore.__file__).parent
TO_BE_CALLED = set()  # by chapters that are still to use them
GUIDES = ["own_data.md", "add_a_paper.md", "changing.md", "core.md"]


def notebook_code():
    """The code of all notebooks, as one source each."""
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        yield "\n\n".join("".join(it["source"]) for it in cells if it["cell_type"] == "code")


def core():
    """Names of the modules of the core."""
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
        if "repro" not in parts and path.name != "__main__.py":
            yield ".".join(parts).removesuffix(".__init__")


def shown():
    """Words of the code that the guides show, in blocks and between back quotes."""
    text = "\n".join((ROOT / "docs" / guide).read_text(encoding="utf-8") for guide in GUIDES)
    blocks = re.findall(r"```.*?```", text, re.DOTALL)
    inline = re.findall(r"`[^`\n]+`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    return set(re.findall(r"\w+", " ".join(blocks + inline)))


def definitions(module):
    """Functions and classes of a module."""
    tree = ast.parse(reach._read(module))
    return [it.name for it in tree.body if isinstance(it, ast.FunctionDef | ast.ClassDef)]


def bound_by(walk):
    """Names of the core that a walk has reached."""
    for module, reached in walk.reached.items():
        for i in reached:
            yield from (f"{module}.{name}" for name in walk.modules[module][i].binds)


@functools.cache
def used_by_pages():
    """Names of the core that notebooks, their studies, examples on own data, the harness reach."""
    used = set()
    studies = (file for paper in pages.papers() for file in ROOT.glob(f"benchmarks/{paper}_*.py"))
    studies = (file.read_text(encoding="utf-8") for file in studies)
    harness = (path.read_text(encoding="utf-8") for path in (PACKAGE / "repro").glob("*.py"))
    examples = (file.read_text("utf-8") for file in ROOT.glob("docs/examples/*.py"))
    for source in [*notebook_code(), *studies, *examples, *harness]:
        walk = reach._Walk(reach._read, {"": source})
        walk.whole("")
        used.update(bound_by(walk))
    return used


def unreached():
    """Definitions of the core that no notebook, the harness, a guide or a specification reaches."""
    walk, words = reach._Walk(reach._read, {}), shown()
    for module in core():
        for name in definitions(module):
            if name in words or name.endswith("_spec"):
                walk.follow(module, (name,))
    used = {*used_by_pages(), *bound_by(walk), "tbdcore.__dir__", "tbdcore.__getattr__"}
    return {f"{m}.{name}" for m in core() for name in definitions(m)} - used


@pytest.mark.slow
def test_the_core_holds_what_is_used():
    assert unreached() == TO_BE_CALLED


def test_a_function_that_nobody_calls_is_noticed(monkeypatch):
    read = reach._read
    planted = "\n\ndef unused():\n    return cv(1.0)\n"
    monkeypatch.setattr(
        reach, "_read", lambda m: read(m) + planted if m == "tbdcore.motion" else read(m)
    )
    assert "tbdcore.motion.unused" in unreached()


def test_the_short_list_names_functions():
    for name in TO_BE_CALLED:
        module, _, function = name.rpartition(".")
        assert function in definitions(module)
