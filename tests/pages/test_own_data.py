"""The examples of docs/own_data.md, executed as they stand in the text."""

import re

import matplotlib
import numpy as np
import pytest

import tbdcore
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
        assert len(block.splitlines()) <= 25
        assert max(map(len, block.splitlines())) <= 100


@pytest.mark.parametrize("example", ["dp_tbd"], indirect=True)
def test_dynamic_programming_finds_the_path(example):
    (track,) = example["found"][-1]
    assert np.abs(track.cells - example["path"][12:]).max() <= 2
    assert not any(example["control"])


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
    tracks, (r, a) = example["tracks"], example["truth"][-1]
    assert len(tracks) == 38
    at = r * np.array([np.cos(a), np.sin(a)])
    assert np.hypot(*(tracks[-1].x[::2] - at)) < 200


@pytest.mark.parametrize("example", ["ljipda_ai"], indirect=True)
def test_both_boats_keep_their_tracks(example):
    page, truth = example["page"], example["truth"]
    result = page.run(example["scans"], example["known"], method="LJIPDA")
    assert np.hypot(*(result.x[-1][:, ::2] - truth[-1]).T).max() < 60
    assert result.existence[-1].min() > 0.99


MADE = {
    "dp_tbd": ("Scenario", "K grid M mean sigma2"),
    "mm_pf_tbd": ("Scene", "nx ny blur noise amplitude"),
    "mda_tbd": ("scenario", "nr na dr da r_min sd_r sd_a noise"),
    "track_cfar": ("Scenario", "scan bandwidth beamwidth sigma_p"),
    "ljipda_ai": ("Setup", "x P F Q sigma_r sigma_theta_deg p_detect"),
}
GOOD = {
    "dp_tbd": (8, (40, 64), 2, 0.0, 1.0),
    "mm_pf_tbd": (40, 30, 0.6, 2.3, 18.0),
    "mda_tbd": (64, 48, 5.0, 0.01, 2000.0, 1.0, 1.5, 1.0),
    "track_cfar": (4.0, 5.0, 1.5, 1.0),
    "ljipda_ai": (np.ones((1, 4)), np.eye(4), np.eye(4), np.eye(4), 20.0, 0.2, 0.95),
}


def use(paper, page, made, rng):
    """Give what was made to the page, with data that fit."""
    if paper == "dp_tbd":
        return page.detect(rng.standard_normal((8, 40, 64)), made, 30.0)
    if paper == "mm_pf_tbd":
        p = page.Scenario(M=100, M_new=100, scene=made)
        return page.run(rng.standard_normal((5, 40, 30)), p, rng)
    if paper == "mda_tbd":
        return page.run(rng.standard_exponential((20, 64, 48)), made, rng)
    if paper == "track_cfar":
        return page.run([np.array([[20e3, 0.5, 30.0]])] * 5, made, accuracy=(10.0, 0.002))
    return page.run([np.ones((1, 2))] * 5, made, method="LJIPDA")


@pytest.mark.parametrize("paper", MADE)
def test_the_arguments_that_are_changed_below_are_good(paper):
    page, rng = tbdcore.page(paper), np.random.default_rng(0)
    maker, names = MADE[paper]
    good = dict(zip(names.split(), GOOD[paper], strict=True))
    use(paper, page, getattr(page, maker)(**good), rng)


@pytest.mark.parametrize("bad", [float("nan"), "five", None, [1.0, 2.0, 3.0]], ids=str)
@pytest.mark.parametrize(
    ("paper", "field"), [(paper, f) for paper, (_, names) in MADE.items() for f in names.split()]
)
def test_each_argument_that_is_wrong_is_named_in_a_line(paper, field, bad):
    page, rng = tbdcore.page(paper), np.random.default_rng(0)
    maker, names = MADE[paper]
    good = dict(zip(names.split(), GOOD[paper], strict=True))
    with pytest.raises(ValueError, match=rf"\b{field}\b") as refused:
        use(paper, page, getattr(page, maker)(**(good | {field: bad})), rng)
    assert "\n" not in str(refused.value)
