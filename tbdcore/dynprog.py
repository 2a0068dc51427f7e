"""Max-product dynamic programming for track-before-detect: the forward pass, stage by stage, and
the path back.

A target that moves through K frames leaves its energy along one path; dynamic programming finds the
best of all admissible paths by keeping, for each state of frame k, only the best way of having come
there:

    I_k(x) = z_k(x) + max over predecessors x' of x of  g(x'|x) I_{k-1}(x')          (Wan, Wang and Wu 2013, eqs. 4, 12, 16)

A state is (iv, jv, i, j): two velocity indices and two cell indices.  Index iv stands for the
velocity ``slowest + iv`` in cells per frame; an algorithm without velocity has one index and
``slowest = 0``.  The predecessors of a state have the velocity v' = v + r and the position i - v' +
m: r is the change of velocity, m the position slack, and the same on the other axis.

``position`` and ``velocity``
    weights of the slacks: an odd number of them, the middle one for slack 0, and 0 for a slack that
    is not allowed. Conventional: ``ones(2M+1)``, one speed.  Tonissen: ``(0, 1, 1)``, velocity
    kept.  State-weighted: ``(a, 1, a)`` both.
``box_forward``        predecessors that keep their velocity and all count the same (eqs. 6 and 7)
``weighted_forward``   slack of one cell and of one velocity, weight = product of four factors (eqs. 8, 10 with deviation |m|)
``coupled_forward``    the same set with a weight that is a table over (m, r) per axis (eq. 10 with deviation |m - r|)
``penalised_forward``  the same set with a price that is subtracted instead of a weight that
multiplies
``*_path``             the best path that ends in one state (eqs. 5, 13, 17, and 19)

Max over products with positive weights is separable on all real numbers, negative ones included,
because x -> g x is increasing: 81 predecessors cost 6 + 6 operations.  Where all weights are 1, the
maximum over seven neighbours is one over three overlapping maxima over three, so that 49
predecessors cost 6 + 6 as well.  Nothing here takes a logarithm.  An empty maximum is
-inf, so a state that cannot be reached is -inf for ever, and no finite sentinel has to be told from
data.

Layout: frames and value maps stand in a margin of -inf (``margin``), at least as wide as the
longest step, so that the edge of the picture needs no case of its own.  Maps are stored plane by
plane, shape (V, V, X, Y) with X = Nx + 2 margins: a step along an axis is then a shift of one
contiguous array.  No back-pointers are stored: the value maps of all frames are kept, and the
argmax is taken again where a path goes through, multiplying in the order of the forward pass so
that both agree to the last bit. Data may be float32 or float64; weights must have the same
type.  Not here: thresholds, Monte Carlo, and which set a paper uses.
"""

import itertools

import numpy as np

from tbdcore import kernel


def margin(frames, width):
    """Frames (K, Nx, Ny), all finite, surrounded by ``width`` cells of -inf; cell (i, j) moves to
    (i + width, j + width).
    """
    frames = np.asarray(frames)
    if frames.ndim != 3 or 0 in frames.shape:
        raise ValueError(
            f"frames: shape {frames.shape} is not (K, Nx, Ny) with at least one cell; "
            f"stack the frames first"
        )
    K, Nx, Ny = frames.shape
    framed = np.empty((K, Nx + 2 * width, Ny + 2 * width), frames.dtype)
    if _surround(np.ascontiguousarray(frames), width, framed):
        k, i, j = np.argwhere(~np.isfinite(frames))[0]
        raise ValueError(
            f"frames: {frames[k, i, j]} in frame {k}, cell ({i}, {j}); "
            f"replace it by the noise mean or drop it"
        )
    return framed


@kernel
def _surround(frames, width, framed):
    """Copy frames into ``framed`` and return how many of their cells are not finite: what is not,
    less itself, is not 0.
    """
    (K, Nx, Ny), (_, X, Y), flat = frames.shape, framed.shape, framed.reshape(framed.size)
    lost = end = 0
    for k in range(K):
        for i in range(Nx):
            start = (k * X + width + i) * Y + width
            _fill(flat[end:start], -np.inf)  # the margin between one row of cells and the next
            cells, row, end = frames[k, i], flat[start:], start + Ny
            for j in range(Ny):
                row[j] = cells[j]
                lost += cells[j] - cells[j] != 0
    _fill(flat[end:], -np.inf)
    return lost


