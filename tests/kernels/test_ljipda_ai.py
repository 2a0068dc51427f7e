"""Association against brute force, closed forms, quadrature and symmetry."""

import itertools
import math

import numpy as np
import pytest
from scipy import integrate, special

from tbdcore import kalman
from tbdcore.kernels import ljipda_ai
from tbdcore.kernels.ljipda_ai import ipda, jipda, ljipda, modulated_log_ratio, visibility

RNG_SEEDS = range(6)


def scene(seed, T, M, outside=0.2):
    rng = np.random.default_rng(seed)
    log_ratio = rng.normal(0.0, 2.0, (T, M))
    log_ratio[rng.random((T, M)) < outside] = -np.inf
    return log_ratio, rng.uniform(0.1, 0.95, T), rng.uniform(0.5, 0.95, T)


def plain_ljipda(log_ratio, existence, detect):
    return ljipda(log_ratio, np.zeros_like(log_ratio), existence, detect)


def lm_ipda(log_ratio, existence, detect):
    return ipda(modulated_log_ratio(log_ratio, existence, detect), existence, detect)


ALL = [ipda, jipda, plain_ljipda, lm_ipda]


def by_matrices(log_ratio, existence, detect):
    """Every 0/1 validation matrix with at most one 1 per row and column, existence a variable of
    its own.
    """
    T, M = log_ratio.shape
    mass, joint, alive = 0.0, np.zeros((T, M + 1)), np.zeros(T)
    for bits in itertools.product((0, 1), repeat=T * M):
        A = np.reshape(bits, (T, M)) if M else np.zeros((T, 0))
        if (A.sum(axis=0) > 1).any() or (A.sum(axis=1) > 1).any():
            continue
        for exists in itertools.product((0, 1), repeat=T):
            if any(A[t].any() and not exists[t] for t in range(T)):
                continue
            w = 1.0
            for t in range(T):
                w *= existence[t] if exists[t] else 1 - existence[t]
                if exists[t]:
                    w *= (
                        detect[t] * math.exp(log_ratio[t, A[t].argmax()])
                        if A[t].any()
                        else 1 - detect[t]
                    )
            mass += w
            for t in range(T):
                if exists[t]:
                    alive[t] += w
                    joint[t, A[t].argmax() + 1 if A[t].any() else 0] += w
    return joint / alive[:, None], alive / mass


@pytest.mark.parametrize("seed", RNG_SEEDS)
@pytest.mark.parametrize(("T", "M"), [(1, 3), (2, 2), (2, 3), (3, 2), (3, 3)])
def test_subset_recursion_equals_enumeration_and_brute_force(seed, T, M):
    args = scene(seed, T, M)
    ours, listed, brute = jipda(*args), ljipda_ai.jipda_spec(*args), by_matrices(*args)
    for our, enumerated, binary in zip(ours, listed, brute, strict=True):
        np.testing.assert_allclose(our, enumerated, rtol=1e-12)
        np.testing.assert_allclose(our, binary, rtol=1e-12, atol=1e-15)


def test_jipda_of_certain_tracks_is_jpda():
    """Two tracks, two plots, existence one: the seven JPDA events written out."""
    (a, b), (c, d) = L = np.array([[0.7, 2.1], [1.3, 0.4]])
    D, q = 0.9, 0.1
    none, one = q * q, D * q
    weights = {
        "a": one * a,
        "b": one * b,
        "c": one * c,
        "d": one * d,
        "ad": D * D * a * d,
        "bc": D * D * b * c,
    }
    total = none + sum(weights.values())
    beta, existence = jipda(np.log(L), np.ones(2), np.full(2, D))
    expected = [
        [
            none + weights["c"] + weights["d"],
            weights["a"] + weights["ad"],
            weights["b"] + weights["bc"],
        ],
        [
            none + weights["a"] + weights["b"],
            weights["c"] + weights["bc"],
            weights["d"] + weights["ad"],
        ],
    ]
    np.testing.assert_allclose(beta, np.array(expected) / total, rtol=1e-13)
    np.testing.assert_allclose(existence, 1.0, rtol=1e-14)


