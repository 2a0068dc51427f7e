"""The package as others get it: a wheel in an environment of its own, far from any repository.

The environment sees the three packages that the wheel requires and what these require, linked from
the environment of the tests, and nothing else; later also the extra ``repro``.  Nothing is
downloaded.
"""

import re
import shutil
import subprocess
import sys
import sysconfig
import venv
from importlib import metadata
from pathlib import Path

import pytest
import tiny
from packaging.requirements import Requirement

COMMANDS = {
    "page": ["-c", "import tbdcore; tbdcore.page('track_cfar')"],
    "begin": ["-c", "import tbdcore; tbdcore.begin('track_cfar', {})"],
    "run": ["-m", "tbdcore", "run", "track_cfar", "--quick"],
    "sweep": ["-m", "tbdcore", "sweep", "track_cfar", "track_pfa=0.1,0.2"],
    "score": ["-m", "tbdcore", "score"],
    "cite": ["-m", "tbdcore", "cite", "track_cfar/fig05"],
    "which": ["-m", "tbdcore", "which", "fig05.pdf"],
    "doctor": ["-m", "tbdcore", "doctor"],
}
CORE = """
import pkgutil, sys
from importlib import import_module
from pathlib import Path

import numpy as np
import tbdcore
from tbdcore import detection, kalman, motion, particles, score
from tbdcore.kernels import dp_tbd, ljipda_ai, track_cfar

assert Path(tbdcore.__file__).is_relative_to(sys.prefix), tbdcore.__file__
for found in pkgutil.walk_packages(tbdcore.__path__, "tbdcore."):
    if not found.name.startswith(("tbdcore.repro", "tbdcore.__main__")):
        import_module(found.name)

x, P = track_cfar.predict_cv(np.zeros(4), np.eye(4), 1.0, 0.5)
frames = np.random.default_rng(1).standard_exponential((3, 8, 9))
weights, log_mean = particles.normalise(np.zeros(4))
beta = ljipda_ai.ipda(np.zeros((1, 3)), np.array([0.5]), np.array([0.9]))
assert P.shape == (4, 4) and P[0, 0] > 1
assert motion.cv(1.0).shape == (4, 4)
assert np.isclose(detection.threshold(np.exp(-2.0)), 2.0)
assert np.allclose(weights, 0.25)
assert score.crossing([0.0, 2.0], [1.0, 0.0], 0.5) == 1.0
assert dp_tbd.point_amplitude(0.0) > 0
assert len(dp_tbd.margin(frames, 3)) == 3
assert np.isfinite(beta[0]).all()
loaded = {name.partition(".")[0] for name in sys.modules}
assert not loaded & {"pandas", "matplotlib", "IPython", "papermill", "jupyter_client", "tqdm"}
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of the working tree."""
    folder = tmp_path_factory.mktemp("wheel")
    build = f"from flit_core import buildapi; print(buildapi.build_wheel({str(folder)!r}))"
    words = [sys.executable, "-c", build]
    built = subprocess.run(words, cwd=tiny.ROOT, capture_output=True, text=True, check=True)
    return folder / built.stdout.strip()


def required(name, extras=()):
    """Distributions that a requirement brings, itself included."""
    found, todo = set(), [Requirement(name)]
    while todo:
        requirement = todo.pop()
        key = re.sub(r"[-_.]+", "-", requirement.name).lower()
        if key not in found:
            found.add(key)
            todo += without_extras(metadata.distribution(key).requires)
    return found


def without_extras(requirements):
    """The requirements that hold here when no extra is asked for."""
    parsed = [Requirement(text) for text in requirements or ()]
    return [each for each in parsed if not each.marker or each.marker.evaluate({"extra": ""})]


@pytest.fixture(scope="module")
def environment(wheel, tmp_path_factory):
    """Folder of an environment with the wheel and what it requires; its interpreter is below."""
    folder = tmp_path_factory.mktemp("installed") / "environment"
    venv.create(folder, symlinks=True)
    pip = ["-m", "pip", "--disable-pip-version-check", "--python", str(folder), "install"]
    words = [*pip, "--quiet", "--no-input", "--no-deps", "--no-index", "--no-compile", str(wheel)]
    subprocess.run([sys.executable, *words], check=True)
    (info,) = libraries(folder).glob("tbdcore-*.dist-info")
    needed = without_extras(metadata.Distribution.at(info).requires)
    for name in set().union(*(required(each.name) for each in needed)):
        distribution = metadata.distribution(name)
        tops = {file.parts[0] for file in distribution.files} - {"..", "__pycache__"}
        for top in tops:
            if not (libraries(folder) / top).exists():
                (libraries(folder) / top).symlink_to(distribution.locate_file(top))
    return folder


def libraries(folder):
    """Where an environment keeps its packages."""
    place = sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)})
    return Path(place)


