"""Bernoulli particle filter with measurement accumulation: frames of power, and their likelihoods.

Source: Yu, Yang and Fu.  A frame is an array of power ``z`` (nr, na) in units of the noise power;
**the first axis is range**, the second azimuth.  Papers count cells from 1, arrays from 0: cell
(i, j) is ``z[i - 1, j - 1]``.  The target is a Gaussian blob of unknown amplitude in noise of
exponential power.

Cells are independent, and one that the target does not reach has the same factor under both
hypotheses: the likelihood ratio is a product over a patch around the target, 1 outside the frame.
A place that is NaN or infinite is off the frame.

``power_log_ratio`` takes an intensity, ``patch_fit`` estimates it, ``coherent_log_ratio`` has one
amplitude in all cells.  ``inherit`` copies what was read
along the past of particles.
"""

import math
from functools import cache
from typing import Annotated, NamedTuple

import numpy as np
from scipy.special import chdtrc, i0e, i1e

from tbdcore import checks
from tbdcore.checks import (
    LARGEST,
    Array,
    ArrayLike,
    Covariance,
    Integer,
    Integers,
    Number,
    Numbers,
    Random,
    Sizes,
    checked,
)
from tbdcore.jit import kernel
from tbdcore.particles import Ancestors
from tbdcore.score import Positive

__all__ = [
    "PolarGrid",
    "Spread",
    "add_target",
    "cell_power",
    "coherent_log_ratio",
    "column_test",
    "inherit",
    "noise_power",
    "ospa_bernoulli",
    "patch_fit",
    "polar_cells",
    "polar_grid",
    "power_log_ratio",
    "spread_area",
    "spread_power",
]

HIGH = 1e50  # largest value in a frame, and largest intensity: products stay finite
Real = Annotated[float, Number()]
Shape = Annotated[ArrayLike, Sizes(2)]  # (nr, na)
Power = Annotated[ArrayLike, Numbers("nr", "na", low=0.0, high=HIGH, single=True)]
Places = Annotated[ArrayLike, Numbers("N", low=None)]  # in cells; NaN is off the frame
Intensities = Annotated[ArrayLike, Numbers("N", low=-HIGH, high=HIGH)]


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


# What their fields may be
GRID = [Number(-HIGH, HIGH)] * 4 + [Integer(1)] * 2
SPREAD = [Number(1e-9, 1e9)] * 2 + [Integer(0, 10_000)] * 2


def _checked_fields(name, value, kind, rules):
    """The named tuple, its numbers of the types that compiled loops expect; or ValueError."""
    if not isinstance(value, kind):
        raise ValueError(f"{name}: give a {kind.__name__}({', '.join(kind._fields)})")
    parts = zip(rules, kind._fields, value, strict=True)
    return kind(*[rule(f"{name}: {field}", a) for rule, field, a in parts])


@checked
def polar_grid(r_min: Real, r_max: Real, a_min: Real, a_max: Real, dr: Real, da: Real) -> PolarGrid:
    """The grid of a region of whole cells; r in m, a in rad, at most a circle."""
    if not (abs(a_min) <= 2 * math.pi and a_max - a_min <= 2 * math.pi + 1e-9):
        raise ValueError(f"azimuth: {a_min:g} to {a_max:g} rad; give radians, at most a circle")
    if not (dr > 0.0 and da > 0.0):
        raise ValueError(f"cell size: dr = {dr} m, da = {da} rad; both must be positive")
    counts = (r_max - r_min) / dr, (a_max - a_min) / da
    for axis, count in zip(("range", "azimuth"), counts, strict=True):
        if not 0.5 < count < 1e9 or abs(count - round(count)) > 1e-6:
            raise ValueError(f"{axis}: the region has {count:g} cells; it must be a whole number")
    return PolarGrid(r_min, a_min, dr, da, round(counts[0]), round(counts[1]))


