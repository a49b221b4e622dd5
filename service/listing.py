"""Lists in pages: a limit, and a cursor that stays true while rows are added."""

import base64
import binascii
from typing import Annotated, TypeAlias

from fastapi import Query

from service.errors import InvalidRequest

Limit: TypeAlias = Annotated[int, Query(ge=1, le=1000, description="Most items to answer.")]
Cursor: TypeAlias = Annotated[
    str | None, Query(max_length=500, description="`next` of the page before.")
]


def cursor_after(key: str) -> str:
    """Write the cursor of the page that starts after a key."""
    return base64.urlsafe_b64encode(key.encode()).decode().rstrip("=")


def key_of(cursor: str | None) -> str | None:
    """Read the key a page starts after.

    Raises
    ------
    InvalidRequest
        The cursor is not one of ours.
    """
    if cursor is None:
        return None
    try:
        key = base64.b64decode(cursor + "=" * (-len(cursor) % 4), b"-_", validate=True).decode()
    except (binascii.Error, ValueError):
        key = "\0"
    if not key.isprintable():
        raise InvalidRequest("query/cursor", "This cursor is not the `next` of any page.")
    return key


def number_of(cursor: str | None) -> int | None:
    """Read the number a page starts after.

    Raises
    ------
    InvalidRequest
        The cursor is not one of ours.
    """
    key = key_of(cursor)
    if key is None:
        return None
    if not (key.isascii() and key.isdigit() and len(key) <= 18):
        raise InvalidRequest("query/cursor", "This cursor is not the `next` of any page.")
    return int(key)
