"""Max-product dynamic programming for track-before-detect: frames, forward pass, back-trace.

Source: Wan, Wang and Wu 2013, eqs. (4), (12), (16).  For each state of frame k only the best way to
reach it is kept:  I_k(x) = z_k(x) + max over predecessors x' of x of  g(x'|x) I_{k-1}(x')

A state is (iv, jv, i, j): two velocity indices and two cell indices.  Index iv is the velocity
``lowest + iv`` in cells per frame; an algorithm without velocity has one index, of velocity 0.  The
predecessors of a state have the velocity v' = v + r and the position i - v' + m: r is the change of
velocity, m the position slack, and the same on the other axis.

position, velocity : weights of m and of r, an odd number, the middle one for 0; a weight of 0
    leaves its slack out.  Conventional: ``ones(2 M + 1)`` and one velocity.  Tonissen:
    ``(0, 1, 1)``, the velocity is kept.  State-weighted: ``(a, 1, a)``.
velocities : (lowest, highest), in cells per frame.
width : cells of -inf around the frames, see :func:`margin`; at least the longest step, which is the
    fastest velocity plus the largest slack.

A maximum over products with positive weights is separable: one axis after the other, and on each
axis first the slack, then the change of velocity.  So 81 predecessors cost 6 + 6 operations.  The
first axis of a plane is a step of Y values in memory, the second a step of one.  A state that
cannot be reached is -inf.  The back-trace takes the argmax again, in the forward pass's order of
operations, so that both agree to the last bit.

A target is a point: all of its signal is in one cell (``point_frames``).
"""

import itertools
import operator
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np

from tbdcore.checks import (
    Array,
    ArrayLike,
    Integer,
    Integers,
    Number,
    Numbers,
    checked,
    fits_memory,
)
from tbdcore.jit import kernel

__all__ = [
    "Transition",
    "box_transition",
    "coupled_transition",
    "forward",
    "margin",
    "path",
    "penalised_transition",
    "point_amplitude",
    "point_frames",
    "weighted_transition",
]


HIGH = 1e50  # largest amplitude: products stay finite


# Point target: all of the signal in one cell
@checked
def point_amplitude(
    snr_db: Annotated[ArrayLike, Numbers(..., low=-1000.0, high=1000.0)],
    sigma: Annotated[float, Number(0.0, HIGH)] = 1.0,
) -> Array:
    """Amplitude A of a point target of SNR 10 log10(A**2 / sigma**2) dB; sigma: of the noise."""
    return sigma * 10.0 ** (snr_db / 20.0)


@checked
def point_frames(
    noise: Annotated[ArrayLike, Numbers("K", "n_x", "n_y", single=True)],
    cells: Annotated[ArrayLike, Integers("K", 2)],
    amplitude: Annotated[ArrayLike, Numbers(...)],
) -> Array:
    """Frames z (K, n_x, n_y): noise w, A + w in the target's cell (Wan, Wang and Wu 2013, eq. 1).

    noise : (K, n_x, n_y), not changed; the result has its type
    cells : (K, 2) of int, the target's cell in each frame, **counted from 0**
    amplitude : A, or (K,), in the noise's unit
    """
    K = len(noise)
    shape = noise.shape[1:]
    if amplitude.shape not in ((), (K,)):
        raise ValueError(f"point_frames: amplitude: shape {amplitude.shape}; a number or ({K},)")
    inside = (cells >= 0) & (cells < shape)
    if not inside.all():
        k = int(inside.all(axis=1).argmin())
        raise ValueError(f"point_frames: cells[{k}] is {cells[k].tolist()}, outside {shape}")
    z = noise.copy()
    z[np.arange(K), cells[:, 0], cells[:, 1]] += amplitude
    return z


PIECE = 1920  # bytes of a plane that are treated together: they stay in the first-level cache
Weights = Annotated[ArrayLike, Numbers("2d+1", low=0.0, single=True)]
Three = Annotated[ArrayLike, Numbers(3, low=0.0, single=True)]
Prices = Annotated[ArrayLike, Numbers(3, low=0.0, high=np.inf, single=True)]
Table = Annotated[ArrayLike, Numbers(3, 3, low=0.0, single=True)]
Pair = Annotated[Sequence[int], Integers(2, low=-(2**31), high=2**31)]
Width = Annotated[int, Integer(0, 2**31)]
Block = Annotated[ArrayLike, Numbers("K", "Nx", "Ny", single=True)]
Frames = Annotated[ArrayLike, Numbers("K", "X", "Y", low=None, single=True)]
Values = Annotated[ArrayLike, Numbers("K", "V", "V", "X", "Y", low=None, single=True)]