@pytest.mark.parametrize("seed", RNG_SEEDS)
@pytest.mark.parametrize("method", [jipda, plain_ljipda, lm_ipda])
def test_one_isolated_track_is_ipda(seed, method):
    args = scene(seed, 1, 5)
    for our, single in zip(method(*args), ipda(*args), strict=True):
        np.testing.assert_allclose(our, single, rtol=1e-13)


@pytest.mark.parametrize("method", ALL)
def test_tracks_that_share_no_plot_do_not_know_each_other(method):
    log_ratio, existence, detect = scene(3, 3, 9, outside=0.0)
    apart = np.kron(np.eye(3), np.ones(3)) > 0
    log_ratio = np.where(apart, log_ratio, -np.inf)
    for our, single in zip(
        method(log_ratio, existence, detect), ipda(log_ratio, existence, detect), strict=True
    ):
        np.testing.assert_allclose(our, single, rtol=1e-13)


@pytest.mark.parametrize("seed", RNG_SEEDS)
def test_modulated_density_is_exact_for_two_tracks_and_one_plot(seed):
    args = scene(seed, 2, 1, outside=0.0)
    for lm, exact in zip(lm_ipda(*args), jipda(*args), strict=True):
        np.testing.assert_allclose(lm, exact, rtol=1e-13)
    assert (
        abs(plain_ljipda(*args)[0] - jipda(*args)[0]).max() > 1e-3
    )  # the paper's visibility is not


def test_zero_information_amplitude_is_ljipda_bit_for_bit():
    log_ratio, existence, detect = scene(5, 3, 8)
    excess = np.random.default_rng(5).exponential(size=8)
    with_amplitude = ljipda(
        log_ratio, ljipda_ai.amplitude_ratio(excess, np.zeros(3)), existence, detect
    )
    for our, plain in zip(with_amplitude, plain_ljipda(log_ratio, existence, detect), strict=True):
        np.testing.assert_array_equal(our, plain)


def test_visibility_by_enumeration_of_the_claims_on_a_plot():
    """Tracks claim a plot independently with the prior (12); at most one of them is right."""
    log_ratio, existence, detect = scene(6, 3, 4, outside=0.0)
    density = np.exp(log_ratio)
    prior = (detect * existence)[:, None] * density / density.sum(axis=1, keepdims=True)
    total, unclaimed = np.zeros(4), np.zeros((3, 4))  # by others than t
    for claims in itertools.product((False, True), repeat=3):
        if sum(claims) <= 1:
            weight = np.where(np.array(claims)[:, None], prior, 1 - prior).prod(axis=0)
            total += weight
            for t in range(3):
                unclaimed[t] += weight if sum(claims) == claims[t] else 0
    np.testing.assert_allclose(
        visibility(log_ratio, existence, detect), unclaimed / total, rtol=1e-12
    )


@pytest.mark.parametrize("method", ALL)
@pytest.mark.parametrize("seed", RNG_SEEDS)
def test_weights_sum_to_one_and_order_does_not_matter(method, seed):
    log_ratio, existence, detect = scene(seed, 4, 5)
    beta, posterior = method(log_ratio, existence, detect)
    np.testing.assert_allclose(beta.sum(axis=1), 1.0, rtol=1e-14)
    assert ((posterior > 0) & (posterior < 1)).all()
    rng = np.random.default_rng(seed)
    t, m = rng.permutation(4), rng.permutation(5)
    beta2, posterior2 = method(
        np.ascontiguousarray(log_ratio[np.ix_(t, m)]), existence[t], detect[t]
    )
    np.testing.assert_allclose(
        beta2, np.column_stack([beta[t, :1], beta[np.ix_(t, m + 1)]]), rtol=1e-12, atol=1e-300
    )
    np.testing.assert_allclose(posterior2, posterior[t], rtol=1e-12)