@checked
def polar_cells(
    x: Annotated[ArrayLike, Numbers(..., low=None)],
    y: Annotated[ArrayLike, Numbers(..., low=None)],
    grid: PolarGrid,
) -> Array:
    """Cell coordinates (rho, alpha) of positions in m; cell (i, j) is centred at (i, j), one wide.

    Azimuths are those within half a turn of the middle of the region.  x, y : of one shape; NaN and
    infinity give NaN.
    """
    if y.shape != x.shape:
        raise ValueError(f"polar_cells: y: shape {y.shape} is not that of x, {x.shape}")
    shape = x.shape
    x = x.reshape(-1) + 0.0  # a copy, without negative zeros
    y = y.reshape(-1) + 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.arctan(x / y)
    out = np.empty((2, x.size))
    _cells(x, y, angle, _checked_fields("grid", grid, PolarGrid, GRID), out)
    return out.reshape(2, *shape)


@kernel
def _cells(x, y, angle, grid, out):
    """The loop of :func:`polar_cells`; angle : arctan(x / y)."""
    r_min, a_min, dr, da, _, na = grid
    for n in range(x.size):
        a = 0.5 * np.pi - angle[n] - np.pi * (y[n] < 0.0) - a_min
        turns = np.rint((a - 0.5 * na * da) / (2.0 * np.pi))
        out[0, n] = (math.sqrt(x[n] * x[n] + y[n] * y[n]) - r_min) / dr + 0.5
        out[1, n] = (a - 2.0 * np.pi * turns) / da + 0.5


@checked
def spread_power(rho: Real, alpha: Real, spread: Spread, shape: Shape) -> Array:
    """h**2 (nr, na) of a point at (rho, alpha): Yu, Yang and Fu, eq. (6) squared, on every cell."""
    spread = _checked_fields("spread", spread, Spread, SPREAD)
    d = np.arange(1, shape[0] + 1) - rho
    e = np.arange(1, shape[1] + 1) - alpha
    return np.exp(-spread.lr * d**2)[:, None] * np.exp(-spread.la * e**2)


@checked
def spread_area(spread: Spread) -> float:
    """Cells that the point-spread function is worth, the integral of h**2: pi / sqrt(lr la)."""
    spread = _checked_fields("spread", spread, Spread, SPREAD)
    return math.pi / math.sqrt(spread.lr * spread.la)


@kernel
def _exponentials(cells, rng):
    for n in range(cells.size):
        cells[n] = rng.standard_exponential(dtype=np.float32)


@checked
def noise_power(
    shape: Annotated[ArrayLike, Sizes("axes")],
    rng: Annotated[np.random.Generator, Random()],
) -> Array:
    """Frames of noise power in units of its mean: float32, as rng.standard_exponential draws."""
    z = np.empty(tuple(shape.tolist()), np.float32)  # by NumPy, for its large memory pages
    _exponentials(z.reshape(-1), rng)
    return z


def _target_cells(rho, alpha, spread, shape):
    """Slices of the cells around a point in which h**2 is above 1e-16, and h**2 in them."""
    if not (0.5 <= rho < shape[0] + 0.5 and 0.5 <= alpha < shape[1] + 0.5):
        raise ValueError(f"target at cell ({rho:.1f}, {alpha:.1f}) is outside {shape}; move it")
    near = []
    power = []
    for v, l, n in ((rho, spread.lr, shape[0]), (alpha, spread.la, shape[1])):
        most = math.sqrt(37.0 / l)
        near.append(slice(max(int(v - most), 0), min(int(v + most) + 1, n)))
        power.append(np.exp(-l * (np.arange(near[-1].start + 1, near[-1].stop + 1) - v) ** 2))
    return tuple(near), power[0][:, None] * power[1]


