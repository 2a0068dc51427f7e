"""One scan of close tracks, its exact marginals by this package, and by Stone Soup's JPDA: for the
test and for the benchmark.
"""

import datetime

import numpy as np

from tbdcore.kernels import ljipda_ai

DETECT, CLUTTER = 0.9, 1e-5
WHEN = datetime.datetime(2020, 1, 1)
COVARIANCE = np.diag([90.0**2, 1.0, 70.0**2, 1.0])
NOISE = np.diag([20.0**2, 20.0**2])


def scan(seed, T, M):
    """Positions of T tracks that stand close together, and M plots among them."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-150, 150, (T, 2)), rng.uniform(-250, 250, (M, 2))


def our_marginals(where, plots):
    """Densities of all plots under all tracks, then the subset recursion: weights of no plot and of
    each plot.
    """
    D = np.broadcast_to(COVARIANCE[::2, ::2] + NOISE, (len(where), 2, 2)).copy()
    _, log_density = ljipda_ai.gate(plots, where, D, 1e6, 1.0)  # a gate that holds everything
    return ljipda_ai.jipda(
        log_density - np.log(CLUTTER), np.ones(len(where)), np.full(len(where), DETECT)
    )[0]


def peer_marginals(where, plots):
    """Stone Soup: PDA hypotheses, every joint hypothesis, weights of no plot and of each plot."""
    from stonesoup.dataassociator.probability import JPDA
    from stonesoup.hypothesiser.probability import PDAHypothesiser
    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import (
        CombinedLinearGaussianTransitionModel,
        ConstantVelocity,
    )
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.state import GaussianState
    from stonesoup.types.track import Track
    from stonesoup.updater.kalman import KalmanUpdater

    sensor = LinearGaussian(ndim_state=4, mapping=(0, 2), noise_covar=NOISE)
    predictor = KalmanPredictor(
        CombinedLinearGaussianTransitionModel([ConstantVelocity(0), ConstantVelocity(0)])
    )
    hypothesiser = PDAHypothesiser(
        predictor, KalmanUpdater(sensor), CLUTTER, DETECT, prob_gate=1.0, include_all=True
    )
    states = [GaussianState([[x], [0.0], [y], [0.0]], COVARIANCE, timestamp=WHEN) for x, y in where]
    tracks = [Track([state], id=str(t)) for t, state in enumerate(states)]
    detections = [Detection([[x], [y]], timestamp=WHEN, measurement_model=sensor) for x, y in plots]
    found = JPDA(hypothesiser).associate(tracks, set(detections), WHEN)
    beta = np.zeros((len(tracks), len(plots) + 1))
    for t, track in enumerate(tracks):
        for hypothesis in found[track]:
            column = detections.index(hypothesis.measurement) + 1 if hypothesis else 0
            beta[t, column] = float(hypothesis.probability)
    return beta