@pytest.mark.parametrize("method", ALL)
def test_empty_scan_and_no_track(method):
    existence, detect = np.array([0.9, 0.3]), np.array([0.8, 0.6])
    beta, posterior = method(np.empty((2, 0)), existence, detect)
    np.testing.assert_array_equal(beta, np.ones((2, 1)))
    np.testing.assert_allclose(
        posterior, (1 - detect) * existence / (1 - detect * existence), rtol=1e-14
    )
    beta, posterior = method(np.empty((0, 3)), np.empty(0), np.empty(0))
    assert beta.shape == (0, 4)
    assert posterior.shape == (0,)


def log_enumeration(log_ratio, existence, detect):
    """The marginals of jipda_spec with every weight a logarithm."""
    T, M = log_ratio.shape
    events = [
        e
        for e in itertools.product(range(M + 1), repeat=T)
        if len(set(e) - {0}) == sum(m > 0 for m in e)
    ]
    log_w = np.column_stack(
        [np.log1p(-detect * existence), np.log(detect * existence)[:, None] + log_ratio]
    )
    weight = np.array([sum(log_w[t, m] for t, m in enumerate(e)) for e in events])
    joint = [
        [
            special.logsumexp([w for w, e in zip(weight, events, strict=True) if e[t] == m])
            for m in range(M + 1)
        ]
        for t in range(T)
    ]
    return np.exp(np.array(joint) - special.logsumexp(weight))


@pytest.mark.parametrize("size", [50.0, 700.0, 20000.0])
@pytest.mark.parametrize("seed", RNG_SEEDS)
def test_exact_marginals_survive_any_evidence(size, seed):
    rng = np.random.default_rng(seed)
    log_ratio = size * rng.choice([-1.0, 0.5, 1.0], (3, 4)) + rng.normal(size=(3, 4))
    existence, detect = np.full(3, 0.9), np.full(3, 0.95)
    beta, posterior = jipda(log_ratio, existence, detect)
    exact = log_enumeration(log_ratio, existence, detect)
    exact[:, 0] *= (1 - detect) * existence / (1 - detect * existence)
    np.testing.assert_allclose(posterior, exact.sum(axis=1), rtol=1e-9)
    np.testing.assert_allclose(
        beta, exact / exact.sum(axis=1, keepdims=True), rtol=1e-8, atol=1e-290
    )


@pytest.mark.parametrize("seed", RNG_SEEDS)
def test_potentials_scale_the_best_event_to_one_and_all_factors_to_at_most_one(seed):
    rng = np.random.default_rng(seed)
    log_w, log_miss = rng.normal(0, 30, (3, 4)), rng.normal(0, 30, 3)
    a, v = ljipda_ai._potentials(log_w, log_miss)
    assert max((log_w + a[:, None] + v).max(), (log_miss + a).max(), v.max()) < 1e-9
    sums = [
        sum(log_miss[t] if m < 0 else log_w[t, m] for t, m in enumerate(event))
        for event in itertools.product([-1, *range(4)], repeat=3)
        if len(set(used := [m for m in event if m >= 0])) == len(used)
    ]
    np.testing.assert_allclose(max(sums) + a.sum() + v.sum(), 0, atol=1e-9)


@pytest.mark.parametrize("method", ALL)
def test_nothing_overflows(method):
    log_ratio = np.array([[1e4, 9e3, -1e4], [1e4, -np.inf, 8e3]])
    beta, posterior = method(log_ratio, np.array([0.5, 0.5]), np.array([0.9, 0.9]))
    assert np.isfinite(beta).all()
    np.testing.assert_allclose(beta.sum(axis=1), 1.0)
    np.testing.assert_allclose(posterior, 1.0)


# Gate ---------------------------------------------------------------------------------------------
# ---------------------


