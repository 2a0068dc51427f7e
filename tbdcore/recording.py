"""From a recording to what a filter takes: noise, background, thresholds, plots, blur, a target.

    at = recording.clipped(frames)                      # mean and spread of the noise
    z = recording.normalise(frames, at)                 # white noise: mean 0, variance 1
    print(misfit.fit(z))                                # does the noise look like that?
    peaks = [statistic(block) for block in recording.blocks(z, 11)]
    V_T = recording.threshold(peaks, 0.05).value

``frames`` (K, nx, ny) are in their order of time; a list will do, in which None is a missing frame.
**A gap is NaN**, a cell or a frame: estimates leave it out, and frames that are returned keep it.

The law of the noise is ``"gaussian"`` (values around a mean, chapters 01 and 02) or
``"exponential"`` (power, chapter 03); any other law is turned into one of these two by
``normal_scores``, or into log-likelihood ratios by ``log_ratio``.  *Normalised* frames have noise
of mean 0 and variance 1, or power of mean 1.
"""

import math
import warnings
from functools import partial
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import betaincinv, ndtri

from tbdcore.checks import Array, ArrayLike, Flag, Integer, Number, Numbers, checked, numbers
from tbdcore.noise import Frames, Generator, Law

__all__ = ["background", "bin_cells", "blocks", "blur_of", "clipped", "empirical_law", "inject"]
__all__ += ["log_ratio", "merge_plots", "normal_scores", "normalise", "plots"]
__all__ += ["starts", "threshold"]

LN2, SMALL, ROUNDS = math.log(2.0), 1e-300, 8
CLIP = {"gaussian": 3.0, "exponential": 5.0}  # standard deviations, mean powers
KEPT = {"gaussian": 0.98657, "exponential": 0.96608}  # spread, mean of what is not clipped
LEAST_BLOCKS = 30
BOUND = 1.5 * math.sqrt(2 / math.pi)
MOST_RATIO = 50.0  # log-likelihood ratios of one cell lie in [-50, 50]

Positive = Annotated[float, Number(1e-100, 1e100)]
Pair = Annotated[ArrayLike, Numbers(2)]


class Level(NamedTuple):
    """Mean and standard deviation of noise: numbers, or arrays that fit the frames."""

    mean: Any
    std: Any


# Noise and background


@checked
def background(frames: Frames, law: Law = "gaussian") -> Level:
    """Level of each cell over time, (nx, ny): what stands still, by medians; ten frames or more.

    "gaussian": median, and median absolute deviation / 0.6745 (Huber and Ronchetti 2009, 5.1);
    "exponential": both are median / ln 2.  A target that stays in a cell for a third of the
    recording becomes background.  NaN where a cell has no value.
    """
    if len(frames) < 10:
        raise ValueError(f"recording.background: frames: {len(frames)} of them; give at least 10")
    return _medians(frames, law, axis=0)


def _medians(z, law, axis):
    """Level by medians along an axis."""
    if not (z == z).any():
        raise ValueError("recording: frames: all cells are NaN; give at least one known cell")
    if law == "exponential" and (z < 0).any():
        raise ValueError("recording: frames: negative power; give abs(z)**2, not decibels")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a cell without values is NaN
        middle = np.nanmedian(z, axis=axis)
        if law == "exponential":
            return Level(middle / LN2, middle / LN2)
        return Level(middle, np.nanmedian(abs(z - middle), axis=axis) / ndtri(0.75))


@checked
def clipped(
    frames: Frames, law: Law = "gaussian", size: Annotated[int, Integer(0, 10**4)] = 0
) -> Level:
    """Level of the noise without bright cells, by repeated clipping (Bertin and Arnouts 1996, 7.1).

    Cells beyond 3 standard deviations ("exponential": above 5 means) are left out, and the mean and
    standard deviation of the others corrected for it, eight times.

    size : 0, one level for the whole recording; else the side of a window in cells: a level for
        each cell of each frame, (K, nx, ny), from the window around it.  Take five widths of a
        target or more.  NaN where less than a quarter of a window is known.
    """
    from scipy.ndimage import uniform_filter

    middle, std = _medians(frames, law, axis=None)
    offset = middle if law == "gaussian" else 0.0
    z = np.asarray(frames, float) - offset
    if not size:
        at = _clip(z, law, np.mean, Level(middle - offset, std))
        return Level(float(at.mean + offset), float(at.std))
    average = partial(uniform_filter, size=size, axes=(1, 2))
    at = _clip(z, law, average, Level(0.0 if law == "gaussian" else np.inf, np.inf))
    known = average((z == z).astype(float)) >= 0.25
    return Level(np.where(known, at.mean + offset, np.nan), np.where(known, at.std, np.nan))