@checked
def add_target(
    z: Annotated[Array, Numbers("K", "nr", "na", low=0.0, high=HIGH, in_place=True)],
    rho: Annotated[ArrayLike, Numbers("K", nan=True)],
    alpha: Annotated[ArrayLike, Numbers("K", nan=True)],
    power: Annotated[ArrayLike, Numbers(..., low=None)],
    spread: Spread,
    rng: Annotated[np.random.Generator | None, Random(optional=True)],
) -> Array:
    """Add a target to noise frames z, in place: |A h + v|**2, one complex amplitude A per frame.

    z : (K, nr, na) noise power |v|**2 in units of its mean
    rho, alpha : (K,) place of the target in cells, NaN where there is none
    power : (K,) |A|**2 over the noise power, or a number; not read where there is no target
    rng : draws the angle between A h and v, uniform in every cell, since v is circular; None: cells
        are independent, Yu, Yang and Fu, eqs. (7), (8), and power is the mean of |A|**2
    """
    spread = _checked_fields("spread", spread, Spread, SPREAD)
    if power.shape not in ((), (len(z),)):
        raise ValueError(f"add_target: power: shape {power.shape}; give a number or ({len(z)},)")
    power = np.broadcast_to(power, len(z))
    there = np.flatnonzero(~np.isnan(rho))
    checks.numbers("add_target: power", power[there], "frames", low=0.0, high=HIGH)
    places = [_target_cells(rho[k], alpha[k], spread, z.shape[1:]) for k in there]
    for k, (near, h2) in zip(there, places, strict=True):
        s = power[k] * h2
        v2 = z[k][near]
        if rng is None:
            v2 *= 1.0 + s
        else:
            v2[:] = s + v2 + 2.0 * np.sqrt(s * v2) * np.cos(2.0 * np.pi * rng.random(s.shape))
    return z


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
def _gaussian(out, h, peak, ratio, decays):
    """out[h + m] = peak ratio**m decays[abs(m)]; 0 beyond ``decays``.

    exp(-l (m - d)**2) is exp(-l d**2) exp(2 l d)**m exp(-l m**2): no exponential per sample.
    """
    middle = np.uint64(h)
    up = peak
    down = peak
    back = 1.0 / ratio
    for m in range(np.uint64(decays.size)):  # unsigned, as in _row_sum
        out[middle - m] = down * decays[m]
        out[middle + m] = up * decays[m]
        up *= ratio
        down *= back


@kernel
def _decays(spread):
    """exp(-l m**2) for m = 0 .. h, of both axes, as far as it is above 1e-300."""
    fr = np.exp(-spread.lr * np.arange(spread.hr + 1.0) ** 2)
    fa = np.exp(-spread.la * np.arange(spread.ha + 1.0) ** 2)
    return fr[fr > 1e-300], fa[fa > 1e-300]


@kernel
def _exponents(rho, alpha, lr, la):
    """Logarithms (3, N) of what :func:`_peaks` returns."""
    out = np.empty((3, rho.size))
    for n in range(rho.size):
        d = rho[n] - np.floor(rho[n] + 0.5)
        e = alpha[n] - np.floor(alpha[n] + 0.5)
        out[0, n] = -lr * d * d - la * e * e
        out[1, n] = 2.0 * lr * d
        out[2, n] = 2.0 * la * e
    return out


def _peaks(rho, alpha, spread):
    """h**2 in the cell of each particle, and the ratios of both axes for :func:`_gaussian`."""
    with np.errstate(over="ignore", invalid="ignore"):  # a point so sharp that it has one cell
        return np.exp(_exponents(rho, alpha, spread.lr, spread.la))


def power_log_ratio_spec(z, rho, alpha, snr, spread):
    """Specification of :func:`power_log_ratio`: sum of the log densities (7) over the patch."""
    out = np.full(len(rho), -np.inf)
    for n, h2, cells in _patches(z, rho, alpha, spread):
        mu = 1.0 + snr[n] * h2
        out[n] = (-np.log(mu) - cells / mu + cells).sum()
    return out


@checked
def power_log_ratio(
    z: Power, rho: Places, alpha: Places, snr: Intensities, spread: Spread
) -> Array:
    """Log-likelihood ratio (N,) of the patch around each particle: Yu, Yang and Fu, eq. (17).

    z : (nr, na) frame of power in units of the noise power; rho, alpha : (N,) places in cells;
    snr : (N,) intensity over noise power.  Log-ratio 0 where snr is 0 or less; -inf off the frame
    (and at NaN), where the region of eqs. (22), (23) has no target.
    """
    spread = _checked_fields("spread", spread, Spread, SPREAD)
    nr, na = z.shape
    spread = spread._replace(hr=min(spread.hr, nr), ha=min(spread.ha, na))
    peaks = _peaks(rho, alpha, spread)
    total, product = _power_log_ratio(z, rho, alpha, snr, peaks, spread)
    return total - np.log(product)


