"""Runs: one notebook in a process of its own, or one notebook over a list of values.

``run`` executes a notebook and returns a :class:`Result`.  How long a paper took with the same
parameters the last time is kept in ``build/seconds``, so that the next run can say what to expect.
With ``resume`` a paper is skipped when its folder holds every product, made from the present
sources with these parameters and these package versions.

The notebook runs in a child process (this module's ``__main__``) with a session of its own.  An
interrupt of the parent ends the child and everything that it started; the child does the same when
its parent has disappeared.  What processes that were killed have left, the next run removes.
"""

import contextlib
import csv
import io
import json
import logging
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from functools import partial
from pathlib import Path
from typing import NamedTuple

import psutil

from tbdcore.repro import claims, pages, paths, products, trials

GOOD, FAILED = 0, 1
TICK = 1.0  # seconds between two looks at a run
QUIET = {  # loky cleans up after killed workers, and says so; the debugger comments on its start
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


def run(paper, values, output, *, say=print, resume=False, debug=False):
    """Execute a notebook with checked parameters; returns its :class:`Result`, of a failed run too.

    `values` are parameters as :func:`tbdcore.repro.pages.validate` returns them, `output` the path
    of the executed notebook; `say` gets the lines of progress; `resume` skips what is done; `debug`
    prints the traceback of a run that fails.  KeyboardInterrupt is raised after everything that the
    run had started has ended.
    """
    folder = Path(values.get("out") or paths.figures())
    result = Result(paper, 0.0, {}, str(folder / paper), str(output))
    if left := _remove_leftovers(folder / paper, output.parent):
        say(f"{paper}: removed what a killed run had left: {', '.join(left)}")
    if resume and done(paper, values, folder):
        kept, found = str(output) if output.is_file() else "", counts(folder / paper)
        say(f"{paper}: skipped, its products have these sources and parameters ({summary(found)})")
        return result._replace(verdicts=found, skipped=True, notebook=kept)
    clock, expected, start = _clock(paper, values), None, time.monotonic()
    with contextlib.suppress(OSError, ValueError):
        expected = float(clock.read_text())
    say(f"{paper}: running" + (f", {expected:.0f} s the last time" if expected else ""))
    try:
        _execute(paper, values, output, partial(_show_clock, paper, start, expected), debug)
    except RuntimeError as error:
        seconds, failed = round(time.monotonic() - start, 1), str(pages.failed_at(output))
        fault = {"status": FAILED, "error": str(error)}
        return result._replace(seconds=seconds, notebook=failed, **fault)
    seconds, found = round(time.monotonic() - start, 1), counts(folder / paper)
    products.write(clock.parent, {clock.name: f"{seconds}\n".encode()})
    judged = f"{sum(found.values())} claims ({summary(found)})" if found else "done"
    said = f", expected {expected:.0f} s" if expected else ""
    say(f"{paper}: {judged}; {seconds:.0f} s{said}")
    return result._replace(seconds=seconds, verdicts=found)


def sweep(paper, name, runs, folder, *, say=print, **options):
    """Run a notebook once for each value of a parameter; yields the Result of each run.

    `runs` is a list of (value, parameters), `options` are those of :func:`run`.  The products of a
    value go to ``folder/<name>=<value>/``.  After each value ``folder/<name>.csv`` holds the
    verdicts so far, a row for each value and claim, and ``folder/<name>_shares.csv`` for each claim
    the share of the values with each verdict.
    """
    import pandas as pd

    tables = []
    for value, values in runs:
        place = folder / f"{name}={value}"
        output, values = place / pages.path(paper).name, values | {"out": str(place)}
        say(f"{name} = {value}")
        result = run(paper, values, output, say=say, **options)
        if result.status == GOOD:
            table = claims.verdicts(paper, place).rename(columns={"id": "claim"})
            tables.append(table.assign(value=value))
            every = pd.concat(tables, ignore_index=True)
            files = {f"{name}.csv": every[[*TABLE]], f"{name}_shares.csv": shares(every)}
            products.write(folder, {file: products.csv(frame) for file, frame in files.items()})
        yield result


def shares(table):
    """For each claim of a sweep's table the number of values and the share with each verdict."""
    import pandas as pd

    each = pd.get_dummies(table["verdict"], dtype=float)
    each = each.reindex(columns=list(claims.VERDICTS), fill_value=0.0)
    grouped = each.groupby([table["claim"], table["evidence"]], sort=False)
    share = grouped.mean()
    share.insert(0, "values", grouped.size())
    return share.reset_index()


def done(paper, values, folder):
    """Whether a folder holds every product of a paper, made as a run would make it now."""
    made = [products.record(file) for file in (folder / paper).glob("*.json")]
    wanted = set().union(*(about["files"] for about in made))
    wanted |= {"verdicts.csv"} if paper in claims.papers() else set()
    if not made or not wanted <= set(os.listdir(folder / paper)):
        return False
    now = {"digest": pages.digest(paper), "versions": products.versions()}
    now["parameters"] = _settings(paper, values)
    return all(about | now == about for about in made)


def counts(folder):
    """How many of each verdict a folder's verdicts.csv has; none without one, as for the index."""
    if not (folder / "verdicts.csv").is_file():
        return {}
    with (folder / "verdicts.csv").open(newline="", encoding="utf-8") as lines:
        found = Counter(row.get("verdict") for row in csv.DictReader(lines))
    return {verdict: found[verdict] for verdict in claims.VERDICTS if verdict in found}


def summary(verdicts):
    """Counts of verdicts as text."""
    return ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())


