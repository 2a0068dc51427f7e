"""Motion: how a target gets from one frame to the next.

A state is [x, vx, y, vy], or [x, vx, y, vy, omega] where a turn rate is carried along.  Positions
are in the notebook's own unit (metres, or cells of an image), T is the time between two frames in
seconds, turn rates are in radians per second, positive from +x towards +y.

**Straight and white.**  A target of constant velocity moves by ``F = cv(T)``, and its deviations
from a straight line are accelerations, constant during one step, independent from step to step.

**Turning.**  Between two frames the velocity turns by the angle omega T.  The matrix is usually
printed with sin(omega T) / omega and (1 - cos(omega T)) / omega, which a computer evaluates badly
near omega = 0.  With h = omega T / 2 and the chord f = T sin(h) / h, which tends to T, the two
entries are f cos(h) and f sin(h).

**Regimes.**  Whether there is a target and which law it follows is a Markov chain, one row of
``Pi`` per regime it comes from.  ``transition`` moves many particles in one pass, first the regime,
by one uniform draw each, then the state by that regime: 0 absent (the state is left alone), 1
constant velocity, 2 coordinated turn with the particle's own rate.  ``box_states`` draws states
from a law of birth that is a box in position and velocity.
"""

import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, ArrayLike, Flag, Integers, Number, Numbers, checked
from tbdcore.jit import kernel

__all__ = ["box_states", "check_transitions", "coordinated_turn", "cv", "step_acceleration"]
__all__ += ["transition", "white_acceleration"]

LARGE = 1e50  # largest time, rate or acceleration: products stay finite
Real = Annotated[float, Number(-LARGE, LARGE)]
Positive = Annotated[float, Number(0.0, LARGE)]


@checked
def cv(T: Real) -> Array:
    """Transition matrix (4, 4) of a constant velocity over T seconds, state [x, vx, y, vy]."""
    return np.kron(np.eye(2), np.array([[1.0, T], [0.0, 1.0]]))


@checked
def white_acceleration(T: Positive, q: Positive) -> Array:
    """Covariance (4, 4) of white acceleration of power density q (m^2/s^3) over T seconds."""
    return q * np.kron(np.eye(2), np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]]))


@checked
def step_acceleration(T: Positive, a: Positive) -> Array:
    """Covariance (4, 4) of T seconds of a constant acceleration of standard deviation a (m/s^2)."""
    g = np.array([T**2 / 2, T])
    return a**2 * np.kron(np.eye(2), np.outer(g, g))


@checked
def coordinated_turn(omega: Real, T: Real) -> Array:
    """Transition matrix (4, 4) of a turn at omega rad/s for T seconds; exact at omega = 0."""
    h = 0.5 * omega * T
    f = T * math.sin(h) / h if h else T
    a, b = f * math.cos(h), f * math.sin(h)
    c, s = math.cos(2 * h), math.sin(2 * h)
    return np.array([[1.0, a, 0.0, -b], [0.0, c, 0.0, -s], [0.0, b, 1.0, a], [0.0, s, 0.0, c]])


@checked
def check_transitions(Pi: Annotated[ArrayLike, Numbers("n", "n", low=0.0, high=1 + 1e-9)]) -> Array:
    """Pi as a float array; ValueError unless its rows are probabilities that sum to 1."""
    for a, row in enumerate(Pi):
        if abs(row.sum() - 1.0) > 1e-9:
            raise ValueError(f"motion.check_transitions: Pi[{a}]: {row.tolist()} do not sum to 1")
    if not Pi.size:
        raise ValueError("motion.check_transitions: Pi is empty; give a row for each regime")
    return Pi


@kernel
def _turn_rate(v, omegas):
    """Turn rate at length v of two intervals (2, 2), measured from the start of the first."""
    left = omegas[0, 1] - omegas[0, 0]
    return omegas[0, 0] + v if v <= left else omegas[1, 0] + v - left


@kernel
def _check_intervals(omegas):
    """Total length of the intervals; ValueError unless omegas (2, 2) holds two finite ones."""
    valid, total = omegas.shape == (2, 2), 0.0
    for low, high in omegas:
        valid &= -np.inf < low <= high < np.inf
        total += high - low
    if not valid:
        raise ValueError("motion: the turn rates omegas are two intervals (2, 2), lower end first")
    return total


def box_states_spec(u, low, width, omegas):
    """Specification of :func:`box_states`: quantiles of uniform laws."""
    lengths = np.concatenate([[0.0], np.cumsum(np.diff(omegas).ravel())])
    turns = np.interp(u[4] * lengths[-1], np.repeat(lengths, 2)[1:-1], omegas.ravel())
    return np.column_stack([np.outer(u[d], width[d]) + low[d] for d in range(4)] + [turns])


