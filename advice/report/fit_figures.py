"""The record and the model beside it: overlay and residual as figures."""

import numpy as np

from advice.facts import op_unit, pv_unit
from advice.report.drawing import (
    INK,
    MARK,
    MOST_POINTS,
    QUIET,
    STRONG,
    Axis,
    Figure,
    Look,
    line,
    points,
    stacked,
)
from historian.downsampling import downsample
from identification.identify import Identification
from loop.record import Record
from loop.signals import Real

STAIRS = Look(INK, "solid", 1.6)


def fit(record: Record, model: Identification) -> Figure:
    """Draw the recorded PV with the model's answer, and OP below."""
    pv = downsample(record.t, record.pv, MOST_POINTS)
    traces = [points(pv.t, pv.values, "PV recorded", color=QUIET, size=3.5)]
    if model.t is not None and model.predicted is not None:
        drawn = downsample(model.t, model.predicted, MOST_POINTS)
        traces.append(line(drawn.t, drawn.values, "model", STRONG))
    op = downsample(record.t, record.op, MOST_POINTS)
    traces.append(line(*_stairs(op.t, op.values), "OP", STAIRS, panel=2, legend=False))
    return stacked(
        traces,
        Axis(title="Time [s]"),
        [Axis(title=f"PV [{pv_unit(record)}]"), Axis(title=f"OP [{op_unit(record)}]")],
        height=430,
    )


def residual(record: Record, model: Identification) -> Figure:
    """Draw what the model does not explain, with twice the noise about zero."""
    traces = []
    if model.t is not None and model.residual is not None and model.noise_sd is not None:
        left = downsample(model.t, model.residual, MOST_POINTS)
        ends = np.array([model.t[0], model.t[-1]])
        traces = [
            points(left.t, left.values, "PV − model", color=QUIET, size=3.5),
            line(ends, np.zeros(2), "0", MARK, legend=False),
            line(ends, np.full(2, 2 * model.noise_sd), "± 2 sd of the noise", MARK),
            line(ends, np.full(2, -2 * model.noise_sd), "", MARK, legend=False),
        ]
    return stacked(
        traces, Axis(title="Time [s]"), [Axis(title=f"PV − model [{pv_unit(record)}]")], height=430
    )


def _stairs(t: Real, op: Real) -> tuple[Real, Real]:
    """A held signal as the steps it is."""
    return np.repeat(t, 2)[1:], np.repeat(op, 2)[:-1]
