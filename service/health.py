"""Whether the service can work, and how it has worked so far."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST

from service.database import Database, database
from service.metrics import Metrics
from service.migration import assert_ready
from service.schemas import Answer

router = APIRouter(tags=["operation"])


class Health(Answer):
    """The service can work: database, migration and triggers are as they must be."""

    status: Literal["ready"] = "ready"


@router.get("/health")
def health(held: Annotated[Database, Depends(database)]) -> Health:
    """Tell whether the database answers, is migrated, and guards the audit trail."""
    assert_ready(held)
    return Health()


@router.get("/metrics", include_in_schema=False)
def metrics(request: Request) -> Response:
    """Give the counters and times of requests and uploads to Prometheus."""
    held = request.app.state.metrics
    assert isinstance(held, Metrics)  # noqa: S101 - create_app put it there
    return Response(held.text(), media_type=CONTENT_TYPE_LATEST)
