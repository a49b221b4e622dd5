"""What users do with assessments."""

import math
from datetime import datetime
from uuid import UUID, uuid4

from pydantic import ValidationError
from sqlalchemy.orm import Session

from advice.fleet import FleetLoop, LoopResult, assess_loop
from advice.rollup import Order, PlantScorecard, Scored, plant_scorecard
from historian.sample_store import SampleStore
from historian.samples import Samples
from loop.digital_pid import OutputLimits
from monitoring.known_loop import KnownLoop
from service import audit
from service.actors import Actor
from service.assessments import store
from service.assessments.schemas import AssessLoop, AssessLoops, Overrule, Period
from service.errors import InvalidRequest, NotFound
from service.jobs.actions import add_job
from service.loops.store import loop_with_id
from service.models.schemas import stated_process
from service.samples import samples_of
from service.sheets.in_force import known_loops
from service.tables import AssessmentRow, JobRow, LoopRow, OverruleRow
from service.tunings.actions import running_controller

# Counts up when the same data would get another answer.
METHOD = "4"


def request_assessments(session: Session, *, actor: Actor, wanted: AssessLoops) -> JobRow:
    """Ask for the assessment of many loops; a worker does it.

    Raises
    ------
    NotFound
        One of the loops is not there.
    """
    store.loops_to_assess(session, wanted.loop_ids)
    return add_job(
        session,
        actor=actor,
        kind="assess",
        key=f"assess:{uuid4()}",
        request=wanted.model_dump(),
    )


def period_of(name: str, start: datetime, end: datetime) -> tuple[datetime, datetime]:
    """Hold two instants against what a period may be.

    Raises
    ------
    InvalidRequest
        They are none.
    """
    try:
        period = Period.model_validate({"start": start, "end": end})
    except ValidationError as error:
        detail = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise InvalidRequest(f"query/{name}_end", detail) from error
    return period.start, period.end


def assess_one(
    reading: Session, samples: SampleStore, *, loop_id: UUID, wanted: AssessLoop
) -> LoopResult:
    """Assess one loop over a period; nothing is stored yet.

    Raises
    ------
    NotFound, NoSamples
        There is no such loop, or nothing of it in the period.
    """
    loop = loop_with_id(reading, loop_id)
    found = samples_of(samples, loop, wanted.start, wanted.end)
    known = known_loops(reading, [loop_id], start=wanted.start, end=wanted.end).get(loop_id)
    return assess_loop(fleet_loop(loop, found, _stated(loop, wanted) or known, wanted.tau_c))


def _stated(loop: LoopRow, wanted: AssessLoop) -> KnownLoop | None:
    """Take model and settings from the question."""
    if wanted.process is None:
        return None
    process = stated_process(wanted.process)
    return KnownLoop(
        process=process,
        controller=running_controller(wanted.running, process),
        limits=OutputLimits(low=loop.op_low, high=loop.op_high),
        scan_time=loop.sample_time or None,
    )


def fleet_loop(
    loop: LoopRow, samples: Samples, known: KnownLoop | None, tau_c: float | None = None
) -> FleetLoop:
    """Put a loop's samples together with what the plant says of it."""
    return FleetLoop(
        name=str(loop.id),
        record=samples.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit),
        kind=loop.kind,
        pv_range=(loop.pv_low, loop.pv_high),
        op_range=(loop.op_low, loop.op_high),
        gain_sign=1 if loop.action == "reverse" else -1,
        known=known,
        tau_c=tau_c,
        pv_limits=_limits(loop),
    )


def _limits(loop: LoopRow) -> tuple[float, float] | None:
    """Limits of PV, open where only one is stated."""
    if loop.limit_low is None and loop.limit_high is None:
        return None
    low = -math.inf if loop.limit_low is None else loop.limit_low
    return low, math.inf if loop.limit_high is None else loop.limit_high


def assessment_row(
    found: LoopResult, *, loop_id: UUID, job_id: UUID | None, period: AssessLoop, author: str
) -> AssessmentRow:
    """Lay an assessment out as a row."""
    return AssessmentRow(
        loop_id=loop_id,
        job_id=job_id,
        start=period.start,
        end=period.end,
        method=METHOD,
        grade=found.points,
        cause=found.cause,
        confidence=found.confidence,
        body=found.body,
        author=author,
    )


def keep_assessment(
    session: Session, *, actor: Actor, loop_id: UUID, period: AssessLoop, found: LoopResult
) -> store.Found:
    """Store the assessment of one loop."""
    row = assessment_row(found, loop_id=loop_id, job_id=None, period=period, author=actor.owner)
    session.add(row)
    session.flush()
    audit.record(
        session,
        actor=actor,
        action="assessment.added",
        subject=f"assessments/{row.id}",
        loop_id=loop_id,
        after={
            "start": row.start,
            "end": row.end,
            "method": row.method,
            "grade": row.grade,
            "cause": row.cause,
        },
    )
    return store.Found(row=row, overrules=())


def overrule(session: Session, *, actor: Actor, assessment_id: UUID, said: Overrule) -> store.Found:
    """Put a person's diagnosis in place of the computed one; both stay to be read."""
    found = store.assessment_with_id(session, assessment_id)
    row = OverruleRow(
        assessment_id=assessment_id, cause=said.cause, reason=said.reason, author=actor.owner
    )
    session.add(row)
    session.flush()
    audit.record(
        session,
        actor=actor,
        action="assessment.overruled",
        subject=f"assessments/{assessment_id}",
        loop_id=found.row.loop_id,
        before={"cause": found.cause},
        after={"cause": said.cause, "reason": said.reason},
    )
    return store.Found(row=found.row, overrules=(row, *found.overrules))


def scorecard(
    session: Session, job_id: UUID | None, by: Order = Order.LOSS
) -> tuple[UUID, PlantScorecard]:
    """Roll up what a job found, by default the job of the latest period.

    Raises
    ------
    NotFound
        There is no such job, or it has found nothing yet.
    """
    job_id = job_id or store.newest_assessment_job(session)
    if job_id is None:
        raise NotFound("scorecard", "yet: assess the plant first, by POST /v1/assessments")
    rows = store.assessments_of_job(session, job_id)
    if not rows:
        raise NotFound("scorecard of job", job_id)
    found = store.with_overrules(session, [row for row, _ in rows])
    loops = {row.id: loop for row, loop in rows}
    scored = [
        Scored(
            name=str(one.row.id),
            tag=loops[one.row.id].tag,
            area=loops[one.row.id].area,
            unit=loops[one.row.id].unit,
            weight=loops[one.row.id].weight,
            points=one.row.grade,
            cause=one.cause,
            worth=loops[one.row.id].worth,
        )
        for one in found
    ]
    return job_id, plant_scorecard(scored, by=by)
