"""What users and workers do with jobs."""

from collections.abc import Mapping
from uuid import UUID

from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from service import audit
from service.actors import Actor, Role
from service.errors import JobEnded
from service.jobs import store
from service.plain_json import plain
from service.tables import JobRow, now

# What the service does by itself stands in the trail under its own name.
SCHEDULE = Actor(owner="schedule", role=Role.ENGINEER)


def add_job(
    session: Session, *, actor: Actor, kind: str, key: str, request: Mapping[str, object]
) -> JobRow:
    """Ask for work; what was asked for under the same key before is that same job."""
    known = store.job_with_key(session, key)
    if known is not None:
        return known
    row = JobRow(
        kind=kind,
        key=key,
        request={name: plain(value) for name, value in request.items()},
        author=actor.owner,
    )
    try:
        with session.begin_nested():
            session.add(row)
    except IntegrityError:  # another process asked at the same moment
        known = store.job_with_key(session, key)
        assert known is not None  # noqa: S101 - the key is what collided
        return known
    audit.record(
        session,
        actor=actor,
        action="job.added",
        subject=f"jobs/{row.id}",
        after={"kind": kind, "key": key, "request": row.request},
    )
    return row


def cancel_job(session: Session, *, actor: Actor, job_id: UUID) -> JobRow:
    """Ask a job to stop; what it has stored stays.

    Raises
    ------
    JobEnded
        It is over already.
    """
    row = session.get(JobRow, job_id, with_for_update=True)
    if row is None:
        row = store.job_with_id(session, job_id)
    if row.state not in ("queued", "running"):
        raise JobEnded(row.state)
    row.cancel = True
    if row.state == "queued":
        end_job(row, "cancelled", f"Cancelled by {actor.owner} before it began.")
    audit.record(
        session,
        actor=actor,
        action="job.cancelled",
        subject=f"jobs/{row.id}",
        after={"done": row.done, "total": row.total},
    )
    return row


def end_job(
    row: JobRow, state: str, message: str, result: Mapping[str, object] | None = None
) -> None:
    """Note how a job ended; nobody holds it any longer."""
    row.state, row.message = state, message
    row.result = None if result is None else {name: plain(value) for name, value in result.items()}
    row.owner = row.lease_until = None
    row.finished_at = now()
