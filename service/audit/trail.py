"""Writing the trail: the one function every action calls, and what a session watches for."""

from collections.abc import Mapping
from uuid import UUID

import structlog
from sqlalchemy.orm import Session, UOWTransaction

from service.actors import Actor
from service.audit import store
from service.audit.chain import line_hash
from service.errors import UnauditedChange
from service.plain_json import plain
from service.tables import AuditHeadRow, AuditRow, now

log = structlog.get_logger()


def record(
    session: Session,
    *,
    actor: Actor,
    action: str,
    subject: str,
    loop_id: UUID | None = None,
    before: Mapping[str, object] | None = None,
    after: Mapping[str, object] | None = None,
) -> AuditRow:
    """Add one line to the audit trail, in the transaction of the change itself.

    Call it last: from here to the end of the transaction every other writer waits.

    Parameters
    ----------
    session : Session
        Transaction of the change.
    actor : Actor
        Who changes.
    action : str
        What happens, `noun.verb` in the past tense, such as `sheet.approved`.
    subject : str
        Path of what changes, such as `loops/<id>`.
    loop_id : UUID, optional
        Loop it belongs to.
    before, after : mapping, optional
        The values that change; none where nothing was or nothing remains.
    """
    session.flush()
    head = store.locked_head(session)
    row = AuditRow(
        id=head.lines + 1,
        at=now(),
        actor=actor.owner,
        key_id=actor.key_id,
        action=action,
        subject=subject,
        loop_id=loop_id,
        before=_values(before),
        after=_values(after),
        previous=head.hash,
    )
    row.hash = line_hash(store.line(row))
    head.lines, head.hash = row.id, row.hash
    session.add(row)
    session.flush()
    session.info.update(audited=True, audit_head=(row.id, row.hash))
    return row


def _values(values: Mapping[str, object] | None) -> dict[str, object] | None:
    return None if values is None else {name: plain(value) for name, value in values.items()}


def watch_changes(session: Session, _: UOWTransaction) -> None:
    """Remember that a session has written something besides the trail."""
    touched = {*session.new, *session.dirty, *session.deleted}
    if any(not isinstance(row, AuditRow | AuditHeadRow) for row in touched):
        session.info["changed"] = True


def refuse_unaudited(session: Session) -> None:
    """Stop a transaction that changes something and leaves no line in the trail.

    Raises
    ------
    UnauditedChange
        Nothing was recorded.
    """
    if session.info.get("changed") and not session.info.get("audited"):
        raise UnauditedChange("a change was made without a line in the audit trail")


def announce_head(session: Session) -> None:
    """Put the new head of the chain into the log, where a database owner does not reach it."""
    head = session.info.pop("audit_head", None)
    if head is not None:
        log.info("audit head", row=head[0], head=head[1])


def declares(action: str | None) -> dict[str, object]:
    """Say in the API's description which line a route leaves in the trail.

    Parameters
    ----------
    action : str or None
        The action recorded; none for a route that computes and stores nothing.
    """
    return {"x-audit": action or "none"}
