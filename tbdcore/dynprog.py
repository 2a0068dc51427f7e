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
along an axis is a shift of one contiguous array.  The maps of all frames are kept, and the
back-trace takes the argmax again, in the forward pass's order of operations, so that both agree to
the last bit.  Frames, maps and weights are contiguous arrays of one type, float32 or float64.
"""

import functools
import itertools
import operator

import numpy as np
from numba.core.errors import NumbaError

from tbdcore import checks, kernel

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


def check_weights(slack, name="slack"):
    """Weights of the slacks -d..d, finite, >= 0, the middle one positive, as a float64 vector."""
    slack = checks.reals(name, np.atleast_1d(slack), "2 d + 1").astype(float)
    if slack.size % 2 == 0:
        raise ValueError(f"{name}: {slack.size} weights are an even window; give 2 d + 1, -d..d")
    if not (np.isfinite(slack).all() and (slack >= 0).all() and slack[slack.size // 2] > 0):
        raise ValueError(f"{name}: {slack.tolist()}; give finite weights >= 0, the middle one > 0")
    return slack


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
def _begin(z, I, slack, lowest, reach):
    """The first map; ValueError unless the frames fit the maps and no step leaves the margin."""
    (_, V, W, X, Y), least = I.shape, min(z.shape[1], z.shape[2])
    if z.shape != (len(I), X, Y) or V != W or I.size == 0:
        raise ValueError("I: maps must be (K, V, V, X, Y) for frames (K, X, Y) in their margin")
    if not (slack <= reach < (least + 1) // 2 and slack - reach <= lowest <= reach - slack - V + 1):
        raise ValueError("reach: a step leaves the margin; use margin(frames, longest step)")
    maps, frames, size = I.reshape(I.size), z.reshape(z.size), X * Y
    for start in range(0, V * V * size, size):  # eq. (14): every velocity has the cell's value
        _top(maps, start, frames, (0, 0), size, frames[:0], 0)


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
    far, width, half, none = (count - 1) * step, 3 * step, work.size // 2, term[:0]
    if count < 3:
        _top(target, to, source, (at, at + far), n, term, origin)
    elif count == 3:
        _top(target, to, source, (at, at + step, at + far), n, term, origin)
    else:
        _top(work, half, source, (at, at + step, at + 2 * step), n + far - 2 * step, none, origin)
        at = half
        while 3 * width <= far:
            ends, wider = (at, at + width, at + 2 * width), n + far + step - 3 * width
            _top(work, half - at, work, ends, wider, none, origin)
            width, at = 3 * width, half - at
        far += step - width
        middle = (far // step + 1) // 2 * step
        _top(target, to, work, (at, at + middle, at + far), n, term, origin)


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


@kernel
def _raise_products(target, to, source, at, step, n, weight):
    """target[to + x] = max of itself and weight[c] source[at + x + c step], c = 0, 1, 2."""
    t, a, b, c = np.uint64(to), weight[0], weight[1], weight[2]
    i, j, k = np.uint64(at), np.uint64(at + step), np.uint64(at + 2 * step)
    for x in range(np.uint64(n)):
        p, q, r = a * source[i + x], b * source[j + x], c * source[k + x]
        p = p if p > q else q
        r = r if r > target[t + x] else target[t + x]
        target[t + x] = p if p > r else r


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


def box_forward_spec(z, position, lowest_velocity, reach, I):
    """Specification of :func:`box_forward`: all pairs of slacks."""
    return coupled_forward_spec(z, position[:, None] > 0, lowest_velocity, reach, I)


@_one_type
@kernel
def box_forward(z, position, lowest_velocity, reach, I):
    """Eqs. (4), (6), (7), (14): the velocity is kept, all allowed slacks count the same.

    z : (K, X, Y) frames in their margin; I : (K, V, V, X, Y) value maps, written and returned.
    position : (2 d + 1,), positive where a slack is allowed; the allowed slacks are neighbours.
    lowest_velocity : of index 0, cells/frame; reach : width of the margin, at least d + the
        fastest velocity.
    """
    _check_weights(position, (position.size,), 0)
    _begin(z, I, position.size // 2, lowest_velocity, reach)
    V, size, Y = I.shape[1], z[0].size, z.shape[2]
    lo, n, along, allowed = reach * Y, size - 2 * reach * Y, np.int64(1), np.flatnonzero(position)
    shift, count = position.size // 2 - allowed[0] + lowest_velocity, allowed.size
    if allowed[-1] - allowed[0] >= count:
        raise ValueError("position: the allowed slacks must be neighbours; fill the gap")
    maps, frames, none = I.reshape(I.size), z.reshape(z.size), z[0, 0, :0]
    rows, work = np.full(size, -np.inf).astype(I.dtype), np.empty(2 * size, I.dtype)
    for k, iv, jv in np.ndindex(len(z) - 1, V, V):
        old = ((k * V + iv) * V + jv) * size + lo
        _window(rows, lo, maps, old - shift - jv, along, count, n, none, lo, work)
        new, frame = old + V * V * size, (k + 1) * size + lo
        _window(maps, new, rows, lo - (shift + iv) * Y, Y, count, n, frames, frame, work)
        _close(maps, new - lo, 1, size, lo)
    return I


def _extended(combine, left_out):
    """The passes of a family: on each axis the best slack of each velocity, then its best change.

    They run through pieces of a plane, whose best slacks stay in the first-level cache.
    """
    best = _best(combine, left_out)

    @_family(combine)
    def forward(z, position, velocity, lowest, reach, I):
        V, size, Y = I.shape[1], z[0].size, z.shape[2]
        lo, n, none, piece = reach * Y, size - 2 * reach * Y, z[0, 0, :0], PIECE // I.itemsize
        rows, half = np.empty((V + 3) * piece, I.dtype), np.empty(V * V * size, I.dtype)
        rows[:], half[:], maps = -np.inf, -np.inf, I.reshape(I.size)  # velocity v in row v + 2
        for k in range(1, len(z)):
            new, frame = k * V * V * size, z[k].reshape(size)
            across = maps, new - V * V * size, half, 0, V * size, size, 1, none
            down = half, 0, maps, new, size, V * size, Y, frame
            for old, begin, out, end, outer, inner, step, term in (across, down):
                for first, x in np.ndindex(V, (n - 1) // piece + 1):
                    here, shape = lo + first * outer + x * piece, (V, min(piece, n - x * piece))
                    at = begin + here - (lowest + 1) * step, inner - step, step
                    best(rows, (2 * piece, piece), old, at, shape, position, none, lo)
                    to, at, origin = (end + here, inner), (piece, piece, piece), lo + x * piece
                    best(out, to, rows, at, shape, velocity, term, origin)
            _close(maps, new, V * V, size, lo)
        return I

    return forward


_weighted, _penalised = _extended(operator.mul, 0), _extended(operator.sub, np.inf)


def weighted_forward_spec(z, position, velocity, lowest_velocity, reach, I):
    """Specification of :func:`weighted_forward`: all 81 predecessors of every state."""
    return coupled_forward_spec(z, np.outer(position, velocity), lowest_velocity, reach, I)


@_one_type
@kernel
def weighted_forward(z, position, velocity, lowest_velocity, reach, I):
    """Eqs. (8), (12) with g a product: position[m] velocity[r] on each axis, slacks -1, 0, 1.

    Arrays as in :func:`box_forward`; position, velocity : (3,) of the frames' type, 0 for a slack
    left out.  The reading Delta_i = |m| of eq. (10) is position = velocity = (a, 1, a).
    """
    _check_weights(position, (3,), 0)
    _check_weights(velocity, (3,), 0)
    _begin(z, I, position.size // 2, lowest_velocity, reach)
    return _weighted(z, position, velocity, lowest_velocity, reach, I)


def penalised_forward_spec(z, position, velocity, lowest_velocity, reach, I):
    """Specification of :func:`penalised_forward`: all 81 predecessors of every state."""
    return _dense(z, np.add.outer(position, velocity), lowest_velocity, I, np.subtract)


@_one_type
@kernel
def penalised_forward(z, position, velocity, lowest_velocity, reach, I):
    """I_k = z_k + max (I_{k-1} - position[m] - velocity[r] - the same on the other axis).

    Not in the paper.  position, velocity : (3,) prices, inf for a slack left out.  A price of
    lambda |m| + lambda |r| is a log-prior of the path, so the maximum is Viterbi's.
    """
    _check_prices(position, velocity)
    _begin(z, I, position.size // 2, lowest_velocity, reach)
    return _penalised(z, position, velocity, lowest_velocity, reach, I)


def coupled_forward_spec(z, table, lowest_velocity, reach, I):
    """Specification of :func:`coupled_forward`: all 81 predecessors of every state."""
    return _dense(z, np.where(table > 0, table, np.nan), lowest_velocity, I, np.multiply)


@_one_type
@kernel
def coupled_forward(z, table, lowest_velocity, reach, I):
    """Eqs. (8), (12) with g = table[m, r] table[n, s]: slack and velocity change weighted together.

    Arrays as in :func:`box_forward`; table : (3, 3) of the frames' type, position slack first, all
    positive.  Eq. (10) to the letter, Delta_i = |m - r|, is table[m, r] = a**(|m - r| + |r|).
    """
    _check_weights(table, (3, 3), TINY)
    _begin(z, I, len(table) // 2, lowest_velocity, reach)
    V, Y, size = I.shape[1], z.shape[2], z[0].size
    lo, n, maps = reach * Y, size - 2 * reach * Y, I.reshape(I.size)
    rows = np.full(V * size, -np.inf).astype(I.dtype)
    for k, jv in np.ndindex(len(z) - 1, V):
        for u in range(V):
            start = u * size + lo
            rows[start : start + n] = -np.inf
            for w in range(max(jv - 1, 0), min(jv + 2, V)):
                at = ((k * V + u) * V + w) * size + lo - lowest_velocity - w - 1
                _raise_products(rows, start, maps, at, 1, n, table[:, w - jv + 1])
        for iv in range(V):
            start = (((k + 1) * V + iv) * V + jv) * size + lo
            target = maps[start : start + n]
            target[:] = -np.inf
            for u in range(max(iv - 1, 0), min(iv + 2, V)):
                at = u * size + lo - (lowest_velocity + u + 1) * Y
                _raise_products(maps, start, rows, at, Y, n, table[:, u - iv + 1])
            target += z[k + 1].reshape(size)[lo : lo + n]
            _close(maps, start - lo, 1, size, lo)
    return I


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
