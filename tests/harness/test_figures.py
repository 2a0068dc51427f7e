"""Products: the same bytes twice, traceable, and nothing written unless all of it is."""

import io
import json
import math
import re
import zlib

import matplotlib
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from tbdcore.repro import figures, screen, trials
from tbdcore.repro.claims import Ledger, Verdict
from tbdcore.repro.publish import Publication

PROVENANCE = {
    "parameters": {"n": 3},
    "seed": 1,
    "trials": 3,
    "digest": "0123456789abcdef",
    "versions": {},
}
CLAIMS = """id,item,quantity,conditions,value,unit,kind,where,rule,evidence,cause
mean,Fig. 1,mean,,1.5,m,number,Sec. 2,Mean,measured,
"""


@pytest.fixture
def portfolio(tmp_path):
    return Publication("toy", tmp_path / "figures", PROVENANCE)


@pytest.fixture
def ledger(tmp_path):
    (tmp_path / "toy.csv").write_text(CLAIMS)
    made = Ledger("toy", folder=tmp_path)
    made.check("mean", 1.52)
    return made


def draw(portfolio, name="fig01"):
    """A figure with all that the house draws: bands, marks, a legend, mathematics."""
    fig, ax = portfolio.new(1, 2)
    x = np.linspace(0, 1, 5)
    portfolio.band(ax[0], x, x**2, 0.1 + 0 * x, name="proposed", label="$P_D$")
    portfolio.marks(ax[1], [0.5], [0.25], label="printed")
    ax[0].legend()
    return portfolio.save(fig, name, caption="Squares, 100 %.", claims=["mean"])


def published(folder):
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_figure_without_a_size_is_as_wide_as_matplotlib_makes_it():
    fig, _ = figures.Portfolio.new()
    assert fig.get_size_inches().tolist() == [matplotlib.rcParamsDefault["figure.figsize"][0], 3.6]


def test_the_same_figure_has_the_same_bytes(tmp_path):
    runs = [Publication("toy", tmp_path, PROVENANCE) for _ in range(2)]
    for run in runs:
        draw(run)
        run.table(pd.DataFrame({"a": [1 / 3]}), "table1", caption="A third.")
    assert set(runs[0].files) == {
        f"fig01.{end}" for end in ("pdf", "svg", "png", "csv", "json")
    } | {f"table1.{end}" for end in ("csv", "md", "tex", "json")}
    assert runs[0].files == runs[1].files


@pytest.mark.slow
def test_an_artist_gives_the_same_bytes(tmp_path, ledger):
    made = []
    for artist in (None, trials.process()):
        run = Publication("toy", tmp_path / str(len(made)), PROVENANCE, artist)
        draw(run)
        run.publish(ledger)
        made.append(published(run.folder))
    assert made[0] == made[1]
    assert len(made[0]) == 6


@pytest.mark.slow
def test_an_artist_that_fails_publishes_nothing(tmp_path, ledger):
    run = Publication("toy", tmp_path / "figures", PROVENANCE, trials.process())
    draw(run)
    run.waiting.append(run.artist.submit(figures.render, None, "fig02", "toy/fig02", ("pdf",)))
    with pytest.raises(AttributeError, match="NoneType"):
        run.publish(ledger)
    assert not published(run.folder)
    run.artist.shutdown()


def test_a_last_bit_changes_no_picture(tmp_path):
    """What moves a number of the layout by a rounding error, another CPU for one, moves nothing
    that is drawn.
    """
    made = []
    for x in (1.1, math.nextafter(1.1, 2)):
        run = Publication("toy", tmp_path, PROVENANCE)
        fig, axes = Publication.new(1, 2)
        axes[1].plot([0, 1])
        axes[1].text(x, 0.5, "outside", transform=axes[1].transAxes)
        run.save(fig, "fig01", caption="A line, and a word that the layout has to find room for.")
        made.append(run.files)
    assert made[0] == made[1]


def test_axes_stand_at_places_of_six_digits(portfolio):
    """An SVG names its axes by all digits of their places; on another CPU the last may differ."""
    fig, axes = portfolio.new(2, 2)
    axes[0, 0].set_ylabel("two\nlines")
    portfolio.save(fig, "fig01", caption="Four axes.")
    places = np.array([ax.get_position().bounds for ax in axes.flat])
    digits = [
        np.abs(places - np.round(places, n)).max() < 1e-12 for n in (5, 6)
    ]  # but for rounding
    assert digits == [False, True]


def test_no_picture_knows_the_date(portfolio):
    draw(portfolio)
    for extension in ("pdf", "svg", "png"):
        content = portfolio.files[f"fig01.{extension}"]
        assert not re.search(rb"CreationDate|<dc:date>|tIME|Creation Time", content), extension


