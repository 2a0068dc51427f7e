"""A run that a signal ends: no process stays, no half-written file, and the old products."""

import signal
import subprocess
import time
from functools import partial

import psutil
import pytest
import tiny


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_leaves_no_process_and_no_half_written_file(folder, sent):
    made = tiny.products(folder)
    words = ["run", "tiny", "--workers", "2", "-p", "pause=2", "--out", "build/slow"]
    # a process in the background may have inherited that SIGINT is ignored
    listening = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    options = {
        "cwd": folder,
        "env": tiny.environment(folder),
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
    }
    run = subprocess.Popen(tiny.command(*words), preexec_fn=listening, text=True, **options)
    own, seen, deadline = psutil.Process(run.pid), set(), time.monotonic() + 60
    while (
        sum("popen_loky" in " ".join(process.cmdline()) for process in seen) < 2
        and time.monotonic() < deadline
    ):
        time.sleep(0.2)
        seen = set(own.children(recursive=True))
    assert len(seen) >= 3, "a kernel and two workers"
    time.sleep(1)
    run.send_signal(sent)
    out, err = run.communicate(timeout=60)
    assert (run.returncode, err) == (
        130,
        "tbdcore: interrupted; finished papers are kept, nothing is half written\n",
    )
    assert not [process for process in seen if process.is_running()]
    assert tiny.products(folder) == made
    assert not [
        file
        for file in (folder / "build").rglob("*")
        if ".part" in file.name or file.parent.name == "tiny"
    ]
