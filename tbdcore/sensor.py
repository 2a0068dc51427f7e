"""Sensor: what a frame of cells looks like, and what it says about a target.

A frame is an array of cells ``z`` of shape (n_x, n_y), or (K, n_x, n_y) for K frames in a row;
**the first axis is the first index of the paper** (x, or range), the second is the second (y, or
azimuth).  Papers count cells from 1, arrays from 0: cell (i, j) is ``z[i - 1, j - 1]``.

Gaussian image     a blob h of known amplitude in normal noise of standard deviation sigma
Point target       all of the target's signal in one cell; any noise, standard normal in the paper
Range and azimuth  power of a Gaussian blob of unknown amplitude in noise of exponential power

Each section has a simulated frame and the log-likelihood ratio of "target at this state" against
"noise only".  Cells are independent, and one that the target does not reach has the same factor
under both hypotheses: the ratio is a product over a patch around the target, 1 outside the frame.
NaN, shapes that do not fit and values out of range are a ValueError.

For a known signal h and normal noise the log-ratio of one cell is h (2 z - h) / (2 sigma**2).
Summed over the patch it is normal too, with mean +d**2/2 if the target is there and -d**2/2 if not,
and variance d**2, where d**2 = sum h**2 / sigma**2 is the energy that a matched filter collects.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.special import i0e, i1e

from tbdcore import checks
from tbdcore.jit import kernel

HIGH = 1e50  # largest value in a frame, and largest intensity: products stay finite

# Gaussian image: a blob of known amplitude in normal noise


def blob_peak(intensity, blur, delta=1.0):
    """Amplitude of the blob's centre, delta**2 I / (2 pi blur**2), intensity I, cell size delta."""
    checks.number("intensity", intensity, 0.0, HIGH)
    checks.number("blur", blur, 1e-9, 1e9)
    checks.number("delta", delta, 0.0, 1e9)
    return delta * delta * intensity / (2.0 * math.pi * blur * blur)


def blob_image(x, y, peak, blur, shape):
    """Noise-free frames h of a Gaussian blob: (n_x, n_y), or (K, n_x, n_y) for K positions.

    x, y : numbers or (K,), in cells, counted from 1; NaN: no target, h = 0.
    peak : amplitude at the centre; blur : standard deviation in cells; shape : (n_x, n_y).
    """
    checks.number("peak", peak, -HIGH, HIGH)
    checks.number("blur", blur, 1e-9, 1e9)
    g = []
    for v, n in zip((x, y), shape, strict=True):
        d = np.arange(1, n + 1) - np.asarray(v, float)[..., None]
        g.append(np.exp(-(d**2) / (2.0 * blur * blur)))
    return np.nan_to_num(peak * g[0][..., :, None] * g[1][..., None, :], nan=0.0)


def blob_log_ratio_spec(z, S, r, peak, blur, noise):
    """Every cell, and a mask for the patch."""
    out = np.zeros(len(r))
    i, j = (np.arange(1, n + 1) for n in z.shape)
    for n in np.flatnonzero(r):
        x, y = S[n, 0], S[n, 2]
        near = np.outer(np.abs(i - np.floor(x + 0.5)) <= 2, np.abs(j - np.floor(y + 0.5)) <= 2)
        h = peak * np.exp(-np.add.outer((i - x) ** 2, (j - y) ** 2) / (2 * blur**2))
        out[n] = (h * (2 * z - h) / (2 * noise**2))[near].sum()
    return out


@kernel
def _row_match(z, i, j, w1, w2, w4, w5):
    """Five cells of row i from column j on, weighted; the middle one by 1."""
    row = np.uint64(i)  # unsigned: no test for indices below 0
    near = w1 * z[row, np.uint64(j)] + w2 * z[row, np.uint64(j + 1)] + z[row, np.uint64(j + 2)]
    return near + w4 * z[row, np.uint64(j + 3)] + w5 * z[row, np.uint64(j + 4)]


