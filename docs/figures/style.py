"""How every figure of the documentation is drawn, and how it is written.

Dark, mid and light curves differ in lightness and dash, not only in hue, so that they stay apart in
grey. Text stays text (small files that can be searched), and nothing in a file tells when or where
it was drawn, so that drawing it again gives the same bytes.
"""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal, TypeAlias

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from loop.signals import Real

Corner: TypeAlias = Literal["best", "upper left", "upper right", "lower left", "lower right"]
# Draws one figure; its key in a family's list is the name of the page that shows it.
Draw: TypeAlias = Callable[[], Figure]

FOLDER = Path(__file__).parents[1] / "images" / "methods"
MOST_POINTS = 500
LARGEST_FILE = 60_000  # bytes; a figure above it holds more points than the eye sees
# Width of a column of text, height of one panel and of each further one. [inch]
WIDTH, FIRST_PANEL, NEXT_PANEL = 7.0, 3.0, 1.7
INK, ACCENT, QUIET, LIGHT = "#1b2a41", "#b0541e", "#8a94a0", "#dfe4e9"

SETTINGS: Mapping[str, object] = {
    "svg.fonttype": "none",  # text as text: no glyph outlines
    "svg.hashsalt": "loopwright",  # names of clip paths are the same every time
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#eceff2",
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
}


def panels(
    count: int = 1, *, columns: int = 1, share_x: bool = True, heights: tuple[float, ...] = ()
) -> tuple[Figure, list[Axes]]:
    """Make a figure with panels, above each other or side by side.

    Parameters
    ----------
    count : int
        Panels.
    columns : int
        Panels side by side; those above each other share the horizontal axis on request.
    share_x : bool
        Whether panels above each other have one horizontal axis.
    heights : tuple of float
        Heights of the rows in proportion; equal by default.
    """
    rows = -(-count // columns)
    height = FIRST_PANEL + NEXT_PANEL * (rows - 1)
    with mpl.rc_context(dict(SETTINGS)):  # type: ignore[arg-type]
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        grid = figure.subplots(
            rows, columns, squeeze=False, sharex=share_x and columns == 1,
            height_ratios=list(heights) or None,
        )  # fmt: skip
    flat = [axes for row in grid for axes in row]
    for axes in flat[count:]:
        axes.remove()
    return figure, flat[:count]


def data(axes: Axes, x: Real, y: Real, name: str = "") -> None:
    """Draw measured readings: small grey points behind everything, at most so many as a page shows.

    They are one path of very short strokes under round caps, a third of the bytes of markers.
    """
    every = max(1, -(-x.size // MOST_POINTS))
    x, y = x[::every], y[::every]
    short = np.ptp(x) / 2_000
    gap = np.full(x.size, np.nan)
    across = np.stack((x, x + short, gap), axis=1).ravel()
    (drawn,) = axes.plot(
        across,
        np.repeat(y, 3),
        color=QUIET,
        linewidth=2.2,
        solid_capstyle="round",
        label=name or None,
        zorder=1,
    )
    drawn.get_path().should_simplify = False
    drawn.set_snap(False)


def model(axes: Axes, x: Real, y: Real, name: str = "") -> None:
    """Draw what a method says: the strong curve of a figure."""
    axes.plot(x, y, "-", color=ACCENT, linewidth=2.0, label=name or None, zorder=3)


def truth(axes: Axes, x: Real, y: Real, name: str = "") -> None:
    """Draw what is true or compared with: dark and dashed."""
    axes.plot(x, y, "--", color=INK, linewidth=1.4, label=name or None, zorder=4)


def held(axes: Axes, x: Real, y: Real, name: str = "") -> None:
    """Draw a held signal as the steps it is."""
    axes.step(x, y, where="post", color=INK, linewidth=1.4, label=name or None, zorder=2)


def band(axes: Axes, x: Real, low: Real, high: Real, name: str = "") -> None:
    """Shade an interval."""
    axes.fill_between(x, low, high, color=LIGHT, linewidth=0, label=name or None, zorder=0)


def mark(axes: Axes, *, x: float | None = None, y: float | None = None, name: str = "") -> None:
    """Draw a thin dotted line at a place of one axis."""
    if x is not None:
        axes.axvline(x, color=INK, linewidth=1.0, linestyle=":", label=name or None)
    if y is not None:
        axes.axhline(y, color=INK, linewidth=1.0, linestyle=":", label=name or None)


def label(
    axes: Axes, *, x: str = "", y: str = "", title: str = "", legend: Corner = "best"
) -> None:
    """Name the axes with their units, and what the curves are.

    Parameters
    ----------
    axes : Axes
        Panel.
    x, y : str
        Quantity with its unit in brackets; empty where the panel below carries it.
    title : str
        What the panel shows.
    legend : str
        Where the legend stands; nothing is drawn where no curve has a name.
    """
    with mpl.rc_context(dict(SETTINGS)):  # type: ignore[arg-type]
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        axes.set_title(title)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(loc=legend, fontsize=8)


def write(family: Mapping[str, Draw], folder: Path = FOLDER) -> None:
    """Draw the figures of a family and write each as `<page>.svg`.

    Parameters
    ----------
    family : mapping of str to Draw
        Name of the page, and what draws its figure.
    folder : Path
        Where the files go.

    Raises
    ------
    ValueError
        A file would be larger than a page should carry.
    """
    for page, draw in family.items():
        file = folder / f"{page}.svg"
        with mpl.rc_context(dict(SETTINGS)):  # type: ignore[arg-type]
            draw().savefig(file, format="svg", metadata={"Date": None, "Creator": "Loopwright"})
        text = _short(file.read_text("utf-8"))
        file.write_text(text, "utf-8")
        if len(text) > LARGEST_FILE:
            raise ValueError(f"{file.name} has {len(text)} bytes, at most {LARGEST_FILE} are fine")


def _short(text: str) -> str:
    """Round to a hundredth of a point, which no eye sees, and leave no spaces at ends of lines."""
    rounded = re.sub(r"\d+\.\d{3,}(?![\d.])", lambda m: f"{float(m[0]):.2f}", text)
    return "\n".join(line.rstrip() for line in rounded.splitlines()) + "\n"
