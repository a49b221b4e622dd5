"""Bodies of the audit trail's answers."""

from datetime import datetime
from uuid import UUID

from pydantic import Field

from service.schemas import Answer


class AuditLine(Answer):
    """One line of the audit trail."""

    id: int
    at: datetime
    actor: str
    key_id: str | None = Field(description="Public part of the key; null on the command line.")
    action: str
    subject: str
    loop_id: UUID | None
    before: dict[str, object] | None
    after: dict[str, object] | None
    previous: str = Field(description="Hash of the line before.")
    hash: str = Field(description="SHA-256 of this line's canonical JSON (RFC 8785).")


class AuditPage(Answer):
    """Lines, newest first, and the cursor of the next page."""

    items: list[AuditLine]
    next: str | None


class BreakBody(Answer):
    """The first place where the chain does not hold."""

    row: int
    reason: str


class VerdictBody(Answer):
    """Whether the chain is intact."""

    intact: bool
    rows: int = Field(description="Lines that hold, from the first one.")
    head: str = Field(description="Hash of the last line that holds. Keep it elsewhere.")
    first_broken: BreakBody | None
    known_head_row: int | None = Field(description="Line of the head that was asked about.")