def _clip(z, law, average, at):
    """Level of the averages of what lies near the level ``at``."""
    with np.errstate(invalid="ignore", divide="ignore"):
        for _ in range(ROUNDS):
            distance, scale = (abs(z - at.mean), at.std) if law == "gaussian" else (z, at.mean)
            keep = distance <= CLIP[law] * scale
            share = average(keep.astype(float))
            mean = average(np.where(keep, z, 0.0)) / share
            if law == "exponential":
                at = Level(mean / KEPT[law], mean / KEPT[law])
            else:
                square = average(np.where(keep, (z - mean) ** 2, 0.0)) / share
                at = Level(mean, np.sqrt(np.maximum(square, 0.0)) / KEPT[law])
    return at


@checked
def normalise(frames: Frames, at: Level, law: Law = "gaussian") -> Array:
    """Noise of mean 0 and variance 1, (z - mean) / std; "exponential": power of mean 1, z / mean.

    at : a Level of numbers, or of arrays (nx, ny) or (K, nx, ny).  NaN where its spread is not
        above 0, as that of a cell that always shows the same value.
    """
    try:
        mean, std = (np.broadcast_to(np.asarray(a, float), frames.shape) for a in at)
    except (TypeError, ValueError):
        advice = "numbers, (nx, ny) or (K, nx, ny)"
        raise ValueError(f"recording.normalise: at: give Level(mean, std), {advice}") from None
    scale = std if law == "gaussian" else mean
    if not (scale > 0).any():
        raise ValueError("recording.normalise: at: its spread is nowhere above 0; look at frames")
    with np.errstate(invalid="ignore", divide="ignore"):
        z = (frames - mean if law == "gaussian" else frames) / scale
    return np.where(scale > 0, z, np.nan)


# Any law of the noise


class TailedLaw(NamedTuple):
    """A law measured from noise: its quantiles x (n,) at probabilities p, and Pareto tails.

    low, high : (shape, scale) of the generalised Pareto laws below x[0] and above x[-1]
    """

    x: Array
    p: Array
    low: tuple
    high: tuple

    def cdf(self, z):
        """Probability of a value of at most z."""
        z, out = np.asarray(z, float), np.array(1 - self.sf(z))
        left = z < self.x[0]
        out[left] = self.p[0] * self._laws()[0].sf(self.x[0] - z[left])  # 1 - sf would round to 0
        return out

    def sf(self, z):
        """Probability of a value above z."""
        z = np.asarray(z, float)
        below, middle, above = self._laws()
        left, right = z < self.x[0], z > self.x[-1]
        out = np.array(1 - middle(z))
        out[left] = 1 - self.p[0] * below.sf(self.x[0] - z[left])
        out[right] = (1 - self.p[-1]) * above.sf(z[right] - self.x[-1])
        return out

    def logpdf(self, z):
        """Logarithm of the density."""
        z = np.asarray(z, float)
        below, middle, above = self._laws()
        left, right = z < self.x[0], z > self.x[-1]
        out = np.array(middle.derivative()(z))
        out[left] = self.p[0] * below.pdf(self.x[0] - z[left])
        out[right] = (1 - self.p[-1]) * above.pdf(z[right] - self.x[-1])
        return np.log(np.maximum(out, SMALL))

    def _laws(self):
        """The laws of the lower excess, of what is between the tails, and of the upper excess."""
        from scipy.interpolate import PchipInterpolator
        from scipy.stats import genpareto

        below, above = (genpareto(shape, scale=scale) for shape, scale in (self.low, self.high))
        return below, PchipInterpolator(self.x, self.p), above


