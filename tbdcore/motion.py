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
"""

import math
from typing import Annotated

import numpy as np

from tbdcore.checks import Array, Number, checked

__all__ = ["coordinated_turn", "cv", "step_acceleration", "white_acceleration"]

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
