"""What a cell says: closed forms, normalisation and invariances of the likelihood ratios; histories
of particles, OSPA by enumeration, a column of a table.
"""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.special import i0e

from tbdcore import particles
from tbdcore.kernels import mda_tbd


@pytest.mark.parametrize("ratio", [mda_tbd.coherent_log_ratio, mda_tbd.power_log_ratio])
@pytest.mark.parametrize("snr", [np.nan, np.inf])
def test_an_intensity_that_is_no_number_is_refused(ratio, snr):
    z, place = np.ones((20, 20)), np.array([10.0])
    with pytest.raises(ValueError, match=r"snr\[0\]: "):
        ratio(z, place, place, np.array([snr]), mda_tbd.Spread(1.44, 0.11, 2, 6))


def test_log_bessel_of_nan_is_nan():
    assert math.isnan(mda_tbd._log_bessel(math.nan, mda_tbd._bessel_table()))


@pytest.mark.parametrize(
    ("x", "most"),
    [(np.linspace(0.0, 31.999, 9973), 1e-10), (np.geomspace(32.0, 1e6, 997), 1e-8)],
)
def test_log_bessel_is_as_accurate_as_it_says(x, most):
    """In the table and beyond it, against scipy's scaled function."""
    table = mda_tbd._bessel_table()
    ours = np.array([mda_tbd._log_bessel(v, table) for v in x])
    np.testing.assert_allclose(ours, np.log(i0e(x)) + x, rtol=1e-15, atol=most)


def test_the_sum_over_amplitudes_begins_at_most_4_steps_below_its_largest_term():
    """Terms exp(-b**2 energy) prod I0(b x) by scipy, at b = (j + 0.5) width."""
    rng, table, below = np.random.default_rng(7), mda_tbd._bessel_table(), set()
    for _ in range(5000):
        x, energy, width = rng.uniform(0.0, 4.0, 3), rng.uniform(0.5, 2.0), rng.uniform(0.02, 1.0)
        b = width * (np.arange(400) + 0.5)
        terms = np.log(i0e(np.outer(b, x))) + np.outer(b, x)
        largest = int((terms.sum(axis=1) - b**2 * energy).argmax())
        below.add(largest - mda_tbd._near_maximum(x, energy, width, table))
    assert below == {0, 1, 2, 3, 4}


def test_power_beyond_the_limit_of_the_coherent_ratio_is_refused():
    place, snr, spread = np.array([2.0]), np.array([3.0]), mda_tbd.Spread(1.44, 0.11, 1, 1)
    z = np.full((3, 3), 1e8)
    assert mda_tbd.coherent_log_ratio(z, place, place, snr, spread) > 0
    z[1, 1] = np.nextafter(1e8, np.inf)
    with pytest.raises(ValueError, match=r"z\[1, 1\]: "):
        mda_tbd.coherent_log_ratio(z, place, place, snr, spread)


@pytest.mark.parametrize("decay", [300.0, 400.0, 700.0, 800.0, 5000.0])
def test_a_sharp_point_has_finite_ratios(decay):
    z = np.random.default_rng(3).standard_exponential((9, 9))
    spread = mda_tbd.Spread(decay, decay, 2, 2)
    place = np.array([4.0, 4.5, 4.3, 0.5]), np.array([5.0, 5.5, 5.2, 9.4])
    ours = mda_tbd.power_log_ratio(z, *place, np.full(4, 3.0), spread)
    theirs = mda_tbd.power_log_ratio_spec(z, *place, np.full(4, 3.0), spread)
    np.testing.assert_allclose(ours, theirs, rtol=1e-10, atol=1e-15)
    assert np.isfinite(mda_tbd.patch_fit(z, *place, spread)).all()
    assert np.isfinite(mda_tbd.coherent_log_ratio(z, *place, np.full(4, 3.0), spread)).all()


