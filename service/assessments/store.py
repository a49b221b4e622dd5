"""Assessments in the database."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from uuid import UUID

from sqlalchemy import exists, select, tuple_
from sqlalchemy.orm import Session, defer

from service.errors import NotFound
from service.tables import AssessmentRow, JobRow, LoopRow, OverruleRow

# Jobs among which the one of the latest period is looked for; a week is caught up at most.
RECENT_JOBS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """An assessment, and what people said against it, the latest first."""

    row: AssessmentRow
    overrules: tuple[OverruleRow, ...]

    @property
    def cause(self) -> str:
        """What is wrong: a person's last word before the computed one."""
        return self.overrules[0].cause if self.overrules else self.row.cause


def assessment_with_id(session: Session, assessment_id: UUID) -> Found:
    """Find an assessment or say that there is none."""
    row = session.get(AssessmentRow, assessment_id)
    if row is None:
        raise NotFound("assessment", assessment_id)
    return with_overrules(session, [row])[0]


def with_overrules(session: Session, rows: Sequence[AssessmentRow]) -> list[Found]:
    """Add what people said against each of some assessments."""
    said: dict[UUID, list[OverruleRow]] = {row.id: [] for row in rows}
    newest = (OverruleRow.created_at.desc(), OverruleRow.id)
    query = select(OverruleRow).where(OverruleRow.assessment_id.in_(said)).order_by(*newest)
    for overrule in session.scalars(query):
        said[overrule.assessment_id].append(overrule)
    return [Found(row=row, overrules=tuple(said[row.id])) for row in rows]


def assessments_of_loop(
    session: Session, loop_id: UUID, *, after: AssessmentRow | None, limit: int
) -> list[AssessmentRow]:
    """List the assessments of a loop, newest first, after one of them."""
    query = select(AssessmentRow).where(AssessmentRow.loop_id == loop_id)
    query = query.options(defer(AssessmentRow.body, raiseload=True))
    if after is not None:
        here = tuple_(AssessmentRow.created_at, AssessmentRow.id)
        query = query.where(here < (after.created_at, after.id))
    newest = (AssessmentRow.created_at.desc(), AssessmentRow.id.desc())
    return list(session.scalars(query.order_by(*newest).limit(limit)))


def assessments_of_job(
    session: Session, job_id: UUID, *, after: str | None = None, limit: int | None = None
) -> list[tuple[AssessmentRow, LoopRow]]:
    """List what a job found, by tag, after a tag."""
    query = (
        select(AssessmentRow, LoopRow)
        .options(defer(AssessmentRow.body, raiseload=True))  # no list needs the documents
        .join(LoopRow, LoopRow.id == AssessmentRow.loop_id)
        .where(AssessmentRow.job_id == job_id)
    )
    if after is not None:
        query = query.where(LoopRow.tag > after)
    return [(row, loop) for row, loop in session.execute(query.order_by(LoopRow.tag).limit(limit))]


def assessed_loops(session: Session, job_id: UUID) -> set[UUID]:
    """Name the loops a job has stored already."""
    query = select(AssessmentRow.loop_id).where(AssessmentRow.job_id == job_id)
    return set(session.scalars(query))


def loops_to_assess(session: Session, wanted: Sequence[UUID] | None) -> list[LoopRow]:
    """Find the loops of a job: those named, or all that are not archived.

    Raises
    ------
    NotFound
        One of those named is not there.
    """
    query = select(LoopRow).where(LoopRow.archived.is_(False)).order_by(LoopRow.tag)
    if wanted is None:
        return list(session.scalars(query))
    rows = {row.id: row for row in session.scalars(select(LoopRow))}
    for loop_id in wanted:
        if loop_id not in rows:
            raise NotFound("loop", loop_id)
    return [rows[loop_id] for loop_id in dict.fromkeys(wanted)]


def newest_assessment_job(session: Session) -> UUID | None:
    """Name the job that assessed the latest period of the whole plant, or of any loops if none has.

    A job that is not done, or was asked about some loops only, would stand for the plant wrongly.
    """
    whole = JobRow.request["loop_ids"].as_string().is_(None)
    found = exists().where(AssessmentRow.job_id == JobRow.id)
    jobs = session.scalars(
        select(JobRow)
        .where(JobRow.kind == "assess", JobRow.state == "done", whole, found)
        .order_by(JobRow.created_at.desc())
        .limit(RECENT_JOBS)
    ).all()
    if jobs:
        return max(jobs, key=lambda job: datetime.fromisoformat(str(job.request["end"]))).id
    order = (AssessmentRow.end.desc(), AssessmentRow.created_at.desc())
    query = select(AssessmentRow.job_id).where(AssessmentRow.job_id.is_not(None))
    return session.scalar(query.order_by(*order).limit(1))
