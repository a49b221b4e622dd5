"""HTTP routes of assessments."""

from typing import Annotated
from uuid import UUID

from fastapi import APIRouter, Query, Response

from advice.rollup import Order
from service.access import Engineer, Viewer
from service.assessments import actions, store
from service.assessments.schemas import (
    AssessLoop,
    AssessLoops,
    AssessmentBody,
    AssessmentPage,
    AssessmentSummary,
    Overrule,
    OverruleBody,
    PeriodsEffect,
    ScorecardBody,
)
from service.audit import declares
from service.database import Reading, Transaction
from service.jobs.schemas import JobBody
from service.jobs.store import job_with_id
from service.limits import HEAVY
from service.listing import Cursor, Limit, cursor_after, key_of
from service.loops.store import loop_with_id
from service.models.schemas import id_from
from service.samples import Samples
from service.sheets.effect import effect_of_periods
from service.units import Moment

router = APIRouter(prefix="/v1", tags=["assessments"])


@router.post(
    "/assessments", status_code=202, openapi_extra=declares("job.added"), dependencies=[HEAVY]
)
def request_assessments(
    body: AssessLoops, actor: Engineer, transaction: Transaction, response: Response
) -> JobBody:
    """Ask what the routine data of many loops say; the answer is the job that finds out."""
    row = actions.request_assessments(transaction, actor=actor, wanted=body)
    response.headers["Location"] = f"/v1/jobs/{row.id}"
    return JobBody.model_validate(row)


@router.get("/assessments")
def list_assessments(
    _: Viewer,
    reading: Reading,
    job_id: Annotated[UUID, Query(description="Job that assessed them.")],
    cursor: Cursor = None,
    limit: Limit = 100,
) -> AssessmentPage:
    """List what a job has found so far, by tag."""
    job_with_id(reading, job_id)
    rows = store.assessments_of_job(reading, job_id, after=key_of(cursor), limit=limit + 1)
    more = cursor_after(rows[limit - 1][1].tag) if len(rows) > limit else None
    found = store.with_overrules(reading, [row for row, _ in rows[:limit]])
    return AssessmentPage(items=[_summary(one) for one in found], next=more)


@router.get("/assessments/{assessment_id}")
def read_assessment(assessment_id: UUID, _: Viewer, reading: Reading) -> AssessmentBody:
    """Read an assessment with all its indices."""
    return _body(store.assessment_with_id(reading, assessment_id))


@router.post(
    "/assessments/{assessment_id}/overrule",
    status_code=201,
    openapi_extra=declares("assessment.overruled"),
)
def overrule_assessment(
    assessment_id: UUID, body: Overrule, actor: Engineer, transaction: Transaction
) -> AssessmentBody:
    """Put a person's diagnosis in place of the computed one, with the reason."""
    return _body(actions.overrule(transaction, actor=actor, assessment_id=assessment_id, said=body))


@router.get("/scorecard")
def read_scorecard(
    _: Viewer,
    reading: Reading,
    job_id: Annotated[UUID | None, Query(description="By default that of the latest period.")] = (
        None
    ),
    by: Annotated[
        Order, Query(description="What makes one bad actor worse than another.")
    ] = Order.LOSS,
) -> ScorecardBody:
    """Read how the plant stands: areas, causes, and the loops that cost the most."""
    job, card = actions.scorecard(reading, job_id, by)
    return ScorecardBody.of(job, card)


@router.post(
    "/loops/{loop_id}/assessments",
    status_code=201,
    openapi_extra=declares("assessment.added"),
    dependencies=[HEAVY],
)
def assess_loop(
    loop_id: UUID,
    body: AssessLoop,
    actor: Engineer,
    reading: Reading,
    transaction: Transaction,
    samples: Samples,
    response: Response,
) -> AssessmentBody:
    """Ask what one loop's routine data say, and keep the answer."""
    # Worked out before the first write, so that nobody waits for it at the database.
    found = actions.assess_one(reading, samples, loop_id=loop_id, wanted=body)
    kept = actions.keep_assessment(
        transaction, actor=actor, loop_id=loop_id, period=body, found=found
    )
    response.headers["Location"] = f"/v1/assessments/{kept.row.id}"
    return _body(kept)


@router.get("/loops/{loop_id}/effect", dependencies=[HEAVY])
def compare_periods(
    loop_id: UUID,
    _: Viewer,
    reading: Reading,
    samples: Samples,
    before_start: Annotated[Moment, Query(description="First period from here on.")],
    before_end: Annotated[Moment, Query(description="Up to here.")],
    after_start: Annotated[Moment, Query(description="Second period from here on.")],
    after_end: Annotated[Moment, Query(description="Up to here.")],
) -> PeriodsEffect:
    """Ask whether the control error differs between two periods, such as around a change."""
    before, after = (
        actions.period_of(name, start, end)
        for name, start, end in (
            ("before", before_start, before_end),
            ("after", after_start, after_end),
        )
    )
    return PeriodsEffect.model_validate(effect_of_periods(reading, samples, loop_id, before, after))


@router.get("/loops/{loop_id}/assessments")
def list_assessments_of_loop(
    loop_id: UUID, _: Viewer, reading: Reading, cursor: Cursor = None, limit: Limit = 50
) -> AssessmentPage:
    """List the assessments of a loop, newest first."""
    loop_with_id(reading, loop_id)
    key = key_of(cursor)
    after = store.assessment_with_id(reading, id_from(key)).row if key else None
    rows = store.assessments_of_loop(reading, loop_id, after=after, limit=limit + 1)
    more = cursor_after(str(rows[limit - 1].id)) if len(rows) > limit else None
    found = store.with_overrules(reading, rows[:limit])
    return AssessmentPage(items=[_summary(one) for one in found], next=more)


def _summary(found: store.Found) -> AssessmentSummary:
    return AssessmentSummary.model_validate(_fields(found))


def _body(found: store.Found) -> AssessmentBody:
    overrules = [OverruleBody.model_validate(said) for said in found.overrules]
    return AssessmentBody.model_validate(
        _fields(found) | {"overrules": overrules, "assessment": found.row.body}
    )


def _fields(found: store.Found) -> dict[str, object]:
    row = found.row
    names = ("id", "loop_id", "job_id", "start", "end", "method", "grade", "confidence")
    return {name: getattr(row, name) for name in (*names, "created_at", "author")} | {
        "cause": found.cause,
        "computed_cause": row.cause,
    }
