"""A run that a signal ends: within five seconds no process, no half-written file, the old products.

The run under test has a kernel with two workers whose trials sleep, so that an interrupt may come
at the start of the command, at the start of the kernel, or during the trials.
"""

import contextlib
import os
import signal
import subprocess
import time

import psutil
import pytest
import tiny

LINE = "tbdcore: interrupted; finished papers are kept, nothing is half written\n"
WORDS = ["run", "tiny", "--workers", "2", "-p", "pause=2", "--out", "build/slow"]
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
LIMIT = 5.0  # seconds that everything has to end, and as much again on a machine that is busy


@contextlib.contextmanager
def started(folder, *words, ignored=()):
    """A command in a small repository that ignores some signals; killed at the end."""

    def handlers():  # a process in the background may have inherited that SIGINT is ignored
        for number in ENDING:
            signal.signal(number, signal.SIG_IGN if number in ignored else signal.SIG_DFL)

    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    options = {"cwd": folder, "env": tiny.environment(folder), "preexec_fn": handlers}
    run = subprocess.Popen(tiny.command(*words), **pipes, **options)
    try:
        yield run
    finally:
        run.kill()
        run.communicate()


def children(run):
    with contextlib.suppress(psutil.NoSuchProcess):
        return set(psutil.Process(run.pid).children(recursive=True))
    return set()


def working(run):
    """Every process of a run, once its trials have begun."""
    deadline = time.monotonic() + 90
    while time.monotonic() < deadline and run.poll() is None:
        seen = children(run)
        with contextlib.suppress(psutil.NoSuchProcess):
            if sum("popen_loky" in " ".join(process.cmdline()) for process in seen) >= 2:
                return seen
        time.sleep(0.1)
    raise AssertionError("no workers")


def alive(processes):
    """Those of some processes that have not ended within the limit."""
    return psutil.wait_procs(processes, timeout=2 * LIMIT)[1]


def parts(folder):
    return [file for file in folder.rglob("*") if ".part" in file.name]


@pytest.mark.parametrize("sent", ENDING)
def test_an_interrupted_run_leaves_no_process_and_no_half_written_file(folder, sent):
    made = tiny.products(folder)
    with started(folder, *WORDS) as run:
        seen, start = working(run), time.monotonic()
        assert len(seen) >= 4, "the child, a kernel and two workers"
        run.send_signal(sent)
        _, err = run.communicate(timeout=60)
        assert time.monotonic() - start < 2 * LIMIT
    assert (run.returncode, err) == (130, LINE)
    assert not alive(seen)
    assert tiny.products(folder) == made
    assert not parts(folder)
    assert not (folder / "build" / "slow" / "tiny").exists()


@pytest.mark.parametrize("seconds", [0.3, 2, 4])
def test_an_interrupt_at_any_moment_ends_the_run(folder, seconds):
    with started(folder, *WORDS) as run:
        time.sleep(seconds)
        seen, start = children(run), time.monotonic()
        run.send_signal(signal.SIGINT)
        _, err = run.communicate(timeout=60)
        assert time.monotonic() - start < 2 * LIMIT
    if seconds >= 1:  # before that Python itself may not have started
        assert (run.returncode, err) == (130, LINE)
    assert run.returncode in (130, -signal.SIGINT)
    assert not alive(seen)
    assert not parts(folder)


def begun(run):
    """Every process of a run that has just begun: the cheapest moment."""
    run.stdout.readline()
    return children(run)


@pytest.mark.parametrize(("count", "gap"), [(5, 0.05), (200, 0.005)])
def test_more_interrupts_change_nothing(folder, count, gap):
    for moment in (begun, begun, begun, working):
        with started(folder, *WORDS) as run:
            seen = moment(run)
            for _ in range(count):
                run.send_signal(signal.SIGINT)
                time.sleep(gap)
            _, err = run.communicate(timeout=60)
        assert (run.returncode, err) == (130, LINE)
        assert not alive(seen)
        assert not parts(folder)


@pytest.mark.parametrize("ignored", ENDING)
def test_a_signal_that_is_ignored_from_the_start_stays_ignored(folder, ignored):
    """As SIGHUP under nohup; the others still end the run."""
    with started(folder, *WORDS, ignored=[ignored]) as run:
        seen = working(run)
        run.send_signal(ignored)
        time.sleep(0.5)
        assert run.poll() is None
        assert all(process.is_running() for process in seen)
        run.send_signal(next(number for number in ENDING if number != ignored))
        _, err = run.communicate(timeout=60)
    assert (run.returncode, err) == (130, LINE)
    assert not alive(seen)


def test_a_killed_run_leaves_no_process_and_only_files_that_the_next_one_removes(folder):
    with started(folder, *WORDS) as run:
        seen = working(run)
        run.kill()
        start = time.monotonic()
        assert not alive(seen)
        assert time.monotonic() - start < 2 * LIMIT
    left = [file for file in parts(folder) if file.parent == folder / "build"]
    assert left
    again = tiny.run(folder, "run")
    assert again.returncode == 0, again.stderr
    said = again.stdout.splitlines()[0]
    assert said.startswith("tiny: removed what a killed run had left: ")
    assert all(file.name in said for file in left)
    assert not parts(folder)


def test_a_child_that_is_killed_ends_its_run(folder):
    with started(folder, *WORDS) as run:
        seen = working(run)
        child = next(process for process in seen if process.ppid() == run.pid)
        os.kill(child.pid, signal.SIGKILL)
        _, err = run.communicate(timeout=60)
    assert run.returncode == 1
    assert err == "tbdcore: tiny: the run died with code -9; run it again\n"
    assert not alive(seen)
    assert not parts(folder)
