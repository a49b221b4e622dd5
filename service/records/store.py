"""Records in the database."""

from uuid import UUID

from sqlalchemy import select, tuple_
from sqlalchemy.orm import Session

from service.errors import NotFound
from service.tables import RecordRow


def record_with_id(session: Session, loop_id: UUID, record_id: UUID) -> RecordRow:
    """Find a record of a loop or say that there is none."""
    row = session.get(RecordRow, record_id)
    if row is None or row.loop_id != loop_id:
        raise NotFound("record", record_id)
    return row


def same_record(
    session: Session, loop_id: UUID, *, sha256: str, decisions_sha256: str
) -> RecordRow | None:
    """Find the record of the same file read the same way."""
    query = select(RecordRow).where(
        RecordRow.loop_id == loop_id,
        RecordRow.sha256 == sha256,
        RecordRow.decisions_sha256 == decisions_sha256,
    )
    return session.scalars(query).one_or_none()


def records_newest_first(
    session: Session, loop_id: UUID, *, after: RecordRow | None, limit: int
) -> list[RecordRow]:
    """List records of a loop, newest first, after one of them."""
    query = select(RecordRow).where(RecordRow.loop_id == loop_id)
    if after is not None:
        here = tuple_(RecordRow.created_at, RecordRow.id)
        query = query.where(here < (after.created_at, after.id))
    newest = (RecordRow.created_at.desc(), RecordRow.id.desc())
    return list(session.scalars(query.order_by(*newest).limit(limit)))
