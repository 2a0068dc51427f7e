"""Max-product dynamic programming for track-before-detect: forward pass and back-trace.

For each state of frame k only the best way to reach it is kept (Wan, Wang and Wu 2013, eqs. 4, 12,
16):  I_k(x) = z_k(x) + max over predecessors x' of x of  g(x'|x) I_{k-1}(x')

A state is (iv, jv, i, j): two velocity indices and two cell indices.  Index iv is the velocity
``lowest_velocity + iv`` in cells per frame; an algorithm without velocity has one index, of
velocity 0.  The predecessors of a state have the velocity v' = v + r and the position i - v' + m:
r is the change of velocity, m the position slack, and the same on the other axis.

``position``, ``velocity`` are weights of the slacks: an odd number, the middle one for slack 0, and
0 for a slack left out.  Conventional: ``ones(2M+1)``, one velocity.  Tonissen: ``(0, 1, 1)``, the
velocity is kept.  State-weighted: ``(a, 1, a)``.

A maximum over products with positive weights is separable: 81 predecessors cost 6 + 6 operations.
A state that cannot be reached is -inf, and so is the margin of frames and value maps (``margin``),
at least as wide as the longest step.  Maps have shape (V, V, X, Y) with X = Nx + 2 margins: a step
along an axis is a shift of one contiguous array.  The maps of all frames are kept: for frames that
differ in a few cells only the rows that these can reach are computed again.  The back-trace takes
the argmax again, in the forward pass's order of operations, so that both agree to the last bit.
Frames, maps and weights are contiguous arrays of one type, float32 or float64.
"""

import functools
import itertools
import operator

import numpy as np
from numba.core.errors import NumbaError

from tbdcore import checks
from tbdcore.jit import kernel

TINY = np.finfo(np.float32).smallest_subnormal
PIECE = 1920  # bytes of a plane that are treated together


def margin(frames, width):
    """Frames (K, Nx, Ny), all finite, with ``width`` cells of -inf around."""
    frames = checks.reals("frames", frames, "K", "Nx", "Ny")
    K, Nx, Ny, width = *frames.shape, checks.integer("width", width, 0)
    if 0 in frames.shape:
        raise ValueError(f"frames: shape {frames.shape}; stack them to (K, Nx, Ny), none empty")
    framed = np.empty((K, Nx + 2 * width, Ny + 2 * width), frames.dtype)
    if _surround(np.ascontiguousarray(frames), width, framed):
        at = np.argwhere(~np.isfinite(frames))[0].tolist()
        raise ValueError(f"frames{at} is {frames[tuple(at)]}; replace it")
    return framed


@kernel
def _surround(frames, width, framed):
    """Copy frames into ``framed``; return how many cells are not finite: x - x is then NaN."""
    (K, Nx, Ny), (_, X, Y), flat = frames.shape, framed.shape, framed.reshape(framed.size)
    lost = end = 0
    for k in range(K):
        for i in range(Nx):
            start = (k * X + width + i) * Y + width
            flat[end:start] = -np.inf  # the margin between one row of cells and the next
            cells, row, end = frames[k, i], flat[start:], start + Ny
            for j in range(Ny):
                row[j] = cells[j]
                lost += cells[j] - cells[j] != 0
    flat[end:] = -np.inf
    return lost


def _one_type(compiled):
    """The compiled function; arrays of several types or another layout are a ValueError."""

    @functools.wraps(compiled, updated=())
    def call(first, *args):
        try:
            valid = first.dtype.char in "fd"
            for a in args:
                valid &= a.dtype is first.dtype if type(a) is np.ndarray else type(a) is not list
            if valid:
                return compiled(first, *args)
        except (AttributeError, NumbaError, IndexError, OverflowError):
            pass
        words = "give contiguous arrays as documented, all float64 or all float32, whole numbers"
        raise ValueError(f"{call.__name__}: {words}") from None

    call.py_func = compiled.py_func
    return call


