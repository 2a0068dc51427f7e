"""Runs of a notebook, each in a process of its own, and the tables of a sweep.

The child process (this module's ``__main__``) has a session of its own.  An interrupt of the parent
ends the child and everything that it started; the child does the same when its parent has
disappeared.  What processes that were killed have left, the next run removes.
"""

import contextlib
import io
import json
import logging
import os
import re
import shutil
import sys
import time
import traceback
from pathlib import Path
from typing import NamedTuple

from tbdcore.repro import claims, pages, paths, processes, products
from tbdcore.repro.exits import ENVIRONMENT, FAILED, GOOD

# loky cleans up after killed workers, and says so; the debugger comments on its start
QUIET_ENVIRONMENT = {
    "PYTHONWARNINGS": "ignore::UserWarning:loky.backend.resource_tracker",
    "PYDEVD_DISABLE_FILE_VALIDATION": "1",
}
TABLE = ("value", "claim", "evidence", "published", "measured", "se", "n", "z", "verdict")


class Result(NamedTuple):
    """What came of one run; `status` is its exit code, `verdicts` how many of each kind."""

    paper: str
    seconds: float
    verdicts: dict
    folder: str
    notebook: str
    skipped: bool = False
    status: int = GOOD
    error: str = ""


def execute(paper, values, output, *, say=print, resume=False, debug=False, came=None):
    """Execute a notebook with checked parameters; returns its :class:`Result`, of a failed run too.

    `output` is the path of the executed notebook; `say` gets the lines of progress; `resume` skips
    what is done; `debug` prints the traceback of a run that fails.  KeyboardInterrupt is raised
    when a signal comes, or is noted in the list `came`, after all that the run had started has
    ended.
    """
    folder, start = Path(values.get("out") or paths.figures()), time.monotonic()
    result = Result(paper, 0.0, {}, str(folder / paper), str(output))
    if left := _remove_leftovers(folder / paper, output.parent):
        say(f"{paper}: removed what a killed run had left: {', '.join(left)}")
    if resume and done(paper, values, folder):
        verdicts, summary = counts(paper, folder, values)
        say(f"{paper}: skipped, its products have these sources and parameters ({summary})")
        kept = str(output) if output.is_file() else ""
        return result._replace(verdicts=verdicts, skipped=True, notebook=kept)
    say(f"{paper}: running")
    try:
        _execute(paper, values, output, debug, came)
    except RuntimeError as error:
        fault = {"status": FAILED, "error": str(error), "notebook": str(_failed_at(output))}
        return result._replace(seconds=round(time.monotonic() - start, 1), **fault)
    result = result._replace(seconds=round(time.monotonic() - start, 1))
    verdicts, summary = counts(paper, folder, values)
    if paper in claims.papers():
        say(f"{paper}: {summary}")
    say(f"{paper}: {result.seconds:.0f} s; products in {folder / paper}")
    return result._replace(verdicts=verdicts)


def tabulate(paper, name, places, folder):
    """Write the tables of a sweep: ``<name>.csv`` with every verdict, and ``<name>_shares.csv``
    with the share of the values that give a claim each verdict; `places` are the folders by value.
    """
    import pandas as pd

    tables = {value: claims.verdicts(paper, place) for value, place in places.items()}
    every = pd.concat(tables, names=["value", None]).reset_index("value")
    every = every.rename(columns={"id": "claim"})
    claim = every.groupby(["claim", "evidence"], sort=False)["verdict"]
    shares = {v: claim.agg(lambda given, v=v: (given == v).mean()) for v in claims.VERDICTS}
    shares = claim.size().to_frame("values").assign(**shares).reset_index()
    files = {f"{name}.csv": every[[*TABLE]].reset_index(drop=True), f"{name}_shares.csv": shares}
    products.write(folder, {file: products.csv(frame) for file, frame in files.items()})


def done(paper, values, folder):
    """Whether a folder holds every product of a paper, made as a run would make it now."""
    made = [products.record(file) for file in (folder / paper).glob("*.json")]
    wanted = set().union(*(about["files"] for about in made))
    wanted |= {"verdicts.csv"} if paper in claims.papers() else set()
    if not made or not wanted <= set(os.listdir(folder / paper)):
        return False
    now = pages.provenance(paper, values)
    return all(about | now == about for about in made)


def counts(paper, folder, values):
    """How many claims of each kind a folder's verdicts have, as the scorecard counts them, and that
    as text; none for a page that judges no paper, and for a run that is too small for verdicts.
    """
    if paper not in claims.papers():
        return {}, "no claims"
    if few := smaller(paper, values):
        return {}, f"verdicts void: {few}"
    numbers = claims.counts(claims.verdicts(paper, folder)).items()
    numbers = {name: n for name, n in numbers if isinstance(n, int) and n and name != "claims"}
    verdicts = {name[10:]: n for name, n in numbers.items() if name.startswith("measured: ")}
    judged = ", ".join(f"{n} {name}" for name, n in verdicts.items())
    others = [f"{n} {name}" for name, n in numbers.items() if not name.startswith("measured: ")]
    return numbers, ", ".join([f"{sum(verdicts.values())} measured ({judged})", *others])


def smaller(paper, values):
    """The numbers of trials, or of scenes, that are below their defaults, in words."""
    full = {name: one.default for name, one in pages.parameters(paper).items() if name[:2] == "n_"}
    few = [name for name in full if values.get(name, full[name]) < full[name]]
    return ", ".join(f"{name} {values[name]} of {full[name]}" for name in few)


