"""Figures in one style, saved with their data: the same run gives the same bytes.

A notebook's ``Portfolio`` keeps its products in memory until ``run`` publishes them all.  Each PDF,
SVG and PNG carries the product's id as its title, and no date.  ``COLOURS`` gives each algorithm
one colour everywhere (Okabe and Ito's palette, which the colour-blind can tell apart), ``LINES`` a
line style, for print without colour.
"""

import io
import json
import pickle
import re

import cloudpickle
import matplotlib
import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from PIL import Image
from scipy.special import ndtr

from tbdcore.repro import products, screen, tables
from tbdcore.score import Z99

STYLE = dict.fromkeys(["font.size", "axes.titlesize", "axes.labelsize"], 9) | {
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.4,
    "image.cmap": "viridis",
    "pdf.fonttype": 42,
    "svg.hashsalt": "tbdcore",
    "svg.fonttype": "path",
}
_PALETTE = {
    "#000000": "truth exact",
    "#D55E00": "paper",
    "#7F7F7F": "reference",
    "#0072B2": "traditional conventional",
    "#E69F00": "proposed weighted",
    "#009E73": "beyond",
    "#CC79A7": "tonissen exact_ai",
    "#56B4E9": "literal",
}
COLOURS = {name: colour for colour, names in _PALETTE.items() for name in names.split()}
LINES = dict.fromkeys(["reference", "truth", "tonissen"], "--") | {"exact": ":"}
LINES |= dict.fromkeys(["traditional", "conventional"], "-.")
CANVASES = {"pdf": FigureCanvasPdf, "svg": FigureCanvasSVG, "png": FigureCanvasAgg}
NO_DATE = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}


