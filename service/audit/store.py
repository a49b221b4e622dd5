"""The audit trail in the database."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from uuid import UUID

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.audit.chain import instant_text
from service.tables import AuditHeadRow, AuditRow

_BATCH = 1000


def locked_head(session: Session) -> AuditHeadRow:
    """Take the end of the chain, and keep every other writer waiting for it.

    PostgreSQL locks the row; on SQLite the transaction itself is the lock.
    """
    return session.scalars(
        select(AuditHeadRow).with_for_update().execution_options(populate_existing=True)
    ).one()


def head(session: Session) -> AuditHeadRow:
    """Read the end of the chain."""
    return session.scalars(select(AuditHeadRow)).one()


def line(row: AuditRow) -> dict[str, object]:
    """Write a row as the chain hashes it and an export shows it."""
    return {
        "id": row.id,
        "at": instant_text(row.at),
        "actor": row.actor,
        "key_id": row.key_id,
        "action": row.action,
        "subject": row.subject,
        "loop_id": None if row.loop_id is None else str(row.loop_id),
        "before": row.before,
        "after": row.after,
        "previous": row.previous,
        "hash": row.hash,
    }


def lines(session: Session) -> Iterator[dict[str, object]]:
    """Walk through the whole trail in order, whatever somebody put there, a thousand at a time.

    A row that cannot even be read comes as its number alone, which no check lets pass.
    """
    last: int | None = None
    while numbers := _numbers(session, last):
        last = numbers[-1]
        try:
            yield from lines_between(session, numbers[0], last)
        except (ValueError, TypeError):
            for number in numbers:
                yield _line_or_number(session, number)


def lines_between(session: Session, first: int, last: int) -> list[dict[str, object]]:
    """Read the lines first to last."""
    rows = session.scalars(
        select(AuditRow).where(AuditRow.id.between(first, last)).order_by(AuditRow.id)
    )
    found = [line(row) for row in rows]
    session.expunge_all()
    return found


def _numbers(session: Session, after: int | None) -> list[int]:
    query = select(AuditRow.id).order_by(AuditRow.id).limit(_BATCH)
    if after is not None:
        query = query.where(AuditRow.id > after)
    return list(session.scalars(query))


def _line_or_number(session: Session, number: int) -> dict[str, object]:
    try:
        return lines_between(session, number, number)[0]
    except (ValueError, TypeError):
        return {"id": number}


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """Which lines to list; none of a field means all.

    Attributes
    ----------
    actor, action, subject : str or None
        Exact value.
    loop_id : UUID or None
        Lines of one loop.
    since, until : datetime or None
        Time of the change, until exclusive.
    """

    actor: str | None = None
    action: str | None = None
    subject: str | None = None
    loop_id: UUID | None = None
    since: datetime | None = None
    until: datetime | None = None


def newest(session: Session, wanted: Filter, *, below: int | None, limit: int) -> list[AuditRow]:
    """List lines that match, newest first, below a line number."""
    query = select(AuditRow).order_by(AuditRow.id.desc()).limit(limit)
    for column, value in (
        (AuditRow.actor, wanted.actor),
        (AuditRow.action, wanted.action),
        (AuditRow.subject, wanted.subject),
        (AuditRow.loop_id, wanted.loop_id),
    ):
        if value is not None:
            query = query.where(column == value)
    if wanted.since is not None:
        query = query.where(AuditRow.at >= wanted.since)
    if wanted.until is not None:
        query = query.where(AuditRow.at < wanted.until)
    if below is not None:
        query = query.where(AuditRow.id < below)
    return list(session.scalars(query))