def test_a_strong_intensity_does_not_overflow():
    z, place = np.ones((9, 30)), (np.array([4.2]), np.array([15.1]))
    spread, snr = mda_tbd.Spread(1e-3, 1e-3, 4, 12), np.array([1e45])
    ours = mda_tbd.power_log_ratio(z, *place, snr, spread)
    np.testing.assert_allclose(
        ours, mda_tbd.power_log_ratio_spec(z, *place, snr, spread), rtol=1e-12
    )


def many_in_cells(shape, counts, rng):
    """Places and intensities of many particles in the named cells, and of some anywhere."""
    cells = np.repeat(list(counts), list(counts.values()), axis=0)
    rho, alpha = (cells + rng.uniform(-0.5, 0.5, cells.shape)).T
    some = rng.uniform(0.0, 1.0, (2, 300)) * (np.array(shape)[:, None] + 1.0)
    order = rng.permutation(rho.size + 300)
    snr = np.maximum(rng.normal(4.0, 3.0, order.size), 0.0)
    return np.append(rho, some[0])[order], np.append(alpha, some[1])[order], snr


@pytest.mark.parametrize(
    ("shape", "spread"),
    [
        ((40, 30), (1.44, 0.1112, 2, 6)),
        ((40, 30), (0.144, 0.01112, 4, 12)),
        ((40, 30), (1.44, 0.1112, 0, 0)),
        ((9, 7), (0.1, 0.05, 5, 30)),
        ((12, 2048), (1.44, 0.1112, 2, 6)),
    ],
)
def test_particles_of_one_cell_have_the_bits_that_they_have_alone(shape, spread):
    """7, 8 and 9 in a cell, one and two lots of 256, cells in the corners, and none at all."""
    rng, (nr, na) = np.random.default_rng(5), shape
    counts = {(3, 2): 7, (3, 3): 8, (5, 3): 9, (6, 6): 255, (7, 6): 256, (8, 6): 257, (9, 7): 600}
    counts |= {(1, 1): 20, (nr, na): 20, (1, na): 20, (nr, 1): 300, (2, 2): 1}
    rho, alpha, snr = many_in_cells(shape, counts, rng)
    snr[::50], snr[1::50] = 1e45, 1e-300
    z = rng.standard_exponential(shape).astype(np.float32)
    spread = mda_tbd.Spread(*spread)
    together = mda_tbd.power_log_ratio(z, rho, alpha, snr, spread)
    for n in range(0, rho.size, 3):
        one = slice(n, n + 1)
        alone = mda_tbd.power_log_ratio(z, rho[one], alpha[one], snr[one], spread)
        assert together[n] == alone[0]
    few = slice(0, 400)
    spec = mda_tbd.power_log_ratio_spec(z, rho[few], alpha[few], snr[few], spread)
    np.testing.assert_allclose(together[few], spec, rtol=1e-9, atol=1e-9)


def test_groups_are_the_cells_with_eight_particles_or_more():
    counts = [4, 7, 8, 9, 20]  # in no cell, and in four cells
    cell = np.random.default_rng(9).permutation(np.repeat([-1, 0, 2, 3, 5], counts))
    order, begins = mda_tbd._by_cell(cell, 7)
    groups = [order[a:b].tolist() for a, b in itertools.pairwise(begins)]
    assert groups == [np.flatnonzero(cell == c).tolist() for c in (2, 3, 5)]


def test_what_is_not_finite_stays_with_its_particle():
    """An intensity at the limit does not change the ratios of other particles in the cell."""
    rng = np.random.default_rng(8)
    rho, alpha = np.full(40, 5.1), np.full(40, 8.3)
    z, snr = rng.standard_exponential((9, 15)), np.full(40, 4.0)
    spread = mda_tbd.Spread(1e-3, 1e-3, 4, 12)
    usual = mda_tbd.power_log_ratio(z, rho, alpha, snr, spread)
    snr[7] = mda_tbd.HIGH
    ours = mda_tbd.power_log_ratio(z, rho, alpha, snr, spread)
    assert np.array_equal(np.delete(ours, 7), np.delete(usual, 7))
    assert ours[7] == pytest.approx(
        mda_tbd.power_log_ratio_spec(z, rho[:1], alpha[:1], snr[7:8], spread)[0], rel=1e-12
    )


