"""Figures and tables as products that can be cited: drawn in one style, saved with their data and
their provenance.

A product is a set of files with one name, ``<paper>/<figure's own number>``: a figure as PDF, SVG
and PNG, a CSV of everything that is drawn, and a JSON that says what made it (caption, parameters,
seed, trials, claims it shows, a hash of the sources, package versions); a table as CSV, Markdown,
LaTeX and JSON.  The same run gives the same bytes: no dates, a fixed salt for SVG identifiers, data
written with as many digits as are certain on any CPU.  The id, the hash of the sources and the
command that made it are embedded in each PDF, SVG and PNG, so that a file found in a report can be
traced back (``EMBEDDED``; ``tbdcore which`` reads them).

A notebook's ``Portfolio`` keeps its products in memory.  ``publish``, the notebook's last call,
writes them all, each beside its place and then renamed, after the ledger of claims has been found
complete; products of an earlier run that this one no longer makes are removed.  A run that fails or
is interrupted leaves the old products as they were.  A page shows the PNG only; with an ``artist``,
a process of its own, the PDF and the SVG are drawn while the page goes on, and are the same bytes.

This is the only module that imports matplotlib.  ``COLOURS`` gives each algorithm one colour for
the whole repository (Okabe and Ito's palette, which the colour-blind can tell apart); ``LINES``
gives it a line style, for print without colour.
"""

import contextlib
import hashlib
import io
import json
import os
import pickle
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version

import cloudpickle
import matplotlib
import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from tbdcore.repro import paths, trials
from tbdcore.score import Z99

STYLE = {
    "figure.dpi": 100,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
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
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PURPLE, GREY = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#F0E442",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
    "#7F7F7F",
)
COLOURS = {  # an algorithm keeps its colour through the whole repository
    "truth": BLACK,
    "paper": RED,
    "reference": GREY,
    "exact": BLACK,
    "traditional": BLUE,
    "proposed": ORANGE,
    "beyond": GREEN,
    "conventional": BLUE,  # the transition sets of dp_tbd
    "tonissen": PURPLE,
    "weighted": ORANGE,
    "literal": SKY,
    "exact_ai": PURPLE,
}
LINES = {
    "reference": "--",
    "exact": ":",
    "traditional": "-.",
    "truth": "--",
    "conventional": "-.",
    "tonissen": "--",
}
# where each format keeps the id, the hash of the sources and the command that made the picture
EMBEDDED = {
    "pdf": ("Title", "Subject", "Keywords"),
    "svg": ("Title", "Source", "Description"),
    "png": ("Title", "Source", "Comment"),
}
SHOWN, APART = ("png",), ("pdf", "svg")  # what a page shows, and what an artist draws
CANVASES = {"pdf": FigureCanvasPdf, "svg": FigureCanvasSVG, "png": FigureCanvasAgg}
ENDING = (
    signal.SIGINT,
    signal.SIGTERM,
    *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []),
)  # what asks a run to end
DONE = "done"  # what an artist is told when there is nothing more to draw
NO_DATE = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {"Software": None}}


class Product:
    """What `save` returns: shows itself as the picture, with its id and caption as text."""

    def __init__(self, id, caption, png):
        self.id, self.caption, self.png = id, caption, png

    def __repr__(self):
        return f"{self.id}: {self.caption}"

    def _repr_png_(self):
        return self.png


