"""HTTP routes of the audit trail."""

from typing import Annotated, TypeAlias
from uuid import UUID

from fastapi import APIRouter, Depends, Query
from fastapi.responses import StreamingResponse

from service.access import Viewer
from service.audit import actions, store
from service.audit.schemas import AuditLine, AuditPage, VerdictBody
from service.database import Database, Reading, database
from service.limits import HEAVY, HEAVY_TO_THE_END
from service.listing import Cursor, Limit, cursor_after, number_of
from service.units import Line, Moment

router = APIRouter(prefix="/v1/audit", tags=["audit"])
HeadHash: TypeAlias = Annotated[
    str | None,
    Query(pattern="^[0-9a-f]{64}$", description="A head kept elsewhere: from a log or an export."),
]


def _wanted(
    actor: Line | None = None,
    action: Line | None = None,
    subject: Line | None = None,
    loop_id: UUID | None = None,
    since: Moment | None = None,
    until: Annotated[Moment | None, Query(description="Exclusive.")] = None,
) -> store.Filter:
    return store.Filter(
        actor=actor, action=action, subject=subject, loop_id=loop_id, since=since, until=until
    )


@router.get("")
def list_audit(
    _: Viewer,
    wanted: Annotated[store.Filter, Depends(_wanted)],
    reading: Reading,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> AuditPage:
    """List who changed what, newest first."""
    rows = store.newest(reading, wanted, below=number_of(cursor), limit=limit + 1)
    more = cursor_after(str(rows[limit - 1].id)) if len(rows) > limit else None
    return AuditPage(items=[AuditLine.model_validate(row) for row in rows[:limit]], next=more)


@router.get("/verify", dependencies=[HEAVY])
def verify_audit(_: Viewer, reading: Reading, head: HeadHash = None) -> VerdictBody:
    """Recompute every hash of the trail: is the chain intact, and does it hold the known head?"""
    return VerdictBody.model_validate(actions.verify(reading, known_head=head))


@router.get(
    "/export",
    response_class=StreamingResponse,
    responses={
        200: {
            "description": "JSON Lines: format, rows and head, then one line of the trail each.",
            "content": {"application/jsonl": {"schema": {"type": "string"}}},
            "headers": {"X-Audit-Head": {"schema": {"type": "string"}}},
        }
    },
    dependencies=[HEAVY_TO_THE_END],
)
def export_audit(_: Viewer, held: Annotated[Database, Depends(database)]) -> StreamingResponse:
    """Take the whole trail away, with its head, in a form that can be verified offline."""
    head, pieces = actions.export(held.readings)
    return StreamingResponse(
        pieces,
        media_type="application/jsonl",
        headers={
            "X-Audit-Head": head,
            "Content-Disposition": f'attachment; filename="audit-{head[:12]}.jsonl"',
        },
    )
