"""HTTP routes of tunings."""

from uuid import UUID

from fastapi import APIRouter, Response

from advice.body import Body
from service.access import Engineer, Viewer
from service.audit import declares
from service.database import Reading, Transaction
from service.limits import HEAVY
from service.listing import Cursor, Limit, cursor_after, key_of
from service.loops.store import loop_with_id
from service.models.schemas import id_from
from service.tables import TuningRow
from service.tunings import actions, store
from service.tunings.schemas import (
    CaseBody,
    CasesBody,
    TuneLoop,
    TuneProcess,
    TuneProcesses,
    TuningBody,
    TuningPage,
    TuningSummary,
)

router = APIRouter(prefix="/v1", tags=["tunings"])


@router.post(
    "/loops/{loop_id}/tunings",
    status_code=201,
    response_model=TuningBody,
    openapi_extra=declares("tuning.proposed"),
    dependencies=[HEAVY],
)
def propose_tuning(
    loop_id: UUID,
    body: TuneLoop,
    actor: Engineer,
    reading: Reading,
    transaction: Transaction,
    response: Response,
) -> Body:
    """Tune a loop by every rule, verify the settings, and keep the case."""
    # Worked out before the first write, so that nobody waits for it at the database.
    case = actions.tune_loop(reading, loop_id=loop_id, wanted=body)
    row = actions.keep_tuning(
        transaction, actor=actor, loop_id=loop_id, model_id=body.model_id, body=case
    )
    response.headers["Location"] = f"/v1/loops/{loop_id}/tunings/{row.id}"
    return _answer(row)


@router.get("/loops/{loop_id}/tunings")
def list_tunings(
    loop_id: UUID, _: Viewer, reading: Reading, cursor: Cursor = None, limit: Limit = 50
) -> TuningPage:
    """List the cases of a loop, newest first."""
    loop_with_id(reading, loop_id)
    key = key_of(cursor)
    after = store.tuning_with_id(reading, loop_id, id_from(key)) if key else None
    rows = store.tunings_newest_first(reading, loop_id, after=after, limit=limit + 1)
    more = cursor_after(str(rows[limit - 1].id)) if len(rows) > limit else None
    return TuningPage(items=[TuningSummary.model_validate(row) for row in rows[:limit]], next=more)


@router.get("/loops/{loop_id}/tunings/{tuning_id}", response_model=TuningBody)
def read_tuning(loop_id: UUID, tuning_id: UUID, _: Viewer, reading: Reading) -> Body:
    """Read a case of a loop."""
    return _answer(store.tuning_with_id(reading, loop_id, tuning_id))


@router.post(
    "/tunings", response_model=CaseBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def tune_process(body: TuneProcess, _: Engineer) -> Body:
    """Tune a process without a loop by every rule and verify the settings; nothing is stored."""
    return actions.tune_one(body)


@router.post(
    "/tunings/batch", response_model=CasesBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def tune_processes(body: TuneProcesses, _: Engineer) -> dict[str, list[Body]]:
    """Tune many processes in one request; nothing is stored."""
    return {"items": actions.tune_many(body)}


def _answer(row: TuningRow) -> Body:
    own: Body = {
        "id": str(row.id),
        "loop_id": str(row.loop_id),
        "model_id": None if row.model_id is None else str(row.model_id),
        "created_at": row.created_at.isoformat(),
        "author": row.author,
    }
    return {**row.body, **own}  # type: ignore[dict-item]