def test_every_picture_carries_its_id(portfolio):
    draw(portfolio)
    assert b"/Title (toy/fig01)" in portfolio.files["fig01.pdf"]
    assert b"<dc:title>toy/fig01</dc:title>" in portfolio.files["fig01.svg"]
    assert b"Title\0toy/fig01" in portfolio.files["fig01.png"]


def test_the_png_is_whole(portfolio):
    """Every chunk of the file has its checksum, and the last one is the end."""
    picture = draw(portfolio).png
    assert picture == portfolio.files["fig01.png"]
    place, names = 8, []
    while place < len(picture):
        length = int.from_bytes(picture[place : place + 4], "big")
        body = picture[place + 4 : place + 8 + length]
        assert zlib.crc32(body) == int.from_bytes(
            picture[place + 8 + length : place + 12 + length], "big"
        )
        names.append(body[:4])
        place += 12 + length
    assert names[-1] == b"IEND"


def test_everything_drawn_is_in_the_csv(portfolio):
    draw(portfolio)
    lines = portfolio.files["fig01.csv"].decode().splitlines()
    assert lines[0] == "series,x,y,se,panel"
    assert lines[1] == "$P_D$,0,0,0.1,0"
    assert lines[-1] == "printed,0.5,0.25,,1"
    assert len(lines) == 1 + 5 + 1


def test_the_json_says_what_made_it(portfolio):
    draw(portfolio)
    about = json.loads(portfolio.files["fig01.json"])
    assert about["id"] == "toy/fig01"
    assert about["caption"] == "Squares, 100 %."
    assert about["claims"] == ["mean"]
    assert about.items() >= PROVENANCE.items()


def test_a_schematic_has_no_csv(portfolio):
    fig, ax = portfolio.new()
    ax.text(0, 0, "box")
    portfolio.save(fig, "fig02", caption="Boxes.")
    assert "fig02.csv" not in portfolio.files


def test_drawing_leaves_no_figure_open(portfolio):
    from matplotlib import pyplot as plt

    before = plt.get_fignums()
    draw(portfolio)
    assert plt.get_fignums() == before


def test_a_film_is_a_figure_with_a_picture_for_each_step(portfolio):
    fig, ax = portfolio.new(width=2, height=1.5)
    (line,) = ax.plot([0, 3], [0, 3])
    portfolio.film(fig, "walk", lambda k: line.set_data([0, k], [0, k]), 4, caption="A walk.")
    film = Image.open(io.BytesIO(portfolio.files["walk.gif"]))
    assert (film.n_frames, film.size) == (4, (200, 150))
    assert film.info["comment"] == b"toy/walk"
    pictures = set()
    for k in range(4):
        film.seek(k)
        pictures.add(film.convert("RGB").tobytes())
    assert len(pictures) == 4
    assert "walk.gif" in json.loads(portfolio.files["walk.json"])["files"]
    assert {"walk.pdf", "walk.svg", "walk.png"} <= set(portfolio.files)


def test_a_film_has_the_colours_of_its_last_picture(portfolio):
    """Grey at first, then all of a colour map: 128 colours, the same for every step."""
    fig, ax = portfolio.new(width=2, height=1.5)
    field = ax.imshow(np.zeros((40, 40)), vmin=0, vmax=1600)

    def draw(k):
        field.set_cmap("viridis" if k else "gray")
        field.set_data(np.arange(1600.0).reshape(40, 40))

    portfolio.film(fig, "map", draw, 2, caption="A map.")
    film, colours = Image.open(io.BytesIO(portfolio.files["map.gif"])), []
    for k in range(2):
        film.seek(k)
        picture = film.convert("RGB")
        colours.append({colour for _, colour in picture.getcolors(10**6)})
    assert 100 < len(colours[1]) <= len(set.union(*colours)) <= 128
    last = Image.open(io.BytesIO(portfolio.files["map.png"])).convert("RGB").resize(picture.size)
    off = np.abs(np.asarray(last, int) - np.asarray(picture, int))
    assert off.mean() < 6, "of 255, and of two sizes"


def test_nothing_is_written_before_publish(portfolio, ledger, tmp_path):
    draw(portfolio)
    assert not (tmp_path / "figures").exists()
    portfolio.publish(ledger)
    made = published(tmp_path / "figures" / "toy")
    assert set(made) == {"verdicts.csv", *portfolio.files}
    assert made["fig01.pdf"] == portfolio.files["fig01.pdf"]
    assert (
        made["verdicts.csv"].decode().splitlines()[1]
        == "mean,Fig. 1,mean,1.5 m,1.52,,,,,reproduced,,measured,"
    )


def test_an_incomplete_ledger_publishes_nothing(portfolio, ledger, tmp_path):
    draw(portfolio)
    ledger.verdicts.clear()
    with pytest.raises(ValueError, match="no verdict on 1 of 1 claims: mean"):
        portfolio.publish(ledger)
    assert not (tmp_path / "figures").exists()


