"""What makes a product stale: every change of code that can change a number, and nothing else.

The changes are made in a copy of the package, at places of its modules that a generator draws.
"""

import ast
import json
import shutil

import numpy as np
import pytest
import tiny

from tbdcore.repro import cite, claims, pages, paths, products, reach

CORE = [file.name for file in sorted(paths.PACKAGE.glob("[!_]*.py"))]
WHOLE = [f"tbdcore.{name.removesuffix('.py')}" for name in CORE]
WHOLE += [f"tbdcore.repro.{name}" for name in ("figures", "claims", "trials", "screen")]
IMPORTS = "\n".join(map("import {}".format, WHOLE)) + f"\n\nmodules = [{', '.join(WHOLE)}]"
SWAPS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
ORDERS = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}


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


@pytest.fixture(scope="module")
def modules(source):
    """The nodes of some modules of the copied package that can be changed."""
    names = [*CORE, *(f"repro/{name}.py" for name in ("figures", "claims", "trials", "screen"))]
    files = [source / "tbdcore" / name for name in names]
    return {file: list(counted(ast.parse(file.read_text(encoding="utf-8")))) for file in files}


def current():
    """Whether `which` says that the table was made by the present sources."""
    return cite.which(paths.figures() / "tiny" / "table1.md")[1]


def counted(tree):
    """Nodes of a module that are in no exception and no f-string."""
    todo = [tree]
    while todo:
        node = todo.pop(0)
        yield node
        if not isinstance(node, ast.Raise | ast.JoinedStr):
            todo += ast.iter_child_nodes(node)


def strings(node):
    """Whether a node is a list or tuple with two strings side by side."""
    kinds = [type(getattr(each, "value", None)) for each in getattr(node, "elts", ())]
    return kinds[:2] == [str, str]


def drop_a_comma(node):
    node.elts[:2] = [ast.Constant(node.elts[0].value + node.elts[1].value)]


def drop_an_entry(node):
    del node.keys[-1], node.values[-1]


def swap(name):
    """A change that puts the last of a list first."""
    return lambda node: getattr(node, name).insert(0, getattr(node, name).pop())


def put(**fields):
    """A change that gives a node other fields."""
    return lambda node: [setattr(node, name, value(node)) for name, value in fields.items()]


def has(kind, what=lambda node: True):
    return lambda node: isinstance(node, kind) and bool(what(node))


def spec(node):
    """The pieces of a returned f-string that have a format."""
    values = getattr(node.value, "values", ()) if isinstance(node.value, ast.JoinedStr) else ()
    return [each for each in values if getattr(each, "format_spec", None)]


CHANGES = {  # the nodes that can be changed, and the change
    "a comma between strings": (strings, drop_a_comma),
    "an entry of a dict": (has(ast.Dict, lambda n: n.keys), drop_an_entry),
    "an element of a list": (has(ast.List, lambda n: n.elts), lambda n: n.elts.pop()),
    "a list for a tuple": (
        has(ast.Return, lambda n: isinstance(n.value, ast.Tuple)),
        put(value=lambda n: ast.List(n.value.elts, ast.Load())),
    ),
    "an operator": (
        has(ast.BinOp, lambda n: type(n.op) in SWAPS),
        put(op=lambda n: SWAPS[type(n.op)]()),
    ),
    "an operator of an assignment": (
        has(ast.AugAssign, lambda n: type(n.op) in SWAPS),
        put(op=lambda n: SWAPS[type(n.op)]()),
    ),
    "a comparison": (
        has(ast.Compare, lambda n: type(n.ops[0]) in ORDERS),
        put(ops=lambda n: [ORDERS[type(n.ops[0])](), *n.ops[1:]]),
    ),
    "and for or": (
        has(ast.BoolOp, lambda n: isinstance(n.op, ast.Or)),
        put(op=lambda n: ast.And()),
    ),
    "a sign": (
        has(ast.UnaryOp, lambda n: isinstance(n.op, ast.USub)),
        put(op=lambda n: ast.UAdd()),
    ),
    "a number": (
        has(ast.Constant, lambda n: type(n.value) in (int, float)),
        put(value=lambda n: 2 * n.value + 1),
    ),
    "a type of number": (
        has(ast.Constant, lambda n: type(n.value) is int),
        put(value=lambda n: float(n.value)),
    ),
    "a string": (has(ast.Call, lambda n: keyword(n, str)), lambda n: rename(keyword(n, str))),
    "a call": (
        has(ast.Assign, lambda n: isinstance(n.value, ast.Call) and n.value.args),
        put(value=lambda n: n.value.args[0]),
    ),
    "the order of arguments": (has(ast.Call, lambda n: len(n.args) > 1), swap("args")),
    "a keyword": (
        has(ast.Call, lambda n: n.keywords and n.keywords[0].arg),
        lambda n: setattr(n.keywords[0], "arg", "other"),
    ),
    "a default": (has(ast.arguments, lambda n: n.defaults), put(defaults=lambda n: n.defaults[1:])),
    "a decorator": (
        has(ast.FunctionDef, lambda n: n.decorator_list),
        put(decorator_list=lambda n: []),
    ),
    "a slice": (has(ast.Slice, lambda n: n.lower), put(lower=lambda n: None)),
    "a statement": (has(ast.For, lambda n: len(n.body) > 1), lambda n: n.body.pop()),
    "the order of statements": (has(ast.For, lambda n: len(n.body) > 1), swap("body")),
    "the branches of a choice": (
        has(ast.IfExp),
        put(body=lambda n: n.orelse, orelse=lambda n: ast.Constant(n.lineno)),
    ),
    "a format": (
        has(ast.Return, spec),
        lambda n: setattr(spec(n)[0], "format_spec", ast.JoinedStr([ast.Constant(".9f")])),
    ),
    "an import": (has(ast.ImportFrom), put(module=lambda n: f"{n.module}_")),
}


def keyword(node, kind):
    """The first constant of a type that is given by keyword."""
    values = [each.value for each in node.keywords if isinstance(each.value, ast.Constant)]
    return next((value for value in values if isinstance(value.value, kind)), None)


def rename(constant):
    constant.value += "_"


@pytest.mark.parametrize(("where", "change"), CHANGES.values(), ids=CHANGES)
def test_a_change_that_can_change_a_number_is_seen(modules, where, change):
    """At three places of the copied package the meaning changes; at one `which` says so."""
    nodes = [(file, i) for file, tree in modules.items() for i in range(sum(map(where, tree)))]
    assert nodes
    for k in np.random.default_rng(41).permutation(len(nodes))[:3]:
        file, i = nodes[k]
        text = file.read_text(encoding="utf-8")
        tree = ast.parse(text)
        change([node for node in counted(tree) if where(node)][i])
        changed = ast.unparse(ast.fix_missing_locations(tree))
        assert reach.meaning(changed) != reach.meaning(text), (file.name, i)
    try:
        file.write_text(changed, encoding="utf-8")
        assert not current()
    finally:
        file.write_text(text, encoding="utf-8")


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
