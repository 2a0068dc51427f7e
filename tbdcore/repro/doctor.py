"""Whether this machine can reproduce the papers.

Each check returns whether all is well, and what it found, or what is wrong and what to do.
"""

import contextlib
import os
import shlex
import sys
from importlib import metadata
from pathlib import Path
from tempfile import gettempdir

import jupyter_client.kernelspec
import numpy as np
from packaging.requirements import Requirement

from tbdcore.kernels import track_cfar
from tbdcore.repro import paths, processes, trials

NAMES = "doctor", "self-test"  # of its random streams
STREAM = 0x052D27BA31D1AF10  # first output of the stream (seed 20, trial 0)
PYTHON = shlex.quote(sys.executable)


def examine(came=()):
    """Every check in turn; yields (good, line).  KeyboardInterrupt when a signal is noted in
    `came`.
    """
    for title, check in CHECKS.items():
        try:
            good, line = processes.wait(check, came)
        except Exception as error:  # the check itself failed
            good, line = False, f"{type(error).__name__}: {error}; {_install()}"
        yield good, f"{title}: {line}"


def _install():
    lock = shlex.quote(str(paths.lock()))
    return f"run: {PYTHON} -m pip install --require-hashes --no-deps -r {lock}"


def locked(text):
    """Versions by distribution that a lock has for this Python and machine."""
    pins = [Requirement(line.rstrip(" \\")) for line in text.splitlines() if line[:1].isalnum()]
    here = [pin for pin in pins if not pin.marker or pin.marker.evaluate()]
    return {pin.name: str(pin.specifier).removeprefix("==") for pin in here}


def packages():
    """Every distribution against the lock."""
    wanted, others = locked(paths.lock().read_text(encoding="utf-8")), []
    for name, version in wanted.items():
        have = "missing"
        with contextlib.suppress(metadata.PackageNotFoundError):
            have = metadata.version(name)
        if have != version:
            others.append(f"{name} is {have}, the lock has {version}")
    if others:
        more = f" and {len(others) - 3} more" if len(others) > 3 else ""
        return False, f"{', '.join(others[:3])}{more}; {_install()}"
    python, lock = sys.version.split()[0], paths.lock().name
    return True, f"Python {python}, {len(wanted)} distributions as in {lock}"


def line_ends():
    """Line ends of what the harness and the scripts read: a checkout with CRLF is refused later."""
    read = [*paths.claims().parent.rglob("*.csv"), *paths.products().glob("*/verdicts.csv")]
    read += [file for file in paths.root().joinpath(".ci").glob("*") if file.is_file()]
    if with_crlf := sorted(file for file in read if b"\r\n" in file.read_bytes()):
        files = f"{with_crlf[0].relative_to(paths.root())} and {len(with_crlf) - 1} more files"
        what = "have CRLF line ends, so that claims cannot be read and .ci does not run"
        return False, f"{files} {what}; clone again: git clone -c core.autocrlf=false ADDRESS"
    return True, f"LF in {len(read)} tables and scripts"


def jupyter_kernel():
    """The Jupyter kernel that runs the notebooks, and whether it is this Python."""
    make = f"make it: {PYTHON} -m ipykernel install --sys-prefix"
    try:
        program = jupyter_client.kernelspec.KernelSpecManager().get_kernel_spec("python3").argv[0]
    except jupyter_client.kernelspec.NoSuchKernel:
        return False, f"no Jupyter kernel python3; {make}"
    program = program if os.path.isabs(program) else sys.executable
    if Path(program).parent != Path(sys.executable).parent:
        return False, f"the Jupyter kernel python3 runs {program}, not this Python; {make}"
    return True, f"python3 runs {program}"


def folders():
    """The folders that runs write into."""
    elsewhere = "give runs another folder: tbdcore run --out DIR"
    places = dict.fromkeys((paths.figures(), paths.build()), elsewhere)
    places[Path(gettempdir())] = "name another folder: TMPDIR=DIR"
    for place, advice in places.items():
        if not paths.writable(place):
            return False, f"{place} cannot be written; {advice}"
    return True, f"{', '.join(map(str, places))} can be written"


def self_test():
    """Three calculations whose results are known."""
    first = trials.generator(20, *NAMES, 0, "noise").bit_generator.random_raw()
    # covariance of a white acceleration of density q: q T^3/3, q T^2/2, q T
    _, P = track_cfar.predict_cv(np.zeros(4), np.zeros((4, 4)), 2.0, 3.0)
    one, two = (trials.run(_draw, 64, seed=20, workers=workers) for workers in (1, 2))
    results = {
        "a random stream": first == STREAM,
        "a compiled kernel": np.array_equal(P[:2], [[8.0, 6.0, 0.0, 0.0], [6.0, 6.0, 0.0, 0.0]]),
        "one process against two": one.tobytes() == two.tobytes(),
    }
    if failed := ", ".join(name for name, good in results.items() if not good):
        cache = f"{paths.PACKAGE}/__pycache__"
        return False, f"{failed}: not the known result; remove {cache}, then {_install()}"
    return True, f"{', '.join(results)}: the known results"


def _draw(seed, i):
    """Covariance of a random state, two seconds later."""
    rng = trials.generator(seed, *NAMES, i, "noise")
    return track_cfar.predict_cv(rng.standard_normal(4), np.diag(rng.random(4)), 2.0, 3.0)[1]


CHECKS = {
    "packages": packages,
    "line ends": line_ends,
    "Jupyter kernel": jupyter_kernel,
    "folders": folders,
    "self-test": self_test,
}