def test_gate_holds_its_probability():
    """The gated density integrates to one: 1 - exp(-gamma / 2) of the Gaussian is inside."""
    D, gamma = np.array([[[400.0, 150.0], [150.0, 900.0]]]), 9.0
    side = np.linspace(-120, 120, 1201)
    z = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    inside, log_p = ljipda_ai.gate(z, np.zeros((1, 2)), D, gamma, 1 - math.exp(-gamma / 2))
    cell = (side[1] - side[0]) ** 2
    assert np.exp(log_p).sum() * cell == pytest.approx(
        1.0, abs=2e-3
    )  # the grid's step across the edge of the ellipse
    assert inside.size * cell == pytest.approx(
        math.pi * gamma * math.sqrt(np.linalg.det(D[0])), rel=2e-3
    )


# Amplitude ----------------------------------------------------------------------------------------
# ---------------------


@pytest.mark.parametrize("snr", [0.3, 1.0, 10.0, 100.0])
def test_amplitude_ratio_has_mean_one_under_noise(snr):
    def integrand(u):
        return math.exp(ljipda_ai.amplitude_ratio(np.array([u]), np.array([snr]))[0, 0] - u)

    mean, error = integrate.quad(integrand, 0, np.inf, limit=400, epsabs=1e-10)
    assert mean == pytest.approx(1.0, abs=max(1e-8, 10 * error))


@pytest.mark.parametrize("p_false", [0.5688, 1e-3])
def test_amplitude_ratio_is_that_of_the_truncated_rayleigh_densities(p_false):
    """Eqs. (1) to (7) literally, on amplitudes, for two thresholds: the ratio depends on the excess
    only.
    """
    d, tau = 10.0, math.sqrt(-2 * math.log(p_false))
    p_detect = integrate.quad(
        lambda a: a / (1 + d) * math.exp(-(a**2) / (2 * (1 + d))), tau, np.inf
    )[0]
    assert p_detect == pytest.approx(p_false ** (1 / (1 + d)), rel=1e-10)
    a = tau + np.array([0.0, 0.4, 2.0, 5.0])
    ratio = (a / (1 + d) * np.exp(-(a**2) / (2 * (1 + d))) / p_detect) / (
        a * np.exp(-(a**2) / 2) / p_false
    )
    np.testing.assert_allclose(
        np.exp(ljipda_ai.amplitude_ratio((a**2 - tau**2) / 2, np.array([d])))[0], ratio, rtol=1e-9
    )
    assert ratio[0] == pytest.approx(1 / (1 + d))


def test_amplitude_information_of_both_hypotheses():
    d = np.array([10.0])
    mean_excess = np.array([1.0, 11.0])  # the log ratio is linear in the excess
    noise, target = ljipda_ai.amplitude_ratio(mean_excess, d)[0]
    assert noise == pytest.approx(10 / 11 - math.log(11))
    assert target == pytest.approx(10 - math.log(11))


# Tracks in Cartesian coordinates
# ---------------------------------------------------------------------------------------


def test_one_certain_plot_is_a_kalman_update():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(4, 4))
    x, P, z = rng.normal(size=(1, 4)) * 1e4, (A @ A.T)[None] * 100, rng.normal(size=(1, 2)) * 1e4
    zhat, R, D = ljipda_ai.gate_tracks(x, P, 1e4, 1e-6)
    mean, cov = ljipda_ai.update_mixture(x, P, D, z, np.array([[0.0, 1.0]]))
    H = np.eye(4)[::2]
    exact = kalman.update(x[0], P[0], z[0] - zhat[0], H, R[0])
    np.testing.assert_allclose(mean[0], exact[0], rtol=1e-9)
    np.testing.assert_allclose(cov[0], exact[1], rtol=1e-9, atol=1e-9)


def test_bound_is_the_kalman_covariance_when_every_plot_arrives():
    rng = np.random.default_rng(4)
    A = rng.normal(size=(2, 4, 4))
    P, F = (
        A @ np.swapaxes(A, 1, 2) + np.eye(4),
        np.broadcast_to(np.kron(np.eye(2), [[1.0, 2.0], [0.0, 1.0]]), (5, 2, 4, 4)),
    )
    R = np.arange(1.0, 7.0)[:, None, None, None] * np.diag([3.0, 5.0]) * np.ones((2, 1, 1))
    bound, H = ljipda_ai.position_bound(F, R, P, 1.0), np.eye(4)[::2]
    for t in range(2):
        cov = P[t]
        for k in range(5):
            x, cov = kalman.predict(np.zeros(4), cov, F[k, t], np.zeros((4, 4)))
            cov = kalman.update(x, cov, np.zeros(2), H, R[k + 1, t])[1]
        np.testing.assert_allclose(bound[-1, t], cov, rtol=1e-9)


