"""The notebooks as objects: found by paper, imported as modules, with parameters that are checked.

A *page* is a notebook ``notebooks/NN_<paper>.ipynb``.  Its cells with the tag ``algorithm`` hold
the paper's method.  The one cell with the tag ``parameters`` has lines such as

    n_trials: int = 1000  # Monte Carlo trials; in [1, inf); quick 40
    reading: str = "m"  # how eq. (10) is read; one of "m", "m-r"
    snr_db: list = [3, 4, 5]  # SNR grid, dB; in [-30, 40]; increasing
"""

import ast
import contextlib
import dataclasses
import functools
import itertools
import json
import math
import re
import reprlib
import shlex
import sys
import tempfile
import threading
import types
from pathlib import Path

import cloudpickle

from tbdcore.repro import claims, paths, products, reach
from tbdcore.repro.claims import nearest

TYPES = {"int": int, "float": float, "str": str, "bool": bool, "list": list}
EXECUTION = ("workers", "scheduler", "out")  # parameters that cannot change a result
LARGEST = 2**63  # integers are below, so that any program can read them in a record
_LOCK = threading.RLock()  # a page may use others


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One line of a parameters cell."""

    name: str
    type: str
    default: object
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    ends: str = "[]"
    choices: tuple = ()
    quick: object = None
    increasing: bool = False

    def coerce(self, value):
        """The value in the parameter's type; ValueError for another type, or out of range."""
        kind, shown = TYPES[self.type], reprlib.repr(value)
        if kind in (int, float) and isinstance(value, int | float) and not isinstance(value, bool):
            with contextlib.suppress(OverflowError, ValueError):  # papermill writes 1000 as 1e3
                value = kind(value) if kind(value) == value else value
        if type(value) is not kind:
            reason = f"is {type(value).__name__}; give {self.type}, like {self.default!r}"
        elif not all(map(self._inside, value if kind is list else [value])):
            reason = f"is out of range; give {self.meaning}, in {self.range()}"
        elif self.choices and value not in self.choices:
            reason = f"is none of {', '.join(map(repr, self.choices))}"
        elif self.increasing and (not value or any(a >= b for a, b in itertools.pairwise(value))):
            reason = "does not increase; give at least one number, the smallest first"
        else:
            return value
        raise ValueError(f"parameter {self.name}: {shown} {reason}")

    def range(self):
        """The range as it is written in the cell."""
        return f"{self.ends[0]}{self.low:g}, {self.high:g}{self.ends[1]}"

    def allowed(self):
        """What the parameter accepts, in words."""
        if self.choices:
            return f"one of {', '.join(map(str, self.choices))}"
        return "" if self.type in ("str", "bool") else f"in {self.range()}"

    def _inside(self, number):
        if isinstance(number, str | bool) or not isinstance(number, int | float):
            return self.low == -math.inf and self.high == math.inf
        above = self.low < number or (self.low == number and "[" in self.ends)
        below = number < self.high or (number == self.high and "]" in self.ends)
        return above and below and abs(number) < (LARGEST if isinstance(number, int) else math.inf)


def _notebooks():
    """Every notebook by the name of its paper, in their order."""
    return {file.stem[3:]: file for file in sorted(paths.notebooks().glob("[0-9][0-9]_*.ipynb"))}


def papers():
    """Names of the papers, which have a claims file, in the order of their notebooks."""
    return [paper for paper in _notebooks() if paper in claims.papers()]


def notebooks():
    """The papers, then the pages without claims, and last the index, which reads all products."""
    return sorted(_notebooks(), key=lambda name: (name not in papers(), name == "index"))


def has_ledger(paper):
    """Whether a notebook enters verdicts on claims: its last call publishes a ledger."""
    return any("publish(ledger)" in cell for cell in cells(paper))


def paper_of(word, choices=None):
    """The paper that a word names: ``dp_tbd``, ``01``, ``notebooks/01_dp_tbd.ipynb``; ValueError,
    with the nearest of the `choices`, when there is none.
    """
    choices, names = choices or notebooks(), {}
    for paper in choices:
        stem = path(paper).stem
        names |= dict.fromkeys((paper, stem, stem[:2], stem[:2].lstrip("0") or "0"), paper)
    if (name := Path(word).name.removesuffix(".ipynb")) in names:
        return names[name]
    near = nearest(name, [it for it in names if len(it) > 1], cutoff=0.6)
    near = f"the nearest is {near!r} of " if near else "there are "
    raise ValueError(f"paper {word!r}: there is no such notebook; {near}{', '.join(choices)}")


