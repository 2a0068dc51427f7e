"""Laws of noise and the plain detector, against SciPy's laws, closed forms and brute force."""

import itertools

import numpy as np
import pytest
from scipy import integrate, stats

from tbdcore import baseline, noise

SHAPE = (60, 40, 30)


def rng(seed=1):
    return np.random.default_rng(seed)


def test_k_survival_is_the_integral_over_the_texture():
    for nu, power in itertools.product((0.5, 1.0, 3.0, 20.0), (0.0, 1e-3, 0.5, 4.6, 30.0)):
        law = stats.gamma(nu, scale=1 / nu)
        expected = integrate.quad(lambda t, x=power, law=law: np.exp(-x / t) * law.pdf(t), 0, 50)[0]
        assert noise.k_survival(power, nu) == pytest.approx(expected, rel=1e-5, abs=1e-9)
    assert np.isnan(noise.k_survival([np.nan, 1.0], 1.0)).tolist() == [True, False]


def test_k_power_has_its_law():
    z = noise.k_power(SHAPE, 1.5, rng())
    assert stats.kstest(z.ravel(), lambda x: 1 - noise.k_survival(x, 1.5)).pvalue > 0.01
    texture = noise.k_power((400, 20, 20), 1.5, rng(), (0.9, 0.0, 0.0))
    assert np.corrcoef(texture[1:].ravel(), texture[:-1].ravel())[0, 1] > 0.2
    assert stats.kstest(texture[::40].ravel(), lambda x: 1 - noise.k_survival(x, 1.5)).pvalue > 1e-3


@pytest.mark.parametrize("correlation", [(0.5, 0.0, 0.3), (0.0, 0.8, 0.0)])
def test_correlated_noise_falls_with_the_power_of_the_distance(correlation):
    z = noise.correlated((200, 60, 50), correlation, rng())
    assert z.var() == pytest.approx(1.0, abs=0.02)
    for axis, rho in enumerate(correlation):
        y = np.moveaxis(z, axis, 0)
        for n in (1, 2, 3):
            assert (y[n:] * y[:-n]).mean() == pytest.approx(rho**n, abs=0.02)


def test_power_of_correlated_scores_is_exponential():
    y = noise.correlated(SHAPE, (0.5, 0.5, 0.5), rng())
    assert stats.norm.sf(y) == pytest.approx(np.exp(-noise.as_power(y)))


def test_faults_are_what_they_say():
    z = noise.gaussian(SHAPE, rng())
    assert noise.louder(z, 3.0).var() / z.var() == pytest.approx(10**0.3)
    power = noise.exponential(SHAPE, rng())
    assert noise.louder(power, 3.0, "exponential").mean() / power.mean() == pytest.approx(10**0.3)
    rising = noise.sloped(np.ones((3, 5, 7)), 0.4, axis=2)
    assert rising[0, 0].tolist() == pytest.approx(np.linspace(0.8, 1.2, 7).tolist())


def test_a_missing_frame_of_a_list_is_nan():
    z = noise.louder([None, np.ones((2, 3)), None], 0.0)
    assert np.isnan(z).all(axis=(1, 2)).tolist() == [True, False, True]
    with pytest.raises(ValueError, match="every frame is missing"):
        noise.louder([None, None], 0.0)


# The plain detector


def image(blur, power):
    d = np.arange(-12, 13)
    h = [np.exp(-(d**2) / (2 * b * b)) ** power for b in blur]
    return np.outer(*h)


@pytest.mark.parametrize(("law", "power"), [("gaussian", 1), ("exponential", 2)])
def test_the_matched_filter_is_the_sum_over_the_image(law, power):
    z, blur = noise.exponential((2, 9, 8), rng()), (0.6, 1.4)
    z[0, 2, 3] = np.nan
    found, h = baseline.matched_filter(z, blur, law), image(blur, power)
    for k, i, j in [(0, 0, 0), (0, 3, 3), (1, 8, 5), (1, 4, 4)]:
        w = h[12 - i : 21 - i, 12 - j : 20 - j]
        part = np.where(np.isnan(z[k]), 0.0, w)
        value = np.nansum(part * (z[k] - (power == 2))) / np.sqrt((part**2).sum())
        assert found[k, i, j] == pytest.approx(value)


def test_a_blurred_target_has_its_full_energy_in_the_matched_filter():
    h = 5.0 * image((0.8, 0.8), 1)[None]
    assert baseline.matched_filter(h, 0.8)[0, 12, 12] == pytest.approx(np.sqrt((h**2).sum()))


@pytest.mark.parametrize("blur", [0.6, 2.0])
def test_a_place_with_less_than_a_tenth_of_its_energy_known_is_no_evidence(blur):
    z, h = np.zeros((1, 41, 41)), np.exp(-(np.arange(-40, 41) ** 2) / blur**2)
    z[0, :20] = np.nan
    share = np.array([h[60 - i : 81 - i].sum() for i in range(41)]) / h.sum()
    unknown = np.isnan(baseline.matched_filter(z, blur)[0, :, 20])
    assert abs(share - 0.1).min() > 1e-3
    assert (unknown == (share < 0.1)).all()


def test_a_place_without_known_cells_is_no_evidence():
    z = np.ones((2, 30, 30))
    z[0, :15], z[1] = np.nan, np.nan
    found = baseline.matched_filter(z, 0.7)
    assert np.isnan(found[0, :14]).all()
    assert np.isfinite(found[0, 14:, 5:25]).all()
    cells, value = baseline.brightest(np.where(np.isnan(found), found, np.arange(30.0)))
    assert cells.tolist()[1] == [-1, -1]
    assert (cells[0, 1], value[0], value[1]) == (29, 29.0, -np.inf)


def test_scores_of_declarations():
    hits = np.array([[1, 0, 0, 1, 1, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 1]], bool)
    assert baseline.delay(hits, 1).tolist() == [2, 5, 4]
    with pytest.raises(ValueError, match="start"):
        baseline.delay(hits, 6)


def test_mean_and_rmse_with_their_errors():
    x = rng().standard_normal((4000, 3))
    mean, se = baseline.mean_se(x)
    assert mean == pytest.approx(x.mean(axis=0))
    assert se == pytest.approx(stats.sem(x))
    mask = rng(2).random(x.shape) < 0.5
    rmse, influence = baseline.masked_rmse(np.where(mask, x, np.nan), mask)
    assert rmse == pytest.approx(np.sqrt((x[mask] ** 2).mean()))
    halves = [baseline.masked_rmse(x[n::200], mask[n::200])[0] for n in range(200)]
    assert influence.std() / 20**0.5 == pytest.approx(np.std(halves), rel=0.2)
