"""Figures as plain Plotly documents, drawn so that they also read in grey.

A figure is data (a JSON object with `data` and `layout`), so that a page, the API and a notebook
can show the same one. Plotly itself is not imported: only its browser script is, by the page.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np

from loop.signals import Real

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"
Figure: TypeAlias = dict[str, Json]

# Dark, mid and light differ in lightness and dash, not only in hue: they stay apart in grey.
INK, ACCENT, QUIET, LIMIT = "#1b2a41", "#b0541e", "#8a94a0", "#4a4a4a"


class Look(NamedTuple):
    """How a curve is drawn: color, dash and width in px."""

    color: str = INK
    dash: str = "solid"
    width: float = 1.8


STRONG = Look(ACCENT, "solid", 2.4)
SECOND = Look(QUIET, "dash", 2.0)
THIRD = Look(INK, "dot", 2.0)
FOURTH = Look(INK, "dashdot", 1.6)
MARK = Look(LIMIT, "dot", 1.2)
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif"
MOST_POINTS = 2_000  # a screen has fewer columns than this; SVG stays quick


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis: what it shows, in which unit, and how.

    Attributes
    ----------
    title : str
        Quantity with its unit in brackets.
    log : bool
        Logarithmic scale.
    span : tuple of float, optional
        Range shown, in the quantity's own unit.
    decades : bool
        Whether a logarithmic scale labels its decades alone; for a quantity that spans several.
    """

    title: str
    log: bool = False
    span: tuple[float, float] | None = None
    decades: bool = False

    def layout(self) -> dict[str, Json]:
        """Plotly's description of the axis."""
        axis: dict[str, Json] = {
            "title": {"text": self.title, "font": {"size": 13}},
            "type": "log" if self.log else "linear",
            "showline": True,
            "linecolor": QUIET,
            "ticks": "outside",
            "tickcolor": QUIET,
            "gridcolor": "#eceff2",
            "zeroline": False,
            "exponentformat": "power",
        }
        if self.decades:
            axis["dtick"] = 1
        if self.span is not None:
            ends = np.log10(self.span) if self.log else np.asarray(self.span)
            axis["range"] = [float(end) for end in ends]
        return axis


def numbers(values: Real) -> list[Json]:
    """JSON numbers with seven digits; what is not a number becomes a gap in the line."""
    return [float(f"{v:.7g}") if np.isfinite(v) else None for v in np.asarray(values, float)]


def line(
    x: Real,
    y: Real,
    name: str,
    look: Look,
    *,
    panel: int = 1,
    legend: bool = True,
) -> Figure:
    """Draw a curve on one panel of a figure."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": numbers(x),
        "y": numbers(y),
        "name": name,
        "line": look._asdict(),
        "showlegend": legend,
        **_on(panel),
    }


def points(
    x: Real, y: Real, name: str, *, color: str = QUIET, size: float = 4, panel: int = 1
) -> Figure:
    """Draw single samples on one panel of a figure."""
    return {
        "type": "scatter",
        "mode": "markers",
        "x": numbers(x),
        "y": numbers(y),
        "name": name,
        "marker": {"color": color, "size": size},
        **_on(panel),
    }


def _on(panel: int) -> dict[str, Json]:
    suffix = "" if panel == 1 else str(panel)
    return {"xaxis": f"x{suffix}", "yaxis": f"y{suffix}"}


def stacked(traces: list[Figure], x: Axis, ys: list[Axis], *, height: int = 420) -> Figure:
    """Put panels above each other on one common horizontal axis.

    Parameters
    ----------
    traces : list of Figure
        Curves from `line` and `points`; their panel counts from the top, starting at 1.
    x : Axis
        The common horizontal axis.
    ys : list of Axis
        Vertical axes from the top down.
    height : int
        Height on screen. [px]
    """
    layout = _layout(height)
    gap = 0.07
    tall = (1 - gap * (len(ys) - 1)) / len(ys)
    for i, y in enumerate(ys):
        top = 1 - i * (tall + gap)
        suffix = "" if i == 0 else str(i + 1)
        last = i == len(ys) - 1
        layout[f"yaxis{suffix}"] = {**y.layout(), "domain": [max(0.0, top - tall), top]}
        layout[f"xaxis{suffix}"] = {
            **replace(x, title=x.title if last else "").layout(),
            "anchor": f"y{suffix}",
            "matches": "x" if i else None,
            "showticklabels": last,
        }
    return {"data": list(traces), "layout": layout}


def side_by_side(
    traces: list[Figure], panels: list[tuple[Axis, Axis]], *, height: int = 300
) -> Figure:
    """Put panels beside each other, each with its own axes."""
    layout = _layout(height)
    gap = 0.09
    wide = (1 - gap * (len(panels) - 1)) / len(panels)
    for i, (x, y) in enumerate(panels):
        left = i * (wide + gap)
        suffix = "" if i == 0 else str(i + 1)
        layout[f"xaxis{suffix}"] = {
            **x.layout(),
            "domain": [left, min(1.0, left + wide)],
            "anchor": f"y{suffix}",
        }
        layout[f"yaxis{suffix}"] = {**y.layout(), "anchor": f"x{suffix}"}
    return {"data": list(traces), "layout": layout}


def _layout(height: int) -> dict[str, Json]:
    return {
        "height": height,
        "margin": {"l": 70, "r": 20, "t": 30, "b": 50},
        "font": {"family": FONT, "size": 12, "color": INK},
        "plot_bgcolor": "white",
        "paper_bgcolor": "white",
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        "hovermode": "closest",
    }