class Portfolio:
    """The products of a paper's run, for ``folder/<paper>/``; `provenance` says what made them.

    An `artist`, an executor, draws PDF and SVG while the page goes on: the same bytes.
    """

    colour = COLOURS

    def __init__(self, paper, folder, provenance, artist=None):
        self.paper, self.folder, self.provenance = paper, folder, provenance
        self.files, self.drawn, self.artist, self.waiting = {}, {}, artist, []

    @staticmethod
    def new(rows=1, cols=1, width=6.4, height=3.6, **subplots):
        """A figure in the house style and its axes (one, or an array of them); sizes in inches."""
        # for good: titles and legends are made by the caller, after this returns
        set_style()
        fig = Figure(figsize=(width, height))
        return fig, fig.subplots(rows, cols, **subplots)

    def band(self, ax, x, mean, se=None, name="reference", label=None, **style):
        """A curve in the style of `name`, NaNs are gaps, with a 99 % Monte Carlo band if there is a
        standard error; what is drawn is remembered for the figure's CSV under `label`.
        """
        style = {"color": COLOURS[name], "ls": LINES.get(name, "-")} | style
        mean = np.asarray(mean, float)
        (line,) = ax.plot(x, mean, label=label, **style)
        if se is not None:
            half = Z99 * np.asarray(se, float)
            ax.fill_between(x, mean - half, mean + half, color=line.get_color(), alpha=0.2, lw=0)
        self._remember(ax, label or name, x, mean, se)
        return line

    def marks(self, ax, x, y, name="paper", label=None, **style):
        """Points without a curve, by default what the paper prints; remembered like a band."""
        marker = {"ls": "none", "marker": "x", "ms": 8, "mew": 2, "color": COLOURS[name]}
        ax.plot(x, y, **(marker | {"label": label or name} | style))
        self._remember(ax, label or name, x, y)

    def prediction(self, ax, x, p, runs, name="paper", label=None, **style):
        """Bars in which a share of `runs` runs falls in 99 % of cases when its probability is p."""
        from scipy.stats import binom  # loading it takes half a second

        tail, p = float(ndtr(-Z99)), np.asarray(p, float)
        low, high = (binom.ppf(q, runs, p) / runs for q in (tail, 1 - tail))
        style = {"color": COLOURS[name], "alpha": 0.35, "lw": 4} | style
        ax.vlines(x, low, high, label=label or f"99 % of {runs} runs", **style)
        self._remember(ax, f"{label or name}, low", x, low)
        self._remember(ax, f"{label or name}, high", x, high)

    def _remember(self, ax, series, x, y, se=None):
        columns = {"series": series, "x": np.atleast_1d(x), "y": np.atleast_1d(y)}
        if se is not None:
            columns["se"] = np.atleast_1d(se)
        self.drawn.setdefault(ax.figure, []).append((ax, pd.DataFrame(columns)))

    def save(self, fig, name, data=None, caption="", claims=()):
        """Keep a figure as ``<paper>/<name>``; returns an Exhibit that displays it.

        `data` is a DataFrame of everything drawn; without one it is what `band` and `marks` drew,
        with the number of the panel if there are several.  `claims` are the ids of the claims that
        the figure shows.  ValueError for a name that was used before, or a missing caption.
        """
        id = self._id(name, caption)
        _lay_out(fig)
        self.files |= {f"{name}.{extension}": b"" for extension in CANVASES}  # their places
        if self.artist:
            copy = cloudpickle.dumps(fig)  # now: drawing changes a figure
            job = self.artist.submit(_render_copy, copy, name, id, ("pdf", "svg"))
            self.waiting.append(job)
        self.files |= render(fig, name, id, ("png",) if self.artist else tuple(CANVASES))
        drawn = self.drawn.pop(fig, [])
        if data is None and drawn:
            if len({ax for ax, _ in drawn}) > 1:
                drawn = [(ax, each.assign(panel=fig.axes.index(ax))) for ax, each in drawn]
            data = pd.concat([each for _, each in drawn], ignore_index=True)
        if data is not None:
            self.files[f"{name}.csv"] = products.csv(data)
        self.files[f"{name}.json"] = self._json(id, caption, claims)
        return screen.Exhibit(id, caption, self.files[f"{name}.png"])

    def film(self, fig, name, draw, steps, caption="", **saved):
        """Keep a figure, and as ``<name>.gif`` how ``draw(0)`` to ``draw(steps - 1)`` change it.

        The figure itself is the last picture, at which the film rests for four seconds; its 128
        colours are those of the film.  `saved` goes to `save`.
        """
        id, frames, gif = self._id(name, caption), [], io.BytesIO()
        draw(steps - 1)
        _lay_out(fig)
        for step in range(steps):
            draw(step)
            (picture,) = render(fig, name, id, ("png",), dpi=STYLE["figure.dpi"]).values()
            frames.append(Image.open(io.BytesIO(picture)).convert("RGB"))
        palette = frames[-1].quantize(128, Image.Quantize.MAXCOVERAGE)
        first, *others = [f.quantize(palette=palette, dither=Image.Dither.NONE) for f in frames]
        how = {"append_images": others, "duration": [400] * len(others) + [4000], "loop": 0}
        first.save(gif, "gif", comment=id.encode(), save_all=True, **how)
        self.files[f"{name}.gif"] = gif.getvalue()
        return self.save(fig, name, caption=caption, **saved)

    def table(self, frame, name, caption="", claims=()):
        """Keep a table as ``<paper>/<name>`` in CSV, Markdown and LaTeX; returns the frame."""
        id = self._id(name, caption)
        self.files |= products.table_files(frame, name, id)
        self.files[f"{name}.json"] = self._json(id, caption, claims)
        return frame

    def methods(self, frame, caption, measures=tables.MEASURES):
        """Keep the table of methods, with the columns of ``tables`` but for CPU times, which a
        study has; returns it as it is shown.
        """
        return self._shown(tables.methods(self.paper, frame, measures), "methods", caption)

    def limits(self, frame, caption):
        """Keep the table of limits, with the columns of ``tables``, in the same way."""
        return self._shown(tables.limits(self.paper, frame), "limits", caption)

    def _shown(self, frame, name, caption):
        shown = self.table(tables.shown(frame), name, caption)
        self.files[f"{name}.csv"] = products.csv(frame)
        return shown

    def _id(self, name, caption):
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            reason = "is no name; use small letters, digits and underscores"
        elif f"{name}.json" in self.files:
            reason = "is saved twice; give every figure and table its own name"
        elif not caption:
            reason = "has no caption; say what it shows"
        else:
            return f"{self.paper}/{name}"
        raise ValueError(f"{self.paper}: product {name!r} {reason}")

    def _json(self, id, caption, claims):
        stem = id.partition("/")[2]
        files = [name for name in self.files if name.partition(".")[0] == stem]
        about = {"id": id, "caption": caption, "paper": self.paper, "claims": list(claims)}
        about |= {"files": files, **self.provenance}
        return (json.dumps(about, indent=1, ensure_ascii=False) + "\n").encode()


def _lay_out(fig):
    """Work the layout out once for all formats, rounded: an SVG names its axes by all digits."""
    fig.get_layout_engine().execute(fig)
    fig.set_layout_engine("none")
    for ax in fig.axes:
        ax.set_position(np.round(ax.get_position(original=True).bounds, 6), which="original")


def _render_copy(copy, *how):
    return render(pickle.loads(copy), *how)


def set_style():
    """Matplotlib's defaults, then our style: nothing of a user's matplotlibrc."""
    matplotlib.rcdefaults()
    matplotlib.rcParams.update(STYLE)


def render(fig, name, id, extensions=tuple(CANVASES), dpi=STYLE["savefig.dpi"]):
    """A figure in some formats, file name -> bytes, the same bytes every time."""
    made = {}
    with matplotlib.rc_context():
        set_style()
        for extension in extensions:
            buffer, canvas = io.BytesIO(), CANVASES[extension](fig)
            fig.dpi = dpi
            metadata = {"Title": id} | NO_DATE[extension]
            # `savefig` would draw each format twice
            getattr(canvas, f"print_{extension}")(buffer, metadata=metadata)
            made[f"{name}.{extension}"] = buffer.getvalue()
    return made
