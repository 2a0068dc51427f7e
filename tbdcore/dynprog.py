"""Max-product dynamic programming for track-before-detect: forward pass and back-trace.

For each state of frame k only the best way to reach it is kept (Wan, Wang and Wu 2013, eqs. 4, 12,
16):  I_k(x) = z_k(x) + max over predecessors x' of x of  g(x'|x) I_{k-1}(x')

A state is (iv, jv, i, j): two velocity indices and two cell indices.  Index iv is the velocity
``lowest_velocity + iv`` in cells per frame; an algorithm without velocity has one index, of
velocity 0.  The predecessors of a state have the velocity v' = v + r and the position i - v' + m:
r is the change of velocity, m the position slack, and the same on the other axis.

``position``, ``velocity``  weights of the slacks: an odd number, the middle one for slack 0, and 0
                            for a slack left out.  Conventional: ``ones(2M+1)``, one velocity.
                            Tonissen: ``(0, 1, 1)``, velocity kept.  State-weighted: ``(a, 1, a)``.
``box_forward``             predecessors keep their velocity and all count the same (eqs. 6, 7)
``weighted_forward``        slack of one cell and one velocity, weight = product of four factors
                            (eqs. 8, 10 with deviation |m|)
``coupled_forward``         the same set, weight = table over (m, r) per axis (eq. 10 with |m - r|)
``penalised_forward``       the same set, a price is subtracted instead (not in the paper)
``*_path``                  the best path that ends in one state (eqs. 5, 13, 17, 19)

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


def margin(frames, width):
    """Frames (K, Nx, Ny), all finite, with ``width`` cells of -inf around."""
    frames, width = np.asarray(frames), checks.integer("width", width, 0)
    if frames.ndim != 3 or 0 in frames.shape:
        raise ValueError(f"frames: shape {frames.shape}; stack them to (K, Nx, Ny), none empty")
    frames = checks.reals("frames", frames, "K", "Nx", "Ny")
    K, Nx, Ny = frames.shape
    framed = np.empty((K, Nx + 2 * width, Ny + 2 * width), frames.dtype)
    if _surround(np.ascontiguousarray(frames), width, framed):
        k, i, j = np.argwhere(~np.isfinite(frames))[0]
        raise ValueError(f"frames: {frames[k, i, j]} in frame {k}, cell ({i}, {j}); replace it")
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
    first = z[0].reshape(X * Y)
    for values in I[0].reshape(V * V, X * Y):  # eq. (14): every velocity has the cell's value
        for x in range(X * Y):  # the same as I[0] = z[0], which takes seconds to compile
            values[x] = first[x]


@kernel
def _check_state(I, state, lowest):
    """Raise ValueError unless state (iv, jv, i, j) is one of the maps I (K, V, V, X, Y)."""
    if I.size == 0 or I.shape[1] != I.shape[2] or abs(lowest) > I.size:
        raise ValueError("I: maps must be (K, V, V, X, Y), K at least 1")
    for axis in range(4):
        if len(state) != 4 or not 0 <= state[axis] < I.shape[axis + 1]:
            raise ValueError("state: give four indices (iv, jv, i, j) into the maps")


# Loops over one contiguous plane


@kernel
def _top_of_two(target, first, second, term):
    plus = term.size > 0
    for x in range(target.size):
        best = first[x] if first[x] > second[x] else second[x]
        target[x] = best + term[x] if plus else best


@kernel
def _top(target, first, second, third, term):
    plus = term.size > 0
    for x in range(target.size):
        best = first[x] if first[x] > second[x] else second[x]
        best = best if best > third[x] else third[x]
        target[x] = best + term[x] if plus else best


@kernel
def _window(target, source, start, step, count, term, work):
    """target[x] = max of source[start + x + c step], c = 0..count-1, plus term[x] if there is one.

    Three maxima over ``width`` neighbours are one over up to 3 width: seven take two passes.
    """
    n, width, source, turn = target.size, 1, source[start:], 0
    while 3 * width < count:
        wider = work[turn, : n + (count - 3 * width) * step]
        _top(wider, source, source[width * step :], source[2 * width * step :], term[:0])
        source, width, turn = wider, 3 * width, 1 - turn
    far = count - width
    if count == 2:
        _top_of_two(target, source, source[step:], term)
    else:
        _top(target, source, source[(far + 1) // 2 * step :], source[far * step :], term)


@kernel
def _best_product(target, source, step, weight, term):
    """target[x] = max of weight[c] source[x + c step], c = 0..2, plus term[x] if there is one.

    A weight of 0 leaves c out.
    """
    first, second, third = source, source[step:], source[2 * step :]
    a, b, c = weight[0], weight[1], weight[2]
    if not a > 0:
        first, a = second, b
    if not c > 0:
        third, c = second, b
    plus = term.size > 0
    for x in range(target.size):
        p, q, r = a * first[x], b * second[x], c * third[x]
        p = p if p > q else q
        p = p if p > r else r
        target[x] = p + term[x] if plus else p


@kernel
def _best_difference(target, source, step, price, term):
    """target[x] = max of source[x + c step] - price[c], c = 0..2, plus term[x] if there is one."""
    first, second, third = source, source[step:], source[2 * step :]
    a, b, c, plus = price[0], price[1], price[2], term.size > 0
    for x in range(target.size):
        p, q, r = first[x] - a, second[x] - b, third[x] - c
        p = p if p > q else q
        p = p if p > r else r
        target[x] = p + term[x] if plus else p


@kernel
def _raise_products(target, source, step, weight):
    """target[x] = max of target[x] and weight[c] source[x + c step] over c = 0, 1, 2."""
    first, second, third = source, source[step:], source[2 * step :]
    a, b, c = weight[0], weight[1], weight[2]
    for x in range(target.size):
        p, q, r = a * first[x], b * second[x], c * third[x]
        p = p if p > q else q
        r = r if r > target[x] else target[x]
        target[x] = p if p > r else r


@kernel
def _allowed(weight):
    """Index of the first positive weight, and how many there are; refuses a gap between them."""
    first, count = 0, 0
    for c in range(weight.size - 1, -1, -1):
        if weight[c] > 0:
            if count > 0 and first != c + 1:
                raise ValueError("position: the allowed slacks must be neighbours; fill the gap")
            first, count = c, count + 1
    return first, count


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


@kernel
def _box_stage(previous, frame, position, lowest, reach, out, work):
    V, Y, d = previous.shape[0], previous.shape[3], position.size // 2
    lo, n = reach * Y, frame.size - 2 * reach * Y
    first, count = _allowed(position)
    z, rows, more = frame.reshape(frame.size), work[0], work[1:]
    rows[:lo] = rows[lo + n :] = -np.inf
    for iv in range(V):
        for jv in range(V):
            source, target = previous[iv, jv].reshape(frame.size), out[iv, jv].reshape(frame.size)
            _window(rows[lo : lo + n], source, lo + first - d - lowest - jv, 1, count, z[:0], more)
            start = lo + (first - d - lowest - iv) * Y
            _window(target[lo : lo + n], rows, start, Y, count, z[lo:], more)
            target[:lo] = target[lo + n :] = -np.inf


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
    work = np.empty((3, z.shape[1] * z.shape[2]), I.dtype)
    for k in range(1, len(z)):
        _box_stage(I[k - 1], z[k], position, lowest_velocity, reach, I[k], work)
    return I


def _extended(best):
    """The loops of a family: on each axis the best slack of each velocity, then its best change."""

    @kernel
    def forward(z, position, velocity, lowest, reach, I):
        V, size, Y = I.shape[1], z[0].size, z.shape[2]
        lo, n = reach * Y, size - 2 * reach * Y
        rows = np.full((V + 2) * n, -np.inf).astype(I.dtype)  # velocity v in row v + 1
        for k in range(1, len(z)):
            old, new = I[k - 1].reshape(V * V * size), I[k].reshape(V * V * size)
            for plane in new.reshape(V * V, size):
                plane[:lo] = plane[lo + n :] = -np.inf
            frame = z[k].reshape(size)[lo : lo + n]
            axes = (V * size, size, 1, frame[:0]), (size, V * size, Y, frame)
            for across, along, step, term in axes:
                for start in range(lo, lo + V * across, across):
                    for v in range(V):
                        source = old[start + v * along - (lowest + v + 1) * step :]
                        best(rows[(v + 1) * n : (v + 2) * n], source, step, position, frame[:0])
                    for v in range(V):
                        best(new[start + v * along :][:n], rows[v * n :], n, velocity, term)
                old = new
        return I

    return forward


_weighted, _penalised = _extended(_best_product), _extended(_best_difference)


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
    _begin(z, I, 1, lowest_velocity, reach)
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
    _begin(z, I, 1, lowest_velocity, reach)
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
    _begin(z, I, 1, lowest_velocity, reach)
    V, Y, size = I.shape[1], z.shape[2], z[0].size
    lo, n, rows = reach * Y, size - 2 * reach * Y, np.full((V, size), -np.inf).astype(I.dtype)
    for k, jv in np.ndindex(len(z) - 1, V):
        for u in range(V):
            rows[u, lo : lo + n] = -np.inf
            for w in range(max(jv - 1, 0), min(jv + 2, V)):
                source = I[k, u, w].reshape(size)[lo - lowest_velocity - w - 1 :]
                _raise_products(rows[u, lo : lo + n], source, 1, table[:, w - jv + 1])
        for iv in range(V):
            plane = I[k + 1, iv, jv].reshape(size)
            target, plane[:] = plane[lo : lo + n], -np.inf
            for u in range(max(iv - 1, 0), min(iv + 2, V)):
                source = rows[u, lo - (lowest_velocity + u + 1) * Y :]
                _raise_products(target, source, Y, table[:, u - iv + 1])
            target += z[k + 1].reshape(size)[lo : lo + n]
    return I


# Back-trace


def _trace(combine):
    """The back-trace of a family: a value is combined with a weight by mul, with a price by sub."""

    @kernel
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

    @kernel
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