@pytest.fixture(scope="module")
def complete(environment, tmp_path_factory):
    """The same environment with the extra: everything that the tests' environment has, too."""
    folder = tmp_path_factory.mktemp("complete") / "environment"
    shutil.copytree(environment, folder, symlinks=True)
    shared = sysconfig.get_path("purelib")
    (libraries(folder) / "extra.pth").write_text(f"{shared}\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """A repository without the package: whatever runs there is the wheel's."""
    folder = tmp_path_factory.mktemp("clone") / "repository"
    for name in ("notebooks", "data", "figures"):
        shutil.copytree(tiny.ROOT / name, folder / name)
    for name in ("README.md", "CITATION.cff", "environment.txt", "pyproject.toml"):
        shutil.copy(tiny.ROOT / name, folder / name)
    return folder


def python(environment, folder, *words, repository=None):
    """What a fresh interpreter says in a folder; only the named repository is known to it."""
    variables = tiny.environment(folder) | {"PYTHONDONTWRITEBYTECODE": "1"}
    del variables["PYTHONPATH"], variables["TBDCORE_REPOSITORY"]
    if repository:
        variables["TBDCORE_REPOSITORY"] = str(repository)
    return subprocess.run(
        [environment / "bin" / "python", *words],
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
    )


def complaint(said, words):
    """The one line in which an interpreter complained."""
    if words[0] == "-c":  # an exception: its message is the last line of the traceback
        assert said.returncode == 1
        return said.stderr.splitlines()[-1]
    assert said.returncode == 3, said.stderr
    assert said.stderr.count("\n") == 1, said.stderr
    assert said.stderr.startswith("tbdcore: ")
    return said.stderr


def test_three_dependencies_and_what_they_need(environment):
    (info,) = libraries(environment).glob("tbdcore-*.dist-info")
    needed = without_extras(metadata.Distribution.at(info).requires)
    assert {each.name for each in needed} == {"numpy", "scipy", "numba"}
    seen = {each.metadata["Name"] for each in metadata.distributions(path=[libraries(environment)])}
    assert seen == {"tbdcore", "numpy", "scipy", "numba", "llvmlite"}


def test_the_metadata_is_complete(environment):
    (info,) = libraries(environment).glob("tbdcore-*.dist-info")
    about = metadata.Distribution.at(info).metadata
    assert about["License-Expression"] == "BSD-3-Clause AND CC-BY-4.0"
    assert set(about.get_all("License-File")) == {"LICENSE", "LICENSE-TEXT"}
    assert all((info / "licenses" / name).is_file() for name in about.get_all("License-File"))
    assert not [each for each in about.get_all("Classifier") if each.startswith("License")]
    assert {"repro", "test", "cluster", "peers", "build"} <= set(about.get_all("Provides-Extra"))


def test_the_core_works_in_an_empty_folder(environment, tmp_path):
    said = python(environment, tmp_path, "-c", CORE)
    assert said.returncode == 0, said.stderr
    assert said.stdout + said.stderr == ""


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_without_a_repository_one_line_says_how_to_name_it(environment, tmp_path, words):
    line = complaint(python(environment, tmp_path, *words), words)
    assert "needs the repository" in line
    assert "TBDCORE_REPOSITORY=" in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_without_the_extra_one_line_says_so(environment, clone, tmp_path, words):
    line = complaint(python(environment, tmp_path, *words, repository=clone), words)
    assert "pip install 'tbdcore[repro]'" in line


def test_the_installed_command_starts(environment, tmp_path):
    command = environment / "bin" / "tbdcore"
    said = subprocess.run([command, "--help"], cwd=tmp_path, capture_output=True, text=True)
    assert (said.returncode, said.stderr) == (0, "")
    assert "doctor" in said.stdout


def test_with_both_a_page_is_a_module(complete, clone, tmp_path):
    code = "import tbdcore; page = tbdcore.page('track_cfar'); print(tbdcore.__file__, page.run)"
    said = python(complete, tmp_path, "-c", code, repository=clone)
    assert said.returncode == 0, said.stderr
    assert said.stdout.startswith(str(libraries(complete)))


def test_with_both_a_figure_is_cited_and_the_current_folder_will_do(complete, clone, tmp_path):
    words = ["-m", "tbdcore", "cite", "track_cfar/fig05"]
    named = python(complete, tmp_path, *words, repository=clone)
    assert named.returncode == 0, named.stderr
    assert "@misc{tbdcore," in named.stdout
    below = python(complete, clone / "notebooks", *words)
    assert below.returncode == 0, below.stderr
    assert "../figures/track_cfar/fig05.pdf" in below.stdout


def test_with_both_a_paper_is_run(complete, clone, tmp_path):
    words = ["run", "track_cfar", "--quick", "--out", str(tmp_path / "try")]
    said = python(complete, tmp_path, "-m", "tbdcore", *words, repository=clone)
    assert said.returncode == 0, said.stderr
    assert (tmp_path / "try" / "track_cfar" / "fig05.pdf").is_file()
    assert list(libraries(complete).glob("tbdcore/__pycache__/*.nbi")), "the wheel's own kernels"
