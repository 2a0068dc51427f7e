"""From a recording to what a filter takes: noise, background, thresholds, plots, blur, a target.

    at = recording.clipped(frames)                      # mean and spread of the noise
    z = recording.normalise(frames, at)                 # white noise: mean 0, variance 1
    print(misfit.fit(z))                                # does the noise look like that?
    cut = recording.windows(z, 11, (20, 20), away=place)  # away from where a target may be
    peaks = [statistic(block) for block in cut.blocks[~cut.control]]
    V_T = recording.threshold(peaks, 0.05).value

``frames`` (K, nx, ny) are in their order of time; a list will do, in which None is a missing frame.
**A gap is NaN**, a cell or a frame: estimates leave it out, and frames that are returned keep it.

The law of the noise is ``"gaussian"`` (values around a mean, chapters 01 and 02) or
``"exponential"`` (power, chapter 03); ``normal_scores`` turns any other law into a
Gaussian one.  *Normalised* frames have noise of mean 0 and variance 1, or power of mean 1.

``levels``      noise and background: the level of each cell, frames in units of it
``laws``        any law of the noise
``thresholds``  blocks without a target, the threshold that they give, what a control delivers
``detections``  plots from cells, plots of one ship made one, start states
``tables``      scans of plots from the rows of a table
``tracks``      tracks that start and end
``targets``     blur, and a target in one's own frames
``misfit``      whether frames agree with what a filter is told
"""

from tbdcore.recording.detections import Unit, merge_plots, noise_unit, plots, starts
from tbdcore.recording.laws import TailedLaw, empirical_law, normal_scores
from tbdcore.recording.levels import Level, background, bin_cells, clipped, normalise
from tbdcore.recording.tables import cartesian, scans
from tbdcore.recording.targets import Blur, blur_of, inject, kept
from tbdcore.recording.thresholds import (
    Outcome,
    Threshold,
    Windows,
    blocks,
    outcome,
    suspects,
    threshold,
    windows,
)
from tbdcore.recording.tracks import Tracks, follow

__all__ = ["Blur", "Level", "Outcome", "TailedLaw", "Threshold", "Tracks", "Unit", "Windows"]
__all__ += ["background", "bin_cells", "blocks", "blur_of", "cartesian", "clipped"]
__all__ += ["empirical_law", "follow", "inject", "kept", "merge_plots", "noise_unit"]
__all__ += ["normal_scores", "normalise", "outcome", "plots", "scans", "starts", "suspects"]
__all__ += ["threshold", "windows"]