@checked
def margin(frames: Block, width: Width) -> Array:
    """Frames (K, Nx, Ny), all finite, with ``width`` cells of -inf around."""
    if frames.size == 0:
        raise ValueError(f"margin: frames: shape {frames.shape}; give at least one cell")
    K, Nx, Ny = frames.shape
    fits_memory("dp_tbd.margin: width", K, Nx + 2 * width, Ny + 2 * width)
    framed = np.full((K, Nx + 2 * width, Ny + 2 * width), -np.inf, frames.dtype)
    framed[:, width : width + Nx, width : width + Ny] = frames
    return framed


# Transitions: which states precede a state, and what each way costs
class Transition(NamedTuple):
    """The predecessors of a state on each axis; made by the four functions below.

    weights : (1, 2 d + 1) of the slacks, (2, 3) of slacks and changes, or a table (3, 3) of both
    position, velocity : (n,) and (n, 2 c + 1), the same for the back-trace, NaN for what is left
        out; velocity has a row for each slack
    setting : width, lowest and highest velocity, whether the weights are prices, and the weights
    """

    weights: Array
    position: Array
    velocity: Array
    setting: tuple[float, ...]


def _transition(name, weights, position, velocity, velocities, width, prices=False):
    lowest, highest = velocities.tolist()
    if weights.shape[1] % 2 == 0:
        raise ValueError(f"{name}: position: {weights.shape[1]} slacks; give an odd number")
    if lowest > highest:
        raise ValueError(f"{name}: velocities: {lowest} is above {highest}")
    longest = max(-lowest, highest) + weights.shape[1] // 2
    if longest > width:
        raise ValueError(f"{name}: width: {width} cells, but a step of {longest}; use a wider one")
    setting = (width, lowest, highest, prices, *weights.shape, *weights.ravel().tolist())
    return Transition(weights, position, velocity, setting)


