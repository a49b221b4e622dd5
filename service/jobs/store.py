"""Jobs in the database: who does which, until when, and how far it has come."""

from datetime import datetime, timedelta
from uuid import UUID

from sqlalchemy import ColumnElement, and_, func, or_, select, tuple_
from sqlalchemy.orm import Session

from service.errors import NotFound
from service.tables import JobRow, now

# Longer than any one step takes between two signs of life; a killed worker's job waits this long.
LEASE = timedelta(seconds=60)
# A job that kills its worker again and again must not do so for ever.
MOST_ATTEMPTS = 5


def job_with_id(session: Session, job_id: UUID) -> JobRow:
    """Find a job or say that there is none."""
    row = session.get(JobRow, job_id)
    if row is None:
        raise NotFound("job", job_id)
    return row


def job_with_key(session: Session, key: str) -> JobRow | None:
    """Find the job that does a certain thing."""
    return session.scalars(select(JobRow).where(JobRow.key == key)).one_or_none()


def jobs_newest_first(session: Session, *, after: JobRow | None, limit: int) -> list[JobRow]:
    """List jobs, newest first, after one of them."""
    query = select(JobRow)
    if after is not None:
        query = query.where(tuple_(JobRow.created_at, JobRow.id) < (after.created_at, after.id))
    return list(
        session.scalars(query.order_by(JobRow.created_at.desc(), JobRow.id.desc()).limit(limit))
    )


def claim_job(session: Session, owner: str, job_id: UUID | None = None) -> JobRow | None:
    """Take the oldest job that nobody does, or a certain one; also from a worker without life.

    Two workers never get the same one: SQLite's transactions that write queue up, and PostgreSQL
    skips the rows that another transaction holds.
    """
    free = _free(moment(session))
    row = session.scalars(
        select(JobRow)
        .where(free if job_id is None else and_(free, JobRow.id == job_id))
        .order_by(JobRow.created_at, JobRow.id)
        .limit(1)
        .with_for_update(skip_locked=True)
    ).one_or_none()
    if row is None:
        return None
    row.state, row.owner = "running", owner
    row.lease_until = lease_end(session)
    row.started_at = row.started_at or now()
    row.attempts += 1
    return row


def _free(at: datetime) -> ColumnElement[bool]:
    return or_(JobRow.state == "queued", and_(JobRow.state == "running", JobRow.lease_until < at))


def moment(session: Session) -> datetime:
    """Tell the time by the one clock that all workers share: the database's.

    SQLite runs within its workers, on one machine: there it is the machine's own.
    """
    if session.get_bind().dialect.name == "postgresql":
        at: datetime = session.execute(select(func.clock_timestamp())).scalar_one()
        return at
    return now()


def lease_end(session: Session) -> datetime:
    """Tell until when a job is its worker's that shows life at this moment."""
    return moment(session) + LEASE


def held_job(session: Session, job_id: UUID, owner: str) -> JobRow | None:
    """Lock a job for its worker; none when another worker has taken it over meanwhile."""
    return session.scalars(
        select(JobRow)
        .where(JobRow.id == job_id, JobRow.owner == owner, JobRow.state == "running")
        .with_for_update()
    ).one_or_none()
