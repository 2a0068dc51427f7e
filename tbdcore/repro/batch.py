"""Runs: one notebook with its time, its verdicts and its processes looked after; one notebook over
a list of values.

``run`` executes a notebook and returns a :class:`Result`.  How long a paper took with the same
parameters the last time is kept in
``build/seconds``, so that the next run can say what to expect.  With ``resume`` a paper is skipped
when its folder holds every product, made from the present sources with these parameters and these
package versions.

``sweep`` runs a notebook for each value of one parameter and keeps one tidy table, a row for each
value and claim.

An interrupted run (Ctrl-C, a batch system's SIGTERM, a terminal that is closed) leaves the old
products, no half-written file and no process.  papermill works in a thread for that reason: in the
main thread it would take the signal for itself, stop the kernel, and forget the worker processes
that the kernel had started.
"""

import contextlib
import json
import logging
import os
import signal
import sys
import time
from concurrent.futures import ThreadPoolExecutor, wait
from concurrent.futures import TimeoutError as NotYet
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import psutil

from tbdcore.repro import claims, pages, paths, products

GOOD, FAILED, INTERRUPTED = 0, 1, 130
# it cleans up after killed workers, and says so
TRACKER = "ignore::UserWarning:loky.backend.resource_tracker"
TICK = 1.0  # seconds between two looks at a run
PATIENCE = 5.0  # seconds that a process has to end before it is killed


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


def run(paper, values, output, *, say=print, resume=False):
    """Execute a notebook with checked parameters; returns its :class:`Result`, of a failed run too.

    Parameters
    ----------
    paper : str
    values : dict
        Parameters as :func:`tbdcore.repro.pages.validate` returns them.
    output : pathlib.Path
        The executed notebook.
    say : callable
        Gets the lines of progress.
    resume : bool
        Skip what is done.

    Raises
    ------
    KeyboardInterrupt
        After everything that the run had started has ended.
    """
    folder = Path(values.get("out") or paths.figures())
    result = Result(paper, 0.0, {}, str(folder / paper), str(output))
    if resume and done(paper, values, folder):
        result = result._replace(
            verdicts=counts(folder / paper),
            skipped=True,
            notebook=str(output) if output.is_file() else "",
        )
        say(
            f"{paper}: skipped, its products have these sources and parameters "
            f"({summary(result.verdicts)})"
        )
        return result
    expected, start = _expected(paper, values), time.monotonic()
    say(f"{paper}: running" + (f", {expected:.0f} s the last time" if expected else ""))
    try:
        _watched(
            lambda: pages.execute(paper, values, output),
            lambda: _show(paper, time.monotonic() - start, expected),
        )
    except RuntimeError as error:
        seconds, failed = round(time.monotonic() - start, 1), str(pages.failed_at(output))
        return result._replace(seconds=seconds, notebook=failed, status=FAILED, error=str(error))
    seconds = round(time.monotonic() - start, 1)
    products.write(paths.BUILD / "seconds", {_key(paper, values): f"{seconds}\n".encode()})
    result = result._replace(seconds=seconds, verdicts=counts(folder / paper))
    took = f"{seconds:.0f} s" + (f", expected {expected:.0f} s" if expected else "")
    judged = (
        f"{sum(result.verdicts.values())} claims ({summary(result.verdicts)})"
        if result.verdicts
        else "done"
    )
    say(f"{paper}: {judged}; {took}")
    return result


def sweep(paper, name, runs, folder, *, say=print, resume=False):
    """Run a notebook once for each value of a parameter; yields (Result, table so far).

    `runs` is a list of (value, parameters).  The products of a value go to
    ``folder/<name>=<value>/``; after each value
    ``folder/<name>.csv`` holds the verdicts of all values so far: value, claim, published,
    measured, se, n, verdict.
    """
    tables = []
    for value, values in runs:
        place = folder / f"{name}={value}"
        say(f"{name} = {value}")
        result = run(
            paper,
            values | {"out": str(place)},
            place / pages.path(paper).name,
            say=say,
            resume=resume,
        )
        if result.status == GOOD:
            table = claims.verdicts(paper, place).rename(columns={"id": "claim"})
            table.insert(0, "value", value)
            tables.append(table[["value", "claim", "published", "measured", "se", "n", "verdict"]])
            products.write(
                folder, {f"{name}.csv": products.csv(pd.concat(tables, ignore_index=True))}
            )
        yield result


