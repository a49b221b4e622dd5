"""HTTP routes of records and samples."""

from typing import Annotated
from uuid import UUID

from fastapi import APIRouter, Depends, Query, Request, Response

from service.access import Engineer, Viewer
from service.audit import declares
from service.database import Database, Reading, Transaction, database
from service.errors import InvalidRequest, NotFound
from service.limits import HEAVY
from service.listing import Cursor, Limit, cursor_after, key_of
from service.loops.store import loop_with_id
from service.models.schemas import id_from
from service.records import actions, store
from service.records.picture import picture_of
from service.records.progress import progress_of
from service.records.receiving import Received
from service.records.schemas import (
    PendingBody,
    RecordBody,
    RecordPage,
    SamplesBody,
    upload_form,
)
from service.samples import Samples
from service.tables import RecordRow
from service.units import Moment, Seconds

router = APIRouter(prefix="/v1/loops/{loop_id}/records", tags=["records"])
samples_router = APIRouter(prefix="/v1/loops/{loop_id}/samples", tags=["records"])


@router.post(
    "",
    status_code=201,
    openapi_extra={**declares("record.stored"), **upload_form()},
    responses={200: {"model": RecordBody, "description": "The same file was stored before."}},
    dependencies=[HEAVY],
)
def upload_record(
    loop_id: UUID,
    upload: Received,
    actor: Engineer,
    held: Annotated[Database, Depends(database)],
    transaction: Transaction,
    samples: Samples,
    request: Request,
    response: Response,
) -> RecordBody:
    """Upload a historian export and keep the loop's samples; sent again it changes nothing."""
    state = request.app.state
    # Read and stored before the first statement of the transaction: nobody waits for it there.
    stored = actions.store_samples(
        held,
        samples,
        loop_id=loop_id,
        upload=upload,
        max_bytes=state.settings.max_upload_bytes,
    )
    if isinstance(stored, RecordRow):
        row, is_new = stored, False
    else:
        row, is_new = actions.add_record(
            transaction, actor=actor, loop_id=loop_id, upload=upload, stored=stored
        )
    response.headers["Location"] = f"/v1/loops/{loop_id}/records/{row.id}"
    if is_new:
        state.metrics.uploads.inc()
        state.metrics.upload_bytes.inc(row.bytes)
        state.metrics.upload_samples.inc(row.samples)
    else:
        response.status_code = 200
    return RecordBody.model_validate(row)


@router.get("")
def list_records(
    loop_id: UUID, _: Viewer, reading: Reading, cursor: Cursor = None, limit: Limit = 50
) -> RecordPage:
    """List the records of a loop, newest first."""
    loop_with_id(reading, loop_id)
    key = key_of(cursor)
    after = store.record_with_id(reading, loop_id, id_from(key)) if key else None
    rows = store.records_newest_first(reading, loop_id, after=after, limit=limit + 1)
    more = cursor_after(str(rows[limit - 1].id)) if len(rows) > limit else None
    return RecordPage(items=[RecordBody.model_validate(row) for row in rows[:limit]], next=more)


@router.get("/{record_id}")
def read_record(
    loop_id: UUID, record_id: UUID, _: Viewer, reading: Reading, request: Request
) -> RecordBody | PendingBody:
    """Read a record, or how far its upload has come."""
    loop_with_id(reading, loop_id)
    try:
        return RecordBody.model_validate(store.record_with_id(reading, loop_id, record_id))
    except NotFound:
        progress = progress_of(request.app.state.settings.data, loop_id, record_id)
        if progress is None:
            raise
        return PendingBody(id=record_id, loop_id=loop_id, progress=progress)


@samples_router.get("", dependencies=[HEAVY])
def read_samples(
    loop_id: UUID,
    _: Viewer,
    reading: Reading,
    samples: Samples,
    start: Annotated[Moment | None, Query(description="First instant.")] = None,
    end: Annotated[Moment | None, Query(description="Instant to stop before.")] = None,
    max_points: Annotated[
        int, Query(ge=1, le=20_000, description="Most points of a signal.")
    ] = 2000,
    max_gap: Annotated[
        Seconds | None,
        Query(description="Distance of neighbours that is a gap. Default: from the samples. [s]"),
    ] = None,
) -> SamplesBody:
    """Read samples of a loop, thinned to what can be drawn, with their extremes and gaps."""
    loop_with_id(reading, loop_id)
    if start is not None and end is not None and start > end:
        raise InvalidRequest("query/end", "end must not be before start.")
    return picture_of(
        samples, loop_id, start=start, end=end, max_points=max_points, max_gap=max_gap
    )
