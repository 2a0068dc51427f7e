"""Multiple-model particle filter: log-ratios of a Gaussian image, regimes, births, resampling.

Source: Miao and Chen.  A frame is an array of cells ``z`` (n_x, n_y); **the first axis is the first
index of the paper** (x), the second is the second (y).  The paper counts cells from 1, arrays from
0: cell (i, j) is ``z[i - 1, j - 1]``.  The target is a blob h of known amplitude in normal noise of
standard deviation sigma.

Cells are independent, and one that the target does not reach has the same factor under both
hypotheses: the likelihood ratio is a product over a patch around the target, 1 outside the frame.
The log-ratio of one cell is h (2 z - h) / (2 sigma**2).  Summed over the patch it is normal too,
with mean +d**2/2 if the target is there and -d**2/2 if not, and variance d**2, where
d**2 = sum h**2 / sigma**2 is the energy that a matched filter collects.

Whether there is a target and which law it follows is a Markov chain, one row of ``Pi`` per regime
it comes from.  ``transition`` moves many particles in one pass, first the regime, by one uniform
draw each, then the state [x, vx, y, vy, omega] by that regime: 0 absent (the state is left alone),
1 constant velocity, 2 coordinated turn with the particle's own rate.  ``box_states`` draws states
from a law of birth that is a box in position and velocity.  ``resample`` draws the particles that
are kept, copies them and takes their mean.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from tbdcore.checks import (
    LARGEST,
    Array,
    ArrayLike,
    Flag,
    Integer,
    Integers,
    Number,
    Numbers,
    Sizes,
    checked,
    fits_memory,
)
from tbdcore.jit import kernel
from tbdcore.motion import coordinated_turn
from tbdcore.particles import systematic

__all__ = [
    "Resampled",
    "blob_image",
    "blob_log_ratio",
    "blob_peak",
    "box_states",
    "check_transitions",
    "resample",
    "transition",
]

HIGH = 1e50  # largest value in a frame, and largest intensity: products stay finite
Positive = Annotated[float, Number(1e-9, 1e9)]
Peak = Annotated[float, Number(-HIGH, HIGH)]
Shape = Annotated[ArrayLike, Sizes(2)]  # (n_x, n_y)
Frame = Annotated[ArrayLike, Numbers("n_x", "n_y", low=-HIGH, high=HIGH, single=True)]
States = Annotated[ArrayLike, Numbers("N", "d", low=None)]
Regimes = Annotated[ArrayLike, Integers("N", low=0, high=2)]
Deviation = Annotated[float, Number(1.0 / HIGH, HIGH)]
Place = Annotated[ArrayLike, Numbers(..., nan=True)]


# Gaussian image: a blob of known amplitude in normal noise
@checked
def blob_peak(
    intensity: Annotated[float, Number(0.0, HIGH)],
    blur: Positive,
    delta: Annotated[float, Number(0.0, 1e9)] = 1.0,
) -> float:
    """Amplitude of the blob's centre, delta**2 I / (2 pi blur**2), intensity I, cell size delta."""
    return delta * delta * intensity / (2.0 * math.pi * blur * blur)


@checked
def blob_image(x: Place, y: Place, peak: Peak, blur: Positive, shape: Shape) -> Array:
    """Noise-free frames h of a Gaussian blob: (n_x, n_y), or (K, n_x, n_y) for K positions.

    x, y : numbers or (K,), in cells, counted from 1; NaN: no target, h = 0.
    peak : amplitude at the centre; blur : standard deviation in cells; shape : (n_x, n_y).
    """
    if x.shape != y.shape or x.ndim > 1:
        raise ValueError(f"blob_image: y: shape {y.shape}, x {x.shape}; give two numbers or (K,)")
    fits_memory("mm_pf_tbd.blob_image: shape", x.size, *shape.tolist())
    g = []
    for v, n in zip((x, y), shape, strict=True):
        d = np.arange(1, n + 1) - v[..., None]
        g.append(np.exp(-(d**2) / (2.0 * blur * blur)))
    return np.nan_to_num(peak * g[0][..., :, None] * g[1][..., None, :], nan=0.0)


