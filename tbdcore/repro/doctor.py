"""Whether this machine can reproduce the papers: a list of checks, each a line that says what is
good or what to do.

A check is a function that returns what it found, or raises :class:`Fault` with what is wrong and
what to do.  The last one is a self-test with known answers, in a few seconds: the first output of a
random stream, a closed form through a compiled kernel, and a Monte Carlo run whose bits must be the
same for one process and for two.
"""

import os
import re
import sys
import tempfile
from importlib import metadata
from pathlib import Path

from tbdcore.repro import paths

INSTALL = "run: python -m pip install --require-hashes --no-deps -r environment.txt"
STREAM = 0x052D27BA31D1AF10  # first output of the stream (seed 20, trial 0)
LOCKED = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;\\]+)\s*(?:;\s*([^\\]+?))?\s*\\?$", re.MULTILINE)


class Fault(Exception):
    """What is wrong, and what to do."""


def examine():
    """Every check in turn; yields (good, line)."""
    for check in CHECKS:
        try:
            yield True, f"{check.__name__}: {check()}"
        except Fault as fault:
            yield False, f"{check.__name__}: {fault}"
        except (
            Exception
        ) as error:  # the check itself cannot be made: that is a fault of the environment too
            yield (
                False,
                f"{check.__name__}: {type(error).__name__}: {' '.join(str(error).split())}; "
                f"{INSTALL}",
            )


def locked(text):
    """Versions by distribution that a lock has for this Python and machine."""
    from packaging.markers import Marker

    return {
        name: version
        for name, version, marker in LOCKED.findall(text)
        if not marker or Marker(marker).evaluate()
    }


def versions():
    """Every distribution against the lock."""
    wanted = locked(paths.LOCK.read_text(encoding="utf-8"))
    have = {name: _version(name) for name in wanted}
    wrong = [
        f"{name} is {have[name] or 'missing'}, the lock has {wanted[name]}"
        for name in wanted
        if have[name] != wanted[name]
    ]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise Fault(f"{', '.join(wrong[:3])}{more}; {INSTALL}")
    return f"Python {sys.version.split()[0]}, {len(wanted)} distributions as in {paths.LOCK.name}"


def _version(name):
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def kernel():
    """The Jupyter kernel that runs the notebooks, and whether it is this Python."""
    from jupyter_client.kernelspec import KernelSpecManager, NoSuchKernel

    make = f"make it: {sys.executable} -m ipykernel install --sys-prefix"
    try:
        program = KernelSpecManager().get_kernel_spec("python3").argv[0]
    except NoSuchKernel:
        raise Fault(f"no Jupyter kernel python3; {make}") from None
    if os.path.isabs(program) and Path(program).parent != Path(sys.executable).parent:
        raise Fault(f"the Jupyter kernel python3 runs {program}, not this Python; {make}")
    return f"python3 runs {program if os.path.isabs(program) else sys.executable}"


def cores():
    """Cores that this process may use."""
    from tbdcore.repro import trials

    return f"{trials.cores()}; choose fewer with --workers"


def folders():
    """The folders that runs write into."""
    from jupyter_core.paths import jupyter_runtime_dir

    places = [
        paths.figures(),
        paths.BUILD,
        Path(jupyter_runtime_dir()),
        Path(tempfile.gettempdir()),
    ]
    for place in places:
        if not _writable(place):
            raise Fault(
                f"{place} cannot be written; change its permissions, or give runs another folder: "
                f"tbdcore run --out DIR"
            )
    return f"{', '.join(map(str, places))} can be written"


def _writable(folder):
    """Whether files can be made in a folder, or in the one that it would be made in."""
    while not folder.exists():
        folder = folder.parent
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def cache():
    """Where compiled kernels are kept between runs."""
    advice = "make it writable, or name a folder that is: NUMBA_CACHE_DIR"
    try:
        from tbdcore import kalman
    except RuntimeError as error:  # Numba found no folder at all
        raise Fault(f"{error}; {advice}") from None
    place = Path(kalman.predict_cv.stats.cache_path)
    if not _writable(place):
        raise Fault(f"{place} cannot be written, so every run compiles again; {advice}")
    return f"compiled kernels are kept in {place}"


def answers():
    """Three calculations whose results are known."""
    import numpy as np

    from tbdcore import kalman
    from tbdcore.repro import trials

    first = int(_stream(20, 0).bit_generator.random_raw())
    if first != STREAM:
        raise Fault(f"a random stream begins with {first:#x} instead of {STREAM:#x}; {INSTALL}")
    _, P = kalman.predict_cv(
        np.zeros(4), np.zeros((4, 4)), 2.0, 3.0
    )  # covariance of white acceleration: q T^3/3, q T^2/2, q T
    if not np.array_equal(P[:2, :2], [[8.0, 6.0], [6.0, 6.0]]) or P[:2, 2:].any():
        raise Fault(
            f"a compiled kernel gives {P[:2, :2].tolist()} instead of [[8, 6], [6, 6]]; "
            f"remove {paths.PACKAGE}/__pycache__"
        )
    one, two = (trials.run(_draw, 64, seed=20, workers=workers) for workers in (1, 2))
    if one.tobytes() != two.tobytes():
        raise Fault(f"one process and two give different numbers; {INSTALL}")
    return "stream, compiled kernel, and one process against two: as they must be"


def _stream(seed, i):
    from tbdcore.repro import trials

    return trials.generator(seed, "doctor", "self-test", i, "noise")


def _draw(seed, i):
    """A trial: a drawn state, and its covariance, two seconds later."""
    from tbdcore import kalman

    rng = _stream(seed, i)
    return kalman.predict_cv(rng.standard_normal(4), rng.standard_normal((4, 4)), 2.0, 3.0)[1]


CHECKS = (versions, kernel, cores, folders, cache, answers)
