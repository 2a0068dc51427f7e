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
turn with the particle's own turn rate.  Both take the draws they need as arrays and are functions of numbers: what a birth
looks like is the notebook's business.

Not here: where new targets are born (the notebooks), what is measured (``sensor``, ``kalman``).
"""

import math

import numpy as np

from tbdcore import kernel

# Straight and white ----------------------------------------------------------------------------------------------------


def cv(T):
    """Transition matrix (4, 4) of a constant velocity over T seconds, state [x, vx, y, vy]."""
    return np.kron(np.eye(2), np.array([[1.0, T], [0.0, 1.0]]))


def white_acceleration(T, q):
    """Covariance (4, 4) of T seconds of white acceleration with power density q, in m^2/s^3, on each axis."""
    return q * np.kron(np.eye(2), np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]))


def step_acceleration(T, a):
    """Covariance (4, 4) of an acceleration of standard deviation a, in m/s^2, that is constant during the T seconds."""
    g = np.array([T**2 / 2, T])
    return a**2 * np.kron(np.eye(2), np.outer(g, g))


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
    after = (u[:, None] >= np.cumsum(Pi, axis=1)[r, :-1]).sum(axis=1)
    R = len(Pi)
    return after, np.bincount(R * r + after, minlength=R * R).reshape(R, R)


@kernel
def regimes(r, Pi, u):
    """Next regime (N,) of every particle, and how many went from each regime to each, (R, R).

    r : (N,) int64 regimes; Pi : (R, R) transition probabilities, rows from; u : (N,) uniform draws in [0, 1).
    """
    C = Pi.copy()
    for b in range(1, Pi.shape[1]):
        C[:, b] += C[:, b - 1]
    out = np.empty(r.size, np.int64)
    moves = np.zeros(Pi.shape, np.int64)
    for n in range(r.size):
        after = 0
        for b in range(Pi.shape[1] - 1):
            after += u[n] >= C[r[n], b]
        out[n] = after
        moves[r[n], after] += 1
    return out, moves


def advance_spec(S, before, r, a, born, omega, T):
    """Specification of :func:`advance`: one matrix per living particle, then overwrite what is born."""
    out = S.copy()
    out[(before == 1) & (r == 2), 4] = omega
    G = np.array([T * T / 2, T])
    for n, (ax, ay) in zip(np.flatnonzero(r), a, strict=True):
        F = coordinated_turn(out[n, 4] if r[n] == 2 else 0.0, T)
        out[n, :4] = F @ out[n, :4] + np.concatenate([G * ax, G * ay])
    out[(before == 0) & (r > 0)] = born
    return out


@kernel
def advance(S, before, r, a, born, omega, T):
    """States (N, 5) one frame later, each by its own regime.

    S : (N, 5) states [x, vx, y, vy, omega]
    before, r : (N,) regimes of the frame before and of this one: 0 absent, 1 constant velocity, 2 coordinated turn.
    a : (L, 2) accelerations, constant during the step, one row for each of the L living particles in their order.
    born : (B, 5) states of those that come alive, 0 -> 1 or 2: they begin there and do not move yet.
    omega : (O,) turn rates of those that begin to turn, 1 -> 2; all others keep theirs.
    Absent particles are copied.
    """
    out = S.copy()
    m = b = o = 0
    for n in range(r.size):
        if r[n] == 0:
            continue
        ax, ay = a[m, 0], a[m, 1]
        m += 1
        if before[n] == 0:
            out[n] = born[b]
            b += 1
            continue
        vx, vy = S[n, 1], S[n, 3]
        along, aside, c, s = T, 0.0, 1.0, 0.0
        if r[n] == 2:
            if before[n] == 1:
                out[n, 4] = omega[o]
                o += 1
            h = 0.5 * out[n, 4] * T
            sh, ch = math.sin(h), math.cos(h)
            f = T * sh / h if h != 0.0 else T
            along, aside, c, s = f * ch, f * sh, 1.0 - 2.0 * sh * sh, 2.0 * sh * ch
        out[n, 0] = S[n, 0] + along * vx - aside * vy + 0.5 * T * T * ax
        out[n, 1] = c * vx - s * vy + T * ax
        out[n, 2] = S[n, 2] + aside * vx + along * vy + 0.5 * T * T * ay
        out[n, 3] = s * vx + c * vy + T * ay
    return out
