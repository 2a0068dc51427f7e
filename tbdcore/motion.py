"""Motion: how a target gets from one frame to the next.

A state is [x, vx, y, vy], positions and velocities interleaved, or [x, vx, y, vy, omega] where a turn rate is carried along.
Positions are in the notebook's own unit (metres, or cells of an image), T is the time between two frames in seconds,
turn rates are in radians per second, positive from +x towards +y.

**Straight and white.**  A target of constant velocity moves by ``F = cv(T)``, and its deviations from a straight line are
accelerations, constant during one step, independent from step to step.

**Turning.**  Between two frames the velocity turns by the angle omega T and the target moves along the arc.  Its
matrix is usually printed with sin(omega T) / omega and (1 - cos(omega T)) / omega, which a computer cannot
evaluate at omega = 0 and evaluates badly near it.  With h = omega T / 2 and f = T sin(h) / h the same two entries are

    sin(omega T) / omega = f cos(h),        (1 - cos(omega T)) / omega = f sin(h),

that is: the chord f, turned by half the angle.  f tends to T, so ``coordinated_turn(0, T)`` is exactly the matrix of a
straight line.

**Regimes.**  Whether there is a target and which law it follows is a Markov chain over a few regimes, one row of ``Pi`` per
regime it comes from.  ``regimes`` moves the regimes of many particles, one uniform draw each; ``advance`` then moves their
states, each by its own regime: 0 absent (the state has no meaning and is left alone), 1 constant velocity, 2 coordinated
turn with the particle's own turn rate.  It draws its accelerations from the caller's generator, two per living particle, in
order.

Not here: where new targets are born (the notebooks), what is measured (``sensor``, ``kalman``).
"""

import math

import numpy as np

from tbdcore import kernel

# Coordinated turn ------------------------------------------------------------------------------------------------------


def coordinated_turn(omega, T):
    """Transition matrix (4, 4) of a turn at omega rad/s for T seconds, state [x, vx, y, vy]; exact at omega = 0."""
    h = 0.5 * omega * T
    f = T * math.sin(h) / h if h else T
    a, b = f * math.cos(h), f * math.sin(h)
    c, s = math.cos(2 * h), math.sin(2 * h)
    return np.array([[1.0, a, 0.0, -b], [0.0, c, 0.0, -s], [0.0, b, 1.0, a], [0.0, s, 0.0, c]])


# Regimes ---------------------------------------------------------------------------------------------------------------


def check_transitions(Pi):
    """Pi as a float array, after checking that it is a square matrix of probabilities whose rows sum to one."""
    Pi = np.asarray(Pi, float)
    if Pi.ndim != 2 or Pi.shape[0] != Pi.shape[1]:
        raise ValueError(f"transition matrix: shape {Pi.shape} is not square; give one row and one column per regime")
    for a, row in enumerate(Pi):
        if not (row >= 0).all() or abs(row.sum() - 1.0) > 1e-9:
            raise ValueError(f"transition matrix: row {a} is {row.tolist()}, not probabilities that sum to 1; correct it")
    return Pi


def regimes_spec(r, Pi, u):
    """Specification of :func:`regimes`: invert the cumulative row of every particle."""
    C = np.cumsum(Pi, axis=1)
    return (u[:, None] >= C[r, :-1]).sum(axis=1)


@kernel
def regimes(r, Pi, u):
    """Next regime (N,) of every particle.

    r : (N,) int64 regimes; Pi : (R, R) transition probabilities, rows from; u : (N,) uniform draws in [0, 1).
    """
    C = Pi.copy()
    for b in range(1, Pi.shape[1]):
        C[:, b] += C[:, b - 1]
    out = np.zeros(r.size, np.int64)
    for n in range(r.size):
        for b in range(Pi.shape[1] - 1):
            out[n] += u[n] >= C[r[n], b]
    return out


def advance_spec(S, r, accel, T, rng):
    """Specification of :func:`advance`: one matrix per living particle."""
    out = S.copy()
    alive = np.flatnonzero(r)
    a = accel * rng.standard_normal((alive.size, 2))
    for n, (ax, ay) in zip(alive, a, strict=True):
        F = coordinated_turn(S[n, 4] if r[n] == 2 else 0.0, T)
        out[n, :4] = F @ S[n, :4] + np.array([T * T / 2 * ax, T * ax, T * T / 2 * ay, T * ay])
    return out


@kernel
def advance(S, r, accel, T, rng):
    """States (N, 5) one frame later, each by its own regime.

    S : (N, 5) states [x, vx, y, vy, omega]; r : (N,) regimes 0 absent, 1 constant velocity, 2 coordinated turn.
    accel : standard deviation of the acceleration per axis, constant during the step; two normal draws per living
    particle, in order.  Absent particles are copied; the turn rate never changes here.
    """
    out = S.copy()
    for n in range(r.size):
        if r[n] == 0:
            continue
        vx, vy = S[n, 1], S[n, 3]
        a, b, c, s = T, 0.0, 1.0, 0.0
        if r[n] == 2 and S[n, 4] != 0.0:
            h = 0.5 * S[n, 4] * T
            sh, ch = math.sin(h), math.cos(h)
            f = T * sh / h
            a, b, c, s = f * ch, f * sh, 1.0 - 2.0 * sh * sh, 2.0 * sh * ch
        ax = accel * rng.standard_normal()
        ay = accel * rng.standard_normal()
        out[n, 0] = S[n, 0] + a * vx - b * vy + 0.5 * T * T * ax
        out[n, 1] = c * vx - s * vy + T * ax
        out[n, 2] = S[n, 2] + b * vx + a * vy + 0.5 * T * T * ay
        out[n, 3] = s * vx + c * vy + T * ay
    return out
