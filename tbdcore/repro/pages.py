"""The notebooks as objects: found by paper, imported as modules, executed with checked parameters.

A *page* is a notebook ``notebooks/NN_<paper>.ipynb``.  Two of its tags matter here.

``parameters``
    the one cell whose lines read ``name: type = default  # meaning; range; quick value``, for
    instance

        ``track_pfa: float = 0.1  # track false-alarm probability P_F; in (0, 1)``
        ``n_trials: int = 1000  # Monte Carlo trials; in [1, inf); quick 40``
        ``reading: str = "m"  # how eq. (10) is read; one of "m", "m-r"``
        ``snr_db: list = [3, 4, 5]  # SNR grid, dB; in [-30, 40]; increasing``

    so that what a reader sees is what is checked: name, type, range, and the value under
    ``--quick``.  ``parameters`` reads the cell without running it, ``validate`` refuses what does
    not fit and names the nearest name that would.

``algorithm``
    the cells that hold the paper's method (imports, scenario, simulation, recursion; no experiment,
    no plot).  ``page`` makes them a module, so that tests, benchmarks and a user's own script run
    exactly what the page shows.

``begin`` is a notebook's first call.  It sees the parameters as they are after papermill has had
its say, finds misspelt ones (papermill itself runs them with the default and reports success), and
opens the ledger and the portfolio of the run.
"""

import ast
import dataclasses
import io
import json
import keyword
import logging
import math
import os
import re
import shlex
import sys
import tempfile
import threading
import tokenize
import types
from itertools import pairwise
from pathlib import Path

from tbdcore.repro import paths
from tbdcore.repro.claims import Ledger, nearest
from tbdcore.repro.figures import Portfolio, artist, digest, versions

TYPES = {"int": int, "float": float, "str": str, "bool": bool, "list": list}
PLUMBING = ("workers", "scheduler", "out")  # parameters that cannot change a result
EVERYWHERE = {
    "__init__",
    "repro/claims",
    "repro/figures",
    "repro/pages",
    "repro/paths",
    "repro/trials",
}  # of every product
COMMON = ("seed", "n_trials", *PLUMBING)
_ONE_AT_A_TIME = threading.Lock()


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
        """The value in the parameter's type; raises ValueError when it has another type or lies
        outside the range.
        """
        if self.type == "float" and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if self.type == "int" and isinstance(value, float) and value.is_integer():
            value = int(value)  # papermill hands 1e3 over as a float
        if type(value) is not TYPES[self.type]:
            raise ValueError(
                f"parameter {self.name}: {value!r} is {type(value).__name__}; give {self.type}, "
                f"like {self.default!r}"
            )
        if self.type in ("int", "float", "list") and not all(
            map(self._inside, value if self.type == "list" else [value])
        ):
            raise ValueError(
                f"parameter {self.name}: {value!r} is out of range; give {self.meaning}, "
                f"in {self.range()}"
            )
        if self.choices and value not in self.choices:
            raise ValueError(
                f"parameter {self.name}: {value!r} is none of {', '.join(map(repr, self.choices))}"
            )
        if self.increasing and (not value or any(a >= b for a, b in pairwise(value))):
            raise ValueError(
                f"parameter {self.name}: {value!r} does not increase; give at least one number, "
                f"the smallest first"
            )
        return value

    def range(self):
        """The range as it is written in the cell."""
        return f"{self.ends[0]}{self.low:g}, {self.high:g}{self.ends[1]}"

    def _inside(self, number):
        if isinstance(number, str | bool) or not isinstance(number, int | float):
            return self.low == -math.inf and self.high == math.inf
        above = number > self.low if self.ends[0] == "(" else number >= self.low
        below = number < self.high if self.ends[1] == ")" else number <= self.high
        return above and below


def papers():
    """Names of the papers in the order of their notebooks."""
    return [
        path.stem[3:]
        for path in sorted(paths.NOTEBOOKS.glob("[0-9][0-9]_*.ipynb"))
        if not path.stem.startswith("00")
    ]


def everything():
    """The papers, and after them the index, which reads their verdicts."""
    return papers() + [path.stem[3:] for path in sorted(paths.NOTEBOOKS.glob("00_*.ipynb"))]