@kernel
def _check_weights(weights, shape, least):
    """Raise ValueError unless the odd number of weights is in [least, inf), the middle one > 0."""
    n = weights.size
    if weights.shape != shape or n % 2 == 0 or not weights.flat[n // 2] > 0:
        raise ValueError("weights: give 2 d + 1, (3,) or (3, 3) weights, the middle one positive")
    for weight in weights.flat:
        if not least <= weight < np.inf:
            raise ValueError("weights: must be finite and >= 0; use 0 for a slack left out")


@kernel
def _check_prices(position, velocity):
    """Raise ValueError unless there are three prices each, the middle one finite."""
    for price in (position, velocity):
        if price.size != 3 or not (0 <= price[1] < np.inf and price[0] >= 0 and price[2] >= 0):
            raise ValueError("position, velocity: give three prices each >= 0, the middle finite")


@kernel
def _begin(z, I, slack, lowest, reach, held):
    """The first map, and the rows (K, 2), first and end, in which frames differ from ``held``.

    ValueError unless the frames fit the maps and no step leaves the margin.
    """
    (K, V, W, X, Y), least = I.shape, min(z.shape[1], z.shape[2])
    if not z.shape == held.shape == (K, X, Y) or V != W or I.size == 0:
        raise ValueError("I: maps must be (K, V, V, X, Y) for frames (K, X, Y) in their margin")
    if not (slack <= reach < (least + 1) // 2 and slack - reach <= lowest <= reach - slack - V + 1):
        raise ValueError("reach: a step leaves the margin; use margin(frames, longest step)")
    maps, frames, size = I.reshape(I.size), z.reshape(z.size), X * Y
    rows = np.empty((K, 2), np.int64)
    for k in range(K):
        rows[k, 0], rows[k, 1] = I.size, -I.size  # none
        for i in range(X):
            new, old, n = z[k, i], held[k, i], 0
            for j in range(Y):
                n += new[j] != old[j]
            if n > 0:
                rows[k, 0], rows[k, 1] = min(rows[k, 0], i), i + 1
        if rows[k, 0] == 0:
            _close(maps, k * V * V * size, V * V, size, reach * Y)
    first, n = _inside(rows[0, 0], rows[0, 1], reach, X)
    for start in range(first * Y, V * V * size, size):  # eq. (14): a cell's value, always
        _top(maps, start, frames, (first * Y, first * Y), n * Y, frames[:0], first)
    return rows


@kernel
def _inside(first, end, reach, X):
    """The rows of a range that are not in the margin: the first one, and how many."""
    first = min(max(first, reach), X - reach)
    return first, max(min(end, X - reach) - first, 0)


@kernel
def _check_state(I, state, lowest):
    """Raise ValueError unless state (iv, jv, i, j) is one of the maps I (K, V, V, X, Y)."""
    if I.size == 0 or I.shape[1] != I.shape[2] or abs(lowest) > I.size:
        raise ValueError("I: maps must be (K, V, V, X, Y), K at least 1")
    for axis in range(4):
        if len(state) != 4 or not 0 <= state[axis] < I.shape[axis + 1]:
            raise ValueError("state: give four indices (iv, jv, i, j) into the maps")


# Loops over planes.  Arrays are flat and offsets unsigned: Numba counts references for each slice
# and tests each signed index, which takes as long as the planes.  It compiles a literal apart.


@kernel
def _close(maps, start, planes, size, width):
    """Set to -inf the first and the last ``width`` values of planes of ``size`` values."""
    for plane in range(start, start + planes * size, size):
        for edge in (np.uint64(plane), np.uint64(plane + size - width)):
            for x in range(np.uint64(width)):
                maps[edge + x] = -np.inf


@kernel
def _top(target, to, source, at, n, term, origin):
    """target[to + x] = max of source[at[c] + x], two or three c, plus term[origin + x] if any."""
    t, o, plus = np.uint64(to), np.uint64(origin), term.size > 0
    i, j, k = np.uint64(at[0]), np.uint64(at[1]), np.uint64(at[-1])
    for x in range(np.uint64(n)):
        best = source[i + x] if source[i + x] > source[j + x] else source[j + x]
        if len(at) == 3:
            best = best if best > source[k + x] else source[k + x]
        target[t + x] = best + term[o + x] if plus else best


@kernel
def _window(target, to, source, at, step, count, n, term, origin, work):
    """target[to + x] = max of source[at + x + c step], c = 0..count-1; term as in :func:`_top`.

    Three maxima over ``width`` neighbours are one over up to 3 width: seven take two passes.
    """
    far, width, half, none = (count - 1) * step, step, work.size // 2, term[:0]
    if count < 3:
        _top(target, to, source, (at, at + far), n, term, origin)
        return
    while 3 * width <= far:
        ends, wider = (at, at + width, at + 2 * width), n + far + step - 3 * width
        _top(work, half, source, ends, wider, none, origin)
        source, at, half, width = work, half, work.size // 2 - half, 3 * width
    far += step - width
    _top(target, to, source, (at, at + (far // step + 1) // 2 * step, at + far), n, term, origin)


def _family(combine):
    """Decorator of a kernel for mul or sub.  Numba's cache links by name: each needs its own."""

    def compiled(function):
        function.__qualname__ += "_" + combine.__name__
        return kernel(function)

    return compiled


def _best(combine, left_out):
    """The loop of a family: a value is combined with a weight by mul, with a price by sub."""

    @_family(combine)
    def best(target, to, source, at, shape, weight, term, origin):
        """target[v, x] = max of source[v, x + c step] with weight[c], plus term[x] if any.

        c = 0, 1, 2, but for those whose weight leaves them out; v, x run through ``shape``.
        to, at : offset of [0, 0] and of one v; then step.  origin : offset of term[0].
        """
        (start, pitch), (first, apart, step), (V, n) = to, at, shape
        o, plus, a, b, c = np.uint64(origin), term.size > 0, weight[0], weight[1], weight[2]
        before, after = -step, step
        if a == left_out:
            before, a = 0, b
        if c == left_out:
            after, c = 0, b
        for v in range(V):
            t, j = np.uint64(start + v * pitch), first + v * apart + step
            i, j, k = np.uint64(j + before), np.uint64(j), np.uint64(j + after)
            for x in range(np.uint64(n)):
                p, q = combine(source[i + x], a), combine(source[j + x], b)
                r = combine(source[k + x], c)
                p = p if p > q else q
                p = p if p > r else r
                target[t + x] = p + term[o + x] if plus else p

    return best


# Specifications


def _dense(z, table, lowest_velocity, I, combine):
    """All value maps from all predecessors; table (position slack, velocity change), NaN: none."""
    I[0], V, slacks = z[0], I.shape[1], list(np.ndindex(table.shape))
    dm, dr = np.array(table.shape) // 2
    for k in range(1, len(z)):
        I[k] = -np.inf
        for iv, jv, (m, r), (n, s) in itertools.product(range(V), range(V), slacks, slacks):
            u, w = iv + r - dr, jv + s - dr
            if 0 <= u < V and 0 <= w < V:
                step = lowest_velocity + u - m + dm, lowest_velocity + w - n + dm
                moved = np.roll(I[k - 1, u, w], step, axis=(0, 1))
                value = combine(combine(moved, table[n, s]), table[m, r])
                np.fmax(I[k, iv, jv], value, out=I[k, iv, jv])  # NaN is never the larger one
        I[k] += z[k]
    return I


def _candidates(previous, state, table, lowest_velocity, combine):
    """Values and states of all predecessors of one state inside the map."""
    n, s, m, r = np.indices(table.shape * 2).reshape(4, -1)
    dm, dr = np.array(table.shape) // 2
    u, w = state[0] + r - dr, state[1] + s - dr
    x, y = state[2] + m - dm - lowest_velocity - u, state[3] + n - dm - lowest_velocity - w
    states = np.stack((u, w, x, y), axis=1)
    keep = ((states >= 0) & (states < previous.shape)).all(axis=1)
    n, s, m, r, states = n[keep], s[keep], m[keep], r[keep], states[keep]
    values = combine(combine(previous[*states.T], table[n, s]), table[m, r])
    return np.nan_to_num(values, nan=-np.inf, posinf=np.inf, neginf=-np.inf), states


def _path_of(I, state, table, lowest_velocity, combine):
    """Best path to a state; four times -1 from where no predecessor can be reached."""
    path = [state]
    for previous in I[-2::-1]:
        values, states = _candidates(previous, state, table, lowest_velocity, combine)
        reached = state[0] >= 0 and values.max(initial=-np.inf) > -np.inf
        state = tuple(states[values.argmax()].tolist()) if reached else (-1, -1, -1, -1)
        path.append(state)
    return np.array(path[::-1])


# Forward pass


def box_forward_spec(z, position, lowest_velocity, reach, I, held):
    """Specification of :func:`box_forward`: all pairs of slacks."""
    return coupled_forward_spec(z, position[:, None] > 0, lowest_velocity, reach, I, held)


@_one_type
@kernel
def box_forward(z, position, lowest_velocity, reach, I, held):
    """Eqs. (4), (6), (7), (14): the velocity is kept, all allowed slacks count the same.

    z : (K, X, Y) frames in their margin; I : (K, V, V, X, Y) value maps, written and returned.
    position : (2 d + 1,), positive where a slack is allowed; the allowed slacks are neighbours.
    lowest_velocity : of index 0, cells/frame; reach : width of the margin, at least d + the
        fastest velocity.
    held : (K, X, Y) frames whose maps, by the same arguments, I holds on entry, NaN if it holds
        none: rows that no cell in which z differs can reach keep their values.
    """
    _check_weights(position, (position.size,), 0)
    differ = _begin(z, I, position.size // 2, lowest_velocity, reach, held)
    (_, V, _, X, Y), along, allowed = I.shape, np.int64(1), np.flatnonzero(position)
    shift, count = position.size // 2 - allowed[0] + lowest_velocity, allowed.size
    if allowed[-1] - allowed[0] >= count:
        raise ValueError("position: the allowed slacks must be neighbours; fill the gap")
    maps, frames, none, size = I.reshape(I.size), z.reshape(z.size), z[0, 0, :0], X * Y
    rows, work = np.full(size, -np.inf).astype(I.dtype), np.empty(2 * size, I.dtype)
    for iv, jv in np.ndindex(V, V):
        (first, end), plane, down = differ[0], (iv * V + jv) * size, shift + iv
        for k in range(1, len(z)):
            first, end = min(first + down - count + 1, differ[k, 0]), max(end + down, differ[k, 1])
            top, n = _inside(first - down, end - down + count - 1, reach, X)
            old, origin = plane + top * Y - shift - jv, k * size
            _window(rows, top * Y, maps, old, along, count, n * Y, none, origin, work)
            plane, (top, n) = plane + V * V * size, _inside(first, end, reach, X)
            to, old, origin = plane + top * Y, (top - down) * Y, origin + top * Y
            _window(maps, to, rows, old, Y, count, n * Y, frames, origin, work)
    return I


@kernel
def _slack(source, at, step, weights):
    """The largest of three values, ``step`` apart, each times its weight."""
    p, q, r = source[at], source[at + step], source[at + step + step]
    p, q, r = p * weights[0], q * weights[1], r * weights[2]
    p = p if p > q else q
    return p if p > r else r


@kernel
def _coupled(target, to, source, at, shape, table, term, origin):
    """As `best`: max of source[v + r - 1, x + c step] table[c, r], r and c from 0 to 2."""
    (start, pitch), (first, apart, step), (V, n) = to, at, shape
    o, s, plus = np.uint64(origin), np.uint64(step), term.size > 0
    for v in range(V):
        low, high, t = max(v - 1, 0), min(v + 1, V - 1), np.uint64(start + v * pitch)
        a, b, c = table[:, low - v + 1], table[:, 1], table[:, high - v + 1]
        before, same, after = (a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2])
        i, j = np.uint64(first + low * apart), np.uint64(first + v * apart)
        k = np.uint64(first + high * apart)
        for x in range(np.uint64(n)):
            p, q = _slack(source, i + x, s, before), _slack(source, j + x, s, same)
            p, q = p if p > q else q, _slack(source, k + x, s, after)
            p = p if p > q else q
            target[t + x] = p + term[o + x] if plus else p


def _extended(combine, left_out):
    """The passes of a family: on each axis the best slack of each velocity, then its best change.

    They run through pieces of a plane, whose best slacks stay in the first-level cache.
    """
    best = _best(combine, left_out)

    @_family(combine)
    def forward(z, position, velocity, lowest, reach, I, differ):
        (_, V, _, X, Y), none, maps, size = I.shape, z[0, 0, :0], I.reshape(I.size), z[0].size
        (low, high), piece = differ[0], PIECE // I.itemsize
        rows, half = np.empty((V + 3) * piece, I.dtype), np.empty(V * V * size, I.dtype)
        rows[:], half[:] = -np.inf, -np.inf  # velocity v in row v + 2
        for k in range(1, len(z)):
            low, high = min(low + lowest - 1, differ[k, 0]), max(high + lowest + V, differ[k, 1])
            new, frame = k * V * V * size, z[k].reshape(size)
            across = maps, new - V * V * size, half, 0, V * size, size, 1, none, 1
            down = half, 0, maps, new, size, V * size, Y, frame, 0
            for old, begin, out, end, outer, inner, step, term, along in (across, down):
                for first in range(V):
                    back = along * (lowest + first)
                    top, n = _inside(low - back - along, high - back + along, reach, X)
                    for x in range(top * Y, (top + n) * Y, piece):
                        here, shape = x + first * outer, (V, min(piece, (top + n) * Y - x))
                        at = begin + here - (lowest + 1) * step, inner - step, step
                        to = end + here, inner
                        if position.ndim == 2:
                            _coupled(out, to, old, at, shape, position, term, x)
                        else:
                            best(rows, (2 * piece, piece), old, at, shape, position, none, x)
                            best(out, to, rows, (piece, piece, piece), shape, velocity, term, x)
        return I

    return forward


_weighted, _penalised = _extended(operator.mul, 0), _extended(operator.sub, np.inf)


def weighted_forward_spec(z, position, velocity, lowest_velocity, reach, I, held):
    """Specification of :func:`weighted_forward`: all 81 predecessors of every state."""
    return coupled_forward_spec(z, np.outer(position, velocity), lowest_velocity, reach, I, held)


@_one_type
@kernel
def weighted_forward(z, position, velocity, lowest_velocity, reach, I, held):
    """Eqs. (8), (12) with g a product: position[m] velocity[r] on each axis, slacks -1, 0, 1.

    Arrays as in :func:`box_forward`; position, velocity : (3,) of the frames' type, 0 for a slack
    left out.  The reading Delta_i = |m| of eq. (10) is position = velocity = (a, 1, a).
    """
    _check_weights(position, (3,), 0)
    _check_weights(velocity, (3,), 0)
    differ = _begin(z, I, position.size // 2, lowest_velocity, reach, held)
    return _weighted(z, position, velocity, lowest_velocity, reach, I, differ)


def penalised_forward_spec(z, position, velocity, lowest_velocity, reach, I, held):
    """Specification of :func:`penalised_forward`: all 81 predecessors of every state."""
    return _dense(z, np.add.outer(position, velocity), lowest_velocity, I, np.subtract)


@_one_type
@kernel
def penalised_forward(z, position, velocity, lowest_velocity, reach, I, held):
    """I_k = z_k + max (I_{k-1} - position[m] - velocity[r] - the same on the other axis).

    Not in the paper.  position, velocity : (3,) prices, inf for a slack left out.  A price of
    lambda |m| + lambda |r| is a log-prior of the path, so the maximum is Viterbi's.
    """
    _check_prices(position, velocity)
    differ = _begin(z, I, position.size // 2, lowest_velocity, reach, held)
    return _penalised(z, position, velocity, lowest_velocity, reach, I, differ)


def coupled_forward_spec(z, table, lowest_velocity, reach, I, held):
    """Specification of :func:`coupled_forward`: all 81 predecessors of every state."""
    return _dense(z, np.where(table > 0, table, np.nan), lowest_velocity, I, np.multiply)


@_one_type
@kernel
def coupled_forward(z, table, lowest_velocity, reach, I, held):
    """Eqs. (8), (12) with g = table[m, r] table[n, s]: slack and velocity change weighted together.

    Arrays as in :func:`box_forward`; table : (3, 3) of the frames' type, position slack first, all
    positive.  Eq. (10) to the letter, Delta_i = |m - r|, is table[m, r] = a**(|m - r| + |r|).
    """
    _check_weights(table, (3, 3), TINY)
    differ = _begin(z, I, len(table) // 2, lowest_velocity, reach, held)
    return _weighted(z, table, table[0], lowest_velocity, reach, I, differ)


# Back-trace


def _trace(combine):
    """The back-trace of a family: a value is combined with a weight by mul, with a price by sub."""

    @_family(combine)
    def predecessor(previous, state, position, table, lowest):
        """Predecessor of largest value; the first one wins a tie, and NaN never wins.

        table : weights of the velocity changes, one row for each position slack or one for all.
        """
        (V, _, X, Y), d, c = previous.shape, position.size // 2, table.shape[1] // 2
        each = min(len(table) - 1, 1)  # 0: one row for all slacks
        best, found = -np.inf, (-1, -1, -1, -1)
        for n in range(position.size):
            for w in range(max(state[1] - c, 0), min(state[1] + c + 1, V)):
                g, y = table[n * each, w - state[1] + c], state[3] + n - d - lowest - w
                if not 0 <= y < Y:
                    continue
                for m in range(position.size):
                    for u in range(max(state[0] - c, 0), min(state[0] + c + 1, V)):
                        h, x = table[m * each, u - state[0] + c], state[2] + m - d - lowest - u
                        if 0 <= x < X:
                            value = combine(combine(previous[u, w, x, y], position[n]), g)
                            value = combine(combine(value, position[m]), h)
                            if value > best:
                                best, found = value, (u, w, x, y)
        return found

    @_family(combine)
    def path(I, state, position, table, lowest):
        _check_state(I, state, lowest)
        path = np.full((len(I), 4), -1)
        for k in range(len(I) - 1, -1, -1):
            for axis in range(4):
                path[k, axis] = state[axis]
            if k > 0 and state[0] >= 0:
                state = predecessor(I[k - 1], state, position, table, lowest)
        return path

    return path


_best_path, _cheapest_path = _trace(operator.mul), _trace(operator.sub)


def weighted_path_spec(I, state, position, velocity, lowest_velocity):
    """Specification of :func:`weighted_path`: argmax over all predecessors, frame by frame."""
    return coupled_path_spec(I, state, np.outer(position, velocity), lowest_velocity)


@_one_type
@kernel
def weighted_path(I, state, position, velocity, lowest_velocity):
    """Eqs. (13), (19): the best path that ends in ``state``.

    Of box_forward (velocity = ones(1)) or weighted_forward.  I : (K, V, V, X, Y) value maps of K
    frames; state : (iv, jv, i, j) in frame K, i and j counted with the margin.  Returns states of
    the same form, (K, 4) of int; four times -1 from where no predecessor can be reached.
    """
    _check_weights(position, (position.size,), 0)
    _check_weights(velocity, (velocity.size,), 0)
    position, velocity = position / (position > 0), velocity / (velocity > 0)  # 0 becomes NaN
    return _best_path(I, state, position, velocity.reshape(1, velocity.size), lowest_velocity)


def penalised_path_spec(I, state, position, velocity, lowest_velocity):
    """Specification of :func:`penalised_path`: argmax over all predecessors, frame by frame."""
    return _path_of(I, state, np.add.outer(position, velocity), lowest_velocity, np.subtract)


@_one_type
@kernel
def penalised_path(I, state, position, velocity, lowest_velocity):
    """The best path that ends in ``state`` under penalised_forward; see :func:`weighted_path`."""
    _check_prices(position, velocity)
    return _cheapest_path(I, state, position, velocity.reshape(1, 3), lowest_velocity)


def coupled_path_spec(I, state, table, lowest_velocity):
    """Specification of :func:`coupled_path`: argmax over all predecessors, frame by frame."""
    return _path_of(I, state, np.where(table > 0, table, np.nan), lowest_velocity, np.multiply)


@_one_type
@kernel
def coupled_path(I, state, table, lowest_velocity):
    """The best path that ends in ``state`` under coupled_forward; see :func:`weighted_path`."""
    _check_weights(table, (3, 3), TINY)
    return _best_path(I, state, np.ones_like(table[0]), table, lowest_velocity)
