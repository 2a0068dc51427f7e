"""200 runs ended by SIGINT or SIGTERM at random moments, four at a time; none lives 5 s longer.

It takes about ten minutes, so that pytest runs it only by its name:
``python -m pytest -s tests/system/random_signals.py``.  It prints how long the runs lived on.
"""

import os
import shutil
import signal
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import psutil
import tiny
from test_signals import LINE, WORDS, parts, started

RUNS, AT_ONCE, LIMIT = 200, 4, 5.0
LATEST = 8.0  # seconds; the trials of a run have begun by then


def living(folder):
    """The processes of a repository, whoever has started them."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.environ().get("TBDCORE_REPOSITORY") == str(folder):
                found.append(process)
        except (psutil.Error, OSError):
            continue
    return [it for it in found if it.is_running() and it.status() != psutil.STATUS_ZOMBIE]


def ended(folder, moment, number):
    """Seconds that the processes of a run live after a signal, its exit code, what it said."""
    with started(folder, *WORDS) as run:
        time.sleep(moment)
        sent = time.monotonic()
        os.kill(run.pid, number)
        while run.poll() is None or living(folder):
            time.sleep(0.05)
            assert time.monotonic() < sent + 60, [it.cmdline() for it in living(folder)]
        lived = time.monotonic() - sent
        return lived, run.returncode, run.stderr.read()


def some(folder, runs):
    """One run after the other in a folder: its moment and signal, and what came of it."""
    made = tiny.products(folder)
    results = []
    for moment, number in runs:
        results.append((moment, number, *ended(folder, moment, number)))
        assert tiny.products(folder) == made
        assert not parts(folder)
    return results


def test_no_run_outlives_a_signal_by_five_seconds(first_run, tmp_path):
    rng = np.random.default_rng(60)
    runs = [(rng.uniform(0, LATEST), int(rng.choice([signal.SIGINT, signal.SIGTERM])))
            for _ in range(RUNS)]  # fmt: skip
    folders = [
        shutil.copytree(first_run[0], tmp_path / str(i), symlinks=True) for i in range(AT_ONCE)
    ]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        jobs = [pool.submit(some, it, runs[i::AT_ONCE]) for i, it in enumerate(folders)]
        results = [result for job in jobs for result in job.result()]
    lived = np.sort([result[2] for result in results])
    print(
        f"{len(lived)} runs lived on for {np.median(lived):.1f} s in the median, {lived[-1]:.1f} s"
    )
    for moment, number, _, code, said in results:
        # while Python itself starts, it says so in its own words
        early = code == -number or (code != 130 and "KeyboardInterrupt" in said)
        assert early or (code, said) == (130, LINE), (moment, number, code, said)
    assert lived[-1] < LIMIT


def test_what_lives_is_seen(tmp_path):
    words = ["sleep", "60"]
    with subprocess.Popen(words, env=os.environ | {"TBDCORE_REPOSITORY": str(tmp_path)}) as one:
        assert [it.pid for it in living(tmp_path)] == [one.pid]
        one.kill()
        one.wait()
    assert living(tmp_path) == []