@pytest.mark.parametrize("name", ["Fig01", "fig 1", "1fig", "fig-1", "../fig", ""])
def test_bad_names_are_refused(portfolio, name):
    with pytest.raises(ValueError, match="use small letters, digits and underscores"):
        draw(portfolio, name)
    assert portfolio.files == {}


def test_a_name_is_used_once(portfolio):
    draw(portfolio)
    with pytest.raises(ValueError, match="'fig01' is saved twice"):
        portfolio.table(pd.DataFrame({"a": [1]}), "fig01", caption="Again.")


def test_a_caption_is_mandatory(portfolio):
    with pytest.raises(ValueError, match="'table1' has no caption"):
        portfolio.table(pd.DataFrame({"a": [1]}), "table1")


def brightness(colour):
    r, g, b = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def test_every_line_style_belongs_to_a_colour():
    assert set(figures.LINES) <= set(figures.COLOURS)
    assert all(re.fullmatch("#[0-9A-F]{6}", colour) for colour in figures.COLOURS.values())
    assert (
        max(map(brightness, figures.COLOURS.values())) < 0.8
    )  # a paler line is lost on white paper


# What a page shows -----------------------------------------------------------------------------


def test_a_figure_shows_its_caption_and_has_it_as_alternative_text(portfolio, monkeypatch):
    from IPython import display

    shown = []
    monkeypatch.setattr(display, "display", lambda what, **how: shown.append((what, how)))
    exhibit = draw(portfolio)
    exhibit._ipython_display_()
    (picture, how), (caption, _) = shown
    assert picture["image/png"] == portfolio.files["fig01.png"]
    assert how["metadata"] == {"image/png": {"alt": "Squares, 100 %."}}
    assert how["display_id"] is None, "what a run draws is not shown anew"
    assert caption["text/markdown"] == "*toy/fig01.* Squares, 100 %."
    assert repr(exhibit) == "toy/fig01: Squares, 100 %."


def test_the_first_screen_is_that_of_the_committed_products(repository, monkeypatch):
    assert "not yet run" in repr(screen.outcome("tiny", {"the mean": "mean"}))
    assert repr(screen.exhibit("tiny/fig1")) == "tiny/fig1: Not yet run."


def test_the_first_screen_has_a_row_for_each_result(inside, monkeypatch):
    """With its error, with its evidence unless it is measured, and its n where it is another."""
    claims = inside / "data" / "claims" / "tiny.csv"
    claims.write_text(claims.read_text().replace("runs = 100,measured", "runs = 100,calibrated"))
    file = inside / "figures" / "tiny" / "verdicts.csv"
    table = pd.read_csv(file, dtype=str, keep_default_na=False).set_index("id")
    changed = {"measured": "0.1", "se": "0.2", "n": "7", "evidence": "calibrated"}
    table.loc["mean", list(changed)] = list(changed.values())
    table.reset_index()[list(Verdict._fields)].to_csv(file, index=False)
    shown = repr(screen.outcome("tiny", {"mean": "mean", "order": "order", "price": "price"}))
    head, _, mean, order, price, _, said = shown.strip().splitlines()
    assert head == "| | published | here | verdict |"
    assert mean == "| mean | 0.0 | 0.1 ± 0.2 (n = 7) | reproduced (calibrated) |"
    assert re.fullmatch(
        r"\| order \| larger \| margin 1\.000? ± 0\.0\d+ \| reproduced \|", order
    ), order
    assert price == "| price | cheap |  | untestable |"
    assert said == "*Default run: seed 20, 400 trials; ± one standard error.*"


def test_published_values_stand_beside_those_of_this_run(ledger):
    rows = {"mean": ("mean", 1.5234, 0.012), "judged": "mean", "not published": ("", 2.0, 0.0)}
    shown = repr(screen.this_run(ledger, rows))
    assert "| mean | 1.5 m | 1.523 ± 0.012 |" in shown
    assert "| judged | 1.5 m | 1.52 |" in shown
    assert "| not published |  | 2 |" in shown
    assert not any(word in shown for word in ("reproduced", "differs"))
    with pytest.raises(ValueError, match="^toy: no claim 'men'; the nearest is 'mean'$"):
        screen.this_run(ledger, {"mean": ("men", 1.5, 0.1)})
    ledger.verdicts.clear()
    with pytest.raises(ValueError, match="^toy: no claim judged so far 'mean'"):
        screen.this_run(ledger, {"mean": "mean"})


def test_a_matplotlibrc_changes_no_picture():
    """What a user's file has set when Matplotlib is loaded is undone; so are later changes."""

    def picture():
        fig, ax = figures.Portfolio.new()
        ax.plot([1, 2, 3])
        ax.set_title("a title")
        return figures.render(fig, "fig1", "tiny/fig1", ("svg",))

    before = picture()
    foreign = {
        "font.family": "serif",
        "axes.grid": True,
        "lines.linewidth": 5,
        "xtick.labelsize": 22,
    }
    with matplotlib.rc_context(foreign):
        assert picture() == before
