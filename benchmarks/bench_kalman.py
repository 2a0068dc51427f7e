"""Kalman filter: the steps of one track, compiled, against the matrices of their specifications.

A step is timed where it is used, in a compiled loop; the specification is one call from Python.

The limit is arithmetic: the multiplications and additions of a step at the rate at which this
machine does independent ones, measured by a loop over eight sums.  A step is a chain of dependent
operations with divisions and a root in it, so several times the limit is as good as it gets.
"""

import numpy as np

from benchmarks.timing import Row, best, loop
from tbdcore import kalman
from tbdcore.kernels import track_cfar

X, P = np.array([7e4, 350.0, 7e4, 350.0]), np.diag([1e4, 400.0, 1e4, 400.0])
Z1, Z2, VAR = np.array([9.5e4, 0.785]), np.array([1e5, 0.786]), (11.0, 6e-7)
STEPS = {  # arguments, multiplications and additions
    "two_point": ((Z1, Z2, VAR, VAR, 10.0), 70),
    "predict_cv": ((X, P, 10.0, 0.01), 40),
    "gate_polar": ((X, P, *VAR), 35),
    "update_polar": ((X, P, 30.0, 1e-4, *VAR), 115),
}
CALLS = 1000


@loop
def sums(x, n):
    """2 n independent multiplications and additions on eight running sums."""
    a = b = c = d = e = f = g = h = 0.0
    for _ in range(n // 8):
        a, b, c, d = a * x + x, b * x + x, c * x + x, d * x + x
        e, f, g, h = e * x + x, f * x + x, g * x + x, h * x + x
    return a + b + c + d + e + f + g + h


@loop
def many_two_point(z1, z2, var1, var2, T):
    total = 0.0
    for _ in range(CALLS):
        x, P = kalman.two_point(z1, z2, var1, var2, T)
        total += x[0] + P[0, 0]
    return total


@loop
def many_predict_cv(x, P, T, q):
    for _ in range(CALLS):
        track_cfar.predict_cv(x, P, T, q)


@loop
def many_gate_polar(x, P, var_r, var_a):
    total = 0.0
    for _ in range(CALLS):
        x[0] += 1.0
        total += track_cfar.gate_polar(x, P, var_r, var_a)[4]
    return total


@loop
def many_update_polar(x, P, y_r, y_a, var_r, var_a):
    for _ in range(CALLS):
        track_cfar.update_polar(x, P, y_r, y_a, var_r, var_a)


def fresh(arguments):
    """Copies, since some kernels work in place."""
    return tuple(a.copy() if isinstance(a, np.ndarray) else a for a in arguments)


def rows():
    operation = best(sums, 0.5, 1_000_000) / 2_000_000
    for name, (arguments, operations) in STEPS.items():
        per_call = best(globals()[f"many_{name}"], *fresh(arguments)) / CALLS
        module = kalman if name == "two_point" else track_cfar
        spec = best(getattr(module, f"{name}_spec"), *arguments)
        where = module.__name__.rpartition(".")[2]
        yield Row(f"{where}.{name}", "one track", per_call, spec, operations * operation)