@kernel
def _blob_exponents(S, r, nx, ny, blur, decay):
    """Particles whose patch has cells in the frame; arguments (n, 3) of their exponentials."""
    present = np.empty(r.size, np.int64)
    m = 0
    for n in range(r.size):
        x = S[n, 0]
        y = S[n, 2]
        present[np.uint64(m)] = n  # the next one overwrites it, unless it counts: no branch
        m += (r[n] != 0) & (x >= -1.5) & (x < nx + 2.5) & (y >= -1.5) & (y < ny + 2.5)
        if (r[n] != 0) & ((x != x) | (y != y)):
            raise ValueError("mm_pf_tbd.blob_log_ratio: S: NaN in a position that is present")
    present = present[:m]
    g = np.empty((m, 3))
    for k in range(m):
        n = np.uint64(present[k])
        dx = np.floor(S[n, 0] + 0.5) - S[n, 0]
        dy = np.floor(S[n, 2] + 0.5) - S[n, 2]
        g[k, 0] = -0.5 / (blur * blur) * (dx * dx + dy * dy)
        g[k, 1] = -decay * dx
        g[k, 2] = -decay * dy
    return present, g


@kernel
def _five_weights(up, down, one, two):
    """g of the cells -2, -1, 1 and 2 beside the nearest one, in units of its own g.

    up, down : exp(-d / b**2) and its inverse; one, two : exp(-m**2 / 2 b**2) for m = 1, 2
    """
    return down * down * two, down * one, up * one, up * up * two


@kernel
def _row_sum(z, i, j, w):
    """Five cells of row i from column j on, with the weights w; the middle one has weight 1."""
    row = np.uint64(i)  # unsigned: no test for indices below 0
    near = w[0] * z[row, np.uint64(j)] + w[1] * z[row, np.uint64(j + 1)] + z[row, np.uint64(j + 2)]
    return near + w[2] * z[row, np.uint64(j + 3)] + w[3] * z[row, np.uint64(j + 4)]


@kernel
def _blob_sums(z, S, present, g, decay, peak, noise):
    """The log-ratios (N,): the two sums of :func:`blob_log_ratio`; 0 of particles not present.

    present : indices of the particles with a cell in the frame
    g : (n, 3) g_i g_j of the nearest cell, exp(-d / b**2) of the rows, and of the columns

    Both sums are in units of the nearest cell's g_i g_j, which is ``centre``.  The five weights of
    an axis, x of the rows and y of the columns, are then 1 in the middle:
    match is the sum of x_i (sum of y_j z_ij), energy (sum of x_i**2) (sum of y_j**2).  Only cells
    in the frame count: ``framed`` is z in a margin of zeros, ``inside`` 1 in the frame, else 0.
    """
    nx, ny = z.shape
    one = math.exp(-0.5 * decay)
    two = math.exp(-2.0 * decay)
    framed = np.zeros((nx + 8, ny + 8))  # a margin of 4: as far as a patch can reach
    for i, j in np.ndindex(nx, ny):  # a slice would take two seconds more to compile
        framed[i + 4, j + 4] = z[i, j]
    inside = np.zeros((2, max(nx, ny) + 8))
    for k in range(4, inside.shape[1]):
        inside[0, k] = k < nx + 4
        inside[1, k] = k < ny + 4
    out = np.zeros(len(S))
    for m in range(present.size):
        n = np.uint64(present[m])
        i = math.floor(S[n, 0] + 0.5) + 1  # first row and column of the patch in ``framed``
        j = math.floor(S[n, 2] + 0.5) + 1
        both = 1.0 / (g[m, 1] * g[m, 2])  # one division for two inverses
        x = _five_weights(g[m, 1], both * g[m, 2], one, two)
        y = _five_weights(g[m, 2], both * g[m, 1], one, two)
        match = x[0] * _row_sum(framed, i, j, y)
        match += x[1] * _row_sum(framed, i + 1, j, y)
        match += x[2] * _row_sum(framed, i + 3, j, y) + x[3] * _row_sum(framed, i + 4, j, y)
        match += _row_sum(framed, i + 2, j, y)
        energy = _row_sum(inside, 0, i, (x[0] * x[0], x[1] * x[1], x[2] * x[2], x[3] * x[3]))
        energy *= _row_sum(inside, 1, j, (y[0] * y[0], y[1] * y[1], y[2] * y[2], y[3] * y[3]))
        centre = g[m, 0]
        out[n] = peak * centre * (match - 0.5 * peak * centre * energy) / (noise * noise)
    return out