# Range and azimuth

GRID = mda_tbd.polar_grid(11e3, 12e3, math.pi / 4, math.pi / 2, 2.0, math.radians(0.5))
SPREAD = mda_tbd.Spread(0.36 * 4.0, 1460 * math.radians(0.5) ** 2, 2, 6)


def power_ratio(z, rho, alpha, snr, spread=SPREAD):
    rho, alpha = np.atleast_1d(np.asarray(rho, float)), np.atleast_1d(np.asarray(alpha, float))
    return mda_tbd.power_log_ratio(
        z, rho, alpha, np.broadcast_to(np.asarray(snr, float), rho.shape).copy(), spread
    )


def test_polar_grid_and_cells():
    """500 x 90 cells; the corner of the region is the corner of cell (1, 1), and azimuth grows from
    +x towards +y.
    """
    assert GRID[4:] == (500, 90)
    r, a = GRID.r_min + 2.0 * 7.25, GRID.a_min + math.radians(0.5) * 30.5
    assert mda_tbd.polar_cells(r * math.cos(a), r * math.sin(a), GRID) == pytest.approx(
        (7.75, 31.0), abs=1e-8
    )
    with pytest.raises(ValueError, match="range: the region has 333.333 cells"):
        mda_tbd.polar_grid(11e3, 12e3, 0.0, 1.0, 3.0, 0.5)


@pytest.mark.parametrize("a_min", [-6.0, -math.pi, -1.0, -0.1, 0.0, 0.4, 3.0, 6.0])
@pytest.mark.parametrize("na", [3, 157, 314])
def test_a_region_may_lie_at_any_azimuth(a_min, na):
    """Up to a whole circle of 314 cells, and positions of both signs."""
    da = math.pi / 157
    grid = mda_tbd.polar_grid(0.0, 900.0, a_min, a_min + na * da, 1.0, da)
    alpha = np.linspace(0.51, na + 0.49, 97)
    a = a_min + da * (alpha - 0.5)
    found = mda_tbd.polar_cells(400.0 * np.cos(a), 400.0 * np.sin(a), grid)
    assert found[0] == pytest.approx(400.5)
    assert found[1] == pytest.approx(alpha, abs=1e-9)


def test_the_axes_have_azimuths_and_the_radar_has_none():
    grid = mda_tbd.polar_grid(0.0, 9.0, -math.pi / 2, math.pi, 1.0, math.pi / 2)
    x, y = np.array([[1, 0, -1, 0, 1, 0], [0, 1, 0, -1, -0.0, 0]])
    assert mda_tbd.polar_cells(x, y, grid)[1][:5] == pytest.approx([1.5, 2.5, 3.5, 0.5, 1.5])
    assert np.isnan(mda_tbd.polar_cells(x, y, grid)[1][5])


@pytest.mark.parametrize("sector", [(45.0, 46.0), (0.0, 8.0)])
def test_a_sector_beyond_a_circle_is_refused(sector):
    with pytest.raises(ValueError, match="azimuth: .* rad; give radians, at most a circle"):
        mda_tbd.polar_grid(0.0, 900.0, *sector, 1.0, 0.1)


def test_spread_closed_forms():
    """Area pi / sqrt(0.36 x 1460) / (2 m x 0.5 deg) = 7.851 cells."""
    assert mda_tbd.spread_area(SPREAD) == pytest.approx(7.851, abs=5e-4)
    assert mda_tbd.spread_power(250.2, 45.4, SPREAD, (500, 90)).sum() == pytest.approx(
        7.851, abs=0.01
    )


