"""Single faults, planted one at a time into a copy of the package, and the test that must fail.

A fault replaces a text that occurs exactly once; where a line has been rewritten, its fault must be
written anew.  Only the named test runs on the copy; before that, all named tests must pass on a
copy without a fault.
"""

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
import tiny

TESTS = Path(__file__).parents[1]


class Plant(NamedTuple):
    """A fault: in which file of the repository, what stands there, what is put there, and the test
    that must notice.
    """

    what: str
    file: str
    old: str
    new: str
    test: str


FAULTS = [
    Plant(
        "a corrected value that nobody has to list",
        "tbdcore/repro/changes.py",
        "if values[-1] != now.value:",
        "if values[-1] != values[-1]:",
        "harness/test_changes.py::test_a_value_that_was_corrected_without_a_line_is_named",
    ),
    Plant(
        "an old value that is looked for in one column only",
        "tbdcore/repro/corrections.py",
        "for column in COLUMNS:",
        'for column in ("value",):',
        "harness/test_corrections.py::test_other_columns_of_the_claims_are_named",
    ),
    Plant(
        "numbers that follow from an old value",
        "tbdcore/repro/corrections.py",
        "return digits in gives[0] - gives[1]",
        "return False",
        "harness/test_corrections.py::test_a_number_that_may_follow_is_named_while_the_correction_is_in_progress",
    ),
    Plant(
        "seeds that judged another value are shown",
        "tbdcore/repro/claims.py",
        "(claim.kind, claim.value, claim.unit, claim.rule)",
        "(claim.kind, claim.unit, claim.rule)",
        "harness/test_scorecard.py::test_seeds_that_judged_another_value_or_rule_are_named_and_not_shown",
    ),
    Plant(
        "a sign in the turn matrix",
        "tbdcore/motion.py",
        "[[1.0, a, 0.0, -b]",
        "[[1.0, a, 0.0, b]",
        "kernels/test_motion.py::test_turn_is_the_exponential_of_its_differential_equation",
    ),
    Plant(
        "a turning particle turns the other way",
        "tbdcore/kernels/mm_pf_tbd.py",
        "S[n, 0] += along * vx - aside * vy",
        "S[n, 0] += along * vx + aside * vy",
        "kernels/test_pairs.py::test_kernel_equals_its_specification[transition0]",
    ),
    Plant(
        "a power of T too few in the process noise",
        "tbdcore/motion.py",
        "return q * np.kron(np.eye(2), np.array([[T**3 / 3, T**2 / 2]",
        "return q * np.kron(np.eye(2), np.array([[T**2 / 3, T**2 / 2]",
        "kernels/test_motion.py::test_noise_of_a_white_acceleration_is_the_integral_of_its_differential_equation",
    ),
    Plant(
        "a missing square in the blob",
        "tbdcore/kernels/mm_pf_tbd.py",
        "g.append(np.exp(-(d**2) / (2.0 * blur * blur)))",
        "g.append(np.exp(-(d**2) / (2.0 * blur)))",
        "kernels/test_mm_pf_tbd.py::test_blob_energy_depends_on_where_in_the_cell_it_falls",
    ),
    Plant(
        "a missing square in the point-spread function",
        "tbdcore/kernels/mda_tbd.py",
        "np.exp(-spread.lr * d**2)[:, None] * np.exp(-spread.la * e**2)",
        "np.exp(-spread.lr * d**2)[:, None] * np.exp(-spread.la * abs(e))",
        "kernels/test_mda_tbd.py::test_spread_closed_forms",
    ),
    Plant(
        "amplitude taken for power",
        "tbdcore/kernels/mda_tbd.py",
        "v2[:] = s + v2 + 2.0 * np.sqrt(s * v2)",
        "v2[:] = s + v2 + 2.0 * (s * v2)",
        "kernels/test_mda_tbd.py::test_illuminated_cells_are_exponential_with_the_right_mean",
    ),
    Plant(
        "a log-ratio without its energy term",
        "tbdcore/kernels/mm_pf_tbd.py",
        "(match - 0.5 * peak * centre * energy)",
        "(match - peak * centre * energy)",
        "kernels/test_mm_pf_tbd.py::test_blob_log_ratio_without_noise_is_half_the_energy",
    ),
    Plant(
        "a gate half as wide",
        "tbdcore/kalman.py",
        "return g * np.sqrt(np.diagonal(",
        "return 0.5 * g * np.sqrt(np.diagonal(",
        "kernels/test_kalman.py::test_gate_volumes",
    ),
    Plant(
        "an elliptic gate half as wide",
        "tbdcore/kernels/ljipda_ai.py",
        "if d2 <= gamma:",
        "if 4.0 * d2 <= gamma:",
        "kernels/test_ljipda_ai.py::test_gate_holds_its_probability",
    ),
    Plant(
        "degrees for radians",
        "tbdcore/kalman.py",
        "return z[..., :1] * np.stack([np.cos(z[..., 1]), np.sin(z[..., 1])], axis=-1)",
        "return z[..., :1] * np.stack([np.cos(np.radians(z[..., 1])), np.sin(np.radians(z[..., "
        "1]))], axis=-1)",
        "kernels/test_kalman.py::test_noise_of_a_plot_in_metres_against_samples",
    ),
    Plant(
        "degrees for radians in a printed input",
        "tbdcore/repro/claims.py",
        '"deg": math.pi / 180',
        '"deg": 1.0',
        "harness/test_claims.py::test_inputs_are_compared_in_their_units",
    ),
    Plant(
        "degrees for radians on the page",
        "notebooks/04_track_cfar.ipynb",
        "math.radians(self.beamwidth)",
        "self.beamwidth",
        "pages/test_page_track_cfar.py::test_flights_follow_the_chain",
    ),
    Plant(
        "an azimuth that is not wrapped",
        "tbdcore/kalman.py",
        "y[..., 1] = (y[..., 1] + np.pi) % (2 * np.pi) - np.pi",
        "y[..., 1] = y[..., 1] + 0.0",
        "kernels/test_kalman.py::test_residual_wraps_the_azimuth",
    ),
    Plant(
        "a resampler off by one",
        "tbdcore/particles.py",
        "if (m - 1 + u) * step >= end:",
        "if (m + u) * step >= end:",
        "kernels/test_particles.py::test_copies_differ_from_their_mean_by_less_than_one",
    ),
    Plant(
        "a weight that is not normalised",
        "tbdcore/particles.py",
        "    W /= total\n    return W, ",
        "    return W, ",
        "kernels/test_particles.py::test_normalise_survives_what_would_overflow",
    ),
    Plant(
        "a likelihood ratio upside down",
        "tbdcore/particles.py",
        "return P / (P + (1.0 - P) * np.exp(-log_ratio))",
        "return P / (P + (1.0 - P) * np.exp(log_ratio))",
        "kernels/test_particles.py::test_existence_against_the_joint_distribution",
    ),
    Plant(
        "the noise forgotten under the target",
        "tbdcore/detection.py",
        "np.exp(-eta / (1 + snr))",
        "np.exp(-eta / (0 + snr))",
        "kernels/test_detection.py::test_swerling_1_from_complex_samples",
    ),
    Plant(
        "a plot visible to its own track only",
        "tbdcore/kernels/ljipda_ai.py",
        "visible[t, m] = (1.0 + odds[t, m]) / total",
        "visible[t, m] = odds[t, m] / total",
        "kernels/test_ljipda_ai.py::test_one_isolated_track_is_ipda",
    ),
    Plant(
        "a window one cell too narrow",
        "tbdcore/kernels/dp_tbd.py",
        "last = at + (count - size) * step",
        "last = at + (count - size - 1) * step",
        "kernels/test_dp_tbd.py::test_conventional_forward_pass_is_a_maximum_filter",
    ),
    Plant(
        "a distance beyond the cutoff",
        "tbdcore/kernels/mda_tbd.py",
        "distance = np.minimum(np.sqrt(np.sum(np.square(x - truth), axis=-1)), c)",
        "distance = np.sqrt(np.sum(np.square(x - truth), axis=-1))",
        "kernels/test_mda_tbd.py::test_bernoulli_ospa_is_ospa_of_at_most_one_point",
    ),
    Plant(
        "the first crossing for the last",
        "tbdcore/score.py",
        "i = int(down[-1])",
        "i = int(down[0])",
        "kernels/test_score.py::test_crossing_is_the_last_downward_one",
    ),
    Plant(
        "a verdict that ignores our own error",
        "tbdcore/repro/claims.py",
        "z = _distance(published, half, measured, spread)",
        "z = _distance(published, half, measured, s_p)",
        "harness/test_claims.py::test_the_edges_of_a_number",
    ),
    Plant(
        "a margin judged without its error",
        "tbdcore/repro/claims.py",
        '"reproduced" if ratio[least] > quantile(n) else',
        '"reproduced" if ratio[least] > 0 else',
        "harness/test_claims.py::test_the_edges_of_margins",
    ),
    Plant(
        "a seed that ignores the trial",
        "tbdcore/repro/trials.py",
        "crc32(experiment.encode()), int(trial), PURPOSES[purpose])",
        "crc32(experiment.encode()), 0, PURPOSES[purpose])",
        "harness/test_trials.py::test_streams_depend_on_each_part_of_their_key_and_on_nothing_else",
    ),
    Plant(
        "trials gathered in another order",
        "tbdcore/repro/trials.py",
        "return [job.result() for job in shown(jobs)]",
        "return [job.result() for job in shown(jobs[::-1])]",
        "harness/test_trials.py::test_workers_do_not_change_a_bit",
    ),
    Plant(
        "a picture without its id",
        "tbdcore/repro/figures.py",
        'metadata = {"Title": id} | NO_DATE[extension]',
        'metadata = {"Title": ""} | NO_DATE[extension]',
        "harness/test_cite.py::test_which_finds_a_renamed_copy_whatever_the_case_of_its_ending",
    ),
    Plant(
        "a digest that overlooks what a definition reads",
        "tbdcore/repro/reach.py",
        "for chain in statement.chains if not statement.is_import else ():",
        "for chain in ():",
        "harness/test_reach.py::test_what_is_reached_counts_and_nothing_else",
    ),
    Plant(
        "a run that is resumed whatever its parameters",
        "tbdcore/repro/pages.py",
        "used = {name: value for name, value in every.items() if name not in EXECUTION}",
        "used = every",
        "harness/test_batch.py::test_resume_goes_by_the_parameters_that_can_change_a_result",
    ),
]
NAMES = [fault.what for fault in FAULTS]


