"""The one walk from routine data to an assessment: indices, cause, grade, what to do next.

The command line, the REST service, a fleet run and a notebook all call these functions:

    from advice.assess import assess
    assessment = assess(record, kind="flow", pv_range=(0, 80))

With `known`, the process model and the settings of the loop, more can be said.
"""

from dataclasses import dataclass
from datetime import datetime

import numpy as np

from historian.resampling import even_record
from loop.process import LARGEST, SMALLEST
from loop.process import gain_sign as sign_of_gain
from loop.record import Record
from loop.signals import Codes, Real
from monitoring.acf_decay import acf_decay
from monitoring.achievable_variance import achievable_variance
from monitoring.cause import Cause, Diagnosis, not_assessable
from monitoring.desired_settling import desired_settling
from monitoring.diagnosis import diagnose
from monitoring.error_statistics import error_statistics
from monitoring.expected_response import expected_response
from monitoring.half_periods import half_periods
from monitoring.indices import ControlIndices, Indices, ModelIndices
from monitoring.known_loop import KnownLoop
from monitoring.load_responses import load_responses
from monitoring.loop_signals import LoopKind, LoopSignals, Stretch, controlled_stretch, unfit
from monitoring.minimum_variance import minimum_variance
from monitoring.model_mismatch import model_mismatch
from monitoring.oscillation import Oscillation, oscillation
from monitoring.score_profile import DEFAULT_SCORE_PROFILE, ScoreProfile, score_profile
from monitoring.scorecard import Grade, grade, ungraded
from monitoring.sensor import SensorHealth, sensor_health
from monitoring.set_point_line import SetPointLine, set_point_line
from monitoring.set_point_moves import SetPointMoves, set_point_moves
from monitoring.stiction import stiction
from monitoring.stiction_result import StictionVerdict
from monitoring.usage import usage
from monitoring.valve_size import valve_range

# Rows of a record count as even where no spacing is off by more than this part of the usual one.
EVEN = 0.01
# A gap of so many samples is bridged when an uneven record is put on an even grid.
LARGEST_GAP = 3.5
SATURATED_TOO_MUCH = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Assessment:
    """What routine data say of one loop over one period.

    Attributes
    ----------
    tag : str
        Name of the loop.
    kind : LoopKind
        What it controls.
    start : datetime or None
        First instant in UTC.
    span, sample_time : float or None
        Length of the record and sample time of the even grid. [s]
    samples : int
        Samples of the even grid.
    resampled : bool
        The record was uneven and was put on an even grid first.
    indices : Indices or None
        Every index; None where nothing can be judged.
    diagnosis : Diagnosis
        Cause, confidence, evidence and action; never missing.
    grade : Grade
        One grade; never missing, but it may say not assessable.
    """

    tag: str
    kind: LoopKind
    start: datetime | None
    span: float | None
    sample_time: float | None
    samples: int
    resampled: bool
    indices: Indices | None
    diagnosis: Diagnosis
    grade: Grade

    @property
    def assessable(self) -> bool:
        """Whether anything could be judged."""
        return self.diagnosis.cause is not Cause.NOT_ASSESSABLE