def test_patch_holds_the_power():
    """5 x 13 cells hold 99.8 % of sum h**2 for a point in the middle of its cell."""
    h2 = mda_tbd.spread_power(250.0, 45.0, SPREAD, (500, 90))
    assert h2[247:252, 38:51].sum() / h2.sum() == pytest.approx(0.998, abs=5e-4)


@pytest.mark.parametrize("common", [True, False])
def test_illuminated_cells_are_exponential_with_the_right_mean(common):
    """Equation (8): E z = snr h**2 + 1, and variance its square, whichever way the cells depend on
    each other.
    """
    rng, n, snr = np.random.default_rng(5), 20_000, 4.0
    z = rng.standard_exponential((n, 9, 15))
    place = np.full(n, 5.3), np.full(n, 8.2)
    if common:
        mda_tbd.add_target(z, *place, snr * rng.standard_exponential(n), SPREAD, rng)
    else:
        mda_tbd.add_target(z, *place, snr, SPREAD, None)
    mean = 1.0 + snr * mda_tbd.spread_power(5.3, 8.2, SPREAD, (9, 15))
    assert (
        abs(z.mean(axis=0) / mean - 1.0) < 4.5 / math.sqrt(n)
    ).all()  # 135 cells: 4.5 standard errors
    assert (abs(z.std(axis=0) / mean - 1.0) < 4.5 * math.sqrt(2 / n)).all()
    shared = np.corrcoef(z[:, 4, 7], z[:, 4, 8])[0, 1]
    s = mean - 1.0
    expected = (
        s[4, 7] * s[4, 8] / (mean[4, 7] * mean[4, 8]) if common else 0.0
    )  # covariance of |A|^2 h1^2 and |A|^2 h2^2
    assert shared == pytest.approx(expected, abs=6 / math.sqrt(n))


@pytest.mark.parametrize("shape", [(3, 50, 40), (0, 5, 5)])
def test_noise_power_is_the_generators_own_draw(shape):
    ours, theirs = (np.random.default_rng(9) for _ in range(2))
    z = mda_tbd.noise_power(shape, ours)
    assert z.dtype == np.float32
    assert np.array_equal(z, theirs.standard_exponential(shape, dtype=np.float32))
    assert ours.random() == theirs.random(), "the stream must go on where NumPy's does"


def test_target_outside_the_area_is_refused():
    z = np.ones((3, 9, 15))
    with pytest.raises(
        ValueError, match=r"target at cell \(9.6, 8.0\) is outside \(9, 15\); move it"
    ):
        mda_tbd.add_target(
            z, np.full(3, 9.6), np.full(3, 8.0), np.ones(3), SPREAD, np.random.default_rng(0)
        )


@pytest.mark.slow
def test_power_ratio_mean_under_noise_is_one():
    """A ratio of densities averages to one under the lower one; second moment prod (1 + s)**2 / (1
    + 2 s), so s is kept small.
    """
    rng, n, snr = np.random.default_rng(6), 40_000, 0.15
    z = rng.standard_exponential((n, 7, 15))
    values = np.exp([power_ratio(frame, 4.2, 7.9, snr)[0] for frame in z])
    s = snr * mda_tbd.spread_power(4.2, 7.9, SPREAD, (7, 15))[1:6, 1:14]
    second = np.prod((1 + s) ** 2 / (1 + 2 * s))
    assert values.mean() == pytest.approx(1.0, abs=4 * math.sqrt((second - 1) / n))


