"""The examples of docs/own_data.md, executed as they stand in the text."""

import re

import matplotlib
import numpy as np
import pytest

from tbdcore.repro import paths

TEXT = (paths.root() / "docs" / "own_data.md").read_text(encoding="utf-8")
BLOCKS = {
    re.search(r'page\("(\w+)"\)', b)[1]: b for b in re.findall(r"```python\n(.*?)```", TEXT, re.S)
}


@pytest.fixture
def example(request, tmp_path, monkeypatch):
    """What the example of a page leaves behind, a picture among it."""
    matplotlib.use("agg")
    (tmp_path / "build").mkdir()
    monkeypatch.setenv("TBDCORE_REPOSITORY", str(paths.root()))
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(BLOCKS[request.param], names)
    names["plt"].close("all")
    (picture,) = (tmp_path / "build").glob("*.png")
    assert picture.stat().st_size > 5000
    return names


def test_every_page_has_a_short_example():
    assert list(BLOCKS) == ["dp_tbd", "mm_pf_tbd", "mda_tbd", "track_cfar", "ljipda_ai"]
    for block in BLOCKS.values():
        assert len(block.splitlines()) <= 12
        assert max(map(len, block.splitlines())) <= 100


@pytest.mark.parametrize("example", ["dp_tbd"], indirect=True)
def test_dynamic_programming_finds_the_path(example):
    path = np.array([[5 + k, 20 + k] for k in range(8)])
    assert np.abs(example["tracks"].conventional.cells - path).max() <= 2


@pytest.mark.parametrize("example", ["mm_pf_tbd"], indirect=True)
def test_the_particle_filter_declares_the_target_while_it_is_there(example):
    declared = example["result"].declared
    assert declared[12:55].mean() > 0.8
    assert declared[:6].sum() == 0


@pytest.mark.parametrize("example", ["mda_tbd"], indirect=True)
def test_the_accumulating_filter_declares_the_echo(example):
    existence = example["track"].existence
    assert existence[:10].max() < 0.5
    assert existence[20:].min() > 0.5


@pytest.mark.parametrize("example", ["track_cfar"], indirect=True)
def test_the_track_of_plots_is_kept(example):
    tracks, r, a = (example[name] for name in ("tracks", "r", "a"))
    assert len(tracks) == 18
    at = r[-1] * np.array([np.cos(a[-1]), np.sin(a[-1])])
    assert np.hypot(*(tracks[-1].x[::2] - at)) < 200


@pytest.mark.parametrize("example", ["ljipda_ai"], indirect=True)
def test_both_boats_keep_their_tracks(example):
    page, truth = example["page"], example["truth"]
    result = page.run(example["scans"], example["known"], method="LJIPDA")
    assert np.hypot(*(result.x[-1][:, ::2] - truth[-1]).T).max() < 60
    assert result.existence[-1].min() > 0.99