def assess(
    record: Record,
    *,
    kind: LoopKind | str = LoopKind.OTHER,
    pv_range: tuple[float, float] | None = None,
    op_range: tuple[float, float] = (0.0, 100.0),
    pv_limits: tuple[float, float] | None = None,
    delay: float | None = None,
    Ti: float | None = None,
    gain_sign: int | None = None,
    integrating: bool | None = None,
    known: KnownLoop | None = None,
    tau_c: float | None = None,
    profile: str = DEFAULT_SCORE_PROFILE,
) -> Assessment:
    """Assess one loop over one period.

    Parameters
    ----------
    record : Record
        Routine data.
    kind : LoopKind or str
        What the loop controls; it decides weights and limits.
    pv_range, op_range : tuple of float
        Lowest and highest PV and OP of the instrument. [PV], [OP]
    pv_limits : tuple of float, optional
        Lowest and highest PV that the process allows. [PV]
    delay : float, optional
        Dead time from OP to PV; one sample is added for the hold. [s]
    Ti : float, optional
        Integral time of the controller, for Hägglund's load events. [s]
    gain_sign : {1, -1}, optional
        Sign of the process gain.
    integrating : bool, optional
        Whether the process integrates; levels do by default.
    known : KnownLoop, optional
        Process model and settings; what of the four above is not given comes from there.
    tau_c : float, optional
        Desired closed-loop time constant. [s]
    profile : str
        Score profile.

    Returns
    -------
    Assessment
        Data that cannot be judged give an assessment too, with the reason.

    Raises
    ------
    ValueError
        A range, the kind or the profile cannot be.
    """
    kind = LoopKind(kind)
    scores = score_profile(kind, profile)
    if delay is not None and not (np.isfinite(delay) and delay >= 0):
        raise ValueError(f"delay must be zero or positive, got {delay}")
    if tau_c is not None and not SMALLEST <= tau_c <= LARGEST:
        raise ValueError(f"tau_c must lie within {SMALLEST:g} and {LARGEST:g} s, got {tau_c}")
    if known is not None:
        process, pid = known.process, known.controller
        delay = process.theta if delay is None else delay
        Ti = pid.Ti if Ti is None and pid is not None and np.isfinite(pid.Ti) else Ti
        gain_sign = int(sign_of_gain(process)) if gain_sign is None else gain_sign
        integrating = process.denominator[-1] == 0 if integrating is None else integrating
    even, resampled = _even(record)
    if even is None:
        return _refused(record, kind, scores, "a single sample, or samples far too uneven")
    signals = LoopSignals(
        dt=even.sample_time,
        pv=even.pv,
        op=even.op,
        sp=even.sp,
        mode=even.mode,
        pv_range=pv_range,
        op_range=op_range,
    )
    reason = unfit(signals)
    if reason is not None:
        return _refused(record, kind, scores, reason)
    sensor = sensor_health(signals)
    used = usage(signals)
    stretch = controlled_stretch(signals)
    indices = Indices(
        usage=used,
        error=error_statistics(signals, limits=pv_limits),
        sensor=sensor,
        valve_range=valve_range(signals),
        control=None
        if stretch is None
        else _control(
            stretch, signals, sensor, kind=kind, delay=delay, Ti=Ti, gain_sign=gain_sign,
            integrating=integrating, saturated=used.saturated, known=known, tau_c=tau_c,
        ),
    )  # fmt: skip
    diagnosis = diagnose(indices, scores)
    judged = diagnosis.cause is not Cause.NOT_ASSESSABLE
    return Assessment(
        tag=record.tag,
        kind=kind,
        start=record.start,
        span=record.span,
        sample_time=signals.dt,
        samples=signals.pv.size,
        resampled=resampled,
        indices=indices,
        diagnosis=diagnosis,
        grade=grade(indices, scores) if judged else ungraded(scores),
    )


def assess_signals(
    t: Real,
    pv: Real,
    op: Real,
    *,
    sp: Real | None = None,
    mode: Codes | None = None,
    tag: str = "",
    kind: LoopKind | str = LoopKind.OTHER,
    pv_range: tuple[float, float] | None = None,
    op_range: tuple[float, float] = (0.0, 100.0),
    delay: float | None = None,
    known: KnownLoop | None = None,
    tau_c: float | None = None,
    profile: str = DEFAULT_SCORE_PROFILE,
) -> Assessment:
    """Assess plain arrays; what is no record at all is not assessable, and the reason is told.

    Parameters
    ----------
    t, pv, op, sp, mode
        As in `loop.record.Record`; empty, unsorted and infinite values are answered, not raised.
    tag, kind, pv_range, op_range, delay, known, tau_c, profile
        As in `assess`.
    """
    try:
        record = Record(t=t, pv=pv, op=op, sp=sp, mode=mode, tag=tag)
    except ValueError as reason:
        return not_recorded(tag, str(reason), kind=kind, profile=profile)
    return assess(
        record, kind=kind, pv_range=pv_range, op_range=op_range, delay=delay, known=known,
        tau_c=tau_c, profile=profile,
    )  # fmt: skip


def not_assessed(
    record: Record, reason: str, *, kind: LoopKind | str, profile: str = DEFAULT_SCORE_PROFILE
) -> Assessment:
    """Answer for a loop that cannot be assessed, with the reason."""
    kind = LoopKind(kind)
    return _refused(record, kind, score_profile(kind, profile), reason)


