"""Signals and processes: one interrupt is reported once, and no process is left."""

import os
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest

from tbdcore.repro import cli, commands, paths, processes

LINE = "tbdcore: interrupted; finished papers are kept, nothing is half written\n"


@pytest.mark.parametrize("number", processes.ENDING)
def test_a_signal_is_noted_and_looked_at(repository, capsys, monkeypatch, number):
    """What a command is doing goes on until it looks; the caller then has its handlers again."""

    def interrupted(arguments):
        signal.raise_signal(number)
        signal.raise_signal(signal.SIGINT)
        done.append(1)
        processes.look(arguments.came)
        done.append(2)

    done, before = [], list(map(signal.getsignal, processes.ENDING))
    monkeypatch.setattr(commands, "list_command", interrupted)
    assert cli.main(["list"]) == 130
    assert capsys.readouterr().err == LINE
    assert done == [1]
    assert list(map(signal.getsignal, processes.ENDING)) == before


def test_a_signal_that_no_loop_has_looked_at_is_reported(repository, capsys, monkeypatch):
    """It came in a finalizer, where Python would drop an exception, as the command ended."""

    class Final:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def lost(arguments):
        Final()
        return 0

    monkeypatch.setattr(commands, "list_command", lost)
    assert cli.main(["list"]) == 130
    assert capsys.readouterr().err == LINE


@pytest.mark.parametrize("words", [["run"], ["sweep", "tiny", "shift=1,2"], ["stamp"], ["doctor"]])
def test_every_command_that_takes_long_looks(repository, capsys, monkeypatch, words):
    """A signal that was noted before it begins."""

    def noted(arguments):
        arguments.came.append(signal.SIGTERM)
        return command(arguments)

    name = f"{words[0]}_command"
    command = getattr(commands, name)
    monkeypatch.setattr(commands, name, noted)
    monkeypatch.setattr(processes, "_watched", lambda *_: pytest.fail("it began"))
    assert cli.main(words) == 130
    assert capsys.readouterr().err == LINE


def test_what_a_thread_answers_is_waited_for_until_a_signal_comes(monkeypatch):
    monkeypatch.setattr(processes, "POLL_INTERVAL", 0.02)
    came, asked = [], threading.Event()
    assert processes.wait(lambda: 7, came) == 7
    with paths.moved(TBDCORE_FIGURES="/elsewhere"):
        assert processes.wait(paths.figures, came) == paths.figures()
    with pytest.raises(ZeroDivisionError):
        processes.wait(lambda: 1 / 0, came)

    def asleep():
        came.append(signal.SIGINT)
        asked.wait(60)

    with pytest.raises(KeyboardInterrupt):
        processes.wait(asleep, came)
    asked.set()


def sleeper(said):
    """Words of a command that starts another one, says its id, and sleeps."""
    child = f"import subprocess as s; print(s.Popen([{sys.executable!r}, '-c', {said!r}]).pid)"
    return [sys.executable, "-uc", f"{child}; import time; time.sleep(99)"]


def test_a_call_ends_what_its_command_has_started(tmp_path, monkeypatch):
    log, came = tmp_path / "log", []
    before = set(psutil.Process().children(recursive=True))

    def tick():
        if log.read_text():
            came.append(signal.SIGINT)

    monkeypatch.setattr(processes, "POLL_INTERVAL", 0.1)
    with pytest.raises(KeyboardInterrupt):
        processes.call(sleeper("import time; time.sleep(99)"), os.environ, log, tick, came)
    assert set(psutil.Process().children(recursive=True)) <= before
    pid = int(log.read_text())
    assert not psutil.pid_exists(pid) or not processes.runs(psutil.Process(pid))


def test_a_process_that_has_ended_is_not_waited_for(monkeypatch):
    """A zombie, whose parent takes no note of it: without a look at its status this would hang."""
    monkeypatch.setattr(processes, "GRACE_PERIOD", 1e6)
    with subprocess.Popen([sys.executable, "-c", ""], stdout=subprocess.PIPE) as child:
        child.stdout.read()  # until it ends
        process = psutil.Process(child.pid)
        while process.status() != psutil.STATUS_ZOMBIE:
            time.sleep(0.01)
        processes.end([process])


def test_a_process_has_time_to_end():
    slow = "import signal, sys, time\nsignal.signal(15, lambda *_: (time.sleep(0.1), sys.exit(7)))"
    words = [sys.executable, "-c", f"{slow}\nprint(flush=True)\ntime.sleep(99)"]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as child:
        child.stdout.readline()
        processes.end([psutil.Process(child.pid)])
        assert child.wait(timeout=60) == 7


def test_a_process_that_does_not_listen_is_killed(monkeypatch):
    monkeypatch.setattr(processes, "GRACE_PERIOD", 0.05)
    deaf = "import signal, time; signal.signal(15, 1); print(flush=True); time.sleep(99)"
    with subprocess.Popen([sys.executable, "-c", deaf], stdout=subprocess.PIPE) as child:
        child.stdout.readline()
        processes.end([psutil.Process(child.pid)])
        assert child.wait(timeout=60) == -9


LATE = """
import signal, subprocess, sys, threading
from pathlib import Path

from tbdcore.repro import processes


class Lock:
    \"\"\"A lock of subprocess; a signal arrives just after it was taken without waiting.\"\"\"

    def __init__(self):
        self.lock, self.sent = threading.Lock(), False

    def acquire(self, *wait):
        taken = self.lock.acquire(*wait)
        if taken and wait == (False,) and not self.sent:
            self.sent = True
            signal.raise_signal(signal.SIGTERM)
        return taken

    def release(self):
        self.lock.release()

    def __enter__(self):
        self.acquire()

    def __exit__(self, *error):
        self.release()


class Popen(subprocess.Popen):
    def __init__(self, *words, **options):
        super().__init__(*words, **options)
        self._waitpid_lock = Lock()


subprocess.Popen = Popen
words = [sys.executable, "-c", "import time; time.sleep(60)"]
try:
    processes.call(words, None, Path(sys.argv[1]), lambda: None)
except KeyboardInterrupt:
    print("interrupted")
"""


def test_a_signal_while_subprocess_holds_its_lock_ends_the_call(tmp_path):
    """An exception raised there would leave the lock taken, and the last wait would not end."""
    words = [sys.executable, "-c", LATE, str(tmp_path / "log")]
    ran = subprocess.run(words, capture_output=True, text=True, timeout=20)
    assert ran.stdout == "interrupted\n", ran.stderr
