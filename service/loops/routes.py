"""HTTP routes of loops."""

from typing import Annotated
from uuid import UUID

from fastapi import APIRouter, Query, Response

from service.access import Engineer, Viewer
from service.audit import declares
from service.database import Reading, Transaction
from service.etags import IfMatch
from service.listing import Cursor, Limit, cursor_after, key_of
from service.loops import actions, store
from service.loops.schemas import LoopBody, LoopChanges, LoopPage, NewLoop
from service.units import Line

router = APIRouter(prefix="/v1/loops", tags=["loops"])


@router.post("", status_code=201, openapi_extra=declares("loop.created"))
def create_loop(
    body: NewLoop, actor: Engineer, transaction: Transaction, response: Response
) -> LoopBody:
    """Add a loop to the plant."""
    row = actions.create_loop(transaction, actor=actor, loop=body)
    response.headers["ETag"] = actions.etag(row)
    response.headers["Location"] = f"/v1/loops/{row.id}"
    return LoopBody.model_validate(row)


@router.get("")
def list_loops(
    _: Viewer,
    reading: Reading,
    area: Line | None = None,
    unit: Line | None = None,
    tag: Annotated[Line | None, Query(description="Beginning of the tag.")] = None,
    archived: Annotated[bool, Query(description="The archived loops instead.")] = False,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> LoopPage:
    """List loops by tag."""
    wanted = store.Filter(area=area, unit=unit, tag=tag, archived=archived)
    rows = store.loops_by_tag(reading, wanted, after=key_of(cursor), limit=limit + 1)
    more = cursor_after(rows[limit - 1].tag) if len(rows) > limit else None
    return LoopPage(items=[LoopBody.model_validate(row) for row in rows[:limit]], next=more)


@router.get("/{loop_id}")
def read_loop(loop_id: UUID, _: Viewer, reading: Reading, response: Response) -> LoopBody:
    """Read a loop; its ETag names this version."""
    row = store.loop_with_id(reading, loop_id)
    response.headers["ETag"] = actions.etag(row)
    return LoopBody.model_validate(row)


@router.patch("/{loop_id}", openapi_extra=declares("loop.changed"))
def change_loop(
    loop_id: UUID,
    body: LoopChanges,
    actor: Engineer,
    transaction: Transaction,
    response: Response,
    if_match: IfMatch = None,
) -> LoopBody:
    """Change fields of a loop. A loop is archived rather than deleted."""
    row = actions.change_loop(
        transaction, actor=actor, loop_id=loop_id, if_match=if_match, changes=body
    )
    response.headers["ETag"] = actions.etag(row)
    return LoopBody.model_validate(row)