@kernel
def _blob_exponents(S, r, nx, ny, half, tail):
    """Particles whose patch has cells in the frame; arguments (n, 3) of their exponentials."""
    present, m = np.empty(r.size, np.int64), 0
    for n in range(r.size):
        x, y = S[n, 0], S[n, 2]
        present[np.uint64(m)] = n  # the next one overwrites it, unless it counts: no branch
        m += (r[n] != 0) & (x >= -1.5) & (x < nx + 2.5) & (y >= -1.5) & (y < ny + 2.5)
        if (r[n] != 0) & ((x != x) | (y != y)):
            raise ValueError("states: NaN in the position of a particle that is present")
    present, g = present[:m], np.empty((m, 3))
    for k in range(present.size):
        n = np.uint64(present[k])
        x, y = S[n, 0], S[n, 2]
        dx, dy = np.floor(x + 0.5) - x, np.floor(y + 0.5) - y
        g[k, 0], g[k, 1], g[k, 2] = -half * (dx * dx + dy * dy), -tail * dx, -tail * dy
    return present, g


@kernel
def _blob_sums(z, S, present, g, tail, peak, noise):
    """The log-ratios (N,), from the exponentials g of those particles; 0 for the others."""
    (nx, ny), one, two = z.shape, math.exp(-0.5 * tail), math.exp(-2.0 * tail)
    framed, out = np.zeros((nx + 8, ny + 8)), np.zeros(len(S))
    inside = np.zeros((2, max(nx, ny) + 8))  # 1 in the frame: no energy is expected beyond the edge
    for i, j in np.ndindex(nx, ny):  # a slice would take two seconds more to compile
        framed[i + 4, j + 4] = z[i, j]
    for k in range(4, inside.shape[1]):
        inside[0, k], inside[1, k] = k < nx + 4, k < ny + 4
    for m in range(present.size):
        n, centre, up_x, up_y = np.uint64(present[m]), g[m, 0], g[m, 1], g[m, 2]
        i, j = math.floor(S[n, 0] + 0.5) + 1, math.floor(S[n, 2] + 0.5) + 1
        both = 1.0 / (up_x * up_y)
        down_x, down_y = both * up_y, both * up_x  # 1 / up_x and 1 / up_y
        x1, x2, x4, x5 = down_x * down_x * two, down_x * one, up_x * one, up_x * up_x * two
        y1, y2, y4, y5 = down_y * down_y * two, down_y * one, up_y * one, up_y * up_y * two
        match = x1 * _row_match(framed, i, j, y1, y2, y4, y5)
        match += x2 * _row_match(framed, i + 1, j, y1, y2, y4, y5)
        far = x4 * _row_match(framed, i + 3, j, y1, y2, y4, y5)
        match += far + x5 * _row_match(framed, i + 4, j, y1, y2, y4, y5)
        match += _row_match(framed, i + 2, j, y1, y2, y4, y5)
        energy = _row_match(inside, 0, i, x1 * x1, x2 * x2, x4 * x4, x5 * x5)
        energy *= _row_match(inside, 1, j, y1 * y1, y2 * y2, y4 * y4, y5 * y5)
        out[n] = peak * centre * (match - 0.5 * peak * centre * energy) / (noise * noise)
    return out


def blob_log_ratio(z, S, r, peak, blur, noise):
    """Log-likelihood ratio (N,) of the 5 x 5 patch around each particle: target against noise only.

    z : (n_x, n_y) frame; S : (N, d) states, x in column 0 and y in column 2, in cells
    r : (N,) regimes, 0 absent; log-ratio 0 where absent, or no cell of the patch is in the frame
    peak, blur, noise : amplitude and standard deviation of the blob, standard deviation of z

    The patch misses 1e-7 of the energy at a blur of 0.6 cells, 0.2 % at one.  The sum is
    (peak sum g_i g_j z_ij - peak**2 / 2 sum g_i**2 sum g_j**2) / noise**2,  and g, with d the
    offset to the nearest cell, m cells further exp(-d**2 / 2b**2) * exp(-d / b**2)**m *
    exp(-m**2 / 2b**2): three exponentials serve 25 cells.
    """
    z = checks.within("frame", checks.reals("frame", z, "n_x", "n_y"), -HIGH, HIGH)
    S, r = checks.reals("states", S, "N", "d"), checks.integers("regimes", r, len(S))
    if S.shape[1] < 3:
        raise ValueError("states: give (N, d), x in column 0 and y in column 2")
    checks.number("peak", peak, -HIGH, HIGH)
    checks.number("blur", blur, 1e-9, 1e9)
    checks.number("noise", noise, 1.0 / HIGH, HIGH)
    tail = min(1.0 / (blur * blur), 700.0)  # a sharper blob has 1e-38 of its peak beyond its cell
    present, g = _blob_exponents(S, r, *z.shape, 0.5 / (blur * blur), tail)
    np.exp(g, out=g)  # NumPy's takes a fifth of the time of a compiled loop's
    return _blob_sums(z, S, present, g, tail, float(peak), float(noise))