class Portfolio:
    """The products of one paper's run.

    Parameters
    ----------
    paper : str
    folder : pathlib.Path
        Products go to ``folder/<paper>/``.
    provenance : dict
        What made them: parameters, seed, trials, hash of the sources, the command.
    studio : callable, optional
        :func:`artist`, asked for one when the first figure is saved, who draws what the page does
        not show while the page goes on.  Without a studio everything is drawn at once.
    """

    colour = COLOURS
    line = LINES

    def __init__(self, paper, folder, provenance, studio=None):
        self.paper, self.folder, self.provenance, self.studio, self.artist = (
            paper,
            folder,
            provenance,
            studio,
            None,
        )
        self.files, self.drawn, self.post = {}, {}, ThreadPoolExecutor(1)
        matplotlib.rcParams.update(STYLE)

    def new(self, rows=1, cols=1, width=6.4, height=3.6, **subplots):
        """A figure in the house style and its axes; sizes in inches."""
        return new(rows, cols, width, height, **subplots)

    def band(self, ax, x, mean, se=None, name="reference", label=None, **style):
        """A curve, with its 99 % Monte Carlo band where a standard error is given; NaNs are gaps.

        `name` chooses colour and line style; what is drawn is remembered for the figure's CSV under
        `label`.
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
        ax.plot(
            x,
            y,
            **(
                {
                    "ls": "none",
                    "marker": "x",
                    "ms": 8,
                    "mew": 2,
                    "color": COLOURS[name],
                    "label": label or name,
                }
                | style
            ),
        )
        self._remember(ax, label or name, x, y)

    def _remember(self, ax, series, x, y, se=None):
        columns = {"series": series, "x": np.atleast_1d(x), "y": np.atleast_1d(y)} | (
            {} if se is None else {"se": np.atleast_1d(se)}
        )
        self.drawn.setdefault(ax.figure, []).append((ax, pd.DataFrame(columns)))

    def _data(self, fig):
        """Everything that `band` and `marks` drew on a figure, in long form; a column of panel
        numbers if it has several.
        """
        drawn = self.drawn.pop(fig, [])
        if not drawn:
            return None
        panels = list(fig.axes)
        many = len({ax for ax, _ in drawn}) > 1
        frames = [frame.assign(panel=panels.index(ax)) if many else frame for ax, frame in drawn]
        return pd.concat(frames, ignore_index=True)

    def save(self, fig, name, data=None, caption="", claims=()):
        """Keep a figure as ``<paper>/<name>``; returns a Product that displays it.

        `data` is a DataFrame of everything drawn; without one it is what `band` and `marks` drew
        (nothing, in a schematic).  `claims` are the ids of the claims the figure shows. Raises
        ValueError for a name that was used before, or a missing caption.
        """
        id = self._id(name, caption)
        with matplotlib.rc_context(STYLE):
            _lay_out(fig)
            self._draw(fig, name, id)
        data = self._data(fig) if data is None else data
        if data is not None:
            self.files[f"{name}.csv"] = _csv(data)
        self.files[f"{name}.json"] = self._json(id, caption, claims)
        return Product(id, caption, self.files[f"{name}.png"])

    def _draw(self, fig, name, id):
        """The pictures of a figure as bytes; what the page does not show is left to the artist, and
        to be filled in.
        """
        if self.artist is None and self.studio is not None:
            self.artist = self.studio()
        job = name, fig, id, self.provenance
        if self.artist is None:
            self.files |= _pictures(*job, EMBEDDED)
            return
        self.files |= {
            f"{name}.{extension}": b"" for extension in EMBEDDED
        }  # their place in the list of files
        self.post.submit(_send, self.artist.stdin, cloudpickle.dumps((*job, APART)))
        self.files |= _pictures(*job, SHOWN)

    def _collect(self):
        """Put what the artist has drawn into its place; the artist is dismissed."""
        if self.artist is None:
            return
        self.post.shutdown()
        pickled, _ = self.artist.communicate(pickle.dumps(DONE))
        drawn = (
            pickle.loads(pickled)
            if pickled
            else ChildProcessError("the process that draws PDF and SVG has died; run it again")
        )
        self.artist = None
        if isinstance(drawn, Exception):
            raise drawn
        self.files |= drawn

    def table(self, frame, name, caption="", claims=()):
        """Keep a table as ``<paper>/<name>`` in CSV, Markdown and LaTeX; returns the frame, which
        displays itself.
        """
        id = self._id(name, caption)
        self.files[f"{name}.csv"] = _csv(frame)
        self.files[f"{name}.md"] = markdown(frame).encode()
        self.files[f"{name}.tex"] = latex(frame).encode()
        self.files[f"{name}.json"] = self._json(id, caption, claims)
        return frame

    def publish(self, ledger=None):
        """Write all products and verdicts.csv; raises, and writes nothing, unless the ledger is
        complete.

        A page that judges no paper, the index, has no ledger.
        """
        table = [] if ledger is None else ledger.table()
        verdicts = {} if ledger is None else {"verdicts.csv": _csv(table)}
        self._collect()
        files = verdicts | self.files  # a product's JSON is the last of its files
        folder = self.folder / self.paper
        write(folder, files, old=self._abandoned(folder))
        judged = "no claims" if ledger is None else f"{len(table)} claims ({ledger.summary()})"
        print(f"{self.paper}: {judged}; {len(files)} files")

    def _abandoned(self, folder):
        """Files of products of this paper that lie in the folder and that this run did not make."""
        ours = [file for file in folder.glob("*.json") if record(file).get("paper") == self.paper]
        files = [
            file.with_suffix(f".{suffix}")
            for file in ours
            for suffix in (*EMBEDDED, "csv", "md", "tex", "json")
        ]
        return [file for file in files if file.name not in self.files]

    def _id(self, name, caption):
        if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            raise ValueError(
                f"{self.paper}: product name {name!r}: use small letters, digits and underscores"
            )
        if f"{name}.json" in self.files:
            raise ValueError(
                f"{self.paper}: product {name!r} is saved twice; "
                f"give every figure and table its own name"
            )
        if not caption:
            raise ValueError(f"{self.paper}: product {name!r} has no caption; say what it shows")
        return f"{self.paper}/{name}"

    def _json(self, id, caption, claims):
        files = [name for name in self.files if name.partition(".")[0] == id.partition("/")[2]]
        about = {
            "id": id,
            "caption": caption,
            "paper": self.paper,
            "claims": list(claims),
            "files": files,
            **self.provenance,
        }
        return (json.dumps(about, indent=1, ensure_ascii=False) + "\n").encode()


def artist():
    """A process that draws what it is sent and hands all over in the end; None on a machine with a
    single core.

    It ends when the process that started it does, however that ends.
    """
    if trials.cores() == 1:
        return None
    studio = [sys.executable, "-c", "from tbdcore.repro import figures; figures._studio()"]
    return subprocess.Popen(
        studio, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )


def _studio():
    """What the artist does: draw until there is nothing more, then write everything, or what went
    wrong, to standard output.
    """
    drawn = {}
    try:
        while (job := pickle.load(sys.stdin.buffer)) != DONE:
            with matplotlib.rc_context(STYLE):
                drawn |= _pictures(*job)
    except (EOFError, pickle.UnpicklingError):  # nobody is there any more
        return
    except Exception as error:
        drawn = error
    pickle.dump(drawn, sys.stdout.buffer)


def _send(place, content):
    """Hand a job to the artist, who may be busy, so that this waits; one who has died is noticed
    when all is collected.
    """
    with contextlib.suppress(BrokenPipeError):
        place.write(content)
        place.flush()


def new(rows=1, cols=1, width=6.4, height=3.6, **subplots):
    """A figure in the house style and its axes (one, or an array of them); sizes in inches."""
    matplotlib.rcParams.update(
        STYLE
    )  # from here on: titles and legends are made by the caller, after this returns
    fig = Figure(figsize=(width, height))
    return fig, fig.subplots(rows, cols, **subplots)


def _lay_out(fig):
    """Work the layout out once, not once for each format; places are rounded, as an SVG names its
    axes by every digit of them.
    """
    fig.get_layout_engine().execute(fig)
    fig.set_layout_engine("none")
    for ax in fig.axes:
        ax.set_position(np.round(ax.get_position(original=True).bounds, 6), which="original")


def write(folder, files, old=()):
    """Write files (name -> bytes) into a folder: all beside their places first, then renamed; the
    files `old` are removed.

    A Ctrl-C during the renaming waits until it is done.  Raises OSError, with nothing replaced,
    when the folder cannot be made or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    beside = [(folder / f".{name}.{os.getpid()}.part", folder / name) for name in files]
    try:
        for (part, _), content in zip(beside, files.values(), strict=True):
            part.write_bytes(content)
        with _undisturbed():
            for part, place in beside:
                os.replace(part, place)
            for place in old:
                place.unlink(missing_ok=True)
    finally:
        for part, _ in beside:
            part.unlink(missing_ok=True)


