"""Loops in the database."""

from dataclasses import dataclass
from uuid import UUID

from sqlalchemy import func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from service.errors import NotFound, TagTaken
from service.tables import LoopRow


def loop_with_id(session: Session, loop_id: UUID, *, lock: bool = False) -> LoopRow:
    """Find a loop or say that there is none.

    With `lock`, other transactions that want to change the loop wait for this one.
    """
    row = session.get(LoopRow, loop_id, with_for_update=True if lock else None)
    if row is None:
        raise NotFound("loop", loop_id)
    return row


def loop_with_tag(session: Session, tag: str) -> LoopRow | None:
    """Find a loop by its tag."""
    return session.scalars(select(LoopRow).where(LoopRow.tag == tag)).one_or_none()


def flush_tag(session: Session, tag: str) -> None:
    """Write a loop's tag, which the database holds unique even between two requests."""
    try:
        session.flush()
    except IntegrityError as error:
        raise TagTaken(tag) from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """Which loops to list; none of a field means all.

    Attributes
    ----------
    area, unit : str or None
        Exact value.
    tag : str or None
        Beginning of the tag.
    archived : bool
        List archived loops in place of the others.
    """

    area: str | None = None
    unit: str | None = None
    tag: str | None = None
    archived: bool = False


def loops_by_tag(
    session: Session, wanted: Filter, *, after: str | None, limit: int
) -> list[LoopRow]:
    """List loops that match, by tag, after a tag."""
    query = select(LoopRow).where(LoopRow.archived.is_(wanted.archived))
    if wanted.area is not None:
        query = query.where(LoopRow.area == wanted.area)
    if wanted.unit is not None:
        query = query.where(LoopRow.unit == wanted.unit)
    if wanted.tag is not None:
        # Not LIKE: it ignores case on SQLite only, and tags may hold its wildcards.
        query = query.where(func.substr(LoopRow.tag, 1, len(wanted.tag)) == wanted.tag)
    if after is not None:
        query = query.where(LoopRow.tag > after)
    return list(session.scalars(query.order_by(LoopRow.tag).limit(limit)))
