"""Models in the database."""

from uuid import UUID

from sqlalchemy import select, tuple_
from sqlalchemy.orm import Session

from service.errors import NotFound
from service.tables import ModelRow, RecordRow


def model_with_id(session: Session, loop_id: UUID, model_id: UUID) -> ModelRow:
    """Find a model of a loop or say that there is none."""
    row = session.get(ModelRow, model_id)
    if row is None or row.loop_id != loop_id:
        raise NotFound("model", model_id)
    return row


def record_with_id(session: Session, loop_id: UUID, record_id: UUID) -> RecordRow:
    """Find a record of a loop or say that there is none."""
    row = session.get(RecordRow, record_id)
    if row is None or row.loop_id != loop_id:
        raise NotFound("record", record_id)
    return row


def models_newest_first(
    session: Session, loop_id: UUID, *, after: ModelRow | None, limit: int
) -> list[ModelRow]:
    """List models of a loop, newest first, after one of them."""
    query = select(ModelRow).where(ModelRow.loop_id == loop_id)
    if after is not None:
        here = tuple_(ModelRow.created_at, ModelRow.id)
        query = query.where(here < (after.created_at, after.id))
    newest = (ModelRow.created_at.desc(), ModelRow.id.desc())
    return list(session.scalars(query.order_by(*newest).limit(limit)))