def test_too_many_tracks_are_refused_before_memory_is():
    assert ljipda_ai.MAX_TRACKS == 16
    with pytest.raises(ValueError, match="the limit is 16 tracks"):
        jipda(np.zeros((17, 3)), np.full(17, 0.9), np.full(17, 0.9))
    beta, _ = jipda(np.zeros((12, 2)), np.full(12, 0.9), np.full(12, 0.9))
    np.testing.assert_allclose(beta.sum(axis=1), 1.0)


def test_a_cluster_has_at_most_16_tracks():
    """Two clusters of 16 that share a plot each; a seventeenth track in one of them."""
    log_ratio = np.full((33, 2), -np.inf)
    log_ratio[:16, 0] = log_ratio[16:, 1] = 1.0
    even = np.full(33, 0.5)
    beta, existence = ljipda_ai.clustered_jipda(log_ratio[:32], even[:32], even[:32])
    each = jipda(log_ratio[:16], even[:16], even[:16])
    assert np.array_equal(beta[:16], each[0])
    assert np.array_equal(existence[16:], each[1])
    with pytest.raises(ValueError, match="^x: over 16 tracks share plots"):
        ljipda_ai.clustered_jipda(log_ratio, even, even)


def test_kept_rmse_and_its_error():
    rng = np.random.default_rng(1)
    e, kept = rng.normal(size=(4000, 3, 2, 2)) * [1.0, 3.0], rng.random((4000, 2)) < 0.7
    rmse, influence = ljipda_ai.kept_rmse(e, kept)
    np.testing.assert_allclose(
        rmse[:, 1], np.sqrt((e[kept[:, 1], :, 1] ** 2).mean(axis=0)), rtol=1e-12
    )
    np.testing.assert_allclose(influence.mean(axis=0), 0.0, atol=1e-12)
    resampled = [
        ljipda_ai.kept_rmse(e[i], kept[i])[0] for i in rng.integers(4000, size=(200, 4000))
    ]
    error = np.std(influence, axis=0) / math.sqrt(len(influence))
    np.testing.assert_allclose(error, np.std(resampled, axis=0), rtol=0.25)  # 200: 5 %, 5 sigma


def test_the_influence_of_each_trial_is_a_derivative():
    """That of trial i: n times the change of the RMSE by the share of i, with the others kept."""
    rng, step = np.random.default_rng(2), 1e-6
    e, kept = rng.normal(size=(5, 1, 1, 2)), np.array([[True], [True], [False], [True], [False]])
    rmse, influence = ljipda_ai.kept_rmse(e, kept)
    for i in range(5):
        share = np.full(5, (1 - step) / 5)
        share[i] += step
        share = share[:, None] * kept[:, 0, None]
        more = np.sqrt((share * e[:, 0, 0] ** 2).sum(axis=0) / share.sum(axis=0))
        np.testing.assert_allclose(influence[i, 0, 0], (more - rmse[0, 0]) / step, atol=1e-5)


def test_no_kept_trial_is_nan():
    rmse, _ = ljipda_ai.kept_rmse(np.ones((3, 2, 1, 2)), np.zeros((3, 1), bool))
    assert np.isnan(rmse).all()


@pytest.mark.parametrize("part", [0, 1])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_one_number_that_is_not_finite_is_enough_for_a_refusal(part, value):
    tracks = [np.zeros((1, 4)), np.zeros((1, 4, 4))]
    tracks[part].flat[3] = value
    with pytest.raises(ValueError, match=r"^ljipda_ai: .*NaN or infinite"):
        ljipda_ai._finite_tracks(*tracks)