@checked
def blob_log_ratio(
    z: Frame, S: States, r: Regimes, peak: Peak, blur: Positive, noise: Deviation
) -> Array:
    """Log-likelihood ratio (N,) of the 5 x 5 patch around each particle: target against noise only.

    z : (n_x, n_y) frame; S : (N, d) states, x in column 0 and y in column 2, in cells
    r : (N,) regimes 0 (absent), 1 and 2; log-ratio 0 where absent, or no cell of the patch is in
        the frame.  NaN in the position of a particle that is present is a ValueError.
    peak, blur, noise : amplitude and standard deviation of the blob, standard deviation of z

    The patch misses 1e-7 of the energy at a blur of 0.6 cells, 0.2 % at one.  The sum is
    (peak sum g_i g_j z_ij - peak**2 / 2 sum g_i**2 sum g_j**2) / noise**2,  and g, with d the
    offset to the nearest cell, m cells further exp(-d**2 / 2b**2) * exp(-d / b**2)**m *
    exp(-m**2 / 2b**2): three exponentials serve 25 cells.
    """
    if S.shape[1] < 3:
        raise ValueError("blob_log_ratio: S: give (N, d), x in column 0 and y in column 2")
    # exp(decay) must be finite: _five_weights has exp(-d / b**2)**2, |d| up to 0.5
    decay = min(1.0 / (blur * blur), 700.0)  # a sharper blob has 1e-38 of its peak beyond its cell
    nx, ny = z.shape
    present, g = _blob_exponents(S, r, nx, ny, blur, decay)
    np.exp(g, out=g)  # NumPy's takes a fifth of the time of a compiled loop's
    return _blob_sums(z, S, present, g, decay, peak, noise)


@checked
def check_transitions(Pi: Annotated[ArrayLike, Numbers("n", "n", low=0.0, high=1 + 1e-9)]) -> Array:
    """Pi as a float array; ValueError unless its rows are probabilities that sum to 1."""
    for a, row in enumerate(Pi):
        if abs(row.sum() - 1.0) > 1e-9:
            raise ValueError(
                f"mm_pf_tbd.check_transitions: Pi[{a}]: {row.tolist()} do not sum to 1"
            )
    if not Pi.size:
        raise ValueError("mm_pf_tbd.check_transitions: Pi is empty; give a row for each regime")
    return Pi


@kernel
def _turn_rate(v, turns):
    """Turn rate at length v of two intervals (2, 2), measured from the start of the first."""
    (low, left), (right, _) = turns[0], turns[1]
    return low + v if v <= left else right + v - left


@kernel
def _total_width(turns):
    """Both widths of the intervals turns (2, 2) = (lower end, width); ValueError if it has none."""
    valid, total = True, 0.0
    for low, width in turns:
        valid &= abs(low) < np.inf and 0.0 <= width < np.inf
        total += width
    if not valid:
        raise ValueError(
            "mm_pf_tbd: turns, or the end of law, is no pair of intervals; give (lower end, width)"
        )
    return total


def box_states_spec(u, law):
    """Specification of :func:`box_states`: quantiles of uniform laws."""
    low, width = law.T
    lengths = np.concatenate([[0.0], np.cumsum(width[4:])])
    ends = np.column_stack([low, low + width])[4:].ravel()
    turns = np.interp(u[4] * lengths[-1], np.repeat(lengths, 2)[1:-1], ends)
    return np.column_stack([np.outer(u[d], width[d]) + low[d] for d in range(4)] + [turns])


@checked
@kernel
def box_states(
    u: Annotated[ArrayLike, Numbers(5, "n", low=None)],
    law: Annotated[ArrayLike, Numbers(6, 2, low=None)],
) -> Array:
    """States (n, 5) = [x, vx, y, vy, omega] of uniform laws, from uniform draws u (5, n).

    A NaN in u is one in the state.
    law : (6, 2) lower end and width of the intervals of x, vx, y and vy, and of two intervals of
        the turn rate, which are chosen in proportion to their widths
    """
    S, turns = np.empty((u.shape[1], 5)), law[4:]
    both = _total_width(turns)
    for d in range(4):
        if not abs(law[d, 0]) + abs(law[d, 1]) < np.inf:
            raise ValueError("mm_pf_tbd.box_states: NaN or infinity in law; give finite intervals")
    for n in range(len(S)):
        for d in range(4):
            S[n, d] = law[d, 0] + law[d, 1] * u[d, n]
        S[n, 4] = _turn_rate(u[4, n] * both, turns)
    return S


