"""What makes a product stale: every change of code that can change a number, and nothing else.

The changes are made in a copy of the package, at places of its modules that a generator draws.
"""

import ast
import json
import shutil

import numpy as np
import pytest
import tiny

from tbdcore.repro import cite, claims, pages, paths, products

CORE = [file.name for file in sorted(paths.PACKAGE.glob("[!_]*.py"))]
WHOLE = [f"tbdcore.{name.removesuffix('.py')}" for name in CORE]
HARNESS = ["figures", "claims", "trials", "screen"]
WHOLE += [f"tbdcore.repro.{name}" for name in HARNESS]
IMPORTS = "\n".join(map("import {}".format, WHOLE)) + f"\n\nmodules = [{', '.join(WHOLE)}]"


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A small repository with a copy of the package, and a table that its present sources made."""
    folder = tmp_path_factory.mktemp("provenance")
    tiny.copy_package(folder)
    tiny.write(folder)
    tiny.change(folder, algorithm=IMPORTS)
    about = {"id": "tiny/table1", "caption": "c", "paper": "tiny", "claims": [], "files": []}
    about |= {"seed": 1, "trials": 1}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TBDCORE_REPOSITORY", str(folder))
        patch.delenv("TBDCORE_FIGURES", raising=False)
        patch.setattr(paths, "PACKAGE", folder / "tbdcore")
        about["digest"] = pages.digest("tiny")
        made = {"table1.md": b"<!-- tiny/table1 -->\n", "table1.json": json.dumps(about).encode()}
        products.write(folder / "figures" / "tiny", made)
        yield folder


def current():
    """Whether `which` says that the table was made by the present sources."""
    return cite.which(paths.figures() / "tiny" / "table1.md")[1]


def numbers(tree):
    """The numbers in a module that are in no exception and no f-string."""
    todo = [tree]
    while todo:
        node = todo.pop(0)
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield node
        if not isinstance(node, ast.Raise | ast.JoinedStr):
            todo += ast.iter_child_nodes(node)


@pytest.mark.parametrize("name", [*CORE, *(f"repro/{name}.py" for name in HARNESS)])
def test_another_number_in_a_module_is_seen(source, name):
    """At three places; what else changes the meaning of a source is in test_reach."""
    file = source / "tbdcore" / name
    text = file.read_text(encoding="utf-8")
    count = len(list(numbers(ast.parse(text))))
    try:
        for i in np.random.default_rng(41).permutation(count)[:3]:
            tree = ast.parse(text)
            number = list(numbers(tree))[i]
            number.value = 2 * number.value + 1
            file.write_text(ast.unparse(tree), encoding="utf-8")
            assert not current(), i
    finally:
        file.write_text(text, encoding="utf-8")
    assert current()


def test_a_reading_counts_but_for_its_words(source):
    readings = source / "data" / "readings.csv"
    header = f"{','.join(claims.Reading._fields)}\n"
    readings.write_text(header)
    assert current()
    seen = set()
    for words, default in (("a gap", "m"), ("Section 3", "m"), ("a gap", "m-r")):
        readings.write_text(f"{header}tiny,eq. 10,{words},m;m-r,{default},mean,\n")
        assert not current()
        seen.add(pages.digest("tiny"))
    assert len(seen) == 2
    readings.unlink()


def reworded(tree):
    """Reword what is raised in a module: the strings that are arguments of its exceptions."""
    count = 0
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            for argument in node.exc.args:
                pieces = getattr(argument, "values", [argument])
                for piece in pieces:
                    if isinstance(getattr(piece, "value", None), str):
                        piece.value, count = f"better: {piece.value}", count + 1
    return count


def test_a_release_and_better_messages_make_nothing_stale(source, tmp_path):
    kept = shutil.copytree(source / "tbdcore", tmp_path / "kept")
    try:
        init = source / "tbdcore" / "__init__.py"
        text = init.read_text(encoding="utf-8")
        assert '__version__ = "' in text
        init.write_text(text.replace('__version__ = "', '__version__ = "9.'), encoding="utf-8")
        counts = {}
        for file in (source / "tbdcore").rglob("*.py"):
            tree = ast.parse(file.read_text(encoding="utf-8"))
            counts[file] = reworded(tree)
            file.write_text(ast.unparse(tree), encoding="utf-8")
        assert sum(count > 5 for count in counts.values()) >= 5
        assert current()
    finally:
        shutil.copytree(kept, source / "tbdcore", dirs_exist_ok=True)
