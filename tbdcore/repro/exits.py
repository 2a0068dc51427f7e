"""Exit codes of the commands, and the one line in which an error is reported."""

import contextlib
import sys
import traceback

GOOD, FAILED, USAGE, ENVIRONMENT, INTERRUPTED = 0, 1, 2, 3, 130


class CheckFailed(Exception):
    """What a check has found, in one line."""


def report(error, code, debug=False):
    """Print an error in one line, or its traceback; returns the exit code."""
    with contextlib.suppress(OSError):  # the terminal may be gone
        if debug and sys.exc_info()[0]:
            traceback.print_exc()
        else:
            print(f"tbdcore: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
    return code