# Point target: all of the signal in one cell


def point_amplitude(snr_db, sigma=1.0):
    """Amplitude A of a point target of SNR 10 log10(A**2 / sigma**2) dB; sigma: of the noise."""
    return sigma * 10.0 ** (np.asarray(snr_db, float) / 20.0)


def point_frames(noise, cells, amplitude):
    """Frames z (K, n_x, n_y): noise w, A + w in the target's cell (Wan, Wang and Wu 2013, eq. 1).

    noise : (K, n_x, n_y), not changed; the result has its type
    cells : (K, 2) of int, the target's cell in each frame, **counted from 0**
    amplitude : A, or (K,), in the noise's unit
    """
    noise = checks.reals("point_frames: noise", noise, "K", "n_x", "n_y")
    K, shape, amplitude = len(noise), noise.shape[1:], np.asarray(amplitude, float)
    cells = checks.integers("point_frames: cells", cells, K, 2)
    if amplitude.shape not in ((), (K,)) or not np.isfinite(amplitude).all():
        raise ValueError("point_frames: amplitude is not finite; give a number or (K,)")
    for k in np.flatnonzero(((cells < 0) | (cells >= shape)).any(axis=1)):
        raise ValueError(f"point_frames: cells[{k}] is {cells[k].tolist()}, outside {shape}")
    z = noise.copy()
    z[np.arange(K), cells[:, 0], cells[:, 1]] += amplitude
    return z


# Range and azimuth: a point of unknown intensity in exponential power


class PolarGrid(NamedTuple):
    """Cells of a range-azimuth frame: lower ends and sizes (m, rad), numbers of cells."""

    r_min: float
    a_min: float
    dr: float
    da: float
    nr: int
    na: int


class Spread(NamedTuple):
    """A point-spread function: power exp(-lr d**2 - la e**2), d cells off in range, e in azimuth.

    lr, la : decay of the *power* per squared cell, (L/R) delta**2 of each axis.
    hr, ha : half widths of the patch that a likelihood reads, (2 hr + 1) x (2 ha + 1) cells.
    """

    lr: float
    la: float
    hr: int
    ha: int


def polar_grid(r_min, r_max, a_min, a_max, dr, da):
    """The grid of a region of whole cells; r in m, a in rad, at most a circle."""
    if not (abs(a_min) <= 2 * math.pi and a_max - a_min <= 2 * math.pi + 1e-9):
        raise ValueError(f"azimuth: {a_min:g} to {a_max:g} rad; give radians, at most a circle")
    if not (0.0 < dr < math.inf and 0.0 < da < math.inf):
        raise ValueError(f"cell size: dr = {dr} m, da = {da} rad; both must be positive")
    counts = (r_max - r_min) / dr, (a_max - a_min) / da
    for axis, count in zip(("range", "azimuth"), counts, strict=True):
        if not 0.5 < count < 1e9 or abs(count - round(count)) > 1e-6:
            raise ValueError(f"{axis}: the region has {count:g} cells; it must be a whole number")
    return PolarGrid(r_min, a_min, dr, da, round(counts[0]), round(counts[1]))


