"""The picture of docs/examples/harbour.py: tracks on the places that satellites gave.

``python -m benchmarks.harbour`` runs the example for both scenes and writes
``figures/recorded/harbour.png``, ``.svg``, ``.pdf`` and ``.csv``, the same bytes every time.
"""

import contextlib
import io
import sys
from unittest import mock

import matplotlib
import numpy as np
import pandas as pd

from tbdcore.repro import figures, paths, products

SCENES = (2, 17)


def scene(number):
    """The names that the example leaves behind."""
    code = (paths.root() / "docs" / "examples" / "harbour.py").read_text(encoding="utf-8")
    names = {}
    quiet = contextlib.redirect_stdout(io.StringIO())
    argv = mock.patch.object(sys, "argv", ["harbour.py", str(number)])
    unsaved = mock.patch("matplotlib.pyplot.savefig")
    with argv, unsaved, quiet, contextlib.chdir(paths.root()):
        exec(code, names)
    names["plt"].close("all")
    return names


def rows(number, names):
    """Places of plots, boats and tracks in m, east and north of the first place of the radar."""
    away, tracks, on = names["away"], names["tracks"], names["on"]
    made = [(number, "plot", k, *z - away) for k, scan in enumerate(names["scans"]) for z in scan]
    for s, boat, north, east in names["true"]:
        k = int(np.searchsorted(names["t"], s))
        made.append((number, f"boat {boat:.0f}", k, *(names["own"][s] + [east, north])))
    for n, k, x in zip(tracks.track, tracks.scan, tracks.x[:, ::2] - away, strict=True):
        made.append((number, f"track {n}" + ", no boat" * (n not in on), k, *x))
    return made


def table():
    """All rows of both scenes."""
    every = [row for number in SCENES for row in rows(number, scene(number))]
    return pd.DataFrame(every, columns=["scene", "what", "scan", "east", "north"]).round(2)


def draw(table):
    """Both scenes side by side."""
    fig, axes = figures.Portfolio.new(1, 2, width=7.2, height=3.6)
    for ax, number in zip(np.ravel(axes), SCENES, strict=True):
        for what, part in table[table["scene"] == number].groupby("what"):
            style = {"plot": ("0.8", ".", "", 2), "boat": ("C0", "", "-", 4)}
            colour, marker, line, size = style.get(what.split()[0], ("k", "", "-", 1))
            line = ":" if "no boat" in what else line
            labels = {"plot": "plots", "boat 1": "boats, by satellite"}
            ax.plot(part["east"], part["north"], color=colour, marker=marker, ls=line, lw=size,
                    ms=size, label=labels.get(what))  # fmt: skip
        ax.plot([], [], "k-", lw=1, label="tracks on boats")
        ax.plot([], [], "k:", lw=1, label="other tracks")
        ax.set(title=f"scene {number}", xlabel="east (m)", ylabel="north (m)", aspect="equal")
    np.ravel(axes)[0].legend(fontsize="x-small")
    return fig


def main():
    matplotlib.use("agg")
    made = table()
    files = figures.render(draw(made), "harbour", "recorded/harbour", ("pdf", "svg", "png"))
    files["harbour.csv"] = made.to_csv(index=False, lineterminator="\n").encode()
    products.write(paths.products() / "recorded", files)
    print("harbour: figures/recorded/harbour.png")


if __name__ == "__main__":
    main()
