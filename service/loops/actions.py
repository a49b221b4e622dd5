"""What users do with loops."""

from uuid import UUID

from pydantic import ValidationError
from sqlalchemy.orm import Session

from service import audit
from service.actors import Actor
from service.errors import InvalidRequest
from service.etags import require_match
from service.loops import store
from service.loops.schemas import LoopChanges, NewLoop
from service.tables import LoopRow, now


def create_loop(session: Session, *, actor: Actor, loop: NewLoop) -> LoopRow:
    """Add a loop to the plant.

    Raises
    ------
    TagTaken
        Another loop has its tag.
    """
    row = LoopRow(**loop.model_dump(), created_by=actor.owner)
    session.add(row)
    store.flush_tag(session, row.tag)
    audit.record(
        session,
        actor=actor,
        action="loop.created",
        subject=f"loops/{row.id}",
        loop_id=row.id,
        after=loop.model_dump(),
    )
    return row


def change_loop(
    session: Session, *, actor: Actor, loop_id: UUID, if_match: str | None, changes: LoopChanges
) -> LoopRow:
    """Change fields of a loop; a change that changes nothing leaves no trace.

    Raises
    ------
    NotFound, IfMatchMissing, StaleVersion, InvalidRequest, TagTaken
        See there.
    """
    row = store.loop_with_id(session, loop_id, lock=True)
    require_match(if_match, etag(row))
    wanted = changes.model_dump(exclude_unset=True)
    _must_describe_a_loop(row, wanted)
    before = {name: getattr(row, name) for name in wanted}
    changed = sorted(name for name in wanted if wanted[name] != before[name])
    if not changed:
        return row
    for name in changed:
        setattr(row, name, wanted[name])
    row.changed_at = now()
    store.flush_tag(session, row.tag)
    audit.record(
        session,
        actor=actor,
        action="loop.changed",
        subject=f"loops/{row.id}",
        loop_id=row.id,
        before={name: before[name] for name in changed},
        after={name: wanted[name] for name in changed},
    )
    return row


def etag(row: LoopRow) -> str:
    """Name this version of a loop."""
    return f'"{row.version}"'


def _must_describe_a_loop(row: LoopRow, wanted: dict[str, object]) -> None:
    """Hold a change against what stays: ranges span only together."""
    stays = {name: getattr(row, name) for name in NewLoop.model_fields}
    try:
        NewLoop.model_validate(stays | {k: v for k, v in wanted.items() if k != "archived"})
    except ValidationError as error:
        detail = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise InvalidRequest("body", detail) from error
