"""The report's figures as still pictures: the same data as the page draws, for paper."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any, TypeAlias, cast

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from advice.report.drawing import INK, QUIET, Figure

Part: TypeAlias = Mapping[str, Any]

DASHES = {"solid": "-", "dash": "--", "dot": ":", "dashdot": "-."}
POINT = 72 / 96  # a CSS pixel in points
# Room for titles and ticks, and for what explains the curves above the panels. [mm]
LEFT, RIGHT, TOP, BOTTOM = 11.0, 2.0, 5.0, 8.0


def still(figure: Figure, *, width: float, height: float) -> bytes:
    """Draw a figure of the report as an SVG.

    Parameters
    ----------
    figure : Figure
        As `advice.report.drawing` makes it.
    width, height : float
        Size on paper. [mm]

    Returns
    -------
    bytes
        The same bytes every time for the same figure.
    """
    # Outlines instead of text: the picture looks the same wherever it is set.
    with rc_context({"svg.fonttype": "path", "svg.hashsalt": "loopwright", "font.size": 6.5}):
        canvas = Canvas(figsize=(width / 25.4, height / 25.4))
        layout = cast(Part, figure["layout"])
        panels = _panels(canvas, layout)
        for trace in cast(Sequence[Part], figure["data"]):
            _draw(panels[trace.get("yaxis", "y")], trace)
        _explain(canvas, panels["y"])
        drawn = BytesIO()
        canvas.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    return drawn.getvalue()


def _panels(canvas: Canvas, layout: Part) -> dict[str, Axes]:
    """Place the panels as the layout's domains say, inside the room for titles and ticks."""
    across, up = (inches * 25.4 for inches in canvas.get_size_inches())
    left, bottom = LEFT / across, BOTTOM / up
    wide, high = 1 - left - RIGHT / across, 1 - bottom - TOP / up
    panels = {}
    for key in sorted(name for name in layout if name.startswith("yaxis")):
        number = key.removeprefix("yaxis")
        y, x = cast(Part, layout[key]), cast(Part, layout[f"xaxis{number}"])
        x0, x1 = x.get("domain", (0.0, 1.0))
        y0, y1 = y.get("domain", (0.0, 1.0))
        axes = canvas.add_axes(
            (left + wide * x0, bottom + high * y0, wide * (x1 - x0), high * (y1 - y0))
        )
        axes.set_xscale(x["type"])
        axes.set_yscale(y["type"])
        axes.set_xlabel(x["title"]["text"], labelpad=2)
        axes.set_ylabel(y["title"]["text"], labelpad=2, fontsize=5.8)
        axes.grid(visible=True, color="#dfe3e7", linewidth=0.4)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(QUIET)
        axes.tick_params(colors=INK, width=0.5, length=2.5, pad=1.5)
        if x.get("showticklabels") is False:
            axes.set_xticklabels([])
        _limit(axes, x, y)
        panels[f"y{number}"] = axes
    return panels


def _limit(axes: Axes, x: Part, y: Part) -> None:
    """Take over stated ranges; on logarithmic axes they are stated as powers of ten."""
    for axis, limit in ((x, axes.set_xlim), (y, axes.set_ylim)):
        if "range" in axis:
            low, high = axis["range"]
            limit((10**low, 10**high) if axis["type"] == "log" else (low, high))
    if "scaleanchor" in y:
        axes.set_aspect("equal", adjustable="box")


def _draw(axes: Axes, trace: Part) -> None:
    x = [float("nan") if value is None else value for value in trace["x"]]
    y = [float("nan") if value is None else value for value in trace["y"]]
    name = trace.get("name", "") if trace.get("showlegend", True) else ""
    label = name or "_unnamed"
    line, marker = trace.get("line", {}), trace.get("marker", {})
    if "lines" in trace["mode"]:
        axes.plot(
            x, y, color=line.get("color", INK), linestyle=DASHES[line.get("dash", "solid")],
            linewidth=line.get("width", 1.5) * POINT * 0.7, label=label,
            drawstyle="steps-post" if line.get("shape") == "hv" else "default",
        )  # fmt: skip
    else:
        axes.plot(
            x, y, linestyle="none", marker="o", label=label,
            color=marker.get("color", QUIET), markersize=marker.get("size", 4) * POINT * 0.5,
        )  # fmt: skip


def _explain(canvas: Canvas, axes: Axes) -> None:
    """Say above the panels which curve is which."""
    if any(not name.startswith("_") for name in axes.get_legend_handles_labels()[1]):
        across = canvas.get_figwidth() * 25.4
        axes.legend(
            loc="upper left", bbox_to_anchor=(LEFT / across, 1.0),
            bbox_transform=canvas.transFigure, ncols=4, frameon=False, fontsize=6.5,
            borderaxespad=0.2, handlelength=1.8, columnspacing=1.0,
        )  # fmt: skip
