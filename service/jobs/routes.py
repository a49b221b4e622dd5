"""HTTP routes of jobs."""

from uuid import UUID

from fastapi import APIRouter

from service.access import Engineer, Viewer
from service.audit import declares
from service.database import Reading, Transaction
from service.jobs import actions, store
from service.jobs.schemas import JobBody, JobPage
from service.listing import Cursor, Limit, cursor_after, key_of
from service.models.schemas import id_from

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


@router.get("")
def list_jobs(_: Viewer, reading: Reading, cursor: Cursor = None, limit: Limit = 50) -> JobPage:
    """List jobs, newest first."""
    key = key_of(cursor)
    after = store.job_with_id(reading, id_from(key)) if key else None
    rows = store.jobs_newest_first(reading, after=after, limit=limit + 1)
    more = cursor_after(str(rows[limit - 1].id)) if len(rows) > limit else None
    return JobPage(items=[JobBody.model_validate(row) for row in rows[:limit]], next=more)


@router.get("/{job_id}")
def read_job(job_id: UUID, _: Viewer, reading: Reading) -> JobBody:
    """Read how far a job is."""
    return JobBody.model_validate(store.job_with_id(reading, job_id))


@router.post("/{job_id}/cancel", openapi_extra=declares("job.cancelled"))
def cancel_job(job_id: UUID, actor: Engineer, transaction: Transaction) -> JobBody:
    """Ask a job to stop after the step it is at; what it has stored stays."""
    return JobBody.model_validate(actions.cancel_job(transaction, actor=actor, job_id=job_id))