@checked
def empirical_law(noise: Frames, tail: Annotated[float, Number(0.001, 0.2)] = 0.02) -> TailedLaw:
    """The law of noise, from 2,000 or more cells without a target.

    The middle is the empirical distribution; the share ``tail`` at each end is a generalised Pareto
    law (Pickands 1975), fitted by probability-weighted moments (Hosking and Wallis 1987), with an
    end where the values have a clear one, as power at 0, and exponential or heavier otherwise.
    """
    z = np.sort(noise[noise == noise].astype(float))
    if z.size < 2000:
        raise ValueError(f"recording.empirical_law: noise: {z.size} known cells; give 2000 or more")
    p = np.linspace(tail, 1 - tail, 65)
    x = np.quantile(z, p)
    if not (np.diff(x) > 0).all():
        raise ValueError("recording.empirical_law: noise: too few different values; add dither")
    return TailedLaw(x, p, _tail(x[0] - z[z < x[0]][::-1]), _tail(z[z > x[-1]] - x[-1]))


def _tail(excess):
    """Shape and scale from the excesses over the threshold, in rising order."""
    n = excess.size
    mean = excess.mean()
    weighted = np.mean((1 - (np.arange(n) + 0.65) / n) * excess)
    shape = min(float(2 - mean / (mean - 2 * weighted)), 0.9)
    shape = 0.0 if -0.5 < shape < 0 else shape
    return shape, float(mean * (1 - shape))


@checked
def normal_scores(frames: Frames, law: Any) -> Array:
    """Scores that are standard normal if ``law`` is the law of the noise; NaN stays.

    law : has ``cdf`` and ``sf``, as a frozen SciPy distribution or :func:`empirical_law`, or is
        the function ``cdf``.  Scores are within +-37, of a function at most 8.3.
    """
    cdf = getattr(law, "cdf", law)
    if not callable(cdf):
        raise ValueError("recording.normal_scores: law: give a function, or what has cdf and sf")
    sf = getattr(law, "sf", lambda z: np.maximum(1 - np.asarray(cdf(z)), 2.0**-53))
    z = np.asarray(frames, float)
    p = np.asarray(cdf(z), float)
    numbers("recording.normal_scores: law", p[z == z], "N", low=0.0, high=1.0)
    right = p > 0.5
    scores = ndtri(np.maximum(p, SMALL))
    scores[right] = -ndtri(np.maximum(sf(z[right]), SMALL))
    return scores


@checked
def log_ratio(
    frames: Frames, law: Any, strength: Positive, adds: Annotated[bool, Flag()] = True
) -> Array:
    """Log-likelihood ratio of each cell, a target of given strength against noise; NaN stays.

    law : of the noise; has ``logpdf``, as a frozen SciPy distribution or :func:`empirical_law`
    strength : adds=True: what the target adds to its cell, ln p(z - a) - ln p(z); False: power
        ratio S of a target that fluctuates as the noise does (in exponential noise Swerling 1),
        ln p(z / (1 + S)) - ln(1 + S) - ln p(z)

    Ratios are within +-50, and 0 where both densities are 0.
    """
    if not callable(getattr(law, "logpdf", None)):
        raise ValueError("recording.log_ratio: law: it has no logpdf; give a frozen distribution")
    z = np.asarray(frames, float)
    gain = 1.0 if adds else 1.0 + strength
    with np.errstate(invalid="ignore", divide="ignore"):
        target = law.logpdf(z - strength if adds else z / gain) - math.log(gain)
        ratio = np.clip(target - law.logpdf(z), -MOST_RATIO, MOST_RATIO)
    return np.where(np.isnan(z), np.nan, np.nan_to_num(ratio, nan=0.0))


# Thresholds from the recording


