"""What several tests share."""

import os
import shutil
import signal

import pytest
import tiny

from tbdcore.repro import paths, processes


def pytest_configure():
    """Signals that the caller ignores (nohup) go to a handler that does nothing: unlike an ignored
    signal it is not inherited, so that commands which tests start can be interrupted.
    """
    ignored = [n for n in processes.ENDING if signal.getsignal(n) == signal.SIG_IGN]
    named = os.environ.setdefault("TESTS_IGNORE", " ".join(str(int(n)) for n in ignored))
    for number in map(int, named.split()):  # in workers of pytest as well
        signal.signal(number, lambda *event: None)


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """The folder of a small repository, which is the repository of this process."""
    folder = tmp_path / "repository"
    folder.mkdir()
    tiny.here(folder, monkeypatch)
    return folder


@pytest.fixture(scope="session")
def first_run(tmp_path_factory):
    """A small repository after one default run, to be copied, and what that run said."""
    folder = tmp_path_factory.mktemp("run") / "repository"
    folder.mkdir()
    said = tiny.repository(folder)("run")
    assert said.returncode == 0, said.stderr
    return folder, said


@pytest.fixture
def folder(first_run, tmp_path):
    """A copy of that repository; commands run there in processes of their own."""
    return shutil.copytree(first_run[0], tmp_path / "repository", symlinks=True)


@pytest.fixture
def inside(folder, monkeypatch):
    """A copy of that repository, which is the one of this process."""
    monkeypatch.setenv("TBDCORE_REPOSITORY", str(folder))
    monkeypatch.delenv("TBDCORE_FIGURES", raising=False)
    monkeypatch.setattr(paths, "PACKAGE", folder / "tbdcore")
    return folder
