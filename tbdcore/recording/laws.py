"""Any law of the noise: measured from noise, and the normal scores of frames under it.

``frames`` (K, nx, ny) are in their order of time; **a gap is NaN**, a cell or a frame.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from tbdcore.checks import Array, Number, checked, numbers
from tbdcore.noise import Frames

__all__ = ["TailedLaw", "empirical_law", "normal_scores"]

SMALL = 1e-300


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
    if p.shape != z.shape:
        words = f"its cdf gives shape {p.shape} for {z.shape}; give the law of one cell"
        raise ValueError(f"recording.normal_scores: law: {words}")
    numbers("recording.normal_scores: law", p[z == z], "N", low=0.0, high=1.0)
    right = p > 0.5
    scores = ndtri(np.maximum(p, SMALL))
    scores[right] = -ndtri(np.maximum(sf(z[right]), SMALL))
    return scores
