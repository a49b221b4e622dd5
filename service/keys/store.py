"""API keys in the database."""

from sqlalchemy import select
from sqlalchemy.orm import Session

from service.actors import Role
from service.errors import NotFound
from service.tables import KeyRow


def find_key(session: Session, key_id: str) -> KeyRow | None:
    """Find a key by its public part."""
    return session.get(KeyRow, key_id)


def key_with_id(session: Session, key_id: str) -> KeyRow:
    """Find a key or say that there is none, and keep others from changing it."""
    row = session.get(KeyRow, key_id, with_for_update=True)
    if row is None:
        raise NotFound("key", key_id)
    return row


def add_key(session: Session, row: KeyRow) -> None:
    """Store a key. The caller owns the transaction."""
    session.add(row)
    session.flush()


def admin_keys(session: Session) -> list[KeyRow]:
    """List the admin keys that are in force, and keep others from revoking them meanwhile."""
    return list(
        session.scalars(
            select(KeyRow)
            .where(KeyRow.role == Role.ADMIN.value, KeyRow.revoked_at.is_(None))
            .order_by(KeyRow.id)
            .with_for_update()
        )
    )


def all_keys(session: Session, *, after: str | None, limit: int) -> list[KeyRow]:
    """List keys by their public part."""
    query = select(KeyRow).order_by(KeyRow.id).limit(limit)
    return list(session.scalars(query if after is None else query.where(KeyRow.id > after)))
