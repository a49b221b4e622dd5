"""Tuning cases in the database."""

from uuid import UUID

from sqlalchemy import select, tuple_
from sqlalchemy.orm import Session

from service.errors import NotFound
from service.tables import TuningRow


def tuning_with_id(session: Session, loop_id: UUID, tuning_id: UUID) -> TuningRow:
    """Find a case of a loop or say that there is none."""
    row = session.get(TuningRow, tuning_id)
    if row is None or row.loop_id != loop_id:
        raise NotFound("tuning", tuning_id)
    return row


def tunings_newest_first(
    session: Session, loop_id: UUID, *, after: TuningRow | None, limit: int
) -> list[TuningRow]:
    """List cases of a loop, newest first, after one of them."""
    query = select(TuningRow).where(TuningRow.loop_id == loop_id)
    if after is not None:
        here = tuple_(TuningRow.created_at, TuningRow.id)
        query = query.where(here < (after.created_at, after.id))
    newest = (TuningRow.created_at.desc(), TuningRow.id.desc())
    return list(session.scalars(query.order_by(*newest).limit(limit)))