def test_power_ratio_peaks_at_the_target_and_is_minus_infinity_off_the_frame():
    z = 1.0 + 9.0 * mda_tbd.spread_power(30.3, 20.6, SPREAD, (60, 40))
    rho, alpha = (
        v.ravel()
        for v in np.meshgrid(np.arange(28, 33, 0.1), np.arange(15, 25, 0.1), indexing="ij")
    )
    best = np.argmax(power_ratio(z, rho, alpha, 9.0))
    assert (rho[best], alpha[best]) == pytest.approx((30.3, 20.6), abs=0.11)
    assert (power_ratio(z, [0.4, 60.5, 5.0, np.nan], [5.0, 5.0, 40.6, 5.0], 1.0) == -np.inf).all()
    assert power_ratio(z, 30.0, 20.0, 0.0)[0] == 0.0


def test_least_squares_fit_of_a_mismatched_spread():
    """Wide and narrow assumed spreads, factor c on both decays: the fitted intensity is 2 c / (1 +
    c) of the true one.
    """
    spread = mda_tbd.Spread(0.02, 0.02, 60, 60)  # fine cells, so that sums are integrals
    z = 1.0 + 5.0 * mda_tbd.spread_power(100.0, 100.0, spread, (199, 199))
    for c in (0.5, 1.0, 2.0):
        assumed = mda_tbd.Spread(0.02 * c, 0.02 * c, 60, 60)
        top, bottom = mda_tbd.patch_fit(z, np.array([100.0]), np.array([100.0]), assumed)
        assert top[0] / bottom[0] / 5.0 == pytest.approx(2 * c / (1 + c), rel=1e-4)


def coherent_oracle(z, rho, alpha, snr, spread):
    """The integral of the likelihood of one patch over the log of the amplitude, by quadrature."""
    i, j = (np.arange(1, n + 1) for n in z.shape)
    near = np.outer(
        abs(i - math.floor(rho + 0.5)) <= spread.hr, abs(j - math.floor(alpha + 0.5)) <= spread.ha
    )
    h2 = mda_tbd.spread_power(rho, alpha, spread, z.shape)[near]
    x = 2.0 * np.sqrt(h2 * z[near])

    def log_integrand(t):
        b = math.exp(t)
        return 2 * t - b * b * (1 / snr + h2.sum()) + (np.log(i0e(b * x)) + b * x).sum()

    t = np.linspace(-15.0, 15.0, 3001)
    rough = t[np.argmax([log_integrand(v) for v in t])]
    top = minimize_scalar(lambda t: -log_integrand(t), bounds=(rough - 0.02, rough + 0.02)).x
    most = log_integrand(top)
    sides = []
    for way in (-1.0, 1.0):
        width = 1e-7
        while log_integrand(top + way * width) > most - 40.0:
            width *= 2.0
        ends = top, top + way * width
        f = quad(lambda t: math.exp(log_integrand(t) - most), *ends, epsabs=0.0, epsrel=1e-6)
        sides.append(way * f[0])
    return most + math.log(2.0 / snr * sum(sides))


@pytest.mark.parametrize("patch", [(0, 0), (1, 4), (9, 14)])
@pytest.mark.parametrize("level", [0.0, 1.0, 1e2, 1e4, 1e6, 1e8])
def test_coherent_ratio_equals_the_quadrature(level, patch):
    """Noise, and a target of 0 to 80 dB in it, with intensities below and above its own."""
    rng = np.random.default_rng(7)
    spread = mda_tbd.Spread(0.3, 0.1, *patch)
    z = rng.standard_exponential((20, 25)) + level * mda_tbd.spread_power(
        9.7, 12.2, spread, (20, 25)
    )
    z = np.minimum(z, 1e8)
    for rho, alpha, snr in ((9.7, 12.2, 4.0), (9.2, 13.1, 3.0 + 3.0 * level), (20.4, 1.0, 0.02)):
        exact = coherent_oracle(z, rho, alpha, snr, spread)
        for step, error in ((0.25, 1e-4), (0.8, 1e-2)):
            ours = mda_tbd.coherent_log_ratio(z, [rho], [alpha], [snr], spread, step)
            assert ours[0] == pytest.approx(exact, abs=error, rel=1e-9)