def path(paper):
    """The notebook of a paper; raises ValueError, with the nearest name, when there is none."""
    found = [
        file
        for file in sorted(paths.NOTEBOOKS.glob("[0-9][0-9]_*.ipynb"))
        if file.stem[3:] == paper
    ]
    if not found:
        raise ValueError(
            f"paper {paper!r}: there is no such notebook; "
            f"the nearest is {nearest(paper, papers())!r} of {', '.join(papers())}"
        )
    return found[0]


def cells(paper, tag=None):
    """Sources of a notebook's code cells, those with a tag if one is given."""
    try:
        notebook = json.loads(path(paper).read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(
            f"{path(paper).name}: no notebook ({error}); take it from the repository again"
        ) from None
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [
        "".join(cell["source"])
        for cell in code
        if tag is None or tag in cell["metadata"].get("tags", ())
    ]


def page(paper):
    """The algorithm of a paper as a module.

    The module is made of the notebook's cells tagged ``algorithm``.  Its functions can be handed to
    worker processes, and its kernels are cached on disk.
    """
    import cloudpickle

    name = f"tbdcore_page_{paper}"
    source = "\n\n\n".join(cells(paper, "algorithm"))
    with _ONE_AT_A_TIME:  # a worker may have threads, and all of them may ask for the page at once
        if name in sys.modules and sys.modules[name].__source__ == source:
            return sys.modules[name]
        file = paths.BUILD / "pages" / f"{paper}_{digest([source.encode()])}.py"
        module = types.ModuleType(name, f"The algorithm cells of {path(paper).name}.")
        module.__file__, module.__source__ = str(_written(file, source)), source
        exec(compile(source, module.__file__, "exec"), module.__dict__)
        sys.modules[name] = module
        cloudpickle.register_pickle_by_value(module)
    return module


def _written(file, source):
    """A file of the source, which Numba's cache and tracebacks need; where it cannot be written,
    one that the machine forgets.
    """
    try:
        if not file.is_file():
            file.parent.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(f".{os.getpid()}.part")
            part.write_text(source, encoding="utf-8")
            os.replace(part, file)
    except OSError:
        file = Path(tempfile.mkdtemp(prefix="tbdcore_")) / file.name
        file.write_text(source, encoding="utf-8")
    return file


def parameters(paper):
    """The parameters of a notebook by name, read from its cell without running it."""
    found = cells(paper, "parameters")
    if len(found) != 1:
        raise ValueError(
            f"{path(paper).name}: {len(found)} cells are tagged 'parameters'; there must be one"
        )
    comments = _comments(found[0])
    lines = [
        _parameter(node, comments.get(node.end_lineno, "")) for node in ast.parse(found[0]).body
    ]
    return {parameter.name: parameter for parameter in lines}


def _comments(source):
    """Comments of a source by line number."""
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    return {
        token.start[0]: token.string[1:].strip()
        for token in tokens
        if token.type == tokenize.COMMENT
    }


def _parameter(node, comment):
    """One line of a parameters cell: an annotated assignment and its comment."""
    if not isinstance(node, ast.AnnAssign) or node.annotation.id not in TYPES:
        raise ValueError(
            f"parameters cell, line {node.lineno}: write `name: type = default  # meaning`, type one of {', '.join(TYPES)}"
        )
    fields = {"meaning": comment.partition(";")[0], "increasing": "; increasing" in comment}
    if match := re.search(r"in ([\[(])\s*(\S+),\s*(\S+?)\s*([\])])", comment):
        fields |= {"low": float(match[2]), "high": float(match[3]), "ends": match[1] + match[4]}
    if match := re.search(r"one of (\"[^;]*)", comment):
        fields["choices"] = tuple(ast.literal_eval(f"[{match[1]}]"))
    if match := re.search(r"quick ([^;]+)$", comment):
        fields["quick"] = ast.literal_eval(match[1])
    return Parameter(node.target.id, node.annotation.id, ast.literal_eval(node.value), **fields)


def validate(paper, given):
    """The given parameters, coerced; raises ValueError for an unknown name, a wrong type or a value
    out of range.
    """
    known = parameters(paper)
    for name in given:
        if name not in known:
            raise ValueError(
                f"parameter {name!r}: {paper} has none of this name; "
                f"the nearest is {nearest(name, known)!r}"
            )
    return {name: known[name].coerce(value) for name, value in given.items()}


def begin(paper, namespace):
    """Open a notebook's run, right after its parameters cell: ``claims, figures =
    tbdcore.begin("track_cfar", vars())``.

    Checks every parameter (a misspelt one is a plain variable that is no parameter), puts coerced
    values back into `namespace`, and makes sure that the output folder can be written before any
    kernel starts.

    Returns
    -------
    claims : tbdcore.repro.claims.Ledger
    figures : tbdcore.repro.figures.Portfolio
    """
    known = parameters(paper)
    strangers = [
        name
        for name, value in namespace.items()
        if name not in known and _plain_variable(name, value)
    ]
    if strangers:
        raise ValueError(
            f"parameter {strangers[0]!r}: {paper} has none of this name; "
            f"the nearest is {nearest(strangers[0], known)!r}"
        )
    values = validate(paper, {name: namespace[name] for name in known})
    namespace.update(values)
    default = all(values[name] == known[name].default for name in known if name not in PLUMBING)
    folder = usable(values["out"] or paths.figures())
    if not default and folder == paths.PRODUCTS.resolve():
        raise ValueError(
            f"{paper}: the repository's figures are for default parameters; "
            f"give these ones a folder: out='build/try'"
        )
    shown = {name: value for name, value in values.items() if name not in PLUMBING}
    provenance = {
        "parameters": shown,
        "seed": values["seed"],
        "trials": values["n_trials"],
        "sources": sources(paper),
        "remake": remake(paper, values),
        "versions": versions(),
    }
    ledger = (
        Ledger(paper, strict=default) if paper in papers() else None
    )  # the index judges no paper
    return ledger, Portfolio(paper, folder, provenance, artist)


def remake(paper, values):
    """The command that runs a notebook with these parameters."""
    known = parameters(paper)
    changed = {
        name: values[name]
        for name in known
        if name not in PLUMBING and values[name] != known[name].default
    }
    written = {
        name: value if isinstance(value, str) else json.dumps(value)
        for name, value in changed.items()
    }
    return shlex.join(
        [
            "tbdcore",
            "run",
            paper,
            *(part for name, text in written.items() for part in ("-p", f"{name}={text}")),
        ]
    )


def _plain_variable(name, value):
    """Whether a notebook's variable looks like a parameter that somebody set."""
    own = name.startswith("_") or name in ("In", "Out", "exit", "quit")
    return (
        not own
        and not keyword.iskeyword(name)
        and isinstance(value, int | float | str | bool | list)
    )


def usable(out):
    """The folder of a name, made if need be; raises ValueError when it cannot be written.

    A relative folder is made with its parents; an absolute one only if its parent exists, since a
    typing mistake should not grow a tree somewhere.
    """
    folder = Path(out)
    advice = "give a folder that can be written, such as build/try"
    if folder.is_absolute() and not folder.parent.is_dir():
        raise ValueError(
            f"output folder {out}: its parent folder does not exist; make it, or {advice}"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"output folder {out}: {error.strerror}; {advice}") from None
    return folder.resolve()


def sources(paper):
    """Hash of everything that decides a paper's products.

    The notebook's code, its claims, the verdicts of a longer run if there is one, every module of
    the package that it imports, directly or through another, and those that all products pass
    through; for the index, which computes nothing, the verdicts and the data of the papers that it
    shows.
    """
    code = cells(paper)
    modules = reached(
        "\n".join(
            line for cell in code for line in cell.splitlines() if not line.startswith(("%", "!"))
        )
    )
    package = [paths.PACKAGE / f"{name}.py" for name in sorted(modules | EVERYWHERE)]
    files = [
        paths.CLAIMS / f"{paper}.csv",
        paths.LONGER / paper / "verdicts.csv",
        *package,
        *_shown(paper, code),
    ]
    return digest(
        [cell.encode() for cell in code] + [file.read_bytes() for file in files if file.is_file()]
    )


def _shown(paper, code):
    """Verdicts and data of other papers that the index reads."""
    if paper in papers():
        return []
    ids = re.findall(r'\.data\("(\w+/\w+)"\)', "\n".join(code))
    return [
        paths.figures() / f"{name}.csv"
        for name in (*(f"{paper}/verdicts" for paper in papers()), *ids)
    ]


def reached(source, seen=None):
    """Names of the package's modules that a source imports, directly or through one another."""
    seen = set() if seen is None else seen
    for name in imported(source) - seen:
        seen.add(name)
        reached((paths.PACKAGE / f"{name}.py").read_text(encoding="utf-8"), seen)
    return seen


def imported(source):
    """Names of the package's modules that a source imports itself."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("tbdcore"):
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names if alias.name.startswith("tbdcore")}
    names = {name.removeprefix("tbdcore").lstrip(".").replace(".", "/") for name in names}
    return {name for name in names if (paths.PACKAGE / f"{name}.py").is_file()}


def execute(paper, given, output, progress=False):
    """Run a notebook through papermill with checked parameters.

    The executed notebook appears at `output` when the run has succeeded; after a failure it is left
    beside it as
    ``*.failed.ipynb``.

    Raises
    ------
    ValueError
        Bad parameters; nothing has started.
    RuntimeError
        A cell failed, or the kernel died; one line that says which and why.
    OSError
        There is no kernel to run in.
    """
    sys.modules.setdefault(
        "rfc3987_syntax", None
    )  # jsonschema would build a grammar of web addresses, for more than a second
    from jupyter_client.kernelspec import NoSuchKernel
    from nbclient.exceptions import DeadKernelError
    from papermill import PapermillExecutionError, execute_notebook

    values = validate(paper, given)
    output.parent.mkdir(parents=True, exist_ok=True)
    part = output.with_suffix(f".{os.getpid()}.part.ipynb")
    options = {
        "kernel_name": "python3",
        "engine_name": _engine(),
        "progress_bar": progress,
        "cwd": str(Path.cwd()),
    }
    with tempfile.TemporaryFile() as aside:
        try:
            execute_notebook(
                path(paper), part, values, kernel_manager_class=_whispering(aside), **options
            )
            os.replace(part, output)
            failed_at(output).unlink(missing_ok=True)
        except PapermillExecutionError as error:
            failed = failed_at(output)
            os.replace(part, failed)
            message = re.sub(r"\s+", " ", f"{error.ename}: {error.evalue}")
            raise RuntimeError(
                f"{paper}, cell {error.exec_count}: {message}; the run is in {failed}"
            ) from None
        except DeadKernelError:
            aside.seek(0)
            last = aside.read().decode(errors="replace").rstrip().rpartition("\n")[2]
            raise RuntimeError(
                f"{paper}: the kernel died{last and f': {last}'}; run it again"
            ) from None
        except NoSuchKernel:
            raise OSError(
                "the Jupyter kernel python3 is not registered; make it: "
                "python -m ipykernel install --sys-prefix"
            ) from None
        finally:
            part.unlink(missing_ok=True)
    return output


def failed_at(output):
    """Where an executed notebook is left when a cell has failed."""
    return output.with_suffix(".failed.ipynb")


def _whispering(aside):
    """A manager of kernels that write into a file what they say outside the cells, of their start
    and their end.
    """
    from jupyter_client import AsyncKernelManager

    class Whispering(AsyncKernelManager):
        async def start_kernel(self, **options):
            await super().start_kernel(**options, stderr=aside)

    return Whispering


def _engine():
    """Name of papermill's own engine without its habit of writing the whole notebook twice for each
    cell.
    """
    from papermill.engines import NBClientEngine, papermill_engines

    class Engine(NBClientEngine):
        @classmethod
        def execute_managed_notebook(cls, nb_man, kernel_name, **options):
            nb_man.output_path = (
                None  # papermill writes it when the run has ended, and when a cell has failed
            )
            return super().execute_managed_notebook(nb_man, kernel_name, **options)

    logging.getLogger("papermill").addHandler(
        logging.NullHandler()
    )  # what it logs of a failure is also raised
    papermill_engines.register("written-once", Engine)
    return "written-once"


def clean(notebook):
    """A papermill result as it is committed: without timings, papermill metadata, standard error
    and injected cells.
    """
    notebook["cells"] = [
        cell
        for cell in notebook["cells"]
        if "injected-parameters" not in cell["metadata"].get("tags", ())
    ]
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for count, cell in enumerate(code, start=1):
        cell["execution_count"] = count
        cell["outputs"] = [output for output in cell["outputs"] if output.get("name") != "stderr"]
        for output in cell["outputs"]:
            output.update({"execution_count": count} if "execution_count" in output else {})
    for cell in notebook["cells"]:
        cell["metadata"] = (
            {"tags": cell["metadata"]["tags"]} if cell["metadata"].get("tags") else {}
        )
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook["metadata"] = {"kernelspec": kernel, "language_info": {"name": "python"}}
    return notebook