@checked
@kernel
def box_states(
    u: Annotated[ArrayLike, Numbers(5, "n", low=None)],
    low: Annotated[ArrayLike, Numbers(4, low=None)],
    width: Annotated[ArrayLike, Numbers(4, low=None)],
    omegas: Annotated[ArrayLike, Numbers(2, 2, low=None)],
) -> Array:
    """States (n, 5) = [x, vx, y, vy, omega] of a uniform law, from uniform draws u (5, n).

    A NaN in u is one in the state.
    low, width : (4,) edge and width of the box of positions and velocities
    omegas : (2, 2) intervals of the turn rate, chosen in proportion to their lengths
    """
    S, both = np.empty((u.shape[1], 5)), _check_intervals(omegas)
    for d in range(4):
        if not abs(low[d]) + abs(width[d]) < np.inf:
            raise ValueError("motion.box_states: low or width is NaN or infinite; give a box")
    for n in range(len(S)):
        for d in range(4):
            S[n, d] = low[d] + width[d] * u[d, n]
        S[n, 4] = _turn_rate(u[4, n] * both, omegas)
    return S


def transition_spec(r, S, Pi, T, u, a, omegas, redraw):
    """Specification of :func:`transition`: cumulative rows, lengths, one matrix per particle."""
    after, born = np.zeros_like(r), []
    for n, before in enumerate(r):
        ends = np.concatenate([[0.0], np.cumsum(Pi[before])])
        after[n] = (u[n] >= ends[1:-1]).sum()
        if after[n] and redraw and before == 0:
            born.append(n)
        elif after[n]:
            if (before, after[n]) == (1, 2) and len(omegas):
                v = np.interp(u[n], [ends[2], 1.0], [0.0, np.diff(omegas).sum()])
                lengths = np.concatenate([[0.0], np.cumsum(np.diff(omegas).ravel())])
                S[n, 4] = np.interp(v, np.repeat(lengths, 2)[1:-1], omegas.ravel())
            F = coordinated_turn(S[n, 4] if after[n] == 2 else 0.0, T)
            S[n, :4] = F @ S[n, :4] + np.outer(a[n], [T * T / 2, T]).ravel()
    return after, np.array(born, np.int64), S


@kernel
def _move(S, n, along, aside, c, s, T, a):
    vx, vy = S[n, 1], S[n, 3]
    S[n, 0] += along * vx - aside * vy + 0.5 * T * T * a[n, 0]
    S[n, 1] = c * vx - s * vy + T * a[n, 0]
    S[n, 2] += aside * vx + along * vy + 0.5 * T * T * a[n, 1]
    S[n, 3] = s * vx + c * vy + T * a[n, 1]


@checked
@kernel
def transition(
    r: Annotated[ArrayLike, Integers("N")],
    S: Annotated[Array, Numbers("N", 5, low=None, in_place=True)],
    Pi: Annotated[ArrayLike, Numbers(3, 3, low=None)],
    T: Annotated[float, Number()],
    u: Annotated[ArrayLike, Numbers("N", low=None)],
    a: Annotated[ArrayLike, Numbers("N", 2, low=None)],
    omegas: Annotated[ArrayLike, Numbers("rates", 2, low=None)],
    redraw: Annotated[bool, Flag()],
) -> tuple[Array, Array, Array]:
    """One frame of the chain and of the motion: regimes (N,), indices of the born (B,), states.

    r : (N,) regimes; S : (N, 5) states [x, vx, y, vy, omega], moved **in place**, NaN stays NaN
    Pi : (3, 3) transition probabilities, rows from; T : seconds
    u : (N,) uniform draws in [0, 1); a : (N, 2) accelerations, constant during the step
    omegas : (2, 2) intervals of the turn rate that is drawn where a turn begins, 1 -> 2, from the
        rest of the draw that chose the turn; or (0, 2) to keep the rate
    redraw : if True, the born are not moved, the caller draws their states; if False they go on
        from the state they have, and the list of the born is empty
    """
    for p, q, w in Pi:
        if not (min(p, q, w) >= 0.0 and abs(p + q + w - 1.0) <= 1e-9):
            raise ValueError("motion.transition: a row of Pi is negative or does not sum to 1")
    both = _check_intervals(omegas) if len(omegas) else 0.0
    after, m = np.empty_like(r), np.zeros(4, np.int64)
    lists = np.empty((4, r.size), np.int64)  # the absent, straight, turning, born; m of each
    for n in range(r.size):  # no branch here, which a processor would have to guess
        before = r[n]
        if not (0 <= before <= 2 and 0.0 <= u[n] < 1.0):
            raise ValueError("motion.transition: a regime r is not 0, 1, 2, or u not in [0, 1)")
        now = int(u[n] >= Pi[before, 0]) + int(u[n] >= Pi[before, 0] + Pi[before, 1])
        k = np.uint64(3 if (before == 0) & (now > 0) & redraw else now)
        after[n], lists[k, np.uint64(m[k])] = now, n
        m[k] += 1
    for n in lists[1, : m[1]]:
        _move(S, n, T, 0.0, 1.0, 0.0, T, a)
    for n in lists[2, : m[2]]:
        if r[n] == 1 and len(omegas):
            second = Pi[1, 0] + Pi[1, 1]
            S[n, 4] = _turn_rate((u[n] - second) / (1.0 - second) * both, omegas)
        h = 0.5 * S[n, 4] * T
        sh, ch = math.sin(h), math.cos(h)
        f = T * sh / h if h != 0.0 else T
        _move(S, n, f * ch, f * sh, 1.0 - 2.0 * sh * sh, 2.0 * sh * ch, T, a)
    return after, lists[3, : m[3]], S
