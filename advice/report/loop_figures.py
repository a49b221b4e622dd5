"""What a loop will do: Bode, Nyquist, responses and the ±50 % sweep as figures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from advice.horizon import horizon
from advice.report.drawing import (
    FOURTH,
    LIMIT,
    MARK,
    SECOND,
    STRONG,
    THIRD,
    Axis,
    Figure,
    line,
    points,
    side_by_side,
    stacked,
)
from loop.controller import PID
from loop.process import Process
from loop.response import frequency_grid, loop_phase, loop_response
from loop.signals import Real
from loop.simulation import Response, simulate
from tuning.profiles import Profile
from tuning.verification import Verification

LOOKS = (STRONG, SECOND, THIRD, FOURTH)


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A controller in a figure, under the name it has there."""

    name: str
    pid: PID


def bode(process: Process, candidates: Sequence[Candidate]) -> Figure:
    """Draw gain and phase of the loops, with exact dead time.

    Parameters
    ----------
    process : Process
        Process model.
    candidates : sequence of Candidate
        Controllers, each with a stable loop or not.
    """
    w = _shared_grid(process, candidates)
    traces = [
        line(w[[0, -1]], np.ones(2), "gain 1", MARK, legend=False),
        line(w[[0, -1]], np.full(2, -180.0), "-180°", MARK, panel=2, legend=False),
    ]
    for candidate, look in zip(candidates, LOOKS, strict=False):
        gain = np.abs(loop_response(process, candidate.pid, w))
        phase = loop_phase(process, candidate.pid, w)
        phase = np.where(phase < -720, np.nan, phase)  # dead time turns on for ever
        traces.append(line(w, gain, candidate.name, look))
        traces.append(line(w, phase, candidate.name, look, panel=2, legend=False))
    return stacked(
        traces,
        Axis(title="Frequency [rad/s]", log=True, decades=True),
        [
            Axis(title="|L| [-]", log=True, decades=True),
            Axis(title="Phase of L [°]", span=(-400, 0)),
        ],
        height=460,
    )


def nyquist(process: Process, candidates: Sequence[Candidate], Ms: float) -> Figure:
    """Draw L(jw) near -1, with the circle it must not enter.

    Parameters
    ----------
    process : Process
        Process model.
    candidates : sequence of Candidate
        Controllers.
    Ms : float
        Limit on the peak of |S|; the circle about -1 has radius 1/Ms. [-]
    """
    angle = np.linspace(0, 2 * math.pi, 181)
    traces = [
        line(
            -1 + np.cos(angle) / Ms,
            np.sin(angle) / Ms,
            f"Ms = {Ms:g}",
            MARK,
        ),
        points(np.array([-1.0]), np.array([0.0]), "-1", color=LIMIT, size=7),
    ]
    w = _shared_grid(process, candidates)
    for candidate, look in zip(candidates, LOOKS, strict=False):
        L = loop_response(process, candidate.pid, w)
        near = np.where(np.abs(L) < 6, L, np.nan)
        traces.append(line(near.real, near.imag, candidate.name, look))
    figure = side_by_side(
        traces,
        [(Axis(title="Re L [-]", span=(-2.5, 1.0)), Axis(title="Im L [-]", span=(-2.4, 1.1)))],
        height=460,
    )
    layout = figure["layout"]
    assert isinstance(layout, dict)  # noqa: S101 - side_by_side made it
    axis = layout["yaxis"]
    assert isinstance(axis, dict)  # noqa: S101
    axis["scaleanchor"] = "x"  # a circle must look like one
    return figure


def _shared_grid(process: Process, candidates: Sequence[Candidate]) -> Real:
    grids = [frequency_grid(process, candidate.pid, 600) for candidate in candidates]
    return np.geomspace(min(g[0] for g in grids), max(g[-1] for g in grids), 900)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """A controller's answer to one event."""

    name: str
    response: Response


def set_point_courses(
    process: Process, candidates: Sequence[Candidate], size: float
) -> tuple[Course, ...]:
    """Simulate a set-point step at t = 0. [PV]"""
    t_end, dt = horizon(process, [c.pid for c in candidates])
    return tuple(
        Course(name=c.name, response=simulate(process, c.pid, t_end=t_end, dt=dt, sp=size))
        for c in candidates
    )


def load_courses(
    process: Process, candidates: Sequence[Candidate], size: float
) -> tuple[Course, ...]:
    """Simulate a load step at the process input at t = 0. [OP]"""
    t_end, dt = horizon(process, [c.pid for c in candidates])
    return tuple(
        Course(name=c.name, response=simulate(process, c.pid, t_end=t_end, dt=dt, load=size))
        for c in candidates
    )


def responses(courses: Sequence[Course], *, pv: str, op: str, size: float | None = None) -> Figure:
    """Draw PV and OP of several controllers above each other.

    Parameters
    ----------
    courses : sequence of Course
        Answers to the same event.
    pv, op : str
        Units of PV and OP for the axes.
    size : float, optional
        Set-point step to draw beside them. [PV]
    """
    t = courses[0].response.t
    traces = []
    if size is not None:
        traces.append(line(t[[0, -1]], np.full(2, size), "set point", MARK))
    for course, look in zip(courses, LOOKS, strict=False):
        r = course.response
        traces.append(line(r.t, r.pv, course.name, look))
        traces.append(line(r.t, r.op, course.name, look, panel=2, legend=False))
    return stacked(
        traces,
        Axis(title="Time [s]"),
        [Axis(title=f"PV − rest [{pv}]"), Axis(title=f"OP − rest [{op}]")],
        height=420,
    )


def sweep(verification: Verification, profile: Profile) -> Figure:
    """Draw gain margin, phase margin and Ms over the error of each parameter.

    Parameters
    ----------
    verification : Verification
        The ±50 % sweep of one controller.
    profile : Profile
        Limits to draw.
    """
    x = 100 * (verification.factors - 1)
    margins = [
        ("Gain margin [-]", verification.sweep.gain, profile.gain),
        ("Phase margin [°]", verification.sweep.phase, profile.phase),
        ("Ms [-]", verification.sweep.Ms, profile.Ms),
    ]
    traces = []
    panels = []
    for i, (title, values, limit) in enumerate(margins, start=1):
        shown = np.where(np.isfinite(values), values, np.nan)
        finite = shown[np.isfinite(shown)]
        top = max(1.15 * limit, float(np.max(finite)) * 1.05 if finite.size else 0.0)
        top = min(top, 4 * limit)
        panels.append((Axis(title="Error [%]", span=(-55, 55)), Axis(title=title, span=(0, top))))
        for name, values_of_one, look in zip(verification.parameters, shown, LOOKS, strict=False):
            traces.append(line(x, values_of_one, f"error of {name}", look, panel=i, legend=i == 1))
        traces.append(
            line(
                x[[0, -1]],
                np.full(2, limit),
                "limit",
                MARK,
                panel=i,
                legend=i == 1,
            )
        )
    return side_by_side(traces, panels, height=320)