def weights(slack, name="slack"):
    """Weights of the slacks -d..d as a float64 vector of odd length; the middle one must be
    allowed.
    """
    slack = np.atleast_1d(np.asarray(slack, dtype=float))
    if slack.ndim != 1 or slack.size % 2 == 0:
        raise ValueError(
            f"{name}: {slack.size} weights, an even window, have no middle; "
            f"give 2 d + 1 weights for slacks -d..d"
        )
    if not (np.isfinite(slack).all() and (slack >= 0).all() and slack[slack.size // 2] > 0):
        raise ValueError(
            f"{name}: weights {slack.tolist()} must be finite, >= 0, and positive in the middle; "
            f"use 0 for a slack left out"
        )
    return slack


# Loops over one contiguous plane
# ------------------------------------------------------------------------------------------


@kernel
def _top(target, first, second, third):
    for x in range(target.size):
        best = first[x] if first[x] > second[x] else second[x]
        target[x] = best if best > third[x] else third[x]


@kernel
def _top_add(target, first, second, third, term):
    for x in range(target.size):
        best = first[x] if first[x] > second[x] else second[x]
        target[x] = (best if best > third[x] else third[x]) + term[x]


@kernel
def _window(target, source, start, step, count, term, work):
    """target[x] = max of source[start + x + c step] over c = 0..count-1, plus term[x] where one is
    given.

    Three maxima over ``width`` neighbours, side by side or overlapping, are one over up to 3
    ``width``: seven take two passes.
    """
    n, width, source, turn = target.size, 1, source[start:], 0
    while 3 * width < count:
        wider = work[turn, : n + (count - 3 * width) * step]
        _top(wider, source, source[width * step :], source[2 * width * step :])
        source, width, turn = wider, 3 * width, 1 - turn
    far = count - width
    middle, last = source[(far + 1) // 2 * step :], source[far * step :]
    if term.size:
        _top_add(target, source, middle, last, term)
    else:
        _top(target, source, middle, last)


@kernel
def _best(target, first, second, third, a, b, c, additive):
    """target = max of (a first, b second, c third), or of (first - a, second - b, third - c) where
    ``additive``.
    """
    if additive:
        for x in range(target.size):
            p, q, r = first[x] - a, second[x] - b, third[x] - c
            p = p if p > q else q
            target[x] = p if p > r else r
    else:
        for x in range(target.size):
            p, q, r = a * first[x], b * second[x], c * third[x]
            p = p if p > q else q
            target[x] = p if p > r else r


@kernel
def _raise_products(target, first, second, third, a, b, c):
    for x in range(target.size):
        p, q, r = a * first[x], b * second[x], c * third[x]
        p = p if p > q else q
        r = r if r > target[x] else target[x]
        target[x] = p if p > r else r


@kernel
def _add(target, term):
    for x in range(target.size):
        target[x] += term[x]


@kernel
def _fill(target, value):
    for x in range(target.size):
        target[x] = value


@kernel
def _edge(plane, lo, n):
    _fill(plane[:lo], -np.inf)
    _fill(plane[lo + n :], -np.inf)


@kernel
def _room(shape, slack, slowest, reach):
    """First interior element and number of elements of a flat plane; refuses a margin that a step
    could leave.
    """
    V, _, X, Y = shape
    if reach < slack + max(abs(slowest), abs(slowest + V - 1)) or min(X, Y) <= 2 * reach:
        raise ValueError(
            "reach: a step is longer than the margin, or the margin fills the frame; "
            "use margin(frames, longest step)"
        )
    return reach * Y, (X - 2 * reach) * Y


@kernel
def _allowed(weight):
    """Index of the first positive weight, and how many there are; refuses a gap between them."""
    first, count = 0, 0
    for c in range(weight.size - 1, -1, -1):
        if weight[c] > 0:
            if count > 0 and first != c + 1:
                raise ValueError(
                    "position: the allowed slacks must be neighbours; fill the gap, "
                    "or use the specification"
                )
            first, count = c, count + 1
    return first, count


@kernel
def _sides(weight, additive):
    """Indices that stand for the slacks -1 and 1; one that is not allowed (weight 0) is replaced by
    the middle, 1.
    """
    if weight.size != 3:
        raise ValueError(
            "weights: slacks of one cell and one velocity need three weights each; "
            "use 0 for a slack left out"
        )
    return (0 if additive or weight[0] > 0 else 1), (2 if additive or weight[2] > 0 else 1)


# Specifications -----------------------------------------------------------------------------------
# ------------------------


def _dense(z, table, slowest, I, combine):
    """All value maps by the dense stage; table: position slack, velocity change; NaN leaves one
    out.
    """
    I[0] = z[0]
    for k in range(1, len(z)):
        _dense_stage(I[k - 1], z[k], table, slowest, I[k], combine)
    return I


def _dense_stage(previous, frame, table, slowest, out, combine):
    """Every predecessor of every state, whole planes at a time."""
    V, (dm, dr) = len(previous), np.array(table.shape) // 2
    out[:] = -np.inf
    slacks = [
        (m, r)
        for m in range(-dm, dm + 1)
        for r in range(-dr, dr + 1)
        if not np.isnan(table[m + dm, r + dr])
    ]
    for iv, jv, (m, r), (n, s) in itertools.product(range(V), range(V), slacks, slacks):
        u, w = iv + r, jv + s
        if 0 <= u < V and 0 <= w < V:
            moved = np.roll(previous[u, w], (slowest + u - m, slowest + w - n), axis=(0, 1))
            value = combine(combine(moved, table[n + dm, s + dr]), table[m + dm, r + dr])
            np.maximum(out[iv, jv], value, out=out[iv, jv])
    out += frame


def _nan_where_zero(table):
    return np.where(table > 0, table, np.nan)


def _candidates(previous, state, table, slowest, combine):
    """Values and states of all predecessors of one state inside the map; NaN in the table leaves
    one out.
    """
    V, X, Y = previous.shape[1:]
    dm, dr = np.array(table.shape) // 2
    n, s, m, r = (
        axis.ravel() for axis in np.mgrid[-dm : dm + 1, -dr : dr + 1, -dm : dm + 1, -dr : dr + 1]
    )
    u, w = state[0] + r, state[1] + s
    x, y = state[2] + m - slowest - u, state[3] + n - slowest - w
    keep = (u >= 0) & (u < V) & (w >= 0) & (w < V) & (x >= 0) & (x < X) & (y >= 0) & (y < Y)
    u, w, x, y, m, n, r, s = (axis[keep] for axis in (u, w, x, y, m, n, r, s))
    return combine(
        combine(previous[u, w, x, y], table[n + dm, s + dr]), table[m + dm, r + dr]
    ), np.stack((u, w, x, y), axis=1)


def _best_of(values, states):
    """State of the largest value, or four times -1 when there is none."""
    values = np.where(np.isnan(values), -np.inf, values)
    if not values.size or values.max() == -np.inf:
        return -1, -1, -1, -1
    return tuple(int(index) for index in states[values.argmax()])


def _path_of(I, state, table, slowest, combine):
    """Best path to a state: the best of all predecessors, again and again; four times -1 is its own
    predecessor.
    """
    path = [state]
    for previous in I[-2::-1]:
        lost = path[-1][0] < 0
        path.append(
            path[-1]
            if lost
            else _best_of(*_candidates(previous, path[-1], table, slowest, combine))
        )
    return np.array(path[::-1])


# Forward pass -------------------------------------------------------------------------------------
# ------------------------


@kernel
def _start(z, I):
    """Eq. (14): before the second frame every velocity has gathered the same."""
    first, frame = I[0].reshape(I.shape[1] * I.shape[2], z[0].size), z[0].reshape(z[0].size)
    for v in range(first.shape[0]):
        for x in range(frame.size):
            first[v, x] = frame[x]


@kernel
def _box_stage(previous, frame, position, slowest, reach, out, work):
    V, Y, d = previous.shape[0], previous.shape[3], position.size // 2
    lo, n = _room(previous.shape, d, slowest, reach)
    first, count = _allowed(position)
    z, rows, more = frame.reshape(frame.size), work[0], work[1:]
    _edge(rows, lo, n)
    for iv in range(V):
        for jv in range(V):
            source, target = previous[iv, jv].reshape(frame.size), out[iv, jv].reshape(frame.size)
            _window(rows[lo:][:n], source, lo + first - d - slowest - jv, 1, count, z[:0], more)
            _window(
                target[lo:][:n], rows, lo + (first - d - slowest - iv) * Y, Y, count, z[lo:], more
            )
            _edge(target, lo, n)


def box_forward_spec(z, position, slowest, reach, I):
    """Specification of :func:`box_forward`: all pairs of slacks."""
    return _dense(z, np.where(position > 0, 1.0, np.nan)[:, None], slowest, I, np.multiply)


@kernel
def box_forward(z, position, slowest, reach, I):
    """Eqs. (4), (6), (7), (14): the velocity is kept, all allowed slacks count the same.  Writes
    the maps I and returns them.

    z : (K, X, Y) frames in their margin; I : (K, V, V, X, Y) value maps in the same layout.
    position : (2 d + 1,), positive where a slack is allowed; the allowed slacks are neighbours.
    slowest : velocity of index 0, cells/frame; reach : width of the margin, at least d + the
        fastest velocity.
    """
    work = np.empty((3, z.shape[1] * z.shape[2]), I.dtype)
    _start(z, I)
    for k in range(1, len(z)):
        _box_stage(I[k - 1], z[k], position, slowest, reach, I[k], work)
    return I


@kernel
def _extended_stage(previous, frame, position, velocity, slowest, reach, additive, out, best):
    """Axis by axis: the best position slack of each velocity, then the best change of velocity;
    ``out`` holds the half-way map.
    """
    V, Y = previous.shape[0], previous.shape[3]
    lo, n = _room(previous.shape, 1, slowest, reach)
    m0, m2 = _sides(position, additive)
    r0, r2 = _sides(velocity, additive)
    a, b, c = position[m0], position[1], position[m2]
    z, planes = frame.reshape(frame.size), out.reshape(V, V, frame.size)
    for axis in range(2):
        step = Y if axis else 1
        for u in range(V):  # the velocity index of the other axis
            for w in range(V):
                source = planes[w, u] if axis else previous[u, w].reshape(frame.size)
                o = lo - (slowest + w) * step
                left, right = source[o + (m0 - 1) * step :][:n], source[o + (m2 - 1) * step :][:n]
                _best(best[w], left, source[o:][:n], right, a, b, c, additive)
            for w in range(V):
                s0, s2 = (r0 if w > 0 else 1), (r2 if w < V - 1 else 1)
                target = planes[w, u] if axis else planes[u, w]
                less, more = best[w + s0 - 1], best[w + s2 - 1]
                _best(
                    target[lo:][:n],
                    less,
                    best[w],
                    more,
                    velocity[s0],
                    velocity[1],
                    velocity[s2],
                    additive,
                )
                if axis:
                    _add(target[lo:][:n], z[lo:])
                else:
                    _edge(target, lo, n)


@kernel
def _extended(z, position, velocity, slowest, reach, additive, I):
    best = np.empty((I.shape[1], _room(I.shape[1:], 1, slowest, reach)[1]), I.dtype)
    _start(z, I)
    for k in range(1, len(z)):
        _extended_stage(I[k - 1], z[k], position, velocity, slowest, reach, additive, I[k], best)


def weighted_forward_spec(z, position, velocity, slowest, reach, I):
    """Specification of :func:`weighted_forward`: all 81 predecessors of every state."""
    return _dense(z, _nan_where_zero(np.outer(position, velocity)), slowest, I, np.multiply)


@kernel
def weighted_forward(z, position, velocity, slowest, reach, I):
    """Eqs. (8), (12) with g a product: position[m] velocity[r] on each axis, slacks -1, 0, 1,
    weight 0 for a slack left out.

    Arrays as in :func:`box_forward`; position, velocity : (3,) of the data's type, positive in the
    middle.  The reading Delta_i = |m| of eq. (10) is position = velocity = (a, 1, a).
    """
    _extended(
        z, position, velocity, slowest, reach, np.bool_(False), I
    )  # a plain False is a type of its own: compiled twice
    return I


def penalised_forward_spec(z, position, velocity, slowest, reach, I):
    """Specification of :func:`penalised_forward`: all 81 predecessors of every state."""
    return _dense(z, np.add.outer(position, velocity), slowest, I, np.subtract)


@kernel
def penalised_forward(z, position, velocity, slowest, reach, I):
    """I_k = z_k + max (I_{k-1} - position[m] - velocity[r] - the same on the other axis): prices,
    inf for a slack left out.

    Not in the paper.  A price of lambda |m| + lambda |r| is a log-prior of the path, so the maximum
    is Viterbi's.
    """
    _extended(z, position, velocity, slowest, reach, np.bool_(True), I)
    return I


@kernel
def _coupled_stage(previous, frame, table, slowest, reach, out, rows):
    V, Y = previous.shape[0], previous.shape[3]
    lo, n = _room(previous.shape, 1, slowest, reach)
    z, planes = frame.reshape(frame.size), out.reshape(V, V, frame.size)
    for jv in range(V):
        for u in range(V):
            _fill(rows[u, lo:][:n], -np.inf)
            for w in range(max(jv - 1, 0), min(jv + 2, V)):
                source, o, g = (
                    previous[u, w].reshape(frame.size),
                    lo - slowest - w,
                    table[:, w - jv + 1],
                )
                _raise_products(
                    rows[u, lo:][:n],
                    source[o - 1 :][:n],
                    source[o:][:n],
                    source[o + 1 :][:n],
                    g[0],
                    g[1],
                    g[2],
                )
        for iv in range(V):
            target = planes[iv, jv, lo:][:n]
            _fill(planes[iv, jv], -np.inf)
            for u in range(max(iv - 1, 0), min(iv + 2, V)):
                source, o, g = rows[u], lo - (slowest + u) * Y, table[:, u - iv + 1]
                _raise_products(
                    target,
                    source[o - Y :][:n],
                    source[o:][:n],
                    source[o + Y :][:n],
                    g[0],
                    g[1],
                    g[2],
                )
            _add(target, z[lo:])


def coupled_forward_spec(z, table, slowest, reach, I):
    """Specification of :func:`coupled_forward`: all 81 predecessors of every state."""
    return _dense(z, table, slowest, I, np.multiply)


@kernel
def coupled_forward(z, table, slowest, reach, I):
    """Eqs. (8), (12) with g = table[m, r] table[n, s]: position slack and velocity change of an
    axis weighted together.

    table : (3, 3) of the data's type, position slack first, all positive.  Eq. (10) to the letter,
        Delta_i = |m - r|, is table[m, r] = a**(|m - r| + |r|), which is no product of a function of
        m and one of r.
    """
    rows = np.empty((I.shape[1], z.shape[1] * z.shape[2]), I.dtype)
    _fill(rows.reshape(rows.size), -np.inf)
    _start(z, I)
    for k in range(1, len(z)):
        _coupled_stage(I[k - 1], z[k], table, slowest, reach, I[k], rows)
    return I


# Back-trace ---------------------------------------------------------------------------------------
# ------------------------


@kernel
def _predecessor(previous, state, position, velocity, slowest, additive):
    """Predecessor of largest value; operations in the order of the forward pass, the first one wins
    a tie.
    """
    V, X, Y = previous.shape[1:]
    dm, dr = position.size // 2, velocity.size // 2
    best, found = -np.inf, (-1, -1, -1, -1)
    for n in range(-dm, dm + 1):
        for s in range(-dr, dr + 1):
            w = state[1] + s
            y = state[3] + n - slowest - w
            if not (0 <= w < V and 0 <= y < Y):
                continue
            for m in range(-dm, dm + 1):
                for r in range(-dr, dr + 1):
                    u = state[0] + r
                    x = state[2] + m - slowest - u
                    if not (0 <= u < V and 0 <= x < X):
                        continue
                    a, b, c, d = (
                        position[n + dm],
                        velocity[s + dr],
                        position[m + dm],
                        velocity[r + dr],
                    )
                    if additive:
                        value = previous[u, w, x, y] - a - b - c - d
                    elif a > 0 and b > 0 and c > 0 and d > 0:
                        value = d * (c * (b * (a * previous[u, w, x, y])))
                    else:
                        continue
                    if value > best:
                        best, found = value, (u, w, x, y)
    return found


@kernel
def _coupled_predecessor(previous, state, table, slowest):
    """The same for a weight that is a table."""
    V, X, Y = previous.shape[1:]
    best, found = -np.inf, (-1, -1, -1, -1)
    for n in range(-1, 2):
        for w in range(max(state[1] - 1, 0), min(state[1] + 2, V)):
            y = state[3] + n - slowest - w
            for m in range(-1, 2):
                for u in range(max(state[0] - 1, 0), min(state[0] + 2, V)):
                    x = state[2] + m - slowest - u
                    if 0 <= x < X and 0 <= y < Y:
                        value = table[m + 1, u - state[0] + 1] * (
                            table[n + 1, w - state[1] + 1] * previous[u, w, x, y]
                        )
                        if value > best:
                            best, found = value, (u, w, x, y)
    return found


@kernel
def _write(path, k, state):
    for c in range(4):
        path[k, c] = state[c]


@kernel
def _path(I, state, position, velocity, slowest, additive):
    path = np.full((len(I), 4), -1)
    _write(path, len(I) - 1, state)
    for k in range(len(I) - 2, -1, -1):
        state = _predecessor(I[k], state, position, velocity, slowest, additive)
        if state[0] < 0:
            break
        _write(path, k, state)
    return path


def weighted_path_spec(I, state, position, velocity, slowest):
    """Specification of :func:`weighted_path`: argmax over the list of all predecessors, frame by
    frame.
    """
    return _path_of(I, state, _nan_where_zero(np.outer(position, velocity)), slowest, np.multiply)


@kernel
def weighted_path(I, state, position, velocity, slowest):
    """Eqs. (13), (19): the best path that ends in ``state``, under box_forward (velocity = ones(1))
    or weighted_forward.

    I : (K, V, V, X, Y) value maps of K frames, of which the last one is not looked at; state : (iv,
        jv, i, j) in frame K, i and j counted in the margin layout.  Returns states of the same
        form, (K, 4) of int; four times -1 from where no predecessor can be reached.
    """
    return _path(I, state, position, velocity, slowest, np.bool_(False))


def penalised_path_spec(I, state, position, velocity, slowest):
    """Specification of :func:`penalised_path`: argmax over the list of all predecessors, frame by
    frame.
    """
    return _path_of(I, state, np.add.outer(position, velocity), slowest, np.subtract)


@kernel
def penalised_path(I, state, position, velocity, slowest):
    """The best path that ends in ``state`` under penalised_forward; see :func:`weighted_path`."""
    return _path(I, state, position, velocity, slowest, np.bool_(True))


def coupled_path_spec(I, state, table, slowest):
    """Specification of :func:`coupled_path`: argmax over the list of all predecessors, frame by
    frame.
    """
    return _path_of(I, state, table, slowest, np.multiply)


@kernel
def coupled_path(I, state, table, slowest):
    """The best path that ends in ``state`` under coupled_forward; see :func:`weighted_path`."""
    path = np.full((len(I), 4), -1)
    _write(path, len(I) - 1, state)
    for k in range(len(I) - 2, -1, -1):
        state = _coupled_predecessor(I[k], state, table, slowest)
        if state[0] < 0:
            break
        _write(path, k, state)
    return path