def polar_cells(x, y, grid):
    """Cell coordinates (rho, alpha) of positions in m; cell (i, j) is centred at (i, j), one wide.

    Azimuths are those within half a turn of the middle of the region.
    """
    x = np.asarray(x, float) + 0.0  # a copy, without negative zeros
    y = checks.reals("y", np.asarray(y, float) + 0.0, *x.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.arctan(x / y)
    out = np.empty((2, *x.shape))
    _cells(x.reshape(-1), y.reshape(-1), angle.reshape(-1), grid, out.reshape(2, -1))
    return out


@kernel
def _cells(x, y, angle, grid, out):
    """The loop of :func:`polar_cells`; angle : arctan(x / y)."""
    r_min, a_min, dr, da, _, na = grid
    for n in range(x.size):
        a = 0.5 * np.pi - angle[n] - np.pi * (y[n] < 0.0) - a_min
        turns = np.rint((a - 0.5 * na * da) / (2.0 * np.pi))
        out[0, n] = (math.sqrt(x[n] * x[n] + y[n] * y[n]) - r_min) / dr + 0.5
        out[1, n] = (a - 2.0 * np.pi * turns) / da + 0.5


def spread_power(rho, alpha, spread, shape):
    """h**2 (nr, na) of a point at (rho, alpha): equation (6) squared, on every cell."""
    d, e = (np.arange(1, n + 1) - v for n, v in zip(shape, (rho, alpha), strict=True))
    return np.exp(-spread.lr * d**2)[:, None] * np.exp(-spread.la * e**2)


def _check_spread(spread):
    """Raise ValueError unless the decays are positive and the half widths whole numbers."""
    for name in ("lr", "la"):
        checks.number(f"spread: {name}", getattr(spread, name), 1e-9, 1e9)
    for name in ("hr", "ha"):
        if checks.integer(f"spread: {name}", getattr(spread, name), 0) > 10_000:
            raise ValueError(f"spread: {name} = {getattr(spread, name)} cells; at most 10000")


def footprint(spread):
    """Cells that the point-spread function is worth, the integral of h**2: pi / sqrt(lr la)."""
    _check_spread(spread)
    return math.pi / math.sqrt(spread.lr * spread.la)


@kernel
def _exponentials(cells, rng):
    for n in range(cells.size):
        cells[n] = rng.standard_exponential(dtype=np.float32)


def noise_power(shape, rng):
    """Frames of noise power in units of its mean: float32, as rng.standard_exponential draws."""
    z = np.empty(shape, np.float32)  # by NumPy, for its large memory pages
    _exponentials(z.reshape(-1), rng)
    return z


def _target_cells(rho, alpha, spread, shape):
    """Slices of the cells around a point in which h**2 is above 1e-16, and h**2 in them."""
    if not (0.5 <= rho < shape[0] + 0.5 and 0.5 <= alpha < shape[1] + 0.5):
        raise ValueError(f"target at cell ({rho:.1f}, {alpha:.1f}) is outside {shape}; move it")
    near, power = [], []
    for v, l, n in ((rho, spread.lr, shape[0]), (alpha, spread.la, shape[1])):
        half = math.sqrt(37.0 / l)
        near.append(slice(max(int(v - half), 0), min(int(v + half) + 1, n)))
        power.append(np.exp(-l * (np.arange(near[-1].start + 1, near[-1].stop + 1) - v) ** 2))
    return tuple(near), power[0][:, None] * power[1]


def add_target(z, rho, alpha, power, spread, rng):
    """Add a target to noise frames, in place: z = |A h + v|**2, one complex amplitude A per frame.

    z : (K, nr, na) noise power |v|**2 in units of its mean
    rho, alpha : (K,) place of the target in cells, NaN where there is none
    power : (K,) |A|**2 over the noise power
    rng : draws the angle between A h and v, uniform in every cell, since v is circular; None: cells
        are independent, equations (7) and (8), and power, (K,) or a number, is the mean of |A|**2
    """
    if checks.reals("frames", z, "K", "nr", "na") is not z:
        raise ValueError("frames: give an array of floats, which is changed in place")
    checks.reals("rho", rho, len(z)), checks.reals("alpha", alpha, len(z))
    power = checks.reals("power", np.broadcast_to(power, len(z)), len(z))
    there = np.flatnonzero(~np.isnan(rho))
    checks.within("power", power[there], 0.0, HIGH)
    for k in there:
        near, h2 = _target_cells(rho[k], alpha[k], spread, z.shape[1:])
        s, v2 = power[k] * h2, z[k][near]
        if rng is None:
            v2 *= 1.0 + s
        else:
            v2[:] = s + v2 + 2.0 * np.sqrt(s * v2) * np.cos(2.0 * np.pi * rng.random(s.shape))


def _polar(spread, z, rho, alpha, *snr, high=HIGH):
    """The arguments of a patch function as arrays; ValueError where they do not fit."""
    _check_spread(spread)
    z, rho = checks.reals("frame", z, "nr", "na"), checks.reals("rho", rho, "N")
    alpha = checks.reals("alpha", alpha, rho.size)
    snr = [checks.within("snr", checks.reals("snr", a, rho.size), -HIGH, HIGH) for a in snr]
    return checks.within("frame", z, 0.0, high), rho, alpha, *snr


def _patches(z, rho, alpha, spread):
    """For specifications: index, h**2 and cells of the patch of every particle on the frame."""
    z = z.astype(float)
    i, j = (np.arange(1, n + 1) for n in z.shape)
    for n, (r, a) in enumerate(zip(rho, alpha, strict=True)):
        if 0.5 <= r < z.shape[0] + 0.5 and 0.5 <= a < z.shape[1] + 0.5:
            d, e = i - np.floor(r + 0.5), j - np.floor(a + 0.5)
            near = np.outer(abs(d) <= spread.hr, abs(e) <= spread.ha)
            yield n, spread_power(r, a, spread, z.shape)[near], z[near]


@kernel
def _inside(rho, alpha, nr, na):
    """Whether a place is on the frame; NaN is not."""
    return 0.5 <= rho < nr + 0.5 and 0.5 <= alpha < na + 0.5


@kernel
def _gaussian(out, h, peak, tilt, fixed):
    """out[h + m] = peak tilt**m fixed[abs(m)]: no exponential per sample; 0 beyond ``fixed``."""
    middle, up, down, back = np.uint64(h), peak, peak, 1.0 / tilt
    for m in range(np.uint64(fixed.size)):  # unsigned, as in _row_match
        out[middle - m] = down * fixed[m]
        out[middle + m] = up * fixed[m]
        up *= tilt
        down *= back


@kernel
def _decays(spread):
    """exp(-l m**2) for m = 0 .. h, of both axes, as far as it is above 1e-300."""
    lr, la, hr, ha = spread
    fr, fa = np.exp(-lr * np.arange(hr + 1.0) ** 2), np.exp(-la * np.arange(ha + 1.0) ** 2)
    return fr[fr > 1e-300], fa[fa > 1e-300]


@kernel
def _exponents(rho, alpha, lr, la):
    """Logarithms (3, N) of h**2 in a particle's cell, and of the tilts of both axes."""
    out = np.empty((3, rho.size))
    for n in range(rho.size):
        d, e = rho[n] - np.floor(rho[n] + 0.5), alpha[n] - np.floor(alpha[n] + 0.5)
        out[0, n], out[1, n], out[2, n] = -lr * d * d - la * e * e, 2.0 * lr * d, 2.0 * la * e
    return out


def _tilts(rho, alpha, spread):
    """h**2 (N,) in the cell of each particle, and the tilts of both axes; (3, N)."""
    with np.errstate(over="ignore"):  # of a point so sharp that its other cells get nothing
        return np.exp(_exponents(rho, alpha, spread.lr, spread.la))


def power_log_ratio_spec(z, rho, alpha, snr, spread):
    """Specification of :func:`power_log_ratio`: sum of the log densities (7) over the patch."""
    out = np.full(len(rho), -np.inf)
    for n, h2, cells in _patches(z, rho, alpha, spread):
        mu = 1.0 + snr[n] * h2
        out[n] = (-np.log(mu) - cells / mu + cells).sum()
    return out


def power_log_ratio(z, rho, alpha, snr, spread):
    """Log-likelihood ratio (N,) of the patch around each particle, equation (17).

    z : (nr, na) frame of power in units of the noise power; rho, alpha : (N,) places in cells;
    snr : (N,) intensity over noise power.  Log-ratio 0 where snr is 0 or less; -inf off the frame
    (and at NaN), where the region of equations (22, 23) has no target.
    """
    z, rho, alpha, snr = _polar(spread, z, rho, alpha, snr)
    total, product = _power_log_ratio(z, rho, alpha, snr, _tilts(rho, alpha, spread), spread)
    return total - np.log(product)


@kernel
def _five_rows(i, last):
    """Rows i to i + 4, the last one instead of those beyond it; unsigned, as in _row_match."""
    a, b, c, d, e = min(i, last), min(i + 1, last), min(i + 2, last), min(i + 3, last), i + 4
    return np.uint64(a), np.uint64(b), np.uint64(c), np.uint64(d), np.uint64(min(e, last))


@kernel
def _five_cells(z, g, h):
    """One division for five cells: num / den = sum z s / (1 + s), den = prod (1 + s), s = g h."""
    num, den = z[0] * (g[0] * h), 1.0 + g[0] * h
    for r in range(1, 5):
        s = g[r] * h
        num, den = num * (1.0 + s) + den * z[r] * s, den * (1.0 + s)
    return num, den


@kernel
def _power_log_ratio(z, rho, alpha, snr, tilts, spread):
    """Sums (N,) of z s / (1 + s), s = snr h**2, and products (N,) of 1 + s, no logarithm yet."""
    (nr, na), (_, _, hr, ha), (fr, fa) = z.shape, spread, _decays(spread)
    gr, ga = np.zeros(2 * hr + 5), np.zeros(2 * ha + 1)
    total, product = np.zeros(rho.size), np.ones(rho.size)
    part, den = np.empty(ga.size), np.empty(ga.size)
    cell = _crowds(z, rho, alpha, snr, tilts, spread, total, product)
    for n in range(rho.size):  # the others, one by one
        if cell[n] < 0:
            continue
        top, left = cell[n] // na - hr, cell[n] % na - ha
        _gaussian(gr, hr, snr[n] * tilts[0, n], tilts[1, n], fr)
        _gaussian(ga, ha, 1.0, tilts[2, n], fa)
        end, ratio, many = min(top + 2 * hr + 1, nr), 0.0, 1.0
        gr[end - top : 2 * hr + 1] = 0.0
        low, high, shift = max(left, 0), min(left + ga.size, na), np.uint64(max(-left, 0))
        for i in range(max(top, 0), end, 5):
            row, m = _five_rows(i, end - 1), i - top
            g = gr[m], gr[m + 1], gr[m + 2], gr[m + 3], gr[m + 4]
            for k in range(np.uint64(high - low)):
                j = np.uint64(low) + k
                five = z[row[0], j], z[row[1], j], z[row[2], j], z[row[3], j], z[row[4], j]
                a, b = _five_cells(five, g, ga[shift + k])
                part[k], den[k] = a / b, b
            for k in range(high - low):
                if not many * den[k] < 1e300:
                    ratio, many = ratio - math.log(many), 1.0
                ratio += part[k]
                many *= den[k]
        total[n], product[n] = ratio, many
    return total, product


@kernel
def _lists(rho, alpha, snr, nr, na, total):
    """Cells (N,) of the particles to weigh, and lists of those of a cell: first, next; -1: none."""
    cell, after, first = np.full(rho.size, -1), np.empty(rho.size, np.int64), np.full(4096, -1)
    for n in range(rho.size):
        if not _inside(rho[n], alpha[n], nr, na):
            total[n] = -np.inf
        elif snr[n] > 0.0:
            cell[n] = (int(rho[n] + 0.5) - 1) * na + int(alpha[n] + 0.5) - 1
            slot = np.uint64(cell[n] % first.size)
            after[n], first[slot] = first[slot], n
    return cell, first, after


@kernel
def _lanes(out, h, peak, tilt, fixed, size):
    """Rows h + m of out as _gaussian, for the peaks and tilts of particles, a column for each."""
    up, down, back = peak.copy(), peak.copy(), 1.0 / tilt
    for m in range(fixed.size):
        f, above, below = fixed[m], out[h + m], out[h - m]
        for l in range(size):
            below[l], above[l] = down[l] * f, up[l] * f
            up[l] *= tilt[l]
            down[l] *= back[l]


@kernel
def _crowds(z, rho, alpha, snr, tilts, spread, total, product):
    """Where a cell has eight particles or more: all at once.  Cells (N,) of the others, else -1."""
    (nr, na), (_, _, hr, ha), (fr, fa) = z.shape, spread, _decays(spread)
    gr, ga, members = np.zeros((2 * hr + 5, 256)), np.zeros((2 * ha + 1, 256)), np.full(256, 0)
    ratio, many, ones = np.ones(256), np.ones(256), np.ones(256)  # of 256 particles at once
    peak, tr, ta = np.ones(256), np.ones(256), np.ones(256)
    cell, first, after = _lists(rho, alpha, snr, nr, na, total)
    for n in first:
        while n >= 0:
            here, size = cell[n], 0
            while n >= 0 and cell[n] == here and size < members.size:
                members[size], size, n = n, size + 1, after[n]
            if size < 8:
                continue
            top, left, whole = here // na - hr, here % na - ha, np.uint64(size + -size % 8)
            for l in range(whole):  # the last ones, up to a multiple of 8, only fill the vectors
                m = np.uint64(members[l])
                peak[l], tr[l], ta[l] = snr[m] * tilts[0, m], tilts[1, m], tilts[2, m]
                ratio[l], many[l] = 0.0, 1.0
            _lanes(gr, hr, peak, tr, fr, whole)
            _lanes(ga, ha, ones, ta, fa, whole)
            end = min(top + 2 * hr + 1, nr)
            gr[end - top : 2 * hr + 1] = 0.0
            for i in range(max(top, 0), end, 5):
                row, m = _five_rows(i, end - 1), i - top
                g = gr[m], gr[m + 1], gr[m + 2], gr[m + 3], gr[m + 4]
                for j in range(max(left, 0), min(left + 2 * ha + 1, na)):
                    k, h = np.uint64(j), ga[j - left]
                    five = z[row[0], k], z[row[1], k], z[row[2], k], z[row[3], k], z[row[4], k]
                    for l in range(whole):
                        gs = g[0][l], g[1][l], g[2][l], g[3][l], g[4][l]
                        a, b = _five_cells(five, gs, h[l])
                        ratio[l] += a / b
                        many[l] *= b
            for l in range(size):
                m = np.uint64(members[l])
                if many[l] < 1e300:  # else alone, with care
                    total[m], product[m], cell[m] = ratio[l], many[l], -1
    return cell


def cell_power_spec(z, rho, alpha):
    """Specification of :func:`cell_power`: the distance to every cell, and the nearest one."""
    i, j = (np.arange(1, n + 1) for n in z.shape)
    out = np.zeros(len(rho))
    for n, (r, a) in enumerate(zip(rho, alpha, strict=True)):
        holds = np.outer((i - 0.5 <= r) & (r < i + 0.5), (j - 0.5 <= a) & (a < j + 0.5))
        out[n] = z[holds].sum()
    return out


@checks.typed
@kernel
def cell_power(z, rho, alpha):
    """Power (N,) of the cell of z (nr, na) at each rho, alpha (N,) in cells, 0 off the frame."""
    (nr, na), out = z.shape, np.zeros(rho.size)
    if alpha.size != rho.size:
        raise ValueError("rho, alpha: give one place (rho, alpha) for each particle")
    for n in range(rho.size):
        if _inside(rho[n], alpha[n], nr, na):
            out[n] = z[int(rho[n] + 0.5) - 1, int(alpha[n] + 0.5) - 1]
    return out


def patch_fit_spec(z, rho, alpha, spread):
    """Specification of :func:`patch_fit`."""
    out = np.zeros((2, len(rho)))
    for n, h2, cells in _patches(z, rho, alpha, spread):
        out[:, n] = (h2 * (cells - 1.0)).sum(), (h2 * h2).sum()
    return out


def patch_fit(z, rho, alpha, spread):
    """sum h**2 (z - 1) and sum h**4 (2, N) over each particle's patch, 0 and 0 off the frame.

    Their quotient is the least-squares intensity over the noise power, of z = snr h**2 + 1.
    Arguments as in :func:`power_log_ratio`.
    """
    z, rho, alpha = _polar(spread, z, rho, alpha)
    return _patch_fit(z, rho, alpha, _tilts(rho, alpha, spread), spread)


@kernel
def _patch_fit(z, rho, alpha, tilts, spread):
    (nr, na), (_, _, hr, ha), (fr, fa) = z.shape, spread, _decays(spread)
    gr, ga, out = np.zeros(2 * hr + 1), np.zeros(2 * ha + 1), np.zeros((2, rho.size))
    for n in range(rho.size):
        if not _inside(rho[n], alpha[n], nr, na):
            continue
        top, left = int(rho[n] + 0.5) - 1 - hr, int(alpha[n] + 0.5) - 1 - ha
        _gaussian(gr, hr, tilts[0, n], tilts[1, n], fr)
        _gaussian(ga, ha, 1.0, tilts[2, n], fa)
        fit = energy = 0.0
        for i in range(max(top, 0), min(top + gr.size, nr)):
            for j in range(max(left, 0), min(left + ga.size, na)):
                h = gr[np.uint64(i - top)] * ga[np.uint64(j - left)]
                fit += h * (z[np.uint64(i), np.uint64(j)] - 1.0)
                energy += h * h
        out[0, n], out[1, n] = fit, energy
    return out


# One amplitude for the whole patch

_KNOTS, _END = 64, 32  # knots per unit of x, last x


@cache
def _bessel_table():
    """Coefficients (n, 4) of log I0 between knots: cubic Hermite, error below 1e-10."""
    from scipy.interpolate import CubicHermiteSpline  # needed only here

    x = np.arange(_END * _KNOTS + 1) / _KNOTS
    return CubicHermiteSpline(x * _KNOTS, np.log(i0e(x)) + x, i1e(x) / i0e(x) / _KNOTS).c.T.copy()


@kernel
def _log_bessel(x, table):
    """log I0(x), x >= 0: by the table, beyond it by a series (1e-8)."""
    if x < _END:
        return _cubic(x, table)
    t = 1.0 / (8.0 * x)
    series = 1.0 + t * (1.0 + t * (4.5 + t * (37.5 + t * 459.375)))
    return x - 0.5 * math.log(2.0 * math.pi * x) + math.log(series)


@kernel
def _cubic(x, table):
    """log I0(x), x below the last of the table."""
    i = np.uint64(x * _KNOTS)
    u = x * _KNOTS - i
    return table[i, 3] + u * (table[i, 2] + u * (table[i, 1] + u * table[i, 0]))


def coherent_log_ratio_spec(z, rho, alpha, snr, spread):
    """Specification of :func:`coherent_log_ratio`: a dense sum over the log of the common power."""
    out = np.full(len(rho), -np.inf)
    for n, h2, cells in _patches(z, rho, alpha, spread):
        p = snr[n] * np.geomspace(1e-12, 80.0 + 80.0 / snr[n], 5000)
        x = 2.0 * np.sqrt(np.outer(p, h2 * cells))
        f = np.log(p / snr[n]) - p / snr[n] + (np.log(i0e(x)) + x - np.outer(p, h2)).sum(axis=1)
        out[n] = f.max() + np.log(np.exp(f - f.max()).sum() * np.log(p[1] / p[0]))
    return out


@kernel
def _coherent(z, rho, alpha, snr, tilts, spread, step, table):
    """The loop of :func:`coherent_log_ratio`; spread : of the amplitude."""
    (nr, na), (_, _, hr, ha), (fr, fa) = z.shape, spread, _decays(spread)
    gr, ga, out = np.zeros(2 * hr + 1), np.zeros(2 * ha + 1), np.empty(rho.size)
    x = np.empty(gr.size * ga.size)
    for n in range(rho.size):
        inside = _inside(rho[n], alpha[n], nr, na)
        out[n] = 0.0 if inside else -np.inf
        if not inside or snr[n] <= 1e-300:
            continue
        top, left = int(rho[n] + 0.5) - 1 - hr, int(alpha[n] + 0.5) - 1 - ha
        _gaussian(gr, hr, tilts[0, n], tilts[1, n], fr)
        _gaussian(ga, ha, 1.0, tilts[2, n], fa)
        cells, energy = 0, 1.0 / snr[n]
        for i in range(max(top, 0), min(top + gr.size, nr)):
            for j in range(max(left, 0), min(left + ga.size, na)):
                h = gr[np.uint64(i - top)] * ga[np.uint64(j - left)]
                x[cells] = 2.0 * h * math.sqrt(z[i, j])
                energy, cells = energy + h * h, cells + 1
        # integral of 2 b / snr exp(-b**2 energy) prod I0(b x) over the amplitude b: midpoint rule,
        # with the slope at b = 0
        width, most = step / math.sqrt(energy), x[:cells].max()
        b, best, total = 0.5 * width, -np.inf, 0.0
        while True:
            term = -b * b * energy
            within = b * most < _END
            for c in range(cells):
                term += _cubic(b * x[c], table) if within else _log_bessel(b * x[c], table)
            if term > best:
                total, best = total * math.exp(best - term) + b, term
            else:
                total += b * math.exp(term - best)
                if not term >= best - 20.0:  # a NaN ends it too
                    break
            b += width
        total -= width / 24.0 * math.exp(-best)
        out[n] = best + math.log(2.0 * width / snr[n] * total)
    return out


def coherent_log_ratio(z, rho, alpha, snr, spread, step=0.8):
    """Log-likelihood ratio (N,) of each patch under equation (5): one amplitude in all its cells.

    Given |A|**2 = p sigma**2 the cells are independent, each with the density
    exp(-z - p h**2) I0(2 h sqrt(p z)); the Swerling 1 average over p, exponential with mean snr,
    couples them.  Arguments and limits as in :func:`power_log_ratio`; z at most 1e8.

    step : of the midpoint rule over the amplitude, in units of (1 / snr + sum h**2)**-0.5, 0.01 to
        2; error below 1e-4 at 0.25, 1e-2 at 0.8.
    """
    checks.number("step", step, 0.01, 2.0)
    arrays = _polar(spread, z, rho, alpha, snr, high=1e8)  # steps grow with the amplitude
    amplitude = Spread(0.5 * spread.lr, 0.5 * spread.la, spread.hr, spread.ha)
    return _coherent(*arrays, _tilts(*arrays[1:3], amplitude), amplitude, step, _bessel_table())