def _settings(paper, values):
    """All parameters that can change a result, as they are read back from JSON."""
    known = pages.parameters(paper)
    kept = {name: values.get(name, known[name].default) for name in known}
    return json.loads(
        json.dumps({name: kept[name] for name in kept if name not in pages.EXECUTION})
    )


def _clock(paper, values):
    """The file that keeps the seconds of a run."""
    settings = json.dumps(_settings(paper, values), sort_keys=True)
    return paths.BUILD / "seconds" / f"{paper}_{products.digest([settings.encode()])}"


def _show_clock(paper, start, expected):
    """The time that a run has taken so far, on a terminal only."""
    if sys.stderr.isatty():
        elapsed, of = time.monotonic() - start, f" of about {expected:.0f}" if expected else ""
        print(f"\r{paper}: {elapsed:.0f}{of} s\033[K\r", end="", file=sys.stderr, flush=True)


# The child process -----------------------------------------------------------------------------


def _execute(paper, values, output, tick, debug):
    """Execute a notebook in a child process; no process that it starts outlives this call.

    Raises as :func:`tbdcore.repro.pages.execute` does.
    """
    own = psutil.Process()
    before, seen, child = set(own.children(recursive=True)), set(), None
    paths.BUILD.mkdir(exist_ok=True)
    place = Path(tempfile.mkdtemp(suffix=f".{os.getpid()}.part", dir=paths.BUILD))
    job = json.dumps([paper, values, str(output), str(place), os.getpid()])
    words = [sys.executable, "-m", "tbdcore.repro.batch", job]
    environment = QUIET | os.environ | {"JUPYTER_RUNTIME_DIR": str(place)}
    options = {"stdin": subprocess.DEVNULL, "env": environment, "start_new_session": True}
    try:
        with (place / "stderr").open("wb") as said:
            child = subprocess.Popen(words, stdout=said, stderr=said, **options)
        while child.poll() is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(TICK)
            seen |= set(own.children(recursive=True)) - before
            tick()
        _raise_failure(paper, child.returncode, place, debug)
    finally:
        with products.signals_held():
            if child and child.poll() is None:
                child.kill()  # nbclient would take a SIGTERM for itself
            trials.end(seen | set(own.children(recursive=True)) - before)
            shutil.rmtree(place, ignore_errors=True)
            _remove_leftovers(Path(values.get("out") or paths.figures()) / paper, output.parent)


def _raise_failure(paper, code, place, debug):
    """Raise what a child process reports in its folder; one that died reports nothing."""
    said = (place / "stderr").read_text(encoding="utf-8", errors="replace").split("\n")
    own = [line.strip() for line in said if line.strip() and "[IPKernelApp]" not in line]
    last = f": {own[-1][:200]}" if own else ""
    outcome = {"kind": "", "error": f"{paper}: the run died with code {code}{last}; run it again"}
    with contextlib.suppress(OSError):
        outcome = json.loads((place / "outcome").read_text(encoding="utf-8"))
    if outcome and debug:
        print(outcome.get("trace", "\n".join(said)), file=sys.stderr)
    if outcome:
        kinds = {"ValueError": ValueError, "OSError": OSError}
        error = outcome["error"].replace("the kernel died;", f"the kernel died{last};")
        raise kinds.get(outcome["kind"], RuntimeError)(error)


def _main(paper, values, output, place, parent):
    """The child process: executes a notebook and reports in a folder how it ended."""
    trials.end_with_parent(parent)
    logging.disable()
    sys.stderr = io.StringIO()  # so that what is in the file comes from the kernel
    outcome = {}
    try:
        pages.execute(paper, values, Path(output))
    except Exception as error:
        known = [kind for kind in (ValueError, OSError, RuntimeError) if isinstance(error, kind)]
        text = str(error) if known else f"{paper}: {type(error).__name__}: {error}"
        kind = known[0].__name__ if known else ""
        outcome = {"kind": kind, "error": text, "trace": traceback.format_exc()}
    products.write(Path(place), {"outcome": json.dumps(outcome).encode()})


def _remove_leftovers(*folders):
    """Remove what processes that no longer exist were writing; returns the names."""
    own = [paths.ROOT, paths.NOTEBOOKS, paths.BUILD, paths.BUILD / "seconds", paths.BUILD / "pages"]
    removed = []
    for file in {file for folder in (*folders, *own) for file in folder.glob("*.part*")}:
        writer = re.search(r"\.(\d+)\.part(\.ipynb)?$", file.name)
        with contextlib.suppress(OSError):
            if writer and not _exists(int(writer[1]), file.stat().st_mtime):
                shutil.rmtree(file) if file.is_dir() else file.unlink()
                removed.append(file.name)
    return sorted(removed)


def _exists(pid, when):
    """Whether the process that had an id at some time still runs."""
    with contextlib.suppress(psutil.NoSuchProcess):
        process = psutil.Process(pid)
        return process.create_time() < when + 1 and process.status() != psutil.STATUS_ZOMBIE
    return False


if __name__ == "__main__":
    _main(*json.loads(sys.argv[1]))