@contextlib.contextmanager
def _undisturbed():
    """Hold back Ctrl-C and a request to end until the block is done (signals reach the main thread
    only).
    """
    came, before = [], {}
    with contextlib.suppress(ValueError):  # not the main thread
        before = {
            number: signal.signal(number, lambda *event: came.append(event[0])) for number in ENDING
        }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)
        for number in came:
            signal.raise_signal(number)


def record(file):
    """What a product's JSON file says of it; raises ValueError, naming the file, when it is
    damaged.
    """
    try:
        about = dict(json.loads(file.read_text(encoding="utf-8")))
        _ = [
            about[key]
            for key in ("id", "caption", "paper", "claims", "files", "seed", "trials", "sources")
        ]
        return about
    except (ValueError, TypeError, KeyError):
        raise ValueError(
            f"{file}: damaged; delete it, then make the products anew: "
            f"tbdcore run {file.parent.name}"
        ) from None


def data(id):
    """The data behind a product of the default runs, ``data("track_cfar/fig05")``, as a frame.

    Raises ValueError when there is none.
    """
    path = paths.figures() / f"{id}.csv"
    if not path.is_file():
        raise ValueError(
            f"{id}: no such data in {paths.figures()}; products are named <paper>/<name>, "
            f"such as track_cfar/fig05"
        )
    return pd.read_csv(path)