@pytest.fixture
def copy(tmp_path):
    """A copy of the package and of the notebooks; everything else is the repository's own."""
    tiny.copy_package(tmp_path)
    (tmp_path / "notebooks").mkdir()
    for notebook in (tiny.ROOT / "notebooks").glob("*.ipynb"):
        (tmp_path / "notebooks" / notebook.name).write_bytes(notebook.read_bytes())
    for name in ("data", "CITATION.cff", "README.md", "environment.txt", "pyproject.toml"):
        (tmp_path / name).symlink_to(tiny.ROOT / name)
    return tmp_path


def judge(copy, tests):
    """Exit code and report of some tests on a copy."""
    without = [
        word
        for plugin in ("cacheprovider", "xdist", "nbval", "anyio")
        for word in ("-p", f"no:{plugin}")
    ]  # slow to load
    words = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        *without,
        *(str(TESTS / test) for test in tests),
    ]
    run = subprocess.run(
        words, cwd=copy, env=tiny.environment(copy), capture_output=True, text=True, timeout=600
    )
    return run.returncode, run.stdout + run.stderr


def test_the_copy_is_what_is_tested(copy):
    run = subprocess.run(
        [sys.executable, "-c", "import tbdcore; print(tbdcore.__file__)"],
        cwd=TESTS,
        env=tiny.environment(copy),
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(run.stdout.strip()) == copy / "tbdcore" / "__init__.py"


def test_without_a_fault_the_named_tests_are_green(copy):
    code, report = judge(copy, sorted({fault.test for fault in FAULTS}))
    assert code == 0, report


@pytest.mark.parametrize("fault", FAULTS, ids=NAMES)
def test_the_fault_is_noticed(copy, fault):
    file = copy / fault.file
    text = file.read_text(encoding="utf-8")
    assert text.count(fault.old) == 1, (
        f"{fault.file} no longer has {fault.old!r} once; plant this fault anew"
    )
    file.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
    code, report = judge(copy, [fault.test])
    assert code == 1, f"{fault.test} does not notice {fault.what}:\n{report}"
    assert any(line.startswith("FAILED") and fault.test in line for line in report.splitlines()), (
        report
    )
