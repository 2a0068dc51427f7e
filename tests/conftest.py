"""What several tests share."""

from pathlib import Path

import pytest
import tiny

from tbdcore.repro import paths


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """The folder of a small repository, to which every path in `tbdcore.repro.paths` points in this
    process.
    """
    folder = tmp_path / "repository"
    folder.mkdir()
    tiny.repository(folder)
    for name, place in list(vars(paths).items()):
        if isinstance(place, Path):
            monkeypatch.setattr(paths, name, folder / place.relative_to(tiny.ROOT))
    monkeypatch.delenv("TBDCORE_FIGURES", raising=False)
    return folder
