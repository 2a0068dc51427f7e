"""Sensor: what a frame of cells looks like, and what it says about a target.

Track-before-detect works on the frame itself.  A frame is an array of cells ``z`` of shape (n_x,
n_y), or (K, n_x, n_y) for K frames in a row; **the first axis is the first index of the paper** (x,
or range), the second is the second (y, or azimuth). Papers count cells from 1, arrays from 0: cell
(i, j) is ``z[i - 1, j - 1]``.  Pictures that show x to the right are pictures of
``z.T``.

Each section below is one kind of sensor, with its signal, its noise, and the two functions that a
filter needs of it: a simulated frame, and the log-likelihood ratio of "target at this state"
against "noise only".

=======================  =====================================================  =============================================
section                  signal in a cell                                       noise in a cell
=======================  =====================================================  =============================================
Gaussian image           h: Gaussian blob, amplitude known                      normal, standard deviation sigma
point target             all of the target's signal in one cell                 any; standard normal in the paper
range and azimuth        power of a Gaussian blob, amplitude unknown            exponential power
=======================  =====================================================  =============================================

Why a *ratio*, and why a *patch*: cells are independent, so the likelihood of a whole frame is a
product over cells, and every cell that the target does not reach has the same factor under both
hypotheses.  Divided by the likelihood of noise these factors are 1, and what remains of a product
over all cells is one over the few cells around the target.  A target outside the frame illuminates
nothing, its ratio is 1, its log-ratio 0: the data speak neither for it nor against it.

For a known signal h and normal noise the log-ratio of one cell is h (2 z - h) / (2
sigma**2).  Summed over the patch it is normal too, with mean +d**2/2 if the target is there and
-d**2/2 if not, and variance d**2, where d**2 = sum h**2 / sigma**2 is the energy that a matched
filter collects.  d is all there is to know about the strength of such a target.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.special import i0e, i1e

from tbdcore import kernel

# Gaussian image: a blob of known amplitude in normal noise
# ----------------------------------------------------------------


def blob_peak(intensity, blur, delta=1.0):
    """Amplitude of the blob's centre, delta**2 I / (2 pi blur**2), in units of the noise's z."""
    return delta * delta * intensity / (2.0 * math.pi * blur * blur)


def blob_image(x, y, peak, blur, shape):
    """Noise-free frames h of a Gaussian blob: (n_x, n_y) for numbers x, y, (K, n_x, n_y) for K
    positions.

    x, y : position in cells; cell (i, j) is centred at (i, j), i = 1 .. n_x, j = 1 .. n_y.  NaN: no
        target, h = 0.
    peak : amplitude at the centre; blur : standard deviation of the blob in cells; shape : (n_x,
        n_y).
    """
    gx, gy = (
        np.exp(
            -((np.arange(1, n + 1) - np.asarray(v, float)[..., None]) ** 2) / (2.0 * blur * blur)
        )
        for v, n in zip((x, y), shape, strict=True)
    )
    return np.nan_to_num(peak * gx[..., :, None] * gy[..., None, :], nan=0.0)


def blob_log_ratio_spec(z, S, r, peak, blur, noise):
    """Specification of :func:`blob_log_ratio`: every cell of the frame, and a mask for the patch."""
    out = np.zeros(len(r))
    i, j = (np.arange(1, n + 1) for n in z.shape)
    for n in np.flatnonzero(r):
        x, y = S[n, 0], S[n, 2]
        near = np.outer(np.abs(i - np.floor(x + 0.5)) <= 2, np.abs(j - np.floor(y + 0.5)) <= 2)
        h = peak * np.exp(-np.add.outer((i - x) ** 2, (j - y) ** 2) / (2 * blur**2))
        inside = 0.5 <= x < z.shape[0] + 0.5 and 0.5 <= y < z.shape[1] + 0.5
        out[n] = inside * (h * (2 * z - h) / (2 * noise**2))[near].sum()
    return out


@kernel
def _row(z, i, j, a, b, c, d):
    """Five cells of row i from column j on, weighted by a, b, 1, c, d."""
    return a * z[i, j] + b * z[i, j + 1] + z[i, j + 2] + c * z[i, j + 3] + d * z[i, j + 4]


@kernel
def blob_log_ratio(z, S, r, peak, blur, noise):
    """Log-likelihood ratio (N,) of the 5 x 5 patch around each particle: target with that state
    against noise only.

    z : (n_x, n_y) frame; S : (N, d) states, x in column 0 and y in column 2, in cells; r : (N,)
        regimes, 0 absent.
    peak, blur, noise : amplitude of the blob, its standard deviation in cells, standard deviation
        of z. Absent particles, and particles outside the frame, have log-ratio 0.  The patch is
        clipped at the edge; it holds all but 1e-7 of the energy of a blob of 0.6 cells (1e-4 at
        0.8, 0.2 % at one cell), and is too small for wider blobs.

    The sum over the patch is  (peak sum g_i g_j z_ij - peak**2 / 2 sum g_i**2 sum g_j**2) /
    noise**2,  and the Gaussian is a recurrence: with d the offset to the nearest cell, its value m
    cells further is exp(-d**2 / 2b**2) * exp(-d / b**2)**m * exp(-m**2 / 2b**2), so three
    exponentials serve 25 cells.
    """
    nx, ny = z.shape
    k = 1.0 / (blur * blur)
    one, two = math.exp(-0.5 * k), math.exp(-2.0 * k)
    framed = np.zeros((nx + 4, ny + 4))
    for i in range(nx):
        for j in range(ny):
            framed[i + 2, j + 2] = z[i, j]
    out = np.zeros(r.size)
    for n in range(r.size):
        x, y = S[n, 0], S[n, 2]
        if r[n] == 0 or not (0.5 <= x < nx + 0.5 and 0.5 <= y < ny + 0.5):
            continue
        i, j = int(x + 0.5), int(y + 0.5)
        dx, dy = i - x, j - y
        centre = math.exp(-0.5 * k * (dx * dx + dy * dy))
        q, p = math.exp(-k * dx), math.exp(-k * dy)
        both = 1.0 / (q * p)
        u, v = both * p, both * q  # 1 / q and 1 / p
        a, b, c, d = u * u * two, u * one, q * one, q * q * two
        e, f, g, h = v * v * two, v * one, p * one, p * p * two
        match = a * _row(framed, i - 1, j - 1, e, f, g, h) + b * _row(framed, i, j - 1, e, f, g, h)
        match += c * _row(framed, i + 2, j - 1, e, f, g, h) + d * _row(
            framed, i + 3, j - 1, e, f, g, h
        )
        match += _row(framed, i + 1, j - 1, e, f, g, h)
        if not (
            2 < i < nx - 1 and 2 < j < ny - 1
        ):  # beyond the edge no energy is expected; to the match these cells are zeros
            a, b, c, d = a * (i > 2), b * (i > 1), c * (i < nx), d * (i < nx - 1)
            e, f, g, h = e * (j > 2), f * (j > 1), g * (j < ny), h * (j < ny - 1)
        energy = (a * a + b * b + 1.0 + c * c + d * d) * (e * e + f * f + 1.0 + g * g + h * h)
        out[n] = peak * centre * (match - 0.5 * peak * centre * energy) / (noise * noise)
    return out


# Point target: all of the signal in one cell
# ----------------------------------------------------------------------------


def point_amplitude(snr_db, sigma=1.0):
    """Amplitude A of a point target whose SNR is 10 log10(A**2 / sigma**2) dB in noise of standard
    deviation sigma.
    """
    return sigma * 10.0 ** (np.asarray(snr_db, float) / 20.0)


def point_frames(noise, cells, amplitude):
    """Frames z (K, n_x, n_y) of a point target: noise w everywhere, A + w in the target's cell
    (Wan, Wang and Wu 2013, eq. 1).

    noise : (K, n_x, n_y), left as it is; cells : (K, 2) of int, the target's cell in each frame,
        **counted from 0**.
    amplitude : A, or one A_k for each frame, in the noise's unit.  The result has the noise's type.

    Raises ValueError when there is not one cell for each frame, or when a cell lies outside the
    frame.
    """
    cells, shape = np.asarray(cells), noise.shape
    if cells.shape != (shape[0], 2):
        raise ValueError(
            f"point_frames: cells have shape {cells.shape} for frames {shape}; give one (i, "
            f"j) for each frame"
        )
    outside = ((cells < 0) | (cells >= shape[1:])).any(axis=1)
    if outside.any():
        k = int(outside.argmax())
        raise ValueError(
            f"point_frames: cell {tuple(cells[k].tolist())} of frame {k} is outside {shape[1:]}; "
            f"move the target"
        )
    z = noise.copy()
    z[np.arange(shape[0]), cells[:, 0], cells[:, 1]] += amplitude
    return z


# Range and azimuth: a point of unknown intensity in exponential power
# ------------------------------------------------------


class PolarGrid(NamedTuple):
    """Cells of a range-azimuth frame: lower ends r_min (m), a_min (rad), cell sizes dr (m), da
    (rad), counts nr, na.
    """

    r_min: float
    a_min: float
    dr: float
    da: float
    nr: int
    na: int


class Spread(NamedTuple):
    """A point-spread function in cells: its power is exp(-lr d**2 - la e**2), d cells off in range
    and e in azimuth.

    lr, la : decay of the *power* per squared cell, (L/R) delta**2 of each axis.
    hr, ha : half widths of the patch that a likelihood reads, (2 hr + 1) x (2 ha + 1) cells.
    """

    lr: float
    la: float
    hr: int
    ha: int


def polar_grid(r_min, r_max, a_min, a_max, dr, da):
    """The grid of a region; r in m, a in rad.  ValueError when the region is no whole number of
    cells.
    """
    counts = (r_max - r_min) / dr, (a_max - a_min) / da
    for axis, count in zip(("range", "azimuth"), counts, strict=True):
        if not count > 0.5 or abs(count - round(count)) > 1e-6:
            raise ValueError(
                f"{axis}: the region has {count:g} cells; "
                f"choose its ends and cell size for a whole number"
            )
    return PolarGrid(r_min, a_min, dr, da, round(counts[0]), round(counts[1]))


def polar_cells(x, y, grid):
    """Cell coordinates (rho, alpha) of Cartesian positions in m, y > 0; cell (i, j) is centred at
    (i, j) and one wide.
    """
    r, a = np.sqrt(x * x + y * y), 0.5 * np.pi - np.arctan(x / y)
    return (r - grid.r_min) / grid.dr + 0.5, (a - grid.a_min) / grid.da + 0.5


def spread_power(rho, alpha, spread, shape):
    """h**2 (nr, na) of a point at (rho, alpha): equation (6) squared, on every cell of the frame."""
    d, e = (np.arange(1, n + 1) - v for n, v in zip(shape, (rho, alpha), strict=True))
    return np.exp(-spread.lr * d**2)[:, None] * np.exp(-spread.la * e**2)


def footprint(spread):
    """Cells that the point-spread function is worth, the integral of h**2: pi / sqrt(lr la)."""
    return math.pi / math.sqrt(spread.lr * spread.la)


def straddle(spread):
    """E[h**2] in the cell that holds the point, over all places of the point in the cell."""
    return math.prod(
        math.sqrt(math.pi / l) * math.erf(0.5 * math.sqrt(l)) for l in (spread.lr, spread.la)
    )


@kernel
def _exponentials(cells, rng):
    """Fill cells (n,) with draws."""
    for n in range(cells.size):
        cells[n] = rng.standard_exponential(dtype=np.float32)


def noise_power(shape, rng):
    """Frames of noise power in units of its mean: independent exponentials (float32), the draws of
    ``rng.standard_exponential``.

    The compiled loop takes two thirds of NumPy's time for them, and they are a good part of a
    trial.
    """
    z = np.empty(
        shape, np.float32
    )  # large arrays of NumPy have large pages, those of a kernel have not
    _exponentials(z.reshape(-1), rng)
    return z


def _lit(rho, alpha, spread, shape):
    """The cells around a point outside of which h**2 is below 1e-16, as slices, and h**2 in them;
    ValueError off the frame.
    """
    if not (0.5 <= rho < shape[0] + 0.5 and 0.5 <= alpha < shape[1] + 0.5):
        raise ValueError(
            f"target at cell ({rho:.1f}, {alpha:.1f}) is outside the {shape[0]} x {shape[1]} "
            f"cells; move it or the area"
        )
    near, power = [], []
    for v, l, n in ((rho, spread.lr, shape[0]), (alpha, spread.la, shape[1])):
        half = math.sqrt(37.0 / l)
        near.append(slice(max(int(v - half), 0), min(int(v + half) + 1, n)))
        power.append(np.exp(-l * (np.arange(near[-1].start + 1, near[-1].stop + 1) - v) ** 2))
    return tuple(near), power[0][:, None] * power[1]


def illuminate(z, rho, alpha, power, spread, rng):
    """Add a target to noise frames, in place: z = |A h + v|**2, one complex amplitude A per frame.

    z : (K, nr, na) noise power |v|**2 in units of its mean; exponential of mean 1.
    rho, alpha : (K,) place of the target in cells, NaN where there is none.
    power : (K,) |A|**2 over the noise power.
    rng : the angle between A h and v, uniform in every cell, since v is circular: only v's modulus
        is in z so far.
    """
    for k in np.flatnonzero(~np.isnan(rho)):
        near, h2 = _lit(rho[k], alpha[k], spread, z.shape[1:])
        s, v2 = power[k] * h2, z[k][near]
        z[k][near] = s + v2 + 2.0 * np.sqrt(s * v2) * np.cos(2.0 * np.pi * rng.random(s.shape))


def illuminate_cells(z, rho, alpha, snr, spread):
    """Add a target to noise frames, in place, as equations (7) and (8) have it: every cell an
    independent exponential.

    Arguments as in :func:`illuminate`; snr : mean of |A|**2 over the noise power.  No generator: a
    cell's exponential is scaled.
    """
    for k in np.flatnonzero(~np.isnan(rho)):
        near, h2 = _lit(rho[k], alpha[k], spread, z.shape[1:])
        z[k][near] *= 1.0 + snr * h2


def check_frames(z):
    """Raise ValueError, naming the first frame, unless every cell of z (K, nr, na) is a finite
    power, at least 0.
    """
    if not (z.min(initial=0.0) >= 0.0 and z.max(initial=0.0) < np.inf):
        bad = next(
            k for k, frame in enumerate(z) if not (frame.min() >= 0.0 and frame.max() < np.inf)
        )
        raise ValueError(
            f"frames: frame {bad + 1} has a cell that is negative, infinite or NaN; "
            f"powers are finite and not below 0"
        )


def _patches(z, rho, alpha, spread):
    """For specifications: particle, h**2 and mask of its patch on the whole frame, for the
    particles on the frame.
    """
    z = z.astype(float)
    i, j = (np.arange(1, n + 1) for n in z.shape)
    for n, (r, a) in enumerate(zip(rho, alpha, strict=True)):
        if 0.5 <= r < z.shape[0] + 0.5 and 0.5 <= a < z.shape[1] + 0.5:
            near = np.outer(
                abs(i - np.floor(r + 0.5)) <= spread.hr, abs(j - np.floor(a + 0.5)) <= spread.ha
            )
            yield n, spread_power(r, a, spread, z.shape)[near], z[near]


@kernel
def _bell(out, peak, tilt, fixed):
    """out[h + m] = peak tilt**m fixed[abs(m)], m = -h .. h: a sampled Gaussian without an
    exponential per sample.
    """
    h = fixed.size - 1
    back = 1.0 / tilt
    up = down = peak
    out[h] = peak
    for m in range(1, h + 1):
        up *= tilt
        down *= back
        out[h + m] = up * fixed[m]
        out[h - m] = down * fixed[m]


def power_log_ratio_spec(z, rho, alpha, snr, spread):
    """Specification of :func:`power_log_ratio`: log densities (7) of target and of noise, summed
    over the patch.
    """
    out = np.full(len(rho), -np.inf)
    for n, h2, cells in _patches(z, rho, alpha, spread):
        mu = 1.0 + snr[n] * h2
        out[n] = (-np.log(mu) - cells / mu + cells).sum()
    return out


@kernel
def power_log_ratio(z, rho, alpha, snr, spread):
    """Log-likelihood ratio (N,) of the patch around each particle, cells independent and
    exponential: equation (17).

    z : (nr, na) frame of power in units of the noise power.
    rho, alpha : (N,) places in cells; snr : (N,) intensity over noise power of each particle.
        Log-ratio 0 where snr is 0; -inf off the frame, where the region of equations (22, 23) has
        no target.

    With s = snr h**2 a cell adds z s / (1 + s) - log(1 + s).  The Gaussian is a recurrence (three
    exponentials per particle). The sum over the cells of one azimuth is kept as a fraction, num /
    den with den = prod (1 + s), so that it costs one division, and the whole patch, as a rule, one
    logarithm.  Azimuths are neighbours in memory and are worked on side by side.  At the frame's
    edges the window of azimuths is shifted into the frame; what it then has too much gets h = 0.
    """
    nr, na = z.shape
    lr, la, hr, ha = spread
    w = min(4 * (ha // 2) + 4, na)  # columns in the window: at least 2 ha + 1, a multiple of four
    fr = np.exp(-lr * np.arange(hr + 1.0) ** 2)
    fa = np.exp(-la * np.arange(ha + 1.0) ** 2)
    gr = np.empty(2 * hr + 1)
    padded = np.zeros(2 * (w + ha) + 1)
    ga = padded[w : w + 2 * ha + 1]
    num, den = np.empty(w), np.empty(w)
    out = np.empty(rho.size)
    for n in range(rho.size):
        if not (0.5 <= rho[n] < nr + 0.5 and 0.5 <= alpha[n] < na + 0.5):
            out[n] = -np.inf
            continue
        if snr[n] <= 0.0:
            out[n] = 0.0
            continue
        i0, j0 = int(rho[n] + 0.5), int(alpha[n] + 0.5)
        d, e = rho[n] - i0, alpha[n] - j0
        _bell(gr, snr[n] * math.exp(-lr * d * d - la * e * e), math.exp(2.0 * lr * d), fr)
        _bell(ga, 1.0, math.exp(2.0 * la * e), fa)
        first = min(max(j0 - 1 - ha, 0), na - w)
        start = w + first - (j0 - 1 - ha)
        c = padded[start : start + w]
        for k in range(w):
            num[k] = 0.0
            den[k] = 1.0
        for i in range(max(i0 - 1 - hr, 0), min(i0 + hr, nr)):
            g = gr[i - i0 + 1 + hr]
            row = z[i, first : first + w]
            for k in range(w):
                s = g * c[k]
                num[k] = num[k] * (1.0 + s) + den[k] * row[k] * s
                den[k] *= 1.0 + s
        for k in range(w):
            num[k] /= den[k]
        total, product = 0.0, 1.0
        for k in range(w):
            total += num[k]
            product *= den[k]
            if product > 1e150:
                total -= math.log(product)
                product = 1.0
        out[n] = total - math.log(product)
    return out


def cell_power_spec(z, rho, alpha):
    """Specification of :func:`cell_power`: the distance to every cell, and the nearest one."""
    i, j = (np.arange(1, n + 1) for n in z.shape)
    out = np.zeros(len(rho))
    for n, (r, a) in enumerate(zip(rho, alpha, strict=True)):
        holds = np.outer((i - 0.5 <= r) & (r < i + 0.5), (j - 0.5 <= a) & (a < j + 0.5))
        out[n] = z[holds].sum()
    return out


@kernel
def cell_power(z, rho, alpha):
    """Power (N,) of the cell that holds each particle; z (nr, na), rho and alpha (N,) in cells; 0
    off the frame.
    """
    nr, na = z.shape
    out = np.zeros(rho.size)
    for n in range(rho.size):
        if 0.5 <= rho[n] < nr + 0.5 and 0.5 <= alpha[n] < na + 0.5:
            out[n] = z[int(rho[n] + 0.5) - 1, int(alpha[n] + 0.5) - 1]
    return out


def patch_fit_spec(z, rho, alpha, spread):
    """Specification of :func:`patch_fit`."""
    out = np.zeros((2, len(rho)))
    for n, h2, cells in _patches(z, rho, alpha, spread):
        out[:, n] = (h2 * (cells - 1.0)).sum(), (h2 * h2).sum()
    return out


@kernel
def patch_fit(z, rho, alpha, spread):
    """Numerator and denominator (2, N) of the least-squares intensity over each particle's patch.

    sum h**2 (z - 1) and sum h**4; their quotient is the intensity over the noise power that fits z
    = snr h**2 + 1 best. Kept apart, so that frames can be added up.  Arguments as in
    :func:`power_log_ratio`; 0 and 0 off the frame.
    """
    nr, na = z.shape
    lr, la, hr, ha = spread
    fr = np.exp(-lr * np.arange(hr + 1.0) ** 2)
    fa = np.exp(-la * np.arange(ha + 1.0) ** 2)
    gr, ga, column = np.empty(2 * hr + 1), np.empty(2 * ha + 1), np.empty(2 * ha + 1)
    out = np.zeros((2, rho.size))
    for n in range(rho.size):
        if not (0.5 <= rho[n] < nr + 0.5 and 0.5 <= alpha[n] < na + 0.5):
            continue
        i0, j0 = int(rho[n] + 0.5), int(alpha[n] + 0.5)
        d, e = rho[n] - i0, alpha[n] - j0
        _bell(gr, math.exp(-lr * d * d - la * e * e), math.exp(2.0 * lr * d), fr)
        _bell(ga, 1.0, math.exp(2.0 * la * e), fa)
        lo, hi = max(j0 - 1 - ha, 0), min(j0 + ha, na)
        for k in range(hi - lo):
            column[k] = 0.0
        energy_r = energy_a = 0.0
        for i in range(max(i0 - 1 - hr, 0), min(i0 + hr, nr)):
            g = gr[i - i0 + 1 + hr]
            energy_r += g * g
            row = z[i, lo:hi]
            for k in range(row.size):
                column[k] += g * (row[k] - 1.0)
        for k in range(hi - lo):
            g = ga[k + lo - j0 + 1 + ha]
            energy_a += g * g
            out[0, n] += g * column[k]
        out[1, n] = energy_r * energy_a
    return out


# One amplitude for the whole patch
# -----------------------------------------------------------------------------------------

_BESSEL_CELLS, _BESSEL_END = 64, 32  # knots per unit of x, last knot


def _bessel_table():
    """log I0 and its slope per knot, on the knots of :func:`_log_bessel`; (n, 2)."""
    x = np.arange(_BESSEL_END * _BESSEL_CELLS + 2) / _BESSEL_CELLS
    return np.column_stack((np.log(i0e(x)) + x, i1e(x) / i0e(x) / _BESSEL_CELLS))


@kernel
def _log_bessel(x, table):
    """log I0(x): cubic Hermite interpolation (error below 1e-10), beyond the table the asymptotic
    series (below 1e-9).
    """
    if x >= _BESSEL_END:
        t = 1.0 / (8.0 * x)
        return (
            x
            - 0.5 * math.log(2.0 * math.pi * x)
            + math.log(1.0 + t * (1.0 + t * (4.5 + t * (37.5 + t * 459.375))))
        )
    m = int(x * _BESSEL_CELLS)
    u = x * _BESSEL_CELLS - m
    f, df = table[m]
    rise, dg = table[m + 1, 0] - f, table[m + 1, 1]
    return f + u * (df + u * (3.0 * rise - 2.0 * df - dg + u * (df + dg - 2.0 * rise)))


def coherent_log_ratio_spec(z, rho, alpha, snr, spread):
    """Specification of :func:`coherent_log_ratio`: adaptive quadrature over the power of the common
    amplitude.
    """
    from scipy.integrate import quad  # half a second, for which no filter has to wait
    from scipy.optimize import minimize_scalar

    out = np.full(len(rho), -np.inf)
    for n, h2, cells in _patches(z, rho, alpha, spread):

        def log_density(p, h2=h2, cells=cells, n=n):
            x = 2.0 * np.sqrt(p * h2 * cells)
            return (np.log(i0e(x)) + x - p * h2).sum() - p / snr[n]

        best = minimize_scalar(
            lambda p, f=log_density: -f(p), bounds=(0.0, 40.0 * snr[n] + 40.0), method="bounded"
        ).x
        top = log_density(best)
        ends = [0.0, best, best + 2.0, 2.0 * best + 20.0, 80.0 * snr[n] + 80.0]
        area = [
            quad(lambda p, f=log_density, c=top: np.exp(f(p) - c), *e, epsabs=0, epsrel=1e-10)[0]
            for e in pairwise(ends)
        ]
        out[n] = top + np.log(sum(area) / snr[n])
    return out


@kernel
def _coherent(z, rho, alpha, snr, spread, step, table, out):
    """The loop of :func:`coherent_log_ratio`."""
    nr, na = z.shape
    lr, la, hr, ha = spread
    fr = np.exp(-0.5 * lr * np.arange(hr + 1.0) ** 2)
    fa = np.exp(-0.5 * la * np.arange(ha + 1.0) ** 2)
    gr, ga = np.empty(2 * hr + 1), np.empty(2 * ha + 1)
    x = np.empty(gr.size * ga.size)
    for n in range(rho.size):
        inside = 0.5 <= rho[n] < nr + 0.5 and 0.5 <= alpha[n] < na + 0.5
        out[n] = 0.0 if inside else -np.inf
        if not inside or snr[n] <= 0.0:
            continue
        i0, j0 = int(rho[n] + 0.5), int(alpha[n] + 0.5)
        d, e = rho[n] - i0, alpha[n] - j0
        _bell(gr, math.exp(-0.5 * (lr * d * d + la * e * e)), math.exp(lr * d), fr)
        _bell(ga, 1.0, math.exp(la * e), fa)
        cells, energy = 0, 1.0 / snr[n]
        for i in range(max(i0 - 1 - hr, 0), min(i0 + hr, nr)):
            for j in range(max(j0 - 1 - ha, 0), min(j0 + ha, na)):
                h = gr[i - i0 + 1 + hr] * ga[j - j0 + 1 + ha]
                x[cells] = 2.0 * h * math.sqrt(z[i, j])
                energy += h * h
                cells += 1
        # integral over the amplitude b of 2 b / snr exp(-b**2 energy) prod I0(b x): midpoints, and
        # the slope at b = 0
        width = step / math.sqrt(energy)
        b, top, total = 0.5 * width, -np.inf, 0.0
        while True:
            term = math.log(2.0 * b * width / snr[n]) - b * b * energy
            for c in range(cells):
                term += _log_bessel(b * x[c], table)
            if term > top:
                total = total * math.exp(top - term) + 1.0
                top = term
            else:
                total += math.exp(term - top)
                if not term >= top - 20.0:  # a NaN ends it too
                    break
            b += width
        out[n] = top + math.log(total - width * width / (12.0 * snr[n]) * math.exp(-top))


def coherent_log_ratio(z, rho, alpha, snr, spread, step=0.8):
    """Log-likelihood ratio (N,) of each particle's patch under equation (5) itself: one amplitude
    in all of its cells.

    Given |A|**2 = p sigma**2 the cells are independent, each with the density exp(-z - p h**2) I0(2
    h sqrt(p z)); the Swerling 1 average over p, exponential with mean snr, couples them.  Arguments
    and limits as in :func:`power_log_ratio`.

    step : of the midpoint rule over the amplitude, in units of (1 / snr + sum h**2)**-0.5; error
        below 1e-4 at 0.25, 1e-2 at 0.8.
    """
    out = np.empty(rho.size)
    _coherent(z, rho, alpha, snr, spread, step, _bessel_table(), out)
    return out