def _execute(paper, values, output, debug, came=None):
    """Execute a notebook in a child process; RuntimeError when a cell fails or the kernel dies,
    OSError when there is no kernel to run in.
    """
    place, start = paths.build() / f"{paper}.{os.getpid()}.part", time.monotonic()

    def tick():
        if sys.stderr.isatty():
            elapsed = f"{time.monotonic() - start:.0f} s"
            print(f"\r{paper}: {elapsed}\033[K\r", end="", file=sys.stderr, flush=True)

    job = json.dumps([paper, values, str(output), str(place), os.getpid()])
    words = [sys.executable, "-m", "tbdcore.repro.batch", job]
    environment = QUIET_ENVIRONMENT | os.environ | {"JUPYTER_RUNTIME_DIR": str(place)}
    environment["IPYTHONDIR"] = str(place / "ipython")  # no startup file of the user runs
    environment["TBDCORE_BUILD"] = str(paths.build())
    environment["PYTHONSAFEPATH"] = "1"  # no module is imported from the current folder
    if path := os.environ.get("PYTHONPATH"):  # whose first folder ipykernel drops if it is that
        environment["PYTHONPATH"] = os.pathsep.join([str(place), path])
    try:
        place.mkdir(parents=True)
        code = processes.call(words, environment, place / "log", tick, came)
        _raise_failure(paper, code, place, debug)
    finally:
        shutil.rmtree(place, ignore_errors=True)
        _remove_leftovers(Path(values.get("out") or paths.figures()) / paper, output.parent)


def _raise_failure(paper, code, place, debug):
    """Raise what a child process reports that failed; one that died reports nothing."""
    if code == 0:
        return
    log = (place / "log").read_text(encoding="utf-8", errors="replace")
    own = [line.strip() for line in log.split("\n") if "[IPKernelApp]" not in line and line.strip()]
    last = f": {own[-1][:200]}" if own else ""
    error, trace = f"{paper}: the run died with code {code}{last}; run it again", log
    with contextlib.suppress(OSError):
        error, trace = json.loads((place / "outcome").read_text(encoding="utf-8"))
    print(trace if debug else "", end="", file=sys.stderr)
    error = error.replace("the kernel died;", f"the kernel died{last};")
    raise (OSError if code == ENVIRONMENT else RuntimeError)(error)


def _main(paper, values, output, place, parent):
    """The child process: executes a notebook through papermill, and reports how it failed in a
    folder and by its exit code; the notebook of a failed run is at :func:`_failed_at`.
    """
    from jupyter_client.kernelspec import NoSuchKernel
    from nbclient.exceptions import DeadKernelError
    from papermill import PapermillExecutionError, execute_notebook

    processes.end_with_parent(parent)
    logging.disable()
    sys.stderr = io.StringIO()  # so that what is in the file comes from the kernel
    output = Path(output)
    part = output.with_suffix(f".{os.getpid()}.part.ipynb")
    options = {"kernel_name": "python3", "progress_bar": False, "cwd": str(Path.cwd())}
    # asked to shut down, a kernel waits 2.5 s for the tracker of its workers, which ends after it
    options["shutdown_kernel"] = "immediate"
    # written once, at the end: a save for each cell costs a second for every 100 cells
    options["request_save_on_cell_execute"] = False
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        execute_notebook(pages.path(paper), part, values, **options)
        os.replace(part, output)
        _failed_at(output).unlink(missing_ok=True)
    except Exception as error:
        code, reason = FAILED, f"{paper}: {type(error).__name__}: {error}"
        if isinstance(error, PapermillExecutionError):
            os.replace(part, _failed_at(output))
            said = " ".join(f"cell {error.exec_count}: {error.ename}: {error.evalue}".split())
            reason = f"{paper}, {said}; the run is in {_failed_at(output)}"
        elif isinstance(error, DeadKernelError):
            reason = f"{paper}: the kernel died; run it again"
        elif isinstance(error, NoSuchKernel):
            code = ENVIRONMENT
            reason = "there is no Jupyter kernel python3; tbdcore doctor says how"
        elif isinstance(error, OSError):
            code, reason = ENVIRONMENT, str(error)
        outcome = json.dumps([reason, traceback.format_exc()]).encode()
        products.write(Path(place), {"outcome": outcome})
        sys.exit(code)
    finally:
        part.unlink(missing_ok=True)


def _failed_at(output):
    """Where an executed notebook is left when a cell has failed."""
    return output.with_suffix(".failed.ipynb")


def _remove_leftovers(*folders):
    """Remove what processes that no longer exist were writing; returns the names."""
    own = [paths.root(), paths.notebooks(), paths.build(), paths.build() / "pages"]
    removed = []
    for file in {file for folder in (*folders, *own) for file in folder.glob("*.part*")}:
        writer = re.search(r"\.(\d+)\.part(\.ipynb)?$", file.name)
        with contextlib.suppress(OSError):
            if writer and not processes.runs_since(int(writer[1]), file.stat().st_mtime):
                shutil.rmtree(file) if file.is_dir() else file.unlink()
                removed.append(file.name)
    return sorted(removed)


if __name__ == "__main__":
    _main(*json.loads(sys.argv[1]))
