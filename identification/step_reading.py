"""Read every step on its own: steady before and after or not, and Smith's two points."""

from dataclasses import dataclass

import numpy as np

from identification.condense import Samples
from identification.least_squares import LeastSquaresFit
from identification.quality import residual_colour
from identification.step_methods import MethodReading, step_methods
from identification.steps import Step
from identification.two_point import TwoPoint, smith_two_point
from loop.errors import LoopError, NotSteady
from loop.signals import Real

# PV is steady where its trend over one time constant is under a twentieth of the step's answer, as
# it is from three and a half time constants on, or where the trend is within its own error.
STEADY = 0.05
SURE = 3.0
FEWEST = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class StepReading:
    """One step of the record.

    Attributes
    ----------
    step : Step
        The move.
    steady_before, steady_after : bool or None
        Whether PV stood still; None where too few samples tell.
    two_point : TwoPoint or None
        Smith's reading, a cross-check of the fit.
    remark : str
        Why there is no such reading; empty where there is one.
    methods : tuple of MethodReading
        What other graphical methods read where Smith's has an answer.
    """

    step: Step
    steady_before: bool | None
    steady_after: bool | None
    two_point: TwoPoint | None
    remark: str
    methods: tuple[MethodReading, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Level:
    """Mean and trend of PV over a stretch."""

    mean: float
    steady: bool


def read_steps(
    fit: LeastSquaresFit, samples: Samples, steps: tuple[Step, ...]
) -> tuple[StepReading, ...]:
    """Read each step where PV was steady around it.

    The model's drift is taken off first, and its tau says how long to look for a trend.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit of the whole record.
    samples : Samples
        What was fitted.
    steps : tuple of Step
        Moves of the output.
    """
    pv = samples.pv - fit.drift * (samples.t - fit.t0)
    edges = [float(samples.t[0]), *(s.end for s in steps)]
    ends = [*(s.start for s in steps[1:]), float(samples.t[-1]) + 1e-9]
    return tuple(
        _read(fit, samples.t, pv, step, begin, end)
        for step, begin, end in zip(steps, edges[:-1], ends, strict=True)
    )


def _read(
    fit: LeastSquaresFit, t: Real, pv: Real, step: Step, begin: float, end: float
) -> StepReading:
    small = STEADY * abs(fit.K * step.size)
    before = _level(t, pv, max(begin, step.start - fit.tau), step.start, small)
    hold = end - step.end
    after = _level(t, pv, max(step.end + fit.theta, end - min(fit.tau, hold / 3)), end, small)
    two_point, remark = None, ""
    methods: tuple[MethodReading, ...] = ()
    try:
        two_point = _two_point(t, pv, step, end, before, after)
        inside = (t >= step.start) & (t < end)
        methods = step_methods(
            t[inside],
            pv[inside],
            step_at=step.instant,
            op_change=step.size,
            pv_from=two_point.pv_from,
            pv_to=two_point.pv_to,
        )
    except (LoopError, ValueError) as fact:
        remark = str(fact)
    return StepReading(
        step=step,
        steady_before=None if before is None else before.steady,
        steady_after=None if after is None else after.steady,
        two_point=two_point,
        remark=remark,
        methods=methods,
    )


def _two_point(
    t: Real, pv: Real, step: Step, end: float, before: _Level | None, after: _Level | None
) -> TwoPoint:
    before, after = _require(before, "before", step), _require(after, "after", step)
    inside = (t >= step.start) & (t < end)
    return smith_two_point(
        t[inside],
        pv[inside],
        step_at=step.instant,
        op_change=step.size,
        pv_from=before.mean,
        pv_to=after.mean,
    )


def _require(level: _Level | None, when: str, step: Step) -> _Level:
    if level is None:
        raise NotSteady(
            f"There are too few samples {when} the step at {step.start:.4g} s to see PV at rest."
        )
    if not level.steady:
        raise NotSteady(f"PV is not steady {when} the step at {step.start:.4g} s.")
    return level


def _level(t: Real, pv: Real, first: float, end: float, small: float) -> _Level | None:
    inside = (t >= first) & (t < end)
    if np.count_nonzero(inside) < FEWEST:
        return None
    times, values = t[inside], pv[inside]
    about = times - times.mean()
    power = float(about @ about)
    slope = float(about @ values) / power
    left = values - values.mean() - slope * about
    colour = residual_colour(left)
    error = (float(left @ left) / (times.size - 2) * colour.inflation / power) ** 0.5
    length = float(times[-1] - times[0])
    trend = abs(slope) * length
    return _Level(mean=float(values.mean()), steady=trend < max(small, SURE * error * length))
