"""The page of the accumulation filter against answers that do not need it."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import tbdcore
from tbdcore import sensor
from tbdcore.repro import pages

page = tbdcore.page("mda_tbd")
SMALL = page.Scenario(N=300, B=100, scans=40)


def rng(*key):
    return np.random.default_rng([3, *key])


def scene(p, i=0):
    return page.simulate(p, rng(i, 0), rng(i, 1))


@pytest.mark.parametrize("source", ["history", "state", "known"])
@pytest.mark.parametrize("reading", ["own-cell", "least-squares", "per-sample"])
def test_scale_invariance(source, reading):
    """Power, noise, threshold and intensity prior times c: the same existence and positions, c
    times the intensity.
    """
    p, c = (
        replace(SMALL, source=source, reading=reading, R=12.0),
        4.0,
    )  # a power of two: not even rounding differs
    q = replace(p, noise=c * p.noise, P_max=c * p.P_max, P_walk=c * p.P_walk)
    z = scene(p)
    one, other = page.run(z, p, rng(2)), page.run(c * z, q, rng(2))
    assert np.array_equal(one.existence, other.existence)
    assert np.array_equal(one.x, other.x)
    assert np.allclose(other.P, c * one.P, rtol=1e-12)


def test_motion_is_the_matrix_of_equation_1():
    """F and the acceleration's column of each axis, on the draws of NumPy: first all of x, then all
    of y.
    """
    S, T, q = rng(6).normal(size=(4, 50)), 2.0, 0.3
    F, G = np.kron(np.eye(2), [[1.0, T], [0.0, 1.0]]), np.kron(np.eye(2), [[0.5 * T * T], [T]])
    assert np.allclose(
        page.propagate(S, q, T, rng(7)),
        F @ S + G @ (q * rng(7).standard_normal((2, 50))),
        rtol=1e-13,
        atol=1e-13,
    )


@pytest.mark.parametrize(("p0", "sign"), [(0.0, -1.0), (1.0, 1.0)])
def test_without_intensity_existence_is_the_markov_chain(p0, sign):
    """p_k = (1 -+ 0.98**k) / 2 when p_s = 1 - p_b and no particle leaves: a threshold that nothing
    passes, particles that stand.
    """
    p = replace(SMALL, R_T=20.0, accel=0.0, birth_speed=0.0, p_initial=p0, appears=41)
    existence = page.run(scene(p), p, rng(5)).existence
    assert existence == pytest.approx(0.5 * (1 + sign * 0.98 ** np.arange(1, 41)), rel=1e-9)


AREA = {
    "r_max": 11_024.0,
    "a_max": math.radians(49),
    "vx": 0.0,
    "vy": 0.0,
    "appears": 1,
    "scans": 5,
    "accel": 0.0,
    "birth_speed": 0.0,
}
CORNER = page.Scenario(**AREA, x0=7650.0, y0=7930.0, source="known", N=20_000, B=20_000, R=-3.0)


def lattice_filter(z, p, n=16):
    """Exact Bernoulli Bayes filter of a target that stands still, on n x n points per cell:
    existence and mean x, y in m.
    """
    places = np.meshgrid(*(0.5 + (np.arange(m * n) + 0.5) / n for m in p.grid[4:]), indexing="ij")
    rho, alpha = (axis.ravel() for axis in places)
    r, theta = p.r_min + p.dr * (rho - 0.5), p.a_min + p.da * (alpha - 0.5)
    x, y, density, results = r * np.cos(theta), r * np.sin(theta), np.zeros(rho.size), []
    for frame in z:
        ratio = np.exp(
            sensor.power_log_ratio(
                frame / p.noise, rho, alpha, np.full(rho.size, p.P_tar / p.noise), p.psf
            )
        )
        absent = 1.0 - density.sum()
        joint = ratio * (p.p_survive * density + p.p_birth * absent / rho.size)
        nothing = (1 - p.p_survive) * density.sum() + (1 - p.p_birth) * absent
        density = joint / (joint.sum() + nothing)
        results.append((density.sum(), density @ x / density.sum(), density @ y / density.sum()))
    return np.array(results)


def test_filter_equals_the_exact_lattice_filter():
    """Existence and mean position of a standing target over five frames, averaged over filter
    seeds.
    """
    z = scene(CORNER, 7)
    exact = lattice_filter(z, CORNER)
    tracks = [page.run(z, CORNER, rng(8, i)) for i in range(12)]
    existence = np.array([track.existence for track in tracks])
    spread = existence.std(axis=0, ddof=1) / math.sqrt(12)
    assert (abs(existence.mean(axis=0) - exact[:, 0]) < 4.5 * spread + 1e-3).all()
    assert 0.001 < exact[:, 0].min() < exact[:, 0].max() < 0.999  # neither trivial end
    place = np.array([track.x[-1, ::2] for track in tracks])
    assert (
        abs(place.mean(axis=0) - exact[-1, 1:]) < 4.5 * place.std(axis=0, ddof=1) / math.sqrt(12)
    ).all()


def test_one_frame_evidence_equals_the_integral():
    """The mean likelihood ratio of the births is the integral over the area, whose grid sum has
    converged.
    """
    z = scene(CORNER, 9)[:1]
    exact, finer = lattice_filter(z, CORNER)[0, 0], lattice_filter(z, CORNER, 24)[0, 0]
    assert finer == pytest.approx(exact, rel=1e-3)
    found = [page.run(z, CORNER, rng(10, i)).existence[0] for i in range(12)]
    assert np.mean(found) == pytest.approx(exact, abs=4.5 * np.std(found, ddof=1) / math.sqrt(12))


def test_own_cell_with_a_window_of_one_is_the_power_above_the_noise():
    p = replace(SMALL, window=1, R_T=-20.0)
    z = rng(11).standard_exponential((60, 40)) + 1.0
    rho, alpha = rng(12).uniform(0.5, 60.5, 50), rng(13).uniform(0.5, 40.5, 50)
    memory = np.zeros((1, 1, 50)), np.zeros(50, np.int64)
    snr = page.brightness(memory, z, rho, alpha, 3, p, rng(14))
    expected = z[(rho + 0.5).astype(int) - 1, (alpha + 0.5).astype(int) - 1] - 1.0
    assert snr == pytest.approx(np.where(expected >= 0.01, expected, 0.0), rel=1e-12)


@pytest.mark.parametrize("reading", list(page.READINGS))
def test_readings_agree_where_they_must(reading):
    """Identical samples, all above the threshold, and a full window: every reading returns the
    sample.
    """
    p = replace(SMALL, reading=reading)
    H = np.full((8, 1 + (reading == "least-squares"), 5), 3.0)
    if reading == "least-squares":
        H[:, 1] = 1.0
    assert page.accumulate(H, np.full(5, 8), 20, p) == pytest.approx(3.0)


def test_young_particles_by_reading():
    """Two frames of 12 and 4 out of eight, threshold 1: zeros count, or do not, or forbid an
    output; later frames than W_l only.
    """
    H = np.zeros((8, 1, 1))
    H[:2, 0, 0] = 12.0, 4.0
    values = {
        name: page.accumulate(H, np.array([2]), 20, replace(SMALL, reading=name))[0]
        for name in page.READINGS
        if name[0] != "l"
    }
    assert values == {"own-cell": 2.0, "available": 8.0, "strict": 0.0, "per-sample": 8.0}
    assert page.accumulate(H, np.array([2]), 6, SMALL)[0] == 0.0


def test_output_is_zero_or_at_least_the_threshold():
    p = replace(SMALL, R_T=3.0)
    H = rng(15).standard_exponential((8, 1, 4000)) * 2
    out = page.accumulate(H, np.full(4000, 8), 30, p)
    assert ((out == 0) | (out >= 10**0.3)).all()
    assert 0 < (out == 0).mean() < 1


def test_chance_of_a_false_pass():
    """P(Gamma_8 > 8 (1 + 10**(R_T/10))): 1.00e-2 at 0 dB and 2.76e-3 at 1 dB."""
    samples = rng(16).standard_exponential((8, 1, 400_000)) - 1.0
    for R_T, chance in ((0.0, 1.00e-2), (1.0, 2.76e-3)):
        passed = (
            page.accumulate(samples, np.full(400_000, 8), 30, replace(SMALL, R_T=R_T)) > 0
        ).mean()
        assert passed == pytest.approx(chance, abs=5e-5 + 4 * math.sqrt(chance / 400_000))


def test_wrong_spread_shifts_the_intensity_the_right_way():
    """Least squares at the true place: wide below the truth, narrow above it, 2 c / (1 + c) in the
    continuum.
    """
    p = page.Scenario(common=False, R=12.0)
    z, x = scene(p), page.target(p)[20:120]
    place = sensor.polar_cells(x[:, 0], x[:, 2], p.grid)
    for sharp, half, expected in ((0.1, (8, 20), 0.182), (1.0, (2, 6), 1.0), (10.0, (1, 3), 1.82)):
        q = replace(p, sharp=sharp, half_r=half[0], half_a=half[1])
        fit = sum(
            sensor.patch_fit(z[20 + k] / p.noise, *(axis[k : k + 1] for axis in place), q.assumed)[
                :, 0
            ]
            for k in range(100)
        )
        assert fit[0] / fit[1] * p.noise / p.P_tar == pytest.approx(
            expected, abs=0.35 * max(expected, 0.3)
        )


def test_births_by_power_are_weighted_back_to_uniform():
    """Importance weights average to one, and a weighted mean of the place is that of the area."""
    p = replace(SMALL, B=200_000)
    z = rng(17).standard_exponential((p.grid.nr, p.grid.na)) ** 1.5
    S, place, excess = page.births_by_power(z, p, rng(18))
    w = np.exp(-excess)
    assert w.mean() == pytest.approx(1.0, abs=4 * w.std() / math.sqrt(w.size))
    assert (w * place[0]).mean() == pytest.approx(
        250.5, abs=4 * (w * place[0]).std() / math.sqrt(w.size)
    )
    assert np.allclose(sensor.polar_cells(S[0], S[2], p.grid), place, atol=1e-6)


@pytest.mark.parametrize(
    "options",
    [
        {"likelihood": "averaged"},
        {"likelihood": "coherent", "source": "known"},
        {"births": "power"},
    ],
)
def test_variants_run_and_stay_probabilities(options):
    p = replace(SMALL, scans=20, half_r=1, half_a=4, **options)
    track = page.run(scene(p), p, rng(19))
    assert ((track.existence >= 0) & (track.existence <= 1)).all()
    assert track.ess.max() <= p.N + p.B


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"window": 0}, "window of 0 frames"),
        ({"R_T": 226.0}, "R_T = 226 dB"),
        ({"R_T": math.nan}, "R_T = nan dB"),
        ({"L_r": 36.0, "L_a": 14600.0}, "covers 0.248 cells|covers 0.25 cells"),
        ({"dr": 3.0}, "range: the region has 333.333 cells"),
    ],
)
def test_bad_scenarios_are_refused_in_one_line(change, message):
    with pytest.raises(ValueError, match=message) as error:
        replace(SMALL, **change)
    assert "\n" not in str(error.value)


def test_bad_data_are_refused_in_one_line():
    with pytest.raises(ValueError, match="target at cell .* is outside") as error:
        scene(replace(SMALL, x0=9500.0))
    assert "\n" not in str(error.value)
    z = scene(SMALL)
    z[3, 0, 0] = np.nan
    with pytest.raises(ValueError, match="frame 4 has a cell"):
        page.run(z, SMALL, rng(20))


@pytest.mark.parametrize(
    ("change", "some"),
    [({"R_T": 20.0, "window": 40}, False), ({"window": 1, "R": 12.0, "appears": 1}, True)],
)
def test_outputs_of_a_run_are_tabled_even_where_there_are_none(change, some):
    p, found = replace(SMALL, **change), {}
    claims = SimpleNamespace(
        check=lambda id, holds, evidence: found.update({id: (holds, evidence)})
    )
    names = {
        "base": p,
        "z": scene(p),
        "stream": lambda *_: rng(21),
        "claims": claims,
        "seed": 21,
        **vars(page),
    }
    for opening in ("def outputs(", "looked = ", "youngest = "):
        (source,) = [cell for cell in pages.cells("mda_tbd") if cell.startswith(opening)]
        exec(source, names)
    assert names["seen"].shape[1] == 3
    assert (len(names["seen"]) > 0) == some
    assert found["s2.thr"][0]
    assert found["s2.kwl"][0]
    assert ("no output in 40 frames" in found["s3.e1.delay"][1]) != some


def test_a_window_longer_than_the_run_is_refused():
    with pytest.raises(ValueError, match=r"parameter window: 201 is out of range; .*\[1, 200\]"):
        pages.validate("mda_tbd", {"window": 201})


def test_a_cloud_that_leaves_altogether_starts_anew_without_a_target():
    z, cloud = scene(SMALL)[0] / SMALL.noise, page.start(SMALL, rng(22))
    gone = cloud._replace(S=10.0 * cloud.S)
    after, estimate = page.step(gone, 1.0, z, 10, SMALL, rng(23))
    assert estimate.existence < 1e-200
    rho, alpha = sensor.polar_cells(after.S[0], after.S[2], SMALL.grid)
    assert ((rho >= 0.5) & (rho < 500.5) & (alpha >= 0.5) & (alpha < 90.5)).all()
    assert page.step(after, estimate.existence, z, 11, SMALL, rng(24))[1].existence < 0.1
