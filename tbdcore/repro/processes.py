"""Signals that ask a command to end, and its processes, of which none outlives it.

The first signal raises KeyboardInterrupt in the main thread; later ones change nothing.  While
:func:`call` waits for a process the handler only notes, and the loop looks: an exception inside
``subprocess`` would leave its lock taken, and the next wait would not end.  Python loses an
exception that is raised in a finalizer, so :data:`came` keeps the signals as well.
"""

import contextlib
import os
import signal
import subprocess
import threading
import time

ENDING = [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])]
GRACE_PERIOD = 2  # seconds that a process has to end before it is killed
POLL_INTERVAL = 0.5  # seconds between two looks at a process that runs
came: list = []  # signals that have asked the present command to end


def note(number, frame):
    """A signal handler that only notes the signal in :data:`came`."""
    came.append(number)


def interrupt(number, frame):
    """A signal handler: the first signal raises KeyboardInterrupt, all are noted."""
    came.append(number)
    if len(came) == 1:
        raise KeyboardInterrupt


@contextlib.contextmanager
def signals_to(handler):
    """Signals that ask the run to end go to a handler until the block is done.

    They reach the main thread only; one that the caller ignores (nohup) stays ignored.
    """
    before = {}
    with contextlib.suppress(ValueError):  # not the main thread
        for number in ENDING:
            if signal.getsignal(number) != signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier or signal.SIG_DFL)


@contextlib.contextmanager
def signals_held():
    """Hold back signals that ask the run to end until the block is done."""
    held = []
    try:
        with signals_to(lambda *event: held.append(event[0])):
            yield
    finally:
        for number in held:
            signal.raise_signal(number)


def call(words, environment, log, tick):
    """Run a command in a session of its own, its output in a file; returns its exit code.

    ``tick()`` is called at every look.  No process that the command starts outlives this call,
    which raises KeyboardInterrupt at its end when a signal has come.
    """
    with signals_to(note):
        code = _watched(words, environment, log, tick)
    if came:
        raise KeyboardInterrupt
    return code


def _watched(words, environment, log, tick):
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
