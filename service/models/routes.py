"""HTTP routes of models."""

from uuid import UUID

from fastapi import APIRouter, Response

from advice.body import Body
from service.access import Engineer, Viewer
from service.audit import declares
from service.database import Reading, Transaction
from service.limits import HEAVY
from service.listing import Cursor, Limit, cursor_after, key_of
from service.loops.store import loop_with_id
from service.models import actions, store
from service.models.schemas import ModelBody, ModelPage, NewModel, id_from
from service.samples import Samples
from service.tables import ModelRow

router = APIRouter(prefix="/v1/loops/{loop_id}/models", tags=["models"])


@router.post(
    "",
    status_code=201,
    response_model=ModelBody,
    openapi_extra=declares("model.added"),
    dependencies=[HEAVY],
)
def add_model(
    loop_id: UUID,
    body: NewModel,
    actor: Engineer,
    reading: Reading,
    transaction: Transaction,
    samples: Samples,
    response: Response,
) -> Body:
    """Identify a loop's process from a record, or state it; a refusal is kept with its reasons."""
    # Worked out before the first write, so that nobody waits for it at the database.
    found = actions.work_out_model(reading, samples, loop_id=loop_id, wanted=body)
    row = actions.keep_model(
        transaction, actor=actor, loop_id=loop_id, record_id=body.record_id, body=found
    )
    response.headers["Location"] = f"/v1/loops/{loop_id}/models/{row.id}"
    return _answer(row)


@router.get("")
def list_models(
    loop_id: UUID, _: Viewer, reading: Reading, cursor: Cursor = None, limit: Limit = 50
) -> ModelPage:
    """List the models of a loop, newest first."""
    loop_with_id(reading, loop_id)
    key = key_of(cursor)
    after = store.model_with_id(reading, loop_id, id_from(key)) if key else None
    rows = store.models_newest_first(reading, loop_id, after=after, limit=limit + 1)
    more = cursor_after(str(rows[limit - 1].id)) if len(rows) > limit else None
    return ModelPage(
        items=[ModelBody.model_validate(_answer(row)) for row in rows[:limit]], next=more
    )


@router.get("/{model_id}", response_model=ModelBody)
def read_model(loop_id: UUID, model_id: UUID, _: Viewer, reading: Reading) -> Body:
    """Read a model of a loop."""
    return _answer(store.model_with_id(reading, loop_id, model_id))


def _answer(row: ModelRow) -> Body:
    own: Body = {
        "id": str(row.id),
        "loop_id": str(row.loop_id),
        "record_id": None if row.record_id is None else str(row.record_id),
        "created_at": row.created_at.isoformat(),
        "author": row.author,
    }
    return {**row.body, **own}  # type: ignore[dict-item]