def versions():
    """Versions of the packages that numbers and pictures depend on."""
    return {name: version(name) for name in ("numpy", "scipy", "numba", "matplotlib", "pandas")}


def digest(contents):
    """Short hash of some bytes strings, for provenance."""
    total = hashlib.sha256()
    for content in contents:
        total.update(hashlib.sha256(content).digest())
    return total.hexdigest()[:16]


def _pictures(name, fig, id, provenance, extensions):
    """A figure in some formats, file name -> bytes."""
    return {
        f"{name}.{extension}": _render(fig, id, provenance, extension) for extension in extensions
    }


def _render(fig, id, provenance, extension):
    """One picture as bytes, the same bytes every time, with its id and what made it inside."""
    about = (id, provenance.get("sources"), provenance.get("remake"))
    metadata = {
        key: text for key, text in zip(EMBEDDED[extension], about, strict=True) if text
    } | NO_DATE[extension]
    buffer, canvas = io.BytesIO(), CANVASES[extension](fig)
    fig.dpi = STYLE["savefig.dpi"]
    getattr(canvas, f"print_{extension}")(
        buffer, metadata=metadata
    )  # `savefig` would draw each format twice
    return buffer.getvalue()


def _csv(frame):
    """A frame as CSV, numbers to six significant digits: fewer than differ between CPUs, more than
    any figure shows.
    """
    return frame.to_csv(
        index=_speaks(frame.index), float_format="%.6g", lineterminator="\n"
    ).encode()


def _speaks(index):
    """Whether an index names its rows, or only counts them."""
    return index.names != [None] or not isinstance(index, pd.RangeIndex)


def _cells(frame):
    """Header and rows of a frame as text; an index that says something becomes a column."""
    named = frame.rename_axis("") if frame.index.names == [None] else frame
    flat = named.reset_index() if _speaks(frame.index) else frame
    rows = [[_cell(value) for value in row] for row in flat.itertuples(index=False, name=None)]
    return [
        _cell(" ".join(map(str, name)) if isinstance(name, tuple) else name)
        for name in flat.columns
    ], rows


def _cell(value):
    """One cell as text; NaN is empty."""
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.6g}"
    return str(value)


def markdown(frame):
    """A frame as a Markdown table."""
    header, rows = _cells(frame)
    lines = [header, ["---"] * len(header), *rows]
    return "".join(
        "| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |\n" for line in lines
    )


_TEX = {
    "\\": r"\textbackslash{}",
    **{c: "\\" + c for c in "&%$#_{}"},
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}
_LETTERS = "alpha beta gamma delta eta theta kappa lambda mu pi rho sigma tau phi chi omega Delta Lambda Sigma Omega le ge times to"
_TEX |= {
    c: rf"\ensuremath{{\{name}}}"
    for c, name in zip("αβγδηθκλμπρστφχωΔΛΣΩ≤≥×→", _LETTERS.split(), strict=True)
}


def latex(frame):
    """A frame as a LaTeX tabular with booktabs rules; cells in dollars stay mathematics, everything
    else is escaped.
    """
    header, rows = _cells(frame)

    def line(cells):
        return " & ".join(tex(cell) for cell in cells) + r" \\"

    body = [line(header), r"\midrule", *map(line, rows)]
    return "\n".join(
        [
            rf"\begin{{tabular}}{{{'l' * len(header)}}}",
            r"\toprule",
            *body,
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


def tex(text):
    """Text with LaTeX's special characters escaped outside mathematics."""
    pieces = re.split(r"(\$[^$]+\$)", text)
    return "".join(
        piece if i % 2 else "".join(_TEX.get(c, c) for c in piece) for i, piece in enumerate(pieces)
    )