# How the sum over a patch is computed.  With s = snr h**2, a number of the cell's row times one of
# its column, the log-ratio is  sum z s / (1 + s) - log prod (1 + s).  To make it fast:
# - Five cells of a column are one fraction: its denominator, the product of their 1 + s, is needed
#   anyway, and one division serves all five.  With z and s up to HIGH, five stay below 1e301.
# - The product runs over the patch and its logarithm is taken once, by power_log_ratio; only where
#   it would overflow are logarithms taken on the way.
# - Particles in one cell have the same patch z.  Where TOGETHER or more share a cell, they are the
#   inner loop, and the processor does several at once (_weigh_together); others go one by one.
#   Both ways do the same operations in the same order: a particle's bits do not depend on the way.
TOGETHER = 8  # particles of one cell from which on they are the inner loop
MOST_TOGETHER = 256  # at most: their arrays stay in the first-level cache
OVERFLOW = 1e300  # a product of 1 + s from here on is replaced by its logarithm


@kernel
def _power_log_ratio(z, rho, alpha, snr, peaks, spread):
    """Sums (N,) of z s / (1 + s) and products (N,) of 1 + s over each particle's patch."""
    nr, na = z.shape
    total = np.zeros(rho.size)
    product = np.ones(rho.size)
    cell = _cells_of(rho, alpha, snr, nr, na, total)
    order, begins = _by_cell(cell, nr * na)
    for group in range(begins.size - 1):
        for first in range(begins[group], begins[group + 1], MOST_TOGETHER):
            members = order[first : min(first + MOST_TOGETHER, begins[group + 1])]
            _weigh_together(members, z, cell, snr, peaks, spread, total, product)
    _weigh_alone(z, cell, snr, peaks, spread, total, product)
    return total, product


@kernel
def _cells_of(rho, alpha, snr, nr, na, total):
    """Index of each particle's cell in the flat frame, -1 where there is nothing to sum.

    That is where snr is 0 or less, and off the frame, where the total becomes -inf.
    """
    cell = np.full(rho.size, -1)
    for n in range(rho.size):
        if not _inside(rho[n], alpha[n], nr, na):
            total[n] = -np.inf
        elif snr[n] > 0.0:
            cell[n] = (int(rho[n] + 0.5) - 1) * na + int(alpha[n] + 0.5) - 1
    return cell


