"""Signals and processes: one interrupt is reported once, and no process is left."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from tbdcore.repro import cli, commands, processes

LINE = "tbdcore: interrupted; finished papers are kept, nothing is half written\n"


@pytest.mark.parametrize("number", processes.ENDING)
def test_the_first_signal_interrupts_and_the_others_change_nothing(
    repository, capsys, monkeypatch, number
):
    """Those that come in the meantime as well; afterwards the caller has its handlers again."""

    def interrupted(arguments):
        try:
            signal.raise_signal(number)
        finally:
            done.append(1)
            signal.raise_signal(signal.SIGINT)
            done.append(2)

    done, before = [], list(map(signal.getsignal, processes.ENDING))
    monkeypatch.setattr(commands, "list_command", interrupted)
    assert cli.main(["list"]) == 130
    assert capsys.readouterr().err == LINE
    assert done == [1, 2]
    assert list(map(signal.getsignal, processes.ENDING)) == before
    assert processes.came == []


def test_an_interrupt_whose_exception_is_lost_is_not(repository, capsys, monkeypatch):
    """Python drops what a finalizer raises."""

    class Final:
        def __del__(self):
            signal.raise_signal(signal.SIGINT)

    def lost(arguments):
        Final()
        return 0

    monkeypatch.setattr(sys, "unraisablehook", lambda event: None)
    monkeypatch.setattr(commands, "list_command", lost)
    assert cli.main(["list"]) == 130
    assert capsys.readouterr().err == LINE


def sleeper(said):
    """Words of a command that starts another one, says its id, and sleeps."""
    child = f"import subprocess as s; print(s.Popen([{sys.executable!r}, '-c', {said!r}]).pid)"
    return [sys.executable, "-uc", f"{child}; import time; time.sleep(99)"]


def test_a_call_ends_what_its_command_has_started(tmp_path, monkeypatch):
    """When an interrupt was noted before, and its exception lost."""
    log, before = tmp_path / "log", set(psutil.Process().children(recursive=True))

    def tick():
        if log.read_text():
            processes.came.append(signal.SIGINT)

    monkeypatch.setattr(processes, "POLL_INTERVAL", 0.1)
    monkeypatch.setattr(processes, "came", [])
    with pytest.raises(KeyboardInterrupt):
        processes.call(sleeper("import time; time.sleep(99)"), os.environ, log, tick)
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
with processes.signals_to(processes.interrupt):
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
