"""Bodies of key requests and answers."""

from datetime import datetime

from pydantic import Field

from service.actors import Role
from service.schemas import Answer, Strict
from service.units import Word


class NewKey(Strict):
    """Ask for a key."""

    owner: Word = Field(description="Person the key belongs to; the audit trail carries the name.")
    role: Role = Field(description="What the person may do.", strict=False)


class KeyBody(Answer):
    """An API key, without its secret."""

    id: str
    owner: str
    role: Role
    created_at: datetime
    created_by: str
    revoked_at: datetime | None
    revoked_by: str | None


class CreatedKey(KeyBody):
    """A new API key with its token."""

    token: str = Field(description="Shown this once; the service keeps only a hash.")


class KeyPage(Answer):
    """Keys, and the cursor of the next page."""

    items: list[KeyBody]
    next: str | None
