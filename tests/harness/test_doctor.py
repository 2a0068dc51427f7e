"""The doctor: a healthy machine passes, and each problem is one line that says what to do."""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
import tiny
from jupyter_client.kernelspec import KernelSpecManager, NoSuchKernel

from tbdcore.repro import cli, doctor, paths


@pytest.mark.slow
def test_a_healthy_machine_passes(capsys):
    assert cli.main(["doctor"]) == 0
    out, err = capsys.readouterr()
    assert (out.count("\n"), err) == (5, "")


def test_a_lock_is_read_with_its_markers():
    text = "numpy==2.0 \\\n    --hash=sha256:0\n"
    text += "old==1.0 ; python_version < '3' \\\n    --hash=sha256:1\n"
    text += "new==1.1 ; python_version >= '3'\n"
    assert doctor.locked(text) == {"numpy": "2.0", "new": "1.1"}


def test_the_real_lock_is_read_whole():
    text = paths.lock().read_text(encoding="utf-8")
    pins = dict(re.findall(r"^([\w.-]+)==(\S+) \\$", text, re.MULTILINE))
    assert pins
    assert doctor.locked(text).items() >= pins.items()


def lock(monkeypatch, tmp_path):
    (tmp_path / "environment.txt").write_text(
        "numpy==0.9\npytest==0.1\nno-such-thing==1.0\nruff==0.1\nscipy==0.1\n"
    )
    monkeypatch.setattr(paths, "lock", lambda: tmp_path / "environment.txt")


def foreign_kernel(monkeypatch, tmp_path):
    spec = type("Spec", (), {"argv": ["/usr/lib/other/bin/python"]})
    monkeypatch.setattr(KernelSpecManager, "get_kernel_spec", lambda *_: spec)


def no_kernel(monkeypatch, tmp_path):
    def missing(*_):
        raise NoSuchKernel("python3")

    monkeypatch.setattr(KernelSpecManager, "get_kernel_spec", missing)


def closed_folder(monkeypatch, tmp_path):
    monkeypatch.setattr(paths, "writable", lambda folder: folder != paths.figures())


def foreign_line_ends(monkeypatch, tmp_path):
    tiny.here(tmp_path, monkeypatch)
    for file in (paths.claims() / "tiny.csv", paths.claims() / "declared.csv"):
        file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))


def closed_temporary(monkeypatch, tmp_path):
    monkeypatch.setattr(paths, "writable", lambda folder: folder != Path(tempfile.gettempdir()))


def another_stream(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "STREAM", 1)


def wrong_kernel_result(monkeypatch, tmp_path):
    from tbdcore.kernels import track_cfar

    monkeypatch.setattr(track_cfar, "predict_cv", lambda x, P, T, q: (x, P + 1))


def wrong_workers(monkeypatch, tmp_path):
    from tbdcore.repro import trials

    real = trials.run
    monkeypatch.setattr(
        trials,
        "run",
        lambda trial, n, seed, workers: real(trial, n, seed=seed + workers, workers=1),
    )


@pytest.mark.parametrize(
    ("plant", "check", "said"),
    [
        (lock, "packages", "numpy is"),
        (lock, "packages", "no-such-thing is missing"),
        (lock, "packages", f"and 2 more; run: {sys.executable} -m pip install"),
        (
            foreign_kernel,
            "Jupyter kernel",
            f"not this Python; make it: {sys.executable} -m ipykernel install",
        ),
        (no_kernel, "Jupyter kernel", "no Jupyter kernel python3; make it"),
        (closed_folder, "folders", "cannot be written; give runs another folder"),
        (foreign_line_ends, "line ends", "data/claims/declared.csv and 1 more files have CRLF"),
        (another_stream, "self-test", "a random stream: not the known result; remove"),
        (
            wrong_kernel_result,
            "self-test",
            "a compiled kernel, one process against two: not",
        ),
        (wrong_workers, "self-test", "one process against two: not the known result"),
    ],
)
def test_each_problem_is_one_line_with_what_to_do(
    monkeypatch, tmp_path, capsys, plant, check, said
):
    plant(monkeypatch, tmp_path)
    monkeypatch.setattr(doctor, "CHECKS", {check: doctor.CHECKS[check]})
    assert cli.main(["doctor"]) == 3
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert said in err


def advice(check):
    """What a check says is to be done, after it was made to fail."""
    good, found = doctor.CHECKS[check]()
    assert not good
    return found.rpartition("; ")[2].partition(": ")[2]


def run(words, **variables):
    return subprocess.run(words, env=os.environ | variables, check=True, capture_output=True)


@pytest.mark.slow
def test_the_advice_on_packages_is_a_command(monkeypatch, tmp_path):
    """Everything is installed already: pip has nothing to fetch."""
    monkeypatch.setattr(doctor, "locked", lambda text: {"numpy": "0.9"})
    run([*shlex.split(advice("packages")), "--no-index", "--dry-run"])


@pytest.mark.parametrize(("count", "more"), [(3, None), (4, "1"), (5, "2")])
def test_three_packages_are_named_and_the_others_counted(monkeypatch, count, more):
    names = ["numpy", "scipy", "numba", "pandas", "matplotlib"][:count]
    monkeypatch.setattr(doctor, "locked", lambda text: dict.fromkeys(names, "0.1"))
    good, found = doctor.packages()
    assert not good
    assert [name for name in names if f"{name} is " in found] == names[:3]
    said = re.search(r" and (\d+) more;", found)
    assert (said and said[1]) == more


def test_the_advice_on_the_kernel_makes_it(monkeypatch, tmp_path):
    with monkeypatch.context() as planted:
        no_kernel(planted, tmp_path)
        words = shlex.split(advice("Jupyter kernel").replace("--sys-prefix", "--prefix"))
    run([*words, tmp_path])
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path / "share" / "jupyter"))
    assert str(tmp_path) in KernelSpecManager().get_kernel_spec("python3").resource_dir
    assert doctor.jupyter_kernel() == (True, f"python3 runs {sys.executable}")


def test_the_advice_on_folders_moves_them(monkeypatch, tmp_path):
    """That on --out is in test_cli."""
    with monkeypatch.context() as planted:
        closed_temporary(planted, tmp_path)
        assert advice("folders") == "TMPDIR=DIR"
    code = "from tbdcore.repro import doctor; print(doctor.folders())"
    said = run([sys.executable, "-c", code], TMPDIR=str(tmp_path))
    assert str(tmp_path) in said.stdout.decode()
