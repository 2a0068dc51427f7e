"""Signals that ask a command to end, and its processes, of which none outlives it.

A handler only notes a signal in a list; loops look at it, and raise KeyboardInterrupt where all
that has been begun is in order.  An exception raised by the handler could leave a lock of
``subprocess`` taken, so that the next wait would not end, or be lost in a finalizer.
"""

import contextlib
import contextvars
import os
import signal
import subprocess
import threading
import time
from concurrent import futures

ENDING = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
GRACE_PERIOD = 2  # seconds that a process has to end before it is killed
POLL_INTERVAL = 0.5  # seconds between two looks at a process that runs


@contextlib.contextmanager
def signals_noted(came=None):
    """Signals that ask the run to end are noted in a list, a new one if none is given, which is
    the value of the block.

    They reach the main thread only; one that the caller ignores (nohup) stays ignored.
    """
    came, before = [] if came is None else came, {}

    def note(number, frame):
        came.append(number)

    with contextlib.suppress(ValueError):  # not the main thread
        for number in ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, note)
    try:
        yield came
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier or signal.SIG_DFL)


@contextlib.contextmanager
def signals_held():
    """Hold back signals that ask the run to end until the block is done."""
    came = []
    try:
        with signals_noted(came):
            yield
    finally:
        for number in came:
            signal.raise_signal(number)


def look(came):
    """Raise KeyboardInterrupt when a signal has been noted."""
    if came:
        raise KeyboardInterrupt


def wait(function, came):
    """The result of a function that runs in a thread; KeyboardInterrupt when a signal comes."""
    job, context = futures.Future(), contextvars.copy_context()

    def answer():
        try:
            job.set_result(context.run(function))
        except BaseException as error:
            job.set_exception(error)

    threading.Thread(target=answer, daemon=True).start()
    while not job.done():
        look(came)
        futures.wait([job], POLL_INTERVAL)
    return job.result()


def call(words, environment, log, tick, came=None):
    """Run a command in a session of its own, its output in a file; returns its exit code.

    ``tick()`` is called at every look.  No process that the command starts outlives this call,
    which raises KeyboardInterrupt at its end when a signal has come, or was noted in `came`.
    """
    with signals_noted(came) as came:
        code = _watched(words, environment, log, tick, came)
    look(came)
    return code


def _watched(words, environment, log, tick, came):
    """Start a command, look at it until it ends or a signal has come, and end all of it."""
    import psutil

    own, child, seen = psutil.Process(), None, set()
    before = set(own.children(recursive=True))
    options = {"stdin": subprocess.DEVNULL, "env": environment, "start_new_session": True}
    try:
        with log.open("wb") as said:
            child = subprocess.Popen(words, stdout=said, stderr=said, **options)
        while child.poll() is None and not came:
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(POLL_INTERVAL)
            seen |= set(own.children(recursive=True)) - before
            tick()
        return child.returncode
    finally:
        seen |= set(own.children(recursive=True)) - before
        if child:
            child.kill()  # nbclient would take a SIGTERM for itself
        end(seen)
        if child:
            child.wait()


def end(processes):
    """End processes: ask, wait, kill."""
    import psutil

    for act in (psutil.Process.terminate, psutil.Process.kill):
        for process in processes:
            with contextlib.suppress(psutil.NoSuchProcess):
                act(process)
        until = time.monotonic() + GRACE_PERIOD
        while (processes := list(filter(runs, processes))) and time.monotonic() < until:
            time.sleep(0.01)


def end_with_parent(parent):
    """End this process, and all that it has started, within seconds of its parent's end."""
    import psutil

    def watch():
        while os.getppid() == parent:
            time.sleep(1)
        end(psutil.Process().children(recursive=True))
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def runs(process):
    """Whether a process has not ended; a zombie has, whenever its parent may take note of it."""
    import psutil

    with contextlib.suppress(psutil.NoSuchProcess):
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    return False


def runs_since(pid, when):
    """Whether the process that had an id at some time still runs."""
    import psutil

    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).create_time() < when + 1 and runs(psutil.Process(pid))
    return False