@checked
def blocks(
    frames: Frames, K: Annotated[int, Integer(1)], step: Annotated[int, Integer(0)] = 0
) -> Array:
    """Blocks (n, K, nx, ny) of K successive frames in their order of time; a read-only view.

    step : from the start of a block to that of the next; 0: K, so that no two overlap.  Gaps stay
        where they are: a block with a gap stands for a search with a gap.
    """
    step = step or K
    n = max(1 + (len(frames) - K) // step, 0)
    if n < LEAST_BLOCKS:
        least = K + (LEAST_BLOCKS - 1) * step
        words = f"{len(frames)} give {n} blocks, fewer than {LEAST_BLOCKS}; give {least} frames"
        raise ValueError(f"recording.blocks: frames: {words}, or a smaller step")
    windows = np.lib.stride_tricks.sliding_window_view(frames, K, axis=0)[::step]
    return np.moveaxis(windows, -1, 1)


class Threshold(NamedTuple):
    """A threshold, and the interval of 95 % in which the delivered probability lies."""

    value: Any
    low: float
    high: float


@checked
def threshold(
    peaks: Annotated[ArrayLike, Numbers(...)],
    p_false: Annotated[float, Number(1e-9, 0.5)],
    independent: Annotated[int, Integer(0)] = 0,
) -> Threshold:
    """Threshold that a search without a target exceeds with probability ``p_false``.

    peaks : (n,) largest value of each of n >= 30 blocks without a target, or (n, sets)
    independent : number of blocks that do not depend on each other, if these are fewer

    The threshold is the order statistic r = p_false (n + 1) from above.  On average it delivers
    p_false for any law of the noise (with r below 2 a tenth less, since r is interpolated, and a
    fifth with very heavy tails); on one recording its probability has the law Beta(r, n + 1 - r)
    (David and Nagaraja 2003, 2.3), whose 95 % interval is returned.
    """
    n = len(peaks) if peaks.ndim else 0
    used = independent or n
    if not LEAST_BLOCKS <= used <= n or peaks.ndim > 2:
        raise ValueError(f"recording.threshold: peaks: shape {peaks.shape}; give 30 or more blocks")
    if p_false * (n + 1) < 1:
        advice = f"give {math.ceil(1 / p_false)} blocks or a larger p_false"
        raise ValueError(f"recording.threshold: p_false: {n} blocks cannot show it; {advice}")
    rank = np.clip((1 - p_false) * (n + 1) - 1, 0, n - 1)
    value = np.quantile(peaks, rank / (n - 1), axis=0)
    r = p_false * (used + 1)
    low, high = betaincinv(r, used + 1 - r, [0.025, 0.975]).tolist()
    return Threshold(value, low, high)


# Plots from cells


@checked
def plots(
    frames: Frames,
    eta: Annotated[float, Number(-1e50, 1e50)],
    law: Law = "gaussian",
    origin: Pair = (0.0, 0.0),
    cell: Pair = (1.0, 1.0),
) -> list:
    """Plots of each frame: a list of (n, 5), place on both axes, strength, accuracy on both axes.

    Cells above ``eta`` that touch, also at a corner, are one plot (Rosenfeld and Pfaltz 1966); a
    missing frame gives None.  Place is the centroid weighted by what is above the mean, strength
    the largest value.  Accuracy is the standard deviation of the place: 1.5 times the bound for a
    blurred point in white noise, sqrt(2 / pi) cells over the amplitude in units of the noise
    (Winick 1986), and the rounding to cells, 1 / sqrt(12) of a cell for one row, less for more.

    frames, eta : normalised; threshold in the same unit, above the noise's mean
    origin, cell : place of the centre of cell (0, 0), and size of a cell, on each axis.  With
        range (m) and azimuth (rad) the columns are those of chapter 04; chapter 05 takes x, y and
        amplitude, [r cos(a), r sin(a), sqrt(2 strength)].
    """
    mean = float(law == "exponential")
    if eta <= mean:
        raise ValueError(f"recording.plots: eta: {eta:g} is not above the noise's mean, {mean:g}")
    return [_plots(z, eta, mean, origin, cell) if (z == z).any() else None for z in frames]


def _plots(frame, eta, mean, origin, cell):
    """The table of :func:`plots` of one frame."""
    from scipy import ndimage

    label, n = ndimage.label(frame > eta, np.ones((3, 3)))
    if not n:
        return np.empty((0, 5))
    number = np.arange(1, n + 1)
    place = np.array(ndimage.center_of_mass(frame - mean, label, number))
    strength = np.array(ndimage.maximum(frame, label, number))[:, None]
    noise = BOUND / (np.sqrt(2 * strength) if mean else strength)
    boxes = ndimage.find_objects(label)
    rows = np.array([[side.stop - side.start for side in box] for box in boxes])
    accuracy = abs(cell) * np.sqrt(noise**2 + 1 / (12 * rows**3))
    return np.hstack([origin + cell * place, strength, accuracy])


@checked
def merge_plots(
    scan: Annotated[ArrayLike, Numbers("n", "d")],
    distance: Annotated[float, Number(0.0, 1e12)],
    weights: Any = None,
) -> Array:
    """Plots of one extended target made one: rows (m, d) of x, y and any further columns.

    Plots at most ``distance`` apart, also through others between them, are one (single linkage,
    Sibson 1973); each column is the mean over the group.

    weights : (n,) positive, such as strengths; None: all alike
    """
    from scipy.sparse.csgraph import connected_components

    place = _places("recording.merge_plots: scan", scan)
    weights = np.ones(len(scan)) if weights is None else weights
    w = numbers("recording.merge_plots: weights", weights, len(scan), low=1e-300)
    n, group = connected_components(abs(place[:, None] - place) <= distance, directed=False)
    member = (group == np.arange(n)[:, None]) * w
    return member @ scan / member.sum(axis=1, keepdims=True)


def _places(name, scan):
    """Places (n,) of the plots of a scan as x + iy."""
    scan = numbers(name, scan, "n", "d")
    if scan.shape[1] < 2:
        raise ValueError(f"{name}: shape {scan.shape}; give rows x, y, ...")
    return scan[:, 0] + 1j * scan[:, 1]


@checked
def starts(
    scans: Any, t: Annotated[ArrayLike, Numbers(3)], fastest: Positive, sigma: Positive
) -> tuple[Array, Array]:
    """Start states (n, 4) of [x, vx, y, vy] and covariances (n, 4, 4), from three scans in a row.

    scans : three arrays of rows x, y, further columns are not read; None was not taken
    t : their times; the states are those at the last one
    fastest, sigma : largest speed; standard deviation of a plot's place on each axis

    A start is a plot of the first and one of the last scan with a third one between them, within
    three standard deviations of constant velocity (two-point differencing, Bar-Shalom, Li and
    Kirubarajan 2001, 5.5.3).  The units are those of the plots.
    """
    before, after = np.diff(t).tolist()
    if len(scans) != 3 or min(before, after) <= 0:
        raise ValueError(f"recording.starts: {len(scans)} scans; give three, and t that rises")
    scans = [np.empty((0, 2)) if scan is None else scan for scan in scans]
    places = [_places(f"recording.starts: scans[{k}]", scan) for k, scan in enumerate(scans)]
    (first, middle, last), rate = places, 1 / (before + after)
    limit = 3 * sigma * math.hypot(1 / before, 1 / after, 1 / before + 1 / after)
    bend = [(last - m) / after - ((m - first) / before)[:, None] for m in middle]
    straight = (abs(np.reshape(bend, (middle.size, first.size, last.size))) <= limit).any(axis=0)
    v = (last - first[:, None]) * rate
    i, j = np.nonzero(straight & (abs(v) <= fastest))
    x = np.stack([last[j].real, v[i, j].real, last[j].imag, v[i, j].imag], axis=-1)
    P = np.kron(np.eye(2), sigma**2 * np.array([[1, rate], [rate, 2 * rate**2]]))
    return x, np.tile(P, (len(x), 1, 1))


# Blur


class Blur(NamedTuple):
    """Standard deviation of a target's image in cells on both axes, its errors, places used."""

    value: Array
    se: Array
    places: int


@checked
def blur_of(
    frames: Frames,
    law: Law = "gaussian",
    eta: Annotated[float, Number(3.0, 1e9)] = 8.0,
    half: Annotated[int, Integer(1, 100)] = 5,
) -> Blur:
    """Blur from the second moments of bright places, less 1/12 for the cell in which the peak is.

    frames, eta : normalised; least value of a place, the largest cell within 2 ``half`` cells
    half : cells on each side of the peak that a moment reads; three times the blur or more

    The images of the places are added, less the mean of their outermost cells; the moments read 3
    blurs and a cell to each side.  The width of power is the amplitude's over sqrt(2): ``sd_r``,
    ``sd_a`` of chapter 03 are sqrt(2) times it.  Places within ``half`` cells of the border or of a
    gap are not used; with fewer than five the result is NaN.
    """
    from scipy.ndimage import maximum_filter

    z = np.where(np.isnan(frames), -np.inf, frames)
    largest = maximum_filter(z, size=4 * half + 1, axes=(1, 2), mode="constant", cval=-np.inf)
    at = np.argwhere((z == largest) & (z > eta))
    inside = ((at[:, 1:] >= half) & (at[:, 1:] < np.array(z.shape[1:]) - half)).all(axis=1)
    patches = [z[k, i - half : i + half + 1, j - half : j + half + 1] for k, i, j in at[inside]]
    patches = np.array([patch for patch in patches if np.isfinite(patch).all()])
    if len(patches) < 5:
        return Blur(np.full(2, np.nan), np.full(2, np.nan), len(patches))
    edge = np.ones(patches.shape[1:], bool)
    edge[1:-1, 1:-1] = False
    patches = patches - patches[:, edge].mean()
    for read in range(min(3, half), half + 1):
        inner = slice(half - read, half + read + 1)
        found = _moments(patches[:, inner, inner])
        if read >= 3 * found.value.max() + 1:
            break
    return found


def _moments(patches):
    """Blur from patches (n, m, m) around peaks."""
    d2 = (np.arange(patches.shape[1]) - patches.shape[1] // 2) ** 2
    second = np.stack([patches.sum(axis=2) @ d2, patches.sum(axis=1) @ d2], axis=-1)
    total = patches.sum(axis=(1, 2))
    square = second.sum(axis=0) / total.sum()
    value = np.sqrt(np.maximum(square - 1 / 12, 1e-12))
    error = (second - square * total[:, None]).std(axis=0) / total.mean() / math.sqrt(len(total))
    return Blur(value, error / (2 * value), len(total))


@checked
def bin_cells(frames: Frames, n: Annotated[int, Integer(1, 1000)], law: Law = "gaussian") -> Array:
    """Frames of cells n times as wide, (K, nx // n, ny // n), for a blur above what a filter takes.

    gaussian:     the sum of n x n cells / n: white noise keeps its variance; the blur and a
                  target's summed amplitude are divided by n
    exponential:  the mean of n x n cells, no longer exponential: use :func:`normal_scores`

    A new cell is NaN if one of its cells is; rows and columns that are left over are dropped.
    """
    K, nx, ny = frames.shape
    if min(nx, ny) < n:
        raise ValueError(f"recording.bin_cells: n: {n} is more than {nx} x {ny} cells; lower it")
    z = frames[:, : nx - nx % n, : ny - ny % n].reshape(K, nx // n, n, ny // n, n)
    return z.sum(axis=(2, 4)) / (n if law == "gaussian" else n * n)


# A target in one's own frames


@checked
def inject(
    frames: Frames,
    path: Annotated[ArrayLike, Numbers("K", 2, nan=True)],
    strength: Annotated[ArrayLike, Numbers(..., low=0.0, high=1e50)],
    blur: Annotated[float, Number(0.0, 100.0)],
    rng: Generator,
    law: Law = "gaussian",
) -> Array:
    """A copy of the frames with a target in them.

    path : (K, 2) place in cells, counted from 0, NaN in frames without the target
    strength : "gaussian": amplitude A of the peak, A h is added; "exponential": power ratio S of
        the peak, |A h + v|**2 with |A|**2 = S and a phase that is uniform in each cell
        (chapter 03, eq. 5); a number or (K,)
    blur : standard deviation of the amplitude's image h in cells; 0: all in the nearest cell
    rng : draws the phases; unused in "gaussian" frames

    The strength does not fluctuate; for Swerling 1 give S * rng.standard_exponential(K).
    """
    K, nx, ny = frames.shape
    if strength.shape not in ((), (K,)):
        raise ValueError(f"recording.inject: strength: give one, or one for each of {K} frames")
    h = _profile(path[:, 0], nx, blur)[:, :, None] * _profile(path[:, 1], ny, blur)[:, None, :]
    strength = np.broadcast_to(strength, K)[:, None, None]
    if law == "gaussian":
        return frames + h * strength
    power = h * h * strength
    phase = np.cos(2 * np.pi * rng.random(frames.shape))
    return frames + power + 2 * np.sqrt(power * np.maximum(frames, 0.0)) * phase


def _profile(place, n, blur):
    """Image (K, n) of the target along one axis, 0 where its place is NaN."""
    d = np.arange(n) - (place[:, None] if blur else np.floor(place[:, None] + 0.5))
    with np.errstate(invalid="ignore"):
        h = np.exp(-(d**2) / (2 * blur * blur)) if blur else (d == 0).astype(float)
    return np.nan_to_num(h, nan=0.0)
