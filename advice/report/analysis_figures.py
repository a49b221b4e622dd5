"""Figures of an analysis: Bode, Nyquist, Nichols, sensitivities, root locus and poles."""

import numpy as np

from advice.analyse import Analysis
from advice.report.drawing import (
    ACCENT,
    INK,
    LIMIT,
    MARK,
    SECOND,
    STRONG,
    THIRD,
    Axis,
    Figure,
    Look,
    line,
    points,
    side_by_side,
    stacked,
)
from loop.frequency_curves import sensitivity_circle
from loop.root_locus import RootLocus
from loop.signals import Complex

# Beyond this the dead time only goes on turning.
LOWEST_PHASE = -720.0
NEAR = 6.0
A_DECADE = 10.0  # so that one is labelled
BRANCH = Look(INK, "solid", 1.6)


def analysis_figures(analysis: Analysis) -> dict[str, Figure]:
    """Draw every figure of an analysis, by name.

    Parameters
    ----------
    analysis : Analysis
        What `advice.analyse` answered.
    """
    figures = {
        "bode": _bode(analysis),
        "nyquist": _nyquist(analysis),
        "nichols": _nichols(analysis),
        "sensitivities": _sensitivities(analysis),
    }
    if analysis.locus is not None:
        figures["root_locus"] = _root_locus(analysis, analysis.locus)
    return figures


def _bode(analysis: Analysis) -> Figure:
    curves = analysis.curves
    ends = curves.w[[0, -1]]
    phase = np.where(curves.phase < LOWEST_PHASE, np.nan, curves.phase)
    return stacked(
        [
            line(ends, np.ones(2), "gain 1", MARK, legend=False),
            line(ends, np.full(2, -180.0), "-180°", MARK, panel=2, legend=False),
            line(curves.w, np.abs(curves.L), "L", STRONG),
            line(curves.w, phase, "L", STRONG, panel=2, legend=False),
        ],
        Axis(title="Frequency [rad/s]", log=True, decades=True),
        [_gain_axis("|L| [-]", curves.L), Axis(title="Phase of L [°]")],
        height=460,
    )


def _nyquist(analysis: Analysis) -> Figure:
    L = np.where(np.abs(analysis.curves.L) < NEAR, analysis.curves.L, np.nan)
    Ms = analysis.profile.Ms
    circle = sensitivity_circle(Ms)
    traces = [
        line(circle.real, circle.imag, f"Ms = {Ms:g}", MARK),
        points(np.array([-1.0]), np.array([0.0]), "-1", color=LIMIT, size=7),
        line(L.real, L.imag, "L", STRONG),
        line(L.real, -L.imag, "L, w < 0", SECOND),
    ]
    panel = (Axis(title="Re L [-]", span=(-2.5, 1.5)), Axis(title="Im L [-]", span=(-2, 2)))
    return _true_to_scale(side_by_side(traces, [panel], height=460))


def _nichols(analysis: Analysis) -> Figure:
    curves = analysis.curves
    shown = (np.abs(curves.L) > 1e-3) & (np.abs(curves.L) < 1e3) & (curves.phase > LOWEST_PHASE)
    gain = np.where(shown, 20 * np.log10(np.abs(curves.L)), np.nan)
    circle = sensitivity_circle(analysis.profile.Ms, 361)
    angle = np.degrees(np.unwrap(np.angle(circle)))
    angle -= 360 * round((float(np.mean(angle)) + 180) / 360)
    traces = [
        line(angle, 20 * np.log10(np.abs(circle)), f"Ms = {analysis.profile.Ms:g}", MARK),
        points(np.array([-180.0]), np.array([0.0]), "-1", color=LIMIT, size=7),
        line(curves.phase, gain, "L", STRONG),
    ]
    panel = (Axis(title="Phase of L [°]"), Axis(title="|L| [dB]", span=(-40, 40)))
    return side_by_side(traces, [panel], height=460)


def _sensitivities(analysis: Analysis) -> Figure:
    curves = analysis.curves
    ends = curves.w[[0, -1]]
    traces = [
        line(ends, np.full(2, analysis.profile.Ms), f"Ms = {analysis.profile.Ms:g}", MARK),
        line(curves.w, np.abs(curves.S), "|S|", STRONG),
        line(curves.w, np.abs(curves.T), "|T|", SECOND),
        line(curves.w, np.abs(curves.GS), "|GS|", THIRD, panel=2),
        line(curves.w, np.abs(curves.CS), "|CS|", Look(ACCENT, "dash", 2.0), panel=3),
    ]
    return stacked(
        traces,
        Axis(title="Frequency [rad/s]", log=True, decades=True),
        [
            _gain_axis("|S|, |T| [-]", np.concatenate([curves.S, curves.T])),
            _gain_axis("|GS| [PV/OP]", curves.GS),
            _gain_axis("|CS| [OP/PV]", curves.CS),
        ],
        height=620,
    )


def _root_locus(analysis: Analysis, locus: RootLocus) -> Figure:
    view = locus.rectangle
    traces = [line(np.zeros(2), np.array([-view.height, view.height]), "axis", MARK, legend=False)]
    for i, branch in enumerate(locus.branches.T):
        traces.append(line(branch.real, branch.imag, "branches", BRANCH, legend=i == 0))
    traces.append(
        points(locus.poles.real, locus.poles.imag, "open-loop poles", color=LIMIT, size=8)
    )
    if locus.zeros.size:
        traces.append(
            points(locus.zeros.real, locus.zeros.imag, "open-loop zeros", color=INK, size=8)
        )
    if analysis.poles is not None:
        here = analysis.poles.poles
        traces.append(points(here.real, here.imag, "poles at k = 1", color=ACCENT, size=7))
    panel = (
        Axis(title="Re s [rad/s]", span=(view.left, view.right)),
        Axis(title="Im s [rad/s]", span=(-view.height, view.height)),
    )
    return side_by_side(traces, [panel], height=460)


def _gain_axis(title: str, response: Complex) -> Axis:
    """A logarithmic axis, labelled by decades where there is one."""
    size = np.abs(response)
    size = size[np.isfinite(size) & (size > 0)]
    many = bool(size.size) and float(size.max()) > A_DECADE * float(size.min())
    return Axis(title=title, log=True, decades=many)


def _true_to_scale(figure: Figure) -> Figure:
    layout = figure["layout"]
    assert isinstance(layout, dict)  # noqa: S101 - side_by_side made it
    axis = layout["yaxis"]
    assert isinstance(axis, dict)  # noqa: S101
    axis["scaleanchor"] = "x"  # a circle must look like one
    return figure