def test_a_large_patch_of_the_largest_power_has_a_ratio():
    """The integral begins at its maximum, so that this ends at once; benchmarks time it."""
    large = mda_tbd.Spread(1e-4, 1e-4, 60, 60)
    assert mda_tbd.coherent_log_ratio(np.full((99, 99), 1e8), [50], [50], [1e50], large)[0] > 1e10


def test_coherent_ratio_equals_a_dense_sum():
    rng = np.random.default_rng(7)
    z = rng.standard_exponential((1, 20, 25))
    mda_tbd.add_target(z, np.array([9.7]), np.array([12.2]), np.array([30.0]), SPREAD, rng)
    rho = np.r_[9.7, 9.7 + rng.normal(size=20), 0.6, 20.4, -1.0]
    alpha = np.r_[12.2, 12.2 + 2 * rng.normal(size=20), 1.0, 25.3, 5.0]
    spread, snr = SPREAD._replace(hr=1, ha=4), np.full(rho.size, 4.0)
    exact = mda_tbd.coherent_log_ratio_spec(z[0], rho, alpha, snr, spread)
    ours = mda_tbd.coherent_log_ratio(z[0], rho, alpha, snr, spread, 0.2)
    assert ours == pytest.approx(exact, abs=5e-5)


def test_coherent_ratio_of_one_cell_is_the_power_ratio():
    """With one cell there is nothing to share: both likelihoods are the exponential of equation
    (7).
    """
    z = np.random.default_rng(8).standard_exponential((9, 9)) * 6
    one = SPREAD._replace(hr=0, ha=0)
    rho, alpha, snr = np.arange(1.2, 9), np.arange(1.4, 9), np.linspace(0.5, 9, 8)
    ours = mda_tbd.coherent_log_ratio(z, rho, alpha, snr, one, 0.1)
    assert ours == pytest.approx(mda_tbd.power_log_ratio(z, rho, alpha, snr, one), abs=1e-5)


def test_coherent_ratio_without_intensity_and_off_the_frame():
    z, place = np.ones((9, 9)), (np.array([4.0, 0.4]), np.array([4.0, 4.0]))
    assert mda_tbd.coherent_log_ratio(z, *place, np.array([0.0, 2.0]), SPREAD).tolist() == [
        0.0,
        -np.inf,
    ]


def test_coherent_ratio_mean_under_noise_is_one():
    rng, n = np.random.default_rng(9), 20_000
    z = rng.standard_exponential((n, 3, 3))
    spread = mda_tbd.Spread(1.44, 0.11, 1, 1)
    particle = np.array([2.1]), np.array([1.9]), np.array([0.1])
    values = np.exp([mda_tbd.coherent_log_ratio(frame, *particle, spread, 0.3)[0] for frame in z])
    assert values.mean() == pytest.approx(1.0, abs=4 * values.std() / math.sqrt(n))


# Ancestors' history


def test_history_travels_with_the_particle():
    """Every particle writes its own path into its history; after resampling the columns must still
    be those of the paths.
    """
    rng, window, N, births = np.random.default_rng(3), 4, 30, 10
    H, age = np.zeros((window, 1, N + births)), np.zeros(N + births, np.int64)
    paths = [() for _ in range(N + births)]
    for k in range(13):
        code = rng.random(N + births)
        H[k % window], age[:] = code, age + 1
        paths = [(*path, c) for path, c in zip(paths, code, strict=True)]
        ancestors = particles.systematic(rng.random(N + births) ** 4, N, rng.random())
        H, age = mda_tbd.inherit(H, age, ancestors, births)
        paths = [paths[a] for a in ancestors] + [()] * births
        for n, path in enumerate(paths):
            assert sorted(H[:, 0, n]) == sorted(
                [*path[-window:], *[0.0] * (window - len(path[-window:]))]
            )
            assert age[n] == len(path)


