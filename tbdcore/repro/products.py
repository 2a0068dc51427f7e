"""Products as files: text of tables, writing, records, and the digest of what made them.

A product is a set of files with one name, ``<paper>/<name>``.  Its JSON, the *record*, says what
made it: caption, parameters, seed, trials, claims shown, package versions, and a digest of the
*meaning* of its sources: the parsed code of the page and of the modules that it imports, and the
claims file but for its causes.  Comments, docstrings, layout, text cells, the version number and
the texts of messages do not count.
"""

import ast
import functools
import hashlib
import json
import math
import os
import re
import textwrap
from importlib.metadata import version

from tbdcore.repro import paths
from tbdcore.repro.processes import signals_held

RECORDED = ("id", "caption", "paper", "claims", "files", "seed", "trials", "digest")

# Files ---------------------------------------------------------------------------------------


def write(folder, files, old=()):
    """Write files (name -> bytes) into a folder, all or none; then remove the files `old`.

    All are written beside their places first, then renamed; a signal that asks the run to end
    waits until the renaming is done.  Raises OSError, with nothing replaced, when the folder
    cannot be made or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    beside = [(folder / f".{name}.{os.getpid()}.part", folder / name) for name in files]
    try:
        for (part, _), content in zip(beside, files.values(), strict=True):
            part.write_bytes(content)
        with signals_held():
            for part, place in beside:
                os.replace(part, place)
            for place in old:
                place.unlink(missing_ok=True)
    finally:
        for part, _ in beside:
            part.unlink(missing_ok=True)


def record(file):
    """What a product's JSON file says of it; ValueError, naming the file, when it is damaged."""
    try:
        about = dict(json.loads(file.read_text(encoding="utf-8")))
        _ = [about[key] for key in RECORDED]
        return about
    except (ValueError, TypeError, KeyError):
        again = f"make the products anew: tbdcore run {file.parent.name}"
        raise ValueError(f"{file}: damaged; delete it, then {again}") from None


# Digests -------------------------------------------------------------------------------------


def digest(contents):
    """Short hash of some byte strings."""
    each = b"".join(hashlib.sha256(content).digest() for content in contents)
    return hashlib.sha256(each).hexdigest()[:16]


def versions():
    """Versions of the packages that numbers and pictures depend on."""
    return {name: version(name) for name in ("numpy", "scipy", "numba", "matplotlib", "pandas")}


@functools.cache
def meaning(source):
    """What a source computes: a canonical text of its syntax tree, the same on every Python.

    Comments, docstrings, layout, ``__version__`` and the texts of messages do not count; everything
    else does.  Fields that are empty are left out: which of them a node has depends on the version.

    The text of a message is a string or f-string among the arguments of an exception that is
    raised, of ``print`` or of ``warn``; or one assigned to a local name that its function uses in
    such messages only.  The calls in an f-string count even there.
    """
    tree = ast.parse(source)
    functions = [node for node in ast.walk(tree) if isinstance(node, FUNCTIONS)]
    said = [*_messages(tree), *(leaf for each in functions for leaf in _local_messages(each))]
    return _walk(tree, {id(leaf) for leaf in said if _is_text(leaf)})


def _walk(node, silent):
    """Text of a node, or list of nodes; of those whose identity is in `silent` only the calls."""
    if isinstance(node, list):
        return "[" + ",".join(_walk(each, silent) for each in node) + "]"
    if not isinstance(node, ast.AST):
        return f"{type(node).__name__}:{node!r}"
    if id(node) in silent:
        return _walk([each for each in _down_to(CALLS, node) if isinstance(each, CALLS)], silent)
    fields = dict(ast.iter_fields(node))
    if isinstance(node, (ast.Module, ast.ClassDef, *FUNCTIONS)):
        body = fields["body"][ast.get_docstring(node, clean=False) is not None :]
        fields["body"] = [statement for statement in body if not _is_version(statement)]
    if isinstance(node, ast.JoinedStr):
        fields["values"] = _merged(node.values)
    kept = {name: value for name, value in fields.items() if name not in ("kind", "type_comment")}
    told = [f"{name}={_walk(it, silent)}" for name, it in kept.items() if it not in (None, [])]
    if isinstance(node, ast.Constant) and node.value is None:
        told = ["value=None"]
    return f"{type(node).__name__}({','.join(told)})"