def transition_spec(r, S, Pi, T, u, a, turns, redraw):
    """Specification of :func:`transition`: cumulative rows, lengths, one matrix per particle."""
    after, born = np.zeros_like(r), []
    for n, before in enumerate(r):
        ends = np.concatenate([[0.0], np.cumsum(Pi[before])])
        after[n] = (u[n] >= ends[1:-1]).sum()
        if after[n] and redraw and before == 0:
            born.append(n)
        elif after[n]:
            if (before, after[n]) == (1, 2):
                low, width = turns.T
                v = np.interp(u[n], [ends[2], 1.0], [0.0, width.sum()])
                lengths = np.concatenate([[0.0], np.cumsum(width)])
                rates = np.column_stack([low, low + width]).ravel()
                S[n, 4] = np.interp(v, np.repeat(lengths, 2)[1:-1], rates)
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
    r: Regimes,
    S: Annotated[Array, Numbers("N", 5, low=None, in_place=True)],
    Pi: Annotated[ArrayLike, Numbers(3, 3, low=None)],
    T: Annotated[float, Number()],
    u: Annotated[ArrayLike, Numbers("N", low=None)],
    a: Annotated[ArrayLike, Numbers("N", 2, low=None)],
    turns: Annotated[ArrayLike, Numbers(2, 2, low=None)],
    redraw: Annotated[bool, Flag()],
) -> tuple[Array, Array, Array]:
    """One frame of the chain and of the motion: regimes (N,), indices of the born (B,), states.

    r : (N,) regimes; S : (N, 5) states [x, vx, y, vy, omega], moved **in place**, NaN stays NaN
    Pi : (3, 3) transition probabilities, rows from; T : seconds
    u : (N,) uniform draws in [0, 1); a : (N, 2) accelerations, constant during the step
    turns : (2, 2) lower end and width of two intervals of the turn rate, which is drawn where a
        turn begins, 1 -> 2, from the rest of the draw that chose the turn
    redraw : if True, the born are not moved, the caller draws their states; if False they go on
        from the state they have, and the list of the born is empty
    """
    for p, q, w in Pi:
        if not (min(p, q, w) >= 0.0 and abs(p + q + w - 1.0) <= 1e-9):
            raise ValueError("mm_pf_tbd.transition: a row of Pi is negative or does not sum to 1")
    both = _total_width(turns)
    after, is_born = np.empty_like(r), np.zeros(r.size, np.bool_)
    for n in range(r.size):
        before = r[n]
        if not 0.0 <= u[n] < 1.0:
            raise ValueError("mm_pf_tbd.transition: a draw u is not in [0, 1)")
        now = int(u[n] >= Pi[before, 0]) + int(u[n] >= Pi[before, 0] + Pi[before, 1])
        after[n], is_born[n] = now, redraw and before == 0 and now > 0
    for n in range(r.size):
        if is_born[n]:
            continue
        if after[n] == 1:
            _move(S, n, T, 0.0, 1.0, 0.0, T, a)
        elif after[n] == 2:
            if r[n] == 1:
                second = Pi[1, 0] + Pi[1, 1]
                S[n, 4] = _turn_rate((u[n] - second) / (1.0 - second) * both, turns)
            h = 0.5 * S[n, 4] * T
            sh, ch = math.sin(h), math.cos(h)
            f = T * sh / h if h != 0.0 else T
            _move(S, n, f * ch, f * sh, 1.0 - 2.0 * sh * sh, 2.0 * sh * ch, T, a)
    return after, np.flatnonzero(is_born), S


class Resampled(NamedTuple):
    """The particles that are kept, and what they say: equations (11) and (12) of Miao and Chen."""

    ancestors: Array  # (M,) indices of the copied particles, ascending
    r: Array  # (M,) regimes 0 (absent), 1 and 2
    S: Array  # (M, d) states
    counts: Array  # (3,) particles in each regime
    mean: Array  # (d,) mean state of those present, NaN if none is
    distinct: int  # different particles among those present


@kernel
def _copies(r, S, ancestors):
    """The particles that ``ancestors`` (M,), ascending, tell to keep."""
    M, d = ancestors.size, S.shape[1]
    regimes, states = np.empty(M, r.dtype), np.empty((M, d))
    counts, total = np.zeros(3, np.int64), np.zeros(d)
    distinct, before = 0, -1
    for m in range(M):
        n = np.uint64(ancestors[m])  # unsigned: no test for indices below 0
        a = regimes[m] = r[n]
        counts[a] += 1
        distinct += (a > 0) & (ancestors[m] != before)
        before = ancestors[m]
        for i in range(d):
            v = states[m, i] = S[n, i]
            total[i] += v if a > 0 else 0.0
    mean = total / (M - counts[0])
    return Resampled(ancestors, regimes, states, counts, mean, distinct)


@checked
def resample(
    r: Regimes,
    S: Annotated[ArrayLike, Numbers("N", "d", low=None)],
    W: Annotated[ArrayLike, Numbers("N", low=None)],
    M: Annotated[int, Integer(0, LARGEST)],
    u: Annotated[float, Number(0.0, 1.0 - 2.0**-53)],
) -> Resampled:
    """M copies of particles, by systematic resampling: :class:`Resampled`.

    r : (N,) regimes 0 (absent), 1 and 2; S : (N, d) states; u : offset in [0, 1), one draw
    W : (N,) weights, finite, none negative, one at least positive; they need not sum to one
    """
    return _copies(r, S, systematic(W, M, u))
