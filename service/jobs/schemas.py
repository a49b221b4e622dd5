"""Bodies of jobs."""

from datetime import datetime
from typing import Literal
from uuid import UUID

from pydantic import Field

from service.schemas import Answer


class JobBody(Answer):
    """Work that goes on after the request that asked for it."""

    id: UUID
    kind: str
    state: Literal["queued", "running", "done", "failed", "cancelled"]
    done: int = Field(description="Steps that are finished and stored.")
    total: int | None = Field(description="Steps in all; null before the work has started.")
    message: str = Field(description="What it is doing, or why it ended.")
    cancel: bool = Field(description="Whether it was asked to stop.")
    attempts: int = Field(description="How often a worker has begun or gone on with it.")
    result: dict[str, object] | None
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    author: str


class JobPage(Answer):
    """Jobs, newest first, and the cursor of the next page."""

    items: list[JobBody]
    next: str | None