def _middle(name, *weights, left_out=0.0):
    """ValueError if slack 0 or change 0 is left out."""
    for argument, w in zip(("position", "velocity"), weights, strict=False):
        if w.size and w[w.size // 2] == left_out:
            raise ValueError(f"{name}: {argument}: the middle one is {left_out:g}; change it")


@checked
def box_transition(position: Weights, velocities: Pair, width: Width) -> Transition:
    """Wan et al. 2013, eqs. (4), (6), (7): the velocity is kept, each allowed slack counts alike.

    position : (2 d + 1,), positive where a slack is allowed; the allowed slacks are neighbours
    velocities : (lowest, highest), cells per frame
    width : of the margin, at least d + the fastest velocity
    """
    _middle("box_transition", position)
    slacks = np.flatnonzero(position)
    if slacks.size and slacks[-1] - slacks[0] >= slacks.size:
        raise ValueError("box_transition: position: the allowed slacks must be neighbours")
    only = np.where(position > 0, position, np.nan)
    velocity = np.ones((position.size, 1), position.dtype)
    return _transition("box_transition", position[None], only, velocity, velocities, width)


@checked
def weighted_transition(
    position: Three, velocity: Three, velocities: Pair, width: Width
) -> Transition:
    """Wan et al. 2013, eqs. (8), (12), with g = position[m] velocity[r] on each axis.

    position, velocity : (3,) weights of the slacks and changes -1, 0, 1; 0: left out
    velocities, width : as in :func:`box_transition`
    The reading Delta_i = |m| of eq. (10) is position = velocity = (a, 1, a).
    """
    _middle("weighted_transition", position, velocity)
    rows = np.array([position, velocity, velocity, velocity])
    kept = np.where(rows > 0, rows, np.nan)
    return _transition("weighted_transition", rows[:2], kept[0], kept[1:], velocities, width)


@checked
def coupled_transition(table: Table, velocities: Pair, width: Width) -> Transition:
    """Wan et al. 2013, eqs. (8), (12), with g = table[m, r] on each axis.

    table : (3, 3) weights, all positive, position slack first
    velocities, width : as in :func:`box_transition`
    Eq. (10) to the letter, Delta_i = |m - r|, is table[m, r] = a**(|m - r| + |r|).
    """
    if not (table > 0).all():
        raise ValueError("coupled_transition: table: all nine weights must be positive")
    ones = np.ones_like(table[0])
    return _transition("coupled_transition", table, ones, table, velocities, width)


@checked
def penalised_transition(
    position: Prices, velocity: Prices, velocities: Pair, width: Width
) -> Transition:
    """Prices are subtracted instead: I_{k-1} - position[m] - velocity[r] - those of the other axis.

    Not in the paper.  position, velocity : (3,) prices, inf for a slack left out.  A price of
    lambda |m| + lambda |r| is a log-prior of the path, so the maximum is Viterbi's.
    """
    _middle("penalised_transition", position, velocity, left_out=np.inf)
    rows = np.array([position, velocity, velocity, velocity])
    return _transition("penalised_transition", rows[:2], rows[0], rows[1:], velocities, width, True)


def _given(transition):
    if not isinstance(transition, Transition):
        raise ValueError("transition: give what one of the functions *_transition returns")
    return transition


# Specifications
def _table(transition):
    """Both weights in one table (slack, change), NaN where left out; how to apply them."""
    if transition.setting[3]:
        return transition.position[:, None] + transition.velocity, np.subtract
    return transition.position[:, None] * transition.velocity, np.multiply


def forward_spec(z, transition):
    """Specification of :func:`forward`: all predecessors of every state."""
    lowest, highest = transition.setting[1:3]
    table, combine = _table(transition)
    if len(transition.weights) == 1:
        table = np.where(table > 0, 1.0, np.nan)
    V = highest - lowest + 1
    dm, dr = np.array(table.shape) // 2
    slacks = list(np.ndindex(table.shape))
    I = np.full((len(z), V, V, *z.shape[1:]), -np.inf, z.dtype)
    I[0] = z[0]
    for k in range(1, len(z)):
        for iv, jv, (m, r), (n, s) in itertools.product(range(V), range(V), slacks, slacks):
            u, w = iv + r - dr, jv + s - dr
            if 0 <= u < V and 0 <= w < V:
                moved = np.roll(I[k - 1, u, w], (lowest + u - m + dm, lowest + w - n + dm), (0, 1))
                value = combine(combine(moved, table[n, s]), table[m, r])
                np.fmax(I[k, iv, jv], value, out=I[k, iv, jv])  # NaN is never the larger one
        I[k] += z[k]
    return I


def _candidates(previous, state, table, lowest, combine):
    """Values and states of all predecessors of one state inside the map."""
    n, s, m, r = np.indices(table.shape * 2).reshape(4, -1)
    dm, dr = np.array(table.shape) // 2
    u, w = state[0] + r - dr, state[1] + s - dr
    x, y = state[2] + m - dm - lowest - u, state[3] + n - dm - lowest - w
    states = np.stack((u, w, x, y), axis=1)
    keep = ((states >= 0) & (states < previous.shape)).all(axis=1)
    states = states[keep]
    values = combine(combine(previous[*states.T], table[n, s][keep]), table[m, r][keep])
    return np.nan_to_num(values, nan=-np.inf, posinf=np.inf, neginf=-np.inf), states


def path_spec(I, state, transition):
    """Specification of :func:`path`: argmax over all predecessors, frame by frame."""
    table, combine = _table(transition)
    lowest = transition.setting[1]
    path = [state]
    for previous in I[-2::-1]:
        values, states = _candidates(previous, state, table, lowest, combine)
        reached = state[0] >= 0 and values.max(initial=-np.inf) > -np.inf
        state = tuple(states[values.argmax()].tolist()) if reached else (-1, -1, -1, -1)
        path.append(state)
    return np.array(path[::-1])


# Forward pass
@checked
def forward(z: Frames, transition: Transition) -> Array:
    """Value maps I (K, V, V, X, Y) of Wan et al. 2013, eqs. (4), (12), (14), (16).

    z : (K, X, Y) frames in their margin; a cell of -inf cannot be passed, NaN is a ValueError
    X and Y count the margin.
    """
    width, lowest, highest, prices = _given(transition).setting[:4]
    (K, X, Y), V = z.shape, highest - lowest + 1
    if K == 0 or min(X, Y) <= 2 * width:
        raise ValueError(f"forward: z: shape {z.shape} leaves no cell in a margin of {width}")
    if not _is_framed(z, width):
        raise ValueError("forward: z: NaN, inf, or no margin of -inf; use margin(frames, width)")
    weights = transition.weights.astype(z.dtype, copy=False)
    fits_memory("dp_tbd.forward: z, transition", K, V, V, X, Y)
    I = np.empty((K, V, V, X, Y), z.dtype)
    I[0] = z[0]  # eq. (14)
    I[..., :width, :] = I[..., X - width :, :] = -np.inf
    if len(weights) == 1:
        _box_forward(I, z, width, lowest, weights[0])
    else:
        _changing_forward(I, z, width, lowest, weights, prices)
    return I


@kernel
def _is_framed(z, width):
    """Whether frames have -inf in their margin, and neither NaN nor inf anywhere."""
    K, X, Y = z.shape
    wrong = 0
    for k in range(K):
        for i in range(X):
            row = z[k, i]
            edge = width if width <= i < X - width else Y  # cells of the margin from either end
            for j in range(Y):
                wrong += not row[j] < np.inf
            for j in range(edge):
                wrong += (row[j] != -np.inf) | (row[Y - 1 - j] != -np.inf)
    return wrong == 0


@kernel
def _combined(value, weight, prices):
    """A value after a departure: times its weight, or less its price."""
    return value - weight if prices else value * weight


# The velocity is kept
@kernel
def _box_forward(values, z, width, lowest, position):
    """The loop of :func:`forward` for a velocity that is kept.

    It is a maximum filter: on each axis the predecessors of a state in cell i with velocity v are
    the ``count`` cells from i - v + slack on, where ``slack`` is the lowest allowed one.
    Margin columns as in :func:`_changing_forward`.
    """
    allowed = np.flatnonzero(position)
    slack = allowed[0] - position.size // 2
    count = allowed.size
    K, V, _, X, Y = values.shape
    maps = values.reshape(values.size)
    frames = z.reshape(z.size)
    none = frames[:0]
    best = np.full(X * Y, -np.inf, values.dtype)  # of the second axis; margin rows stay -inf
    work = np.empty(2 * X * Y, values.dtype)
    row, n = width * Y, (X - 2 * width) * Y  # first of the cells that are in no row of the margin
    for iv, jv in np.ndindex(V, V):
        back_i = lowest + iv - slack
        back_j = lowest + jv - slack
        for k in range(1, K):
            old = (((k - 1) * V + iv) * V + jv) * X * Y + row
            new = old + V * V * X * Y
            _window(best, row, maps, old - back_j, 1, count, n, none, 0, work)
            at = row - back_i * Y
            _window(maps, new, best, at, Y, count, n, frames, k * X * Y + row, work)


@kernel
def _window(target, to, source, at, step, count, n, frames, origin, work):
    """target[to + x] = frame[x] + max of source[at + x + c step], c = 0 .. count - 1; x < n.

    A window is the union of three windows of a third of its size, which may overlap: the maximum of
    seven values takes two passes.  No frame: an empty one.
    """
    size = 1  # source[x] is the maximum of so many values
    length = n + (count - 1) * step
    middle = work.size // 2
    free = 0  # start of the part of ``work`` that can be written
    while 3 * size < count:
        length -= 2 * size * step
        ends = at, at + size * step, at + 2 * size * step
        _largest(work, free, source, ends, length, frames[:0], 0)
        source = work
        at = free
        free = middle - free
        size *= 3
    second = at + (count - size + 1) // 2 * step
    last = at + (count - size) * step
    if count < 3:
        _largest(target, to, source, (at, last), n, frames, origin)
    else:
        _largest(target, to, source, (at, second, last), n, frames, origin)


@kernel
def _largest(target, to, source, at, n, frames, origin):
    """target[to + x] = frame[x] + max of source[at[c] + x], two or three c; x < n."""
    t = np.uint64(to)  # unsigned: Numba tests a signed index, which takes as long as the maximum
    i = np.uint64(at[0])
    j = np.uint64(at[1])
    k = np.uint64(at[-1])
    o = np.uint64(origin)
    plus = frames.size > 0
    for x in range(np.uint64(n)):
        best = source[i + x] if source[i + x] > source[j + x] else source[j + x]
        if len(at) == 3:
            best = best if best > source[k + x] else source[k + x]
        target[t + x] = best + frames[o + x] if plus else best


# The velocity changes by -1, 0 or 1
class _Axis(NamedTuple):
    """How many values lie between neighbouring velocities and cells; lowest velocity."""

    velocity: int
    cell: int
    lowest: int


@kernel
def _changing_forward(values, z, width, lowest, weights, prices):
    """The loop of :func:`forward` for a velocity that changes: in each frame, axis by axis.

    State, slacks m, n and changes r, s are as at the head of this module.  With v and w the
    velocities of the predecessor, of indices iv + r and jv + s, and g the weight of a slack and a
    change:
        between[iv, jv, i, j] = max over n, s of g[n, s] I_{k-1}[iv, jv + s, i, j - w + n]
        I_k[iv, jv, i, j] = z_k[i, j] + max over m, r of g[m, r] between[iv + r, jv, i - v + m, j]
    Both lines are :func:`_one_axis`: along an axis neighbouring velocities and cells are _Axis
    values apart in memory.  The value of (iv, jv, i, j) is at ((iv V + jv) X + i) Y + j.
    Whole rows are computed.  In their margin columns a read may leave the row; what it finds has no
    effect, because the frame adds -inf there.
    """
    K, V, _, X, Y = values.shape
    size = X * Y
    maps = values.reshape(values.size)
    frames = z.reshape(K, size)
    between = np.full(V * V * size, -np.inf, values.dtype)  # values after the second axis
    best = np.full((V + 2) * (PIECE // values.itemsize), -np.inf, values.dtype)
    cells = width * Y, (X - 2 * width) * Y  # those that are in no row of the margin
    for k in range(1, K):
        none = frames[k, :0]
        old = (k - 1) * V * V * size
        new = k * V * V * size
        axis = _Axis(size, 1, lowest)
        for iv in range(V):
            planes = iv * V * size
            _one_axis(between, planes, maps, old + planes, axis, weights, prices, cells, none, best)
        axis = _Axis(V * size, Y, lowest)
        for jv in range(V):
            planes = jv * size
            _one_axis(
                maps, new + planes, between, planes, axis, weights, prices, cells, frames[k], best
            )


@kernel
def _one_axis(new, to, old, at, axis, weights, prices, cells, frame, best):
    """The best predecessor on one axis, for all velocities of it and a range of cells of a plane.

    to, at : where the planes of the lowest velocity begin in ``new`` and ``old``, flat arrays
    cells : first cell and number of cells; frame : what is added to them, or empty
    Weights of slack and change that are separate take two steps.  The first writes the best slack
    of velocity v to row v + 1 of ``best``, whose first and last rows are -inf; the second takes the
    best of three rows.  Cells are treated in pieces: ``best`` stays in the first-level cache.
    """
    start, n = cells
    piece = PIECE // best.itemsize
    V = best.size // piece - 2  # numbers of velocities: best has V + 2 rows
    none = frame[:0]
    for x in range(start, start + n, piece):
        shape = V, min(piece, start + n - x)
        target = to + x, axis.velocity
        source = at + x - (axis.lowest + 1) * axis.cell, axis.velocity - axis.cell, axis.cell
        if len(weights) == 3:
            _coupled(new, target, old, source, shape, weights, frame, x)
        else:
            rows = piece, piece  # v + 1 for velocity v
            _separate(best, rows, old, source, shape, weights[0], prices, none, 0)
            slacks = 0, piece, piece  # rows v, v + 1 and v + 2, for the changes -1, 0, 1
            _separate(new, target, best, slacks, shape, weights[1], prices, frame, x)


@kernel
def _separate(target, to, source, at, shape, weights, prices, frame, origin):
    """target[v, x] = max of source[v, x + c step] weights[c], c = 0, 1, 2, plus frame[x] if any.

    Prices are subtracted instead.  A weight of 0 leaves its value out: 0 times -inf would be NaN,
    so the middle one stands in.
    to : offset of [0, 0] in the flat target, and how far the next v is; at : the same of the
    source, then the step; shape : numbers of v and x; origin : offset of frame[0].
    """
    first, apart, step = at
    before, after = -step, step
    a, b, c = weights[0], weights[1], weights[2]
    if a == 0 and not prices:
        before, a = 0, b
    if c == 0 and not prices:
        after, c = 0, b
    o = np.uint64(origin)  # unsigned: Numba tests a signed index, which takes as long as the rest
    plus = frame.size > 0
    for v in range(shape[0]):
        t = np.uint64(to[0] + v * to[1])
        j = first + v * apart + step
        i, j, k = np.uint64(j + before), np.uint64(j), np.uint64(j + after)
        for x in range(np.uint64(shape[1])):
            p = _combined(source[i + x], a, prices)
            q = _combined(source[j + x], b, prices)
            r = _combined(source[k + x], c, prices)
            p = p if p > q else q
            p = p if p > r else r
            target[t + x] = p + frame[o + x] if plus else p


@kernel
def _coupled(target, to, source, at, shape, table, frame, origin):
    """As _separate: max of source[v + r - 1, x + c step] table[c, r], r and c from 0 to 2.

    All weights are positive.  At either end of the velocities r = 1 is taken twice.
    """
    first, apart, step = at
    V, n = shape
    o, s = np.uint64(origin), np.uint64(step)
    plus = frame.size > 0
    for v in range(V):
        t = np.uint64(to[0] + v * to[1])
        low = max(v - 1, 0)
        high = min(v + 1, V - 1)
        i, j = np.uint64(first + low * apart), np.uint64(first + v * apart)
        k = np.uint64(first + high * apart)
        a = table[0, low - v + 1], table[1, low - v + 1], table[2, low - v + 1]
        b = table[0, 1], table[1, 1], table[2, 1]
        c = table[0, high - v + 1], table[1, high - v + 1], table[2, high - v + 1]
        for x in range(np.uint64(n)):
            p = _best_slack(source, i + x, s, a)
            q = _best_slack(source, j + x, s, b)
            r = _best_slack(source, k + x, s, c)
            p = p if p > q else q
            p = p if p > r else r
            target[t + x] = p + frame[o + x] if plus else p


@kernel
def _best_slack(source, at, step, weights):
    """The largest of three values, ``step`` apart, each times its weight."""
    p = _combined(source[at], weights[0], False)
    q = _combined(source[at + step], weights[1], False)
    r = _combined(source[at + step + step], weights[2], False)
    p = p if p > q else q
    return p if p > r else r


# Back-trace
@kernel
def _predecessor(previous, state, position, table, lowest, prices):
    """Predecessor of largest value; the first one wins a tie, and NaN never wins.

    table : weights of the velocity changes, one row for each position slack.
    """
    V, _, X, Y = previous.shape
    d = position.size // 2
    c = table.shape[1] // 2
    best = -np.inf
    found = (-1, -1, -1, -1)
    for n in range(position.size):
        for w in range(max(state[1] - c, 0), min(state[1] + c + 1, V)):
            y = state[3] + n - d - lowest - w
            if not 0 <= y < Y:
                continue
            g = table[n, w - state[1] + c]
            for m in range(position.size):
                for u in range(max(state[0] - c, 0), min(state[0] + c + 1, V)):
                    x = state[2] + m - d - lowest - u
                    if 0 <= x < X:
                        value = _combined(previous[u, w, x, y], position[n], prices)
                        value = _combined(value, g, prices)
                        value = _combined(value, position[m], prices)
                        value = _combined(value, table[m, u - state[0] + c], prices)
                        if value > best:
                            best = value
                            found = (u, w, x, y)
    return found


@kernel
def _path(I, state, position, table, lowest, prices):
    """The loop of :func:`path`."""
    path = np.full((len(I), 4), -1)
    for k in range(len(I) - 1, -1, -1):
        for axis in range(4):
            path[k, axis] = state[axis]
        if k > 0 and state[0] >= 0:
            state = _predecessor(I[k - 1], state, position, table, lowest, prices)
    return path


@checked
def path(I: Values, state: Sequence[int], transition: Transition) -> Array:
    """Wan et al. 2013, eqs. (13), (19): the best path that ends in ``state``.

    I : (K, V, V, X, Y) value maps of :func:`forward`; NaN never wins
    state : (iv, jv, i, j) in frame K, i and j counted with the margin

    Returns states of the same form, (K, 4) of int; four times -1 from where no predecessor can be
    reached.
    """
    K, V, _, X, Y = I.shape
    try:
        iv, jv, i, j = map(operator.index, state)
        valid = K > 0 and 0 <= iv < V and 0 <= jv < V and 0 <= i < X and 0 <= j < Y
    except (TypeError, ValueError):  # no integers, or not four of them
        valid = False
    if not valid:
        raise ValueError(f"path: state: give four indices (iv, jv, i, j) into maps {I.shape}")
    _, lowest, _, prices = _given(transition).setting[:4]
    position = transition.position.astype(I.dtype, copy=False)
    velocity = transition.velocity.astype(I.dtype, copy=False)
    return _path(I, (iv, jv, i, j), position, velocity, lowest, prices)