def _even(record: Record) -> tuple[Record | None, bool]:
    """Put the record on an even grid if it is not on one; None where that is impossible."""
    if len(record) < 2:
        return None, False
    steps = np.diff(record.t)
    dt = record.sample_time
    if np.all(np.abs(steps - dt) <= EVEN * dt):
        return record, False
    if record.span / dt > 20 * len(record):
        return None, False
    return even_record(record, dt, max_gap=LARGEST_GAP * dt), True


def _refused(record: Record, kind: LoopKind, scores: ScoreProfile, reason: str) -> Assessment:
    return Assessment(
        tag=record.tag,
        kind=kind,
        start=record.start,
        span=record.span,
        sample_time=record.sample_time if len(record) > 1 else None,
        samples=len(record),
        resampled=False,
        indices=None,
        diagnosis=not_assessable(reason),
        grade=ungraded(scores),
    )


def not_recorded(
    tag: str, reason: str, *, kind: LoopKind | str, profile: str = DEFAULT_SCORE_PROFILE
) -> Assessment:
    """Answer for a loop of which there is no record at all, with the reason."""
    kind = LoopKind(kind)
    scores = score_profile(kind, profile)
    return Assessment(
        tag=tag, kind=kind, start=None, span=None, sample_time=None, samples=0, resampled=False,
        indices=None, diagnosis=not_assessable(reason), grade=ungraded(scores),
    )  # fmt: skip


def _control(
    stretch: Stretch,
    signals: LoopSignals,
    sensor: SensorHealth,
    *,
    kind: LoopKind,
    delay: float | None,
    Ti: float | None,
    gain_sign: int | None,
    integrating: bool | None,
    saturated: float | None,
    known: KnownLoop | None,
    tau_c: float | None,
) -> ControlIndices:
    """Indices of the part in which the controller was free to act."""
    error, dt, share = stretch.error, stretch.dt, stretch.share
    moves = set_point_moves(stretch)
    swings = oscillation(error, dt, share=share, compressed=sensor.compressed)
    level = kind in (LoopKind.LEVEL, LoopKind.AVERAGING_LEVEL)
    sticking = stiction(
        stretch,
        swings,
        op_span=signals.op_span,
        integrating=level if integrating is None else integrating,
        compressed=sensor.compressed,
    )
    marks = []
    if kind is LoopKind.AVERAGING_LEVEL:
        marks.append("an averaging level is meant to let PV move")
    if saturated is not None and saturated > SATURATED_TOO_MUCH:
        marks.append(f"OP stood at a limit for {saturated:.0%} of the time")
    if sticking.verdict is StictionVerdict.STICTION:
        marks.append("the valve sticks, which raises the index")
    b = None if delay is None else round(delay / dt) + 1
    return ControlIndices(
        oscillation=swings,
        set_point_line=_set_point_line(stretch, swings),
        half_periods=half_periods(error, dt, pv_span=signals.pv_span, Ti=Ti, share=share),
        acf_decay=acf_decay(error, dt, share=share),
        set_point_moves=moves,
        load_responses=load_responses(stretch, gain_sign=gain_sign),
        stiction=sticking,
        minimum_variance=minimum_variance(error, delay=b, share=share, marks=tuple(marks)),
        desired_settling=None
        if b is None or tau_c is None
        else desired_settling(error, dt, delay=b, tau_c=tau_c, share=share, marks=tuple(marks)),
        model=None if known is None else _by_model(stretch, moves, known, tau_c, tuple(marks)),
    )


def _by_model(
    stretch: Stretch,
    moves: SetPointMoves,
    known: KnownLoop,
    tau_c: float | None,
    marks: tuple[str, ...],
) -> ModelIndices:
    best_PI, best_PID = (
        achievable_variance(stretch, known, derivative=derivative, tau_c=tau_c, marks=marks)
        for derivative in (False, True)
    )
    return ModelIndices(
        best_PI=best_PI,
        best_PID=best_PID,
        mismatch=model_mismatch(stretch, known),
        expected_response=expected_response(stretch, moves, known),
    )


def _set_point_line(stretch: Stretch, swings: Oscillation) -> SetPointLine | None:
    if stretch.sp is None or swings.main is None:
        return None
    return set_point_line(stretch.sp, stretch.dt, swings.main, share=stretch.share)