def path(paper):
    """The notebook of a paper; raises ValueError, with the nearest name, when there is none."""
    files = _notebooks()
    return files[paper if paper in files else paper_of(paper)]


def cells(paper, tag=None):
    """Sources of a notebook's code cells, those with a tag if one is given; ValueError, naming the
    file, when it is no notebook.
    """
    file = path(paper)
    try:
        code = _code(file.read_text(encoding="utf-8"))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        reason = f"no notebook ({type(error).__name__}: {error})"
        raise ValueError(f"{file.name}: {reason}; take it from the repository again") from None
    return [source for source, tags in code if tag is None or tag in tags]


def code(paper):
    """The code cells of a notebook as one source, without the lines of IPython's own."""
    return "\n\n\n".join(re.sub(r"(?m)^[%!].*\n?", "", cell) for cell in cells(paper))


@functools.lru_cache(maxsize=16)  # asked for in every run of trials on a cluster
def _code(text):
    """Source and tags of each code cell in the text of a notebook."""
    code = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    return [("".join(cell["source"]), cell["metadata"].get("tags", ())) for cell in code]


def page(paper):
    """A notebook's cells tagged ``algorithm`` as a module, so that tests, benchmarks and a user's
    script run exactly what the page shows.  Its functions reach worker processes.
    """
    name, source = f"tbdcore_page_{paper}", "\n\n\n".join(cells(paper, "algorithm"))
    with _LOCK:  # a worker may have threads, and all of them may ask for the page at once
        if name in sys.modules and sys.modules[name].__source__ == source:
            return sys.modules[name]
        reached = reach.of_code(source)  # what its kernels compile goes along
        key = products.digest([source.encode(), repr(reached).encode()])
        file = paths.build() / "pages" / f"{paper}_{key}.py"  # for Numba's cache and tracebacks
        if not file.is_file():
            if not paths.writable(file.parent):
                file = Path(tempfile.mkdtemp(prefix="tbdcore_"), file.name)
            products.write(file.parent, {file.name: source.encode()})
        module = types.ModuleType(name, f"The algorithm cells of {path(paper).name}.")
        module.__file__, module.__source__ = str(file), source
        exec(compile(source, file, "exec"), module.__dict__)
        sys.modules[name] = module
        cloudpickle.register_pickle_by_value(module)
    return module


def parameters(paper):
    """The parameters of a notebook by name, read from its cell without running it."""
    tagged = cells(paper, "parameters")
    if len(tagged) != 1:
        reason = f"{len(tagged)} cells are tagged 'parameters'; there must be one"
        raise ValueError(f"{path(paper).name}: {reason}")
    try:
        lines = [_parameter(node, tagged[0].splitlines()) for node in ast.parse(tagged[0]).body]
    except (ValueError, SyntaxError, AttributeError, TypeError) as error:
        raise ValueError(f"{path(paper).name}: its parameters cell is damaged: {error}") from None
    return {parameter.name: parameter for parameter in lines}


def _parameter(node, lines):
    """One line of a parameters cell, which may be wrapped: an annotated assignment, a comment."""
    if not isinstance(node, ast.AnnAssign) or node.annotation.id not in TYPES:
        advice = f"write `name: type = default  # meaning`, type one of {', '.join(TYPES)}"
        raise ValueError(f"parameters cell, line {node.lineno}: {advice}")
    comment = re.search("  # (.*)|$", "\n".join(lines[node.lineno - 1 : node.end_lineno]))[1] or ""
    meaning, *pieces = comment.split("; ")
    said = dict(piece.split(" ", 1) for piece in pieces if " " in piece)
    fields = {"meaning": meaning, "increasing": "increasing" in pieces}
    if "in" in said:
        low, high = said["in"][1:-1].split(",")
        fields |= {"low": float(low), "high": float(high), "ends": said["in"][0] + said["in"][-1]}
    if "one" in said:
        fields["choices"] = tuple(ast.literal_eval(f"[{said['one'].removeprefix('of ')}]"))
    if "quick" in said:
        fields["quick"] = ast.literal_eval(said["quick"])
    return Parameter(node.target.id, node.annotation.id, ast.literal_eval(node.value), **fields)


def validate(paper, given):
    """The given parameters, coerced; ValueError for an unknown name or a value that is bad."""
    declared = parameters(paper)
    for name in given:
        if name not in declared:
            advice = f"the nearest is {nearest(name, declared)!r}"
            raise ValueError(f"parameter {name!r}: {paper} has none of this name; {advice}")
    return {name: declared[name].coerce(value) for name, value in given.items()}