def _is_version(statement):
    return [getattr(it, "id", "") for it in getattr(statement, "targets", ())] == ["__version__"]


def _is_text(node):
    return isinstance(node, ast.JoinedStr) or isinstance(getattr(node, "value", None), str)


def _merged(pieces):
    """Pieces of an f-string, neighbouring texts as one: Python versions divide them differently."""
    out = []
    for piece in (each for each in pieces if getattr(each, "value", None) != ""):
        if out and _is_text(out[-1]) and _is_text(piece):
            piece = ast.Constant(out.pop().value + piece.value)
        out.append(piece)
    return out


FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
SCOPES = (*FUNCTIONS, ast.ClassDef, ast.Lambda)
CALLS = (ast.Call, ast.NamedExpr, ast.Await, ast.Yield, ast.YieldFrom)
JOINED = {ast.IfExp: ("body", "orelse"), ast.BinOp: ("left", "right")}


def _messages(tree):
    """The expressions that are put together to the messages of a tree."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise):
            yield from _arguments(node.exc)
        elif isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            to_file = {keyword.arg for keyword in node.keywords} & {"file", None}
            if name == "warn" or (name == "print" and not to_file):
                yield from _arguments(node)


def _arguments(call):
    """The expressions that are put together to the arguments of a call; none without a call."""
    if isinstance(call, ast.Call):
        for argument in (*call.args, *(keyword.value for keyword in call.keywords)):
            yield from _leaves(argument)


def _leaves(node):
    """What an expression chooses from or joins."""
    parts = [getattr(node, name) for name in JOINED.get(type(node), ())]
    return [leaf for part in parts for leaf in _leaves(part)] if parts else [node]


def _down_to(kinds, node):
    """A node and everything in it, but nothing that is in a node of some kinds."""
    yield node
    if not isinstance(node, kinds):
        for child in ast.iter_child_nodes(node):
            yield from _down_to(kinds, child)


def _local_messages(function):
    """The expressions assigned to local names that a function uses in messages only."""
    leaves = {}
    for node in (node for statement in function.body for node in _down_to(SCOPES, statement)):
        if isinstance(node, ast.Assign) and [type(each) for each in node.targets] == [ast.Name]:
            leaves.setdefault(node.targets[0].id, []).extend(_leaves(node.value))
    while odd := _used_elsewhere(function, leaves):
        leaves = {name: each for name, each in leaves.items() if name not in odd}
    return [leaf for each in leaves.values() for leaf in each]


def _used_elsewhere(function, leaves):
    """The names in `leaves` that are not local, or used elsewhere than in messages and `leaves`."""
    told = [*_messages(function), *(leaf for each in leaves.values() for leaf in each)]
    told = [leaf for leaf in told if isinstance(leaf, ast.JoinedStr | ast.Name)]
    shown = {id(part) for leaf in told for part in _down_to(CALLS, leaf)}
    used = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Global | ast.Nonlocal):
            used.update(node.names)
        elif isinstance(node, ast.Name) and id(node) not in shown:
            every = node.id in ("locals", "vars", "eval", "exec")
            used.update(leaves if every else [node.id] if isinstance(node.ctx, ast.Load) else [])
    return used & leaves.keys()


def imported(source):
    """Files of this package that a source imports, directly or through one another, sorted."""
    found, todo = set(), _files(source)
    while todo:
        file = todo.pop()
        found.add(file)
        todo |= _files(file.read_text(encoding="utf-8")) - found
    return sorted(found)


def _files(source):
    """Files of this package that a source imports directly."""
    parts = [name.split(".")[1:] for name in _imports(source)]
    files = {paths.PACKAGE.joinpath(*part).with_suffix(".py") for part in parts if part}
    return {file for file in files if file.is_file()}


@functools.cache
def _imports(source):
    """Names of this package that a source imports."""
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            names += [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    return [name for name in names if name.startswith("tbdcore")]


# Tables as text ------------------------------------------------------------------------------


def table_files(frame, name, id):
    """A frame as the files of a table: CSV, Markdown and LaTeX by name."""
    return {
        f"{name}.csv": csv(frame),
        f"{name}.md": f"<!-- {id} -->\n\n{markdown(frame)}".encode(),
        f"{name}.tex": f"% {id}\n{latex(frame)}".encode(),
    }


def csv(frame):
    """A frame as CSV, numbers to six digits: the same on all CPUs, and more than figures show."""
    named = _named(frame.index)
    return frame.to_csv(index=named, float_format="%.6g", lineterminator="\n").encode()


def _named(index):
    """Whether an index has names for the rows, or only counts them."""
    return index.names != [None] or type(index).__name__ != "RangeIndex"


def _cells(frame):
    """Header and rows of a frame as text; an index with names becomes a column."""
    named = frame.rename_axis("") if frame.index.names == [None] else frame
    flat = named.reset_index() if _named(frame.index) else frame
    rows = [[_cell(value) for value in row] for row in flat.itertuples(index=False, name=None)]
    columns = [" ".join(map(str, c)) if isinstance(c, tuple) else c for c in flat.columns]
    return [_cell(name) for name in columns], rows


def _cell(value):
    """One cell as text; NaN is empty."""
    if isinstance(value, float):  # NumPy's double is one
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def markdown(frame):
    """A frame as a Markdown table."""
    header, rows = _cells(frame)
    lines = [header, ["---"] * len(header), *rows]
    escaped = [" | ".join(cell.replace("|", r"\|") for cell in line) for line in lines]
    return "".join(f"| {line} |\n" for line in escaped)


_LETTERS = """alpha beta gamma delta eta theta kappa lambda mu pi rho sigma tau phi chi omega
Delta Lambda Sigma Omega le ge times to pm"""
_SYMBOLS = zip("αβγδηθκλμπρστφχωΔΛΣΩ≤≥×→±", _LETTERS.split(), strict=True)
_TEX = {c: "\\" + c for c in "&%$#_{}"} | {c: rf"\ensuremath{{\{name}}}" for c, name in _SYMBOLS}
_TEX |= {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
_SYMBOL = re.compile(r"\b([A-Za-z])_([A-Za-z0-9]{1,3}|FA|TAR)\b")  # P_d, R_T, r_P
_NUMBER = re.compile(r"[-+−]?[\d.]+(e[-+]?\d+)?( ± [\d.]+)?|")


def latex(frame):
    """A frame as a LaTeX tabular with booktabs rules.

    Cells in dollars stay mathematics, symbols such as P_d and ± become it, everything else is
    escaped; columns of numbers are aligned to the right.  Headers wider than their column are
    broken, and so are long texts.
    """
    header, rows = _cells(frame)
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(header)
    places = ["r" if all(map(_NUMBER.fullmatch, column)) else "l" for column in columns]
    widths = [max(map(len, column), default=0) for column in columns]
    parts = zip(header, widths, places, strict=True)
    head = " & ".join(_stack(name, max(width, 9), place) for name, width, place in parts)
    form = "".join("p{13em}" if w > 34 else p for w, p in zip(widths, places, strict=True))
    lines = [rf"\begin{{tabular}}{{{form}}}", r"\toprule", head + r" \\", r"\midrule"]
    lines += [" & ".join(map(tex, cells)) + r" \\" for cells in rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def _stack(text, width, place):
    """A header in as many lines as its column's width asks for."""
    lines = [text] if "$" in text else textwrap.wrap(text, width, break_long_words=False)
    stacked = r" \\ ".join(map(tex, lines))
    return stacked if len(lines) < 2 else rf"\shortstack[{place}]{{{stacked}}}"


def tex(text):
    """Text with LaTeX's special characters escaped outside mathematics."""
    text = _SYMBOL.sub(r"$\1_{\\mathrm{\2}}$", text) if "$" not in text else text
    pieces = re.split(r"(\$[^$]+\$)", text)
    pieces[::2] = ["".join(_TEX.get(c, c) for c in piece) for piece in pieces[::2]]
    return "".join(pieces)