@kernel
def _by_cell(cell, cells):
    """Particles sorted by cell (counting sort), those of cells with fewer than TOGETHER left out.

    Group g, the particles of one cell, is order[begins[g] : begins[g + 1]].
    """
    count = np.zeros(cells, np.int32)
    for c in cell:
        if c >= 0:
            count[c] += 1
    place = np.empty(cells, np.int32)  # of the next particle of a cell in ``order``
    begins = np.zeros(cell.size // TOGETHER + 1, np.int64)
    groups = 0
    for c in range(cells):
        if count[c] >= TOGETHER:
            place[c] = begins[groups]
            begins[groups + 1] = begins[groups] + count[c]
            groups += 1
    order = np.empty(begins[groups], np.int64)
    for n in range(cell.size):
        c = cell[n]
        if c >= 0 and count[c] >= TOGETHER:
            order[place[c]] = n
            place[c] += 1
    return order, begins[: groups + 1]


@kernel
def _five_rows(first, last):
    """Rows first to first + 4, the last one instead of those beyond it, where g is 0.

    They are unsigned: Numba tests a signed index, which takes as long as the arithmetic.
    """
    a, b, c = min(first, last), min(first + 1, last), min(first + 2, last)
    d, e = min(first + 3, last), min(first + 4, last)
    return np.uint64(a), np.uint64(b), np.uint64(c), np.uint64(d), np.uint64(e)


@kernel
def _five(z, rows, j):
    """The values of five rows in column j."""
    return z[rows[0], j], z[rows[1], j], z[rows[2], j], z[rows[3], j], z[rows[4], j]


@kernel
def _fraction(z, g, h):
    """Numerator and denominator of the sum of z s / (1 + s) over five cells, s = g h.

    g, h : the factors of the rows (with the intensity) and of the column
    """
    s = g[0] * h
    numerator = z[0] * s
    denominator = 1.0 + s
    for r in range(1, 5):
        s = g[r] * h
        numerator = numerator * (1.0 + s) + denominator * z[r] * s
        denominator = denominator * (1.0 + s)
    return numerator, denominator


@kernel
def _gaussians(out, h, peak, ratio, decays, size):
    """As :func:`_gaussian` down the rows of ``out``, a column for each peak and ratio."""
    up = peak.copy()
    down = peak.copy()
    back = 1.0 / ratio
    for m in range(decays.size):
        for n in range(size):
            out[h - m, n] = down[n] * decays[m]
            out[h + m, n] = up[n] * decays[m]
            up[n] *= ratio[n]
            down[n] *= back[n]


@kernel
def _weigh_together(members, z, cell, snr, peaks, spread, total, product):
    """Totals and products of particles that share a cell; their ``cell`` becomes -1.

    As :func:`_weigh_alone`, but with a column of every array for each member.  A member whose
    product overflows keeps its cell, and is left to that function.
    """
    nr, na = z.shape
    _, _, hr, ha = spread
    fr, fa = _decays(spread)
    size = members.size + -members.size % 8  # columns that fill up are dropped
    particles = np.zeros(size, np.int64)
    particles[: members.size] = members
    gr = np.zeros((2 * hr + 5, size))
    ga = np.zeros((2 * ha + 1, size))
    _gaussians(gr, hr, snr[particles] * peaks[0][particles], peaks[1][particles], fr, size)
    _gaussians(ga, ha, np.ones(size), peaks[2][particles], fa, size)
    top = cell[members[0]] // na - hr
    left = cell[members[0]] % na - ha
    end = min(top + 2 * hr + 1, nr)
    gr[end - top : 2 * hr + 1] = 0.0
    sums = np.zeros(size)
    factors = np.ones(size)
    for i in range(max(top, 0), end, 5):
        g = gr[i - top : i - top + 5]
        rows = _five_rows(i, end - 1)
        for j in range(max(left, 0), min(left + 2 * ha + 1, na)):
            five = _five(z, rows, np.uint64(j))
            h = ga[j - left]
            for n in range(size):
                a, b = _fraction(five, (g[0, n], g[1, n], g[2, n], g[3, n], g[4, n]), h[n])
                sums[n] += a / b
                factors[n] *= b
    for n in range(members.size):
        if factors[n] < OVERFLOW:
            total[members[n]] = sums[n]
            product[members[n]] = factors[n]
            cell[members[n]] = -1


@kernel
def _weigh_alone(z, cell, snr, peaks, spread, total, product):
    """Totals and products of the particles whose cell is not -1, one by one.

    gr, ga : snr h**2 of the rows, h**2 of the columns of a patch, which begins in row top and
    column left of the frame.  gr is 0 in rows below the frame and in those that fill up a five.
    """
    nr, na = z.shape
    _, _, hr, ha = spread
    fr, fa = _decays(spread)
    gr = np.zeros(2 * hr + 5)
    ga = np.zeros(2 * ha + 1)
    quotients = np.empty(ga.size)
    products = np.empty(ga.size)
    for n in range(cell.size):
        if cell[n] < 0:
            continue
        top = cell[n] // na - hr
        left = cell[n] % na - ha
        _gaussian(gr, hr, snr[n] * peaks[0, n], peaks[1, n], fr)
        _gaussian(ga, ha, 1.0, peaks[2, n], fa)
        end = min(top + 2 * hr + 1, nr)
        gr[end - top : 2 * hr + 1] = 0.0
        low = max(left, 0)
        columns = min(left + ga.size, na) - low
        first, shift = np.uint64(low), np.uint64(low - left)
        sums = 0.0
        factors = 1.0
        for i in range(max(top, 0), end, 5):
            rows = _five_rows(i, end - 1)
            m = i - top
            g = gr[m], gr[m + 1], gr[m + 2], gr[m + 3], gr[m + 4]
            for k in range(np.uint64(columns)):
                a, b = _fraction(_five(z, rows, first + k), g, ga[shift + k])
                quotients[k] = a / b
                products[k] = b
            before = sums, factors
            for k in range(columns):
                sums += quotients[k]
                factors *= products[k]
            if not factors < OVERFLOW:
                sums, factors = _with_logarithms(before, quotients[:columns], products)
        total[n] = sums
        product[n] = factors


@kernel
def _with_logarithms(before, quotients, products):
    """The sum and the product, continued; before it overflows, the product's log is subtracted."""
    sums, factors = before
    for k in range(quotients.size):
        if not factors * products[k] < OVERFLOW:
            sums -= math.log(factors)
            factors = 1.0
        sums += quotients[k]
        factors *= products[k]
    return sums, factors


def cell_power_spec(z, rho, alpha):
    """Specification of :func:`cell_power`: the distance to every cell, and the nearest one."""
    i, j = (np.arange(1, n + 1) for n in z.shape)
    out = np.zeros(len(rho))
    for n, (r, a) in enumerate(zip(rho, alpha, strict=True)):
        holds = np.outer((i - 0.5 <= r) & (r < i + 0.5), (j - 0.5 <= a) & (a < j + 0.5))
        out[n] = z[holds].sum()
    return out


@checked
@kernel
def cell_power(
    z: Annotated[ArrayLike, Numbers("nr", "na", low=None, single=True)], rho: Places, alpha: Places
) -> Array:
    """Value (N,) of the cell of z (nr, na), NaN too, at each rho, alpha (N,); 0 off the frame."""
    nr, na = z.shape
    out = np.zeros(rho.size)
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


@checked
def patch_fit(z: Power, rho: Places, alpha: Places, spread: Spread) -> Array:
    """sum h**2 (z - 1) and sum h**4 (2, N) over each particle's patch, 0 and 0 off the frame.

    Their quotient is the least-squares intensity over the noise power, of z = snr h**2 + 1.
    Arguments as in :func:`power_log_ratio`.
    """
    spread = _checked_fields("spread", spread, Spread, SPREAD)
    return _patch_fit(z, rho, alpha, _peaks(rho, alpha, spread), spread)


@kernel
def _patch_fit(z, rho, alpha, peaks, spread):
    nr, na = z.shape
    _, _, hr, ha = spread
    fr, fa = _decays(spread)
    gr = np.zeros(2 * hr + 1)
    ga = np.zeros(2 * ha + 1)
    out = np.zeros((2, rho.size))
    for n in range(rho.size):
        if not _inside(rho[n], alpha[n], nr, na):
            continue
        top = int(rho[n] + 0.5) - 1 - hr
        left = int(alpha[n] + 0.5) - 1 - ha
        _gaussian(gr, hr, peaks[0, n], peaks[1, n], fr)
        _gaussian(ga, ha, 1.0, peaks[2, n], fa)
        fit = energy = 0.0
        for i in range(max(top, 0), min(top + gr.size, nr)):
            for j in range(max(left, 0), min(left + ga.size, na)):
                h = gr[np.uint64(i - top)] * ga[np.uint64(j - left)]
                fit += h * (z[np.uint64(i), np.uint64(j)] - 1.0)
                energy += h * h
        out[0, n] = fit
        out[1, n] = energy
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
    return x + math.log(series / math.sqrt(2.0 * math.pi * x))


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
def _amplitude_term(b, x, energy, table):
    """Logarithm of exp(-b**2 energy) prod I0(b x)."""
    term = -b * b * energy
    if b * x.max() < _END:
        for c in range(x.size):
            term += _cubic(b * x[c], table)
    else:
        for c in range(x.size):
            term += _log_bessel(b * x[c], table)
    return term


@kernel
def _rises(j, x, energy, width, table):
    """Whether the term of step j + 1 is larger than that of step j, at (j + 0.5) width."""
    next_one = _amplitude_term((j + 1.5) * width, x, energy, table)
    return next_one > _amplitude_term((j + 0.5) * width, x, energy, table)


@kernel
def _near_maximum(x, energy, width, table):
    """A step at most 4 below that of the largest term.

    The terms have one maximum over b >= 0, since they are log-concave in b**2.  It is below
    sum x / (2 energy), since log I0(t) rises by less than t.  Search from there in growing
    distances, then by bisection.
    """
    low = 0
    high = int(x.sum() / (2.0 * energy) / width) + 1
    distance = 4
    while high - distance > low:
        if _rises(high - distance, x, energy, width, table):
            low = high - distance
        else:
            high -= distance
            distance *= 2
    while high - low > 4:
        j = (low + high) // 2
        if _rises(j, x, energy, width, table):
            low = j
        else:
            high = j
    return low


@kernel
def _log_mean(x, energy, step, table):
    """Log of the integral of 2 b exp(-b**2 energy) prod I0(b x) over the amplitude b >= 0.

    Midpoint rule with the correction for the slope at b = 0, from the largest term to both sides,
    until a term is below exp(-20) of the largest.
    """
    width = step / math.sqrt(energy)
    middle = _near_maximum(x, energy, width, table)
    best = -np.inf
    total = 0.0
    for start, way in ((middle, 1), (middle - 1, -1)):
        j = start
        while j >= 0:
            b = (j + 0.5) * width
            term = _amplitude_term(b, x, energy, table)
            if term > best:
                total = total * math.exp(best - term) + b
                best = term
            else:
                total += b * math.exp(term - best)
                if not term >= best - 20.0:  # a NaN ends it too
                    break
            j += way
    total -= width / 24.0 * math.exp(-best)
    return best + math.log(2.0 * width * total)


@kernel
def _coherent(z, rho, alpha, snr, peaks, spread, step, table):
    """The loop of :func:`coherent_log_ratio`; spread : of the amplitude."""
    nr, na = z.shape
    _, _, hr, ha = spread
    fr, fa = _decays(spread)
    gr = np.zeros(2 * hr + 1)
    ga = np.zeros(2 * ha + 1)
    out = np.zeros(rho.size)
    x = np.empty(min(gr.size, nr) * min(ga.size, na))
    for n in range(rho.size):
        if not _inside(rho[n], alpha[n], nr, na):
            out[n] = -np.inf
        elif snr[n] > 1e-300:
            top = int(rho[n] + 0.5) - 1 - hr
            left = int(alpha[n] + 0.5) - 1 - ha
            _gaussian(gr, hr, peaks[0, n], peaks[1, n], fr)
            _gaussian(ga, ha, 1.0, peaks[2, n], fa)
            cells = 0
            energy = 1.0 / snr[n]
            for i in range(max(top, 0), min(top + gr.size, nr)):
                for j in range(max(left, 0), min(left + ga.size, na)):
                    h = gr[np.uint64(i - top)] * ga[np.uint64(j - left)]
                    x[cells] = 2.0 * h * math.sqrt(z[i, j])
                    energy += h * h
                    cells += 1
            out[n] = _log_mean(x[:cells], energy, step, table) - math.log(snr[n])
    return out


@checked
def coherent_log_ratio(
    z: Annotated[ArrayLike, Numbers("nr", "na", low=0.0, high=1e8, single=True)],
    rho: Places,
    alpha: Places,
    snr: Intensities,
    spread: Spread,
    step: Annotated[float, Number(0.01, 2.0)] = 0.8,
) -> Array:
    """Log-likelihood ratio (N,) of each patch under one amplitude in all its cells.

    Yu, Yang and Fu, eq. (5).  Given |A|**2 = p sigma**2 the cells are independent, each with the
    density exp(-z - p h**2) I0(2 h sqrt(p z)); the Swerling 1 average over p, exponential with mean
    snr, couples them.  Arguments and limits as in :func:`power_log_ratio`; z at most 1e8.

    step : of the midpoint rule over the amplitude, in units of (1 / snr + sum h**2)**-0.5, 0.01 to
        2; error below 1e-4 at 0.25, 1e-2 at 0.8.
    """
    spread = _checked_fields("spread", spread, Spread, SPREAD)
    amplitude = Spread(0.5 * spread.lr, 0.5 * spread.la, spread.hr, spread.ha)
    peaks = _peaks(rho, alpha, amplitude)
    patch = min(2 * spread.hr + 1, len(z)) * min(2 * spread.ha + 1, z.shape[1])
    many = max(1, 10**6 // max(patch, 1))  # particles of a compiled call: under a second
    out = np.empty(rho.size)
    for first in range(0, rho.size, many):
        n = slice(first, first + many)
        part = np.ascontiguousarray(peaks[:, n])
        arguments = z, rho[n], alpha[n], snr[n], part, amplitude, step, _bessel_table()
        out[n] = _coherent(*arguments)
    return out


# Ancestors' history: what was read along a particle's past in the last `window` frames, in
# H (window, s, N), s samples a frame.  Frame k is in row k mod window, whatever a particle's age.
def inherit_spec(H, age, ancestors, births):
    """Specification of :func:`inherit`: fancy indices, and zeros behind them."""
    return tuple(
        np.concatenate((a[..., ancestors], np.zeros((*a.shape[:-1], births), a.dtype)), axis=-1)
        for a in (H, age)
    )


@checked
@kernel
def inherit(
    H: Annotated[ArrayLike, Numbers("window", "s", "N", low=None)],
    age: Annotated[ArrayLike, Integers("N")],
    ancestors: Ancestors,
    births: Annotated[int, Integer(0, LARGEST)],
) -> tuple[Array, Array]:
    """History and age after resampling: those of the ancestors (M,), then those of new particles.

    H : (window, s, N), s samples a frame; age : (N,) frames recorded since birth; births : number
    of particles without a history.  Returns new arrays, (window, s, M + births) and (M + births,).
    """
    M, size = ancestors.size, ancestors.size + births
    moved, older = np.empty((H.shape[0], H.shape[1], size)), np.zeros(size, age.dtype)
    for m in range(M):
        if not 0 <= ancestors[m] < age.size:
            raise ValueError("mda_tbd.inherit: ancestors must be 0 to N - 1")
        older[m] = age[np.uint64(ancestors[m])]  # unsigned: no test for an index from the end
    for i in range(H.shape[0]):
        for j in range(H.shape[1]):
            old, new = H[i, j], moved[i, j]
            for m in range(M):
                new[m] = old[np.uint64(ancestors[m])]
            new[M:] = 0.0
    return moved, older


Maybe = Annotated[ArrayLike, Numbers(..., "d", low=None)]
Column = Annotated[ArrayLike, Numbers("r")]


@checked
def ospa_bernoulli(
    x: Maybe,
    existence: Annotated[ArrayLike, Numbers(...)],
    truth: Maybe,
    c: Positive,
    threshold: Annotated[float, Number()] = 0.5,
) -> Array:
    """OSPA (...,) of at most one estimate and one target; every order p gives the same number.

    x : (..., d) estimates, none (or NaN) where existence (...,) is at or below the threshold
    truth : (..., d), NaN for no target
    """
    if x.shape != truth.shape or x.shape[:-1] != existence.shape:
        words = f"x {x.shape}, existence {existence.shape}, truth {truth.shape}"
        raise ValueError(f"mda_tbd.ospa_bernoulli: {words}; give (..., d), (...,), (..., d)")
    declared, present = existence > threshold, ~np.isnan(truth[..., 0])
    with np.errstate(over="ignore", invalid="ignore"):
        distance = np.minimum(np.sqrt(np.sum(np.square(x - truth), axis=-1)), c)
    if np.isnan(distance[declared & present]).any():
        raise ValueError("mda_tbd.ospa_bernoulli: a declared x or its target has a NaN; remove it")
    return np.where(declared & present, distance, np.where(declared | present, float(c), 0.0))


@checked
def column_test(
    measured: Column,
    printed: Column,
    covariance: Annotated[ArrayLike, Covariance("r", "r")],
    ratio: Annotated[float, Number(0.0)],
    half: Annotated[float, Number(0.0)] = 0.0,
) -> tuple[float, float, float, float]:
    """Whether a table's column agrees with ours as a whole: mean difference, its error, z, and p.

    measured, printed : (r,); covariance : (r, r) of our values; ratio : our number of trials over
    the paper's; half : half of the last printed digit.  The mean difference tests for a common
    shift; p is that of d' C**-1 d, chi-square with r degrees of freedom.
    """
    d = measured - printed
    C = covariance * (1.0 + ratio) + np.eye(d.size) * half**2 / 3.0
    try:
        p = float(chdtrc(d.size, d @ np.linalg.solve(C, d)))
    except np.linalg.LinAlgError:
        raise ValueError("mda_tbd.column_test: covariance is singular; leave a row out") from None
    shift, se = float(d.mean()), float(np.sqrt(C.sum())) / d.size
    return shift, se, shift / se, p