def done(paper, values, folder):
    """Whether a folder holds every product of a paper, made from the present sources with these
    parameters and versions.
    """
    now = {
        "digest": pages.digest(paper),
        "parameters": _settings(paper, values),
        "versions": products.versions(),
    }
    made = [products.record(file) for file in (folder / paper).glob("*.json")]
    same = all(about.get(key) == value for about in made for key, value in now.items())
    present = {file.name for file in (folder / paper).glob("*")}
    judged = {"verdicts.csv"} if paper in claims.papers() else set()
    return (
        bool(made)
        and same
        and judged.union(*(about.get("files", ("?",)) for about in made)) <= present
    )


def counts(folder):
    """How many of each verdict a folder's verdicts.csv has; none without one, as for the index."""
    if not (folder / "verdicts.csv").is_file():
        return {}
    found = pd.read_csv(folder / "verdicts.csv", dtype=str, keep_default_na=False)[
        "verdict"
    ].value_counts()
    return {verdict: int(found[verdict]) for verdict in claims.VERDICTS if verdict in found}


def summary(verdicts):
    """Counts of verdicts as text."""
    return ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())


def _settings(paper, values):
    """All parameters that can change a result, as they are read back from JSON."""
    known = pages.parameters(paper)
    full = {
        name: values.get(name, parameter.default)
        for name, parameter in known.items()
        if name not in pages.PLUMBING
    }
    return json.loads(json.dumps(full))


def _key(paper, values):
    """File that keeps the time of a run."""
    return f"{paper}_{products.digest([json.dumps(_settings(paper, values), sort_keys=True).encode()])}"


def _expected(paper, values):
    """Seconds that the same run took the last time, or None."""
    with contextlib.suppress(OSError, ValueError):
        return float((paths.BUILD / "seconds" / _key(paper, values)).read_text())


def _show(paper, elapsed, expected):
    """The clock of a run, on a terminal only."""
    if sys.stderr.isatty():
        of = f" of about {expected:.0f}" if expected else ""
        print(f"\r{paper}: {elapsed:.0f}{of} s\033[K\r", end="", file=sys.stderr, flush=True)


def _watched(work, tick):
    """Do some work in a thread of its own; no process that it starts outlives it."""
    os.environ.setdefault("PYTHONWARNINGS", TRACKER)
    here = psutil.Process()
    before, seen = set(here.children(recursive=True)), set()
    with _terminable(), ThreadPoolExecutor(1) as pool:
        job = pool.submit(work)
        try:
            while True:
                seen |= set(here.children(recursive=True)) - before
                with contextlib.suppress(NotYet):
                    job.exception(timeout=TICK)
                    return job.result()
                tick()
        finally:
            if not job.done():
                logging.disable()  # what the client of a killed kernel has to say
                seen |= set(here.children(recursive=True)) - before
            _end(seen)
            wait([job])
            logging.disable(logging.NOTSET)


@contextlib.contextmanager
def _terminable():
    """A request to end (SIGTERM), or the end of the terminal (SIGHUP), is a Ctrl-C."""
    before = {}
    with contextlib.suppress(ValueError):  # not the main thread
        before = {
            number: signal.signal(number, signal.default_int_handler)
            for number in products.ENDING[1:]
        }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)


def _end(processes):
    """End processes: ask, wait, kill."""
    processes = [process for process in processes if process.is_running()]
    for act in (psutil.Process.terminate, psutil.Process.kill):
        for process in processes:
            with contextlib.suppress(psutil.NoSuchProcess):
                act(process)
        _, processes = psutil.wait_procs(processes, timeout=PATIENCE)