def changed(paper, values):
    """The values that are not the defaults, of parameters that can change a result."""
    declared = parameters(paper)
    settings = {name: value for name, value in values.items() if name not in EXECUTION}
    return {name: value for name, value in settings.items() if value != declared[name].default}


def provenance(paper, values):
    """What the records of a run with these parameters say of it."""
    every = {name: one.default for name, one in parameters(paper).items()} | values
    used = {name: value for name, value in every.items() if name not in EXECUTION}
    words = ["tbdcore", "run", paper]
    for name, value in changed(paper, values).items():
        words += ["-p", f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    made = {"parameters": used, "seed": used["seed"], "trials": used["n_trials"]}
    made |= {"digest": digest(paper), "remake": shlex.join(words)}
    return made | {"versions": products.versions()}


def destination(paper, values):
    """The folder for the products of a run; ValueError if that of the repository's figures should
    get products of other parameters than the defaults, or like :func:`usable`.
    """
    folder = usable(values.get("out") or paths.figures())
    if changed(paper, values) and folder == paths.products().resolve():
        reason = "the repository's figures are for default parameters"
        raise ValueError(f"{paper}, output folder {folder}: {reason}; give another: build/try")
    return folder


def usable(out):
    """The folder of a name, made if need be; ValueError when it cannot be written.  The parent of
    an absolute one must exist: a typing mistake should not grow a tree somewhere.
    """
    folder = Path(out)
    try:
        folder.mkdir(parents=not folder.is_absolute(), exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        advice = "give a folder that can be written, such as build/try"
        raise ValueError(f"output folder {out}: {error.strerror}; {advice}") from None
    return folder.resolve()


def digest(paper):
    """Short hash of what makes a paper's products: the code that the notebook reaches; claims
    without causes, readings without words; the tables that the index shows.
    """
    try:
        parts = [repr(sorted(reach.of_code(code(paper)).items()))]
    except SyntaxError as error:
        raise ValueError(f"{path(paper).name}: a code cell is no Python: {error}") from None
    if paper == "index":
        tables = itertools.product(papers(), ("verdicts.csv", "methods.csv"))
        shown = [paths.figures() / name / file for name, file in tables]
        parts += [file.read_text(encoding="utf-8") for file in shown if file.is_file()]
    if paper in claims.papers():
        parts += ["\0".join(row[:-1]) for row in claims.read(paper).values()]  # the cause is last
        parts += [repr(row._replace(words="")) for row in claims.readings(paper).values()]
        flown = claims.flown(paper).values()
        parts += [repr(row._replace(digest="")) for each in flown for row in each]
    return products.digest([part.encode() for part in parts])


def warned(notebook):
    """What the first cell that wrote to standard error said, "cell 46: its first line"; empty when
    none did.  The committed page does not show it, and the comparison of its outputs refuses it.
    """
    code = (cell for cell in notebook["cells"] if cell["cell_type"] == "code")
    for cell in code:
        for output in cell["outputs"]:
            if output.get("name") == "stderr":
                line = "".join(output["text"]).strip().partition("\n")[0]
                return f"cell {cell['execution_count']} wrote to standard error: {line}"
    return ""


def clean(notebook):
    """A papermill result as it is committed: without timings, papermill's metadata, standard error
    and injected cells; input with the tag ``hide-input`` folded in JupyterLab too; a picture's
    alternative text also in the cell's metadata, where the book looks for it; the metadata in the
    order of ruff, which then changes nothing but code.
    """
    cells = []
    for cell in notebook["cells"]:
        tags = cell["metadata"].get("tags", [])
        cell["metadata"] = {"tags": tags} if tags else {}
        if "hide-input" in tags:
            cell["metadata"]["jupyter"] = {"source_hidden": True}
        cells += [cell] if "injected-parameters" not in tags else []
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    for count, cell in enumerate(code, start=1):
        cell["execution_count"] = count
        cell["outputs"] = [output for output in cell["outputs"] if output.get("name") != "stderr"]
        for output in cell["outputs"]:
            output.update({"execution_count": count} if "execution_count" in output else {})
            if alt := output.get("metadata", {}).get("image/png", {}).get("alt"):
                cell["metadata"]["mystnb"] = {"image": {"alt": alt}}
    for cell in cells:
        cell["metadata"] = dict(sorted(cell["metadata"].items()))
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    about = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return notebook | {"cells": cells, "metadata": about}