def test_history_of_the_newborn_is_empty_and_old_arrays_are_untouched():
    H, age = np.ones((3, 1, 5)), np.full(5, 7)
    moved, older = mda_tbd.inherit(H, age, np.array([4, 4]), 2)
    assert moved.tolist() == [[[1, 1, 0, 0]]] * 3
    assert older.tolist() == [7, 7, 0, 0]
    assert (H == 1).all()
    assert (age == 7).all()


@pytest.mark.parametrize("ancestor", [2, -1])
def test_an_ancestor_out_of_range_is_refused(ancestor):
    with pytest.raises(ValueError, match="ancestors must be"):
        mda_tbd.inherit(np.ones((1, 1, 2)), np.ones(2, int), np.array([1, ancestor]), 0)


def test_a_column_of_right_numbers_rarely_differs_and_a_shifted_one_does():
    """Rows on the same scenes are correlated: both tests keep their level all the same."""
    rng, r = np.random.default_rng(3), 4
    C = 0.01 * (0.6 + 0.4 * np.eye(r))
    root = np.linalg.cholesky(C)
    found = []
    for _ in range(4000):
        ours, paper = root @ rng.standard_normal(r), 2.0 * root @ rng.standard_normal(r)
        found.append(mda_tbd.column_test(ours, np.round(paper, 1), C, 4.0, half=0.05))
    _, _, z, p = np.array(found).T
    assert abs((np.abs(z) > 1.96).mean() - 0.05) < 4 * math.sqrt(0.05 * 0.95 / 4000)
    assert abs((p < 0.05).mean() - 0.05) < 4 * math.sqrt(0.05 * 0.95 / 4000) + 0.005
    shift, se, _, p = mda_tbd.column_test(np.ones(r), np.zeros(r), C, 4.0)
    assert shift == 1.0
    np.testing.assert_allclose(se, math.sqrt(5 * 0.01 * 0.7))
    assert p < 1e-4


def test_the_rounding_of_a_printed_column_adds_its_uniform_variance():
    """Half h: h**2 / 3, so that a difference of one standard deviation has z = 1, p = 0.317."""
    shift, se, z, p = mda_tbd.column_test([0.2], [0.0], [[0.01]], 0.0, half=0.3)
    np.testing.assert_allclose((shift, se, z), (0.2, 0.2, 1.0))
    np.testing.assert_allclose(p, 0.31731, atol=1e-5)


def brute_force_ospa(X, Y, c, p):
    """The definition: every injection of the smaller set into the larger one."""
    X, Y = sorted((X, Y), key=len)
    if not len(Y):
        return 0.0
    d = (
        np.minimum(np.linalg.norm(X[:, None] - Y[None], axis=-1), c)
        if len(X)
        else np.zeros((0, len(Y)))
    )
    pairings = itertools.permutations(range(len(Y)), len(X))
    best = min(sum(d[i, j] ** p for i, j in enumerate(pairing)) for pairing in pairings)
    return ((best + c**p * (len(Y) - len(X))) / len(Y)) ** (1 / p)


def test_bernoulli_ospa_is_ospa_of_at_most_one_point():
    """An estimate at the declaration threshold is empty; the order p does not matter."""
    rng = np.random.default_rng(13)
    x, truth, existence = rng.uniform(0, 300, (60, 2)), rng.uniform(0, 300, (60, 2)), rng.random(60)
    truth[::3], existence[:6] = np.nan, [0.5, 0.5, 0.5, 0.51, 0.51, 0.51]
    ours = mda_tbd.ospa_bernoulli(x, existence, truth, 200.0)
    for k in range(60):
        X, Y = (
            x[k : k + 1][existence[k : k + 1] > 0.5],
            truth[k : k + 1][~np.isnan(truth[k : k + 1, 0])],
        )
        assert ours[k] == pytest.approx(brute_force_ospa(X, Y, 200.0, 1 + k % 2), rel=1e-12)
    assert ours.shape == (60,)
