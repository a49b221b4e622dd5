"""Changes that name the version they change: ETag and If-Match (RFC 9110, section 13.1.1)."""

import re
from typing import Annotated, TypeAlias

from fastapi import Header

from service.errors import IfMatchMissing, StaleVersion

IfMatch: TypeAlias = Annotated[
    str | None,
    Header(max_length=500, description="ETag of the version that was read; 428 without it."),
]
_ONE_TAG = re.compile(r'(W/)?("[^"]*")')


def require_match(if_match: str | None, current: str) -> None:
    """Let a change pass only if it was made from the current version.

    Parameters
    ----------
    if_match : str or None
        The If-Match header: ETags, or `*` for any version.
    current : str
        ETag as it is now, with its quotes.

    Raises
    ------
    IfMatchMissing
        There is no such header.
    StaleVersion
        None of the ETags is the current one; a weak one never is.
    """
    if if_match is None:
        raise IfMatchMissing
    if if_match.strip() == "*":
        return
    if current not in {tag for weak, tag in _ONE_TAG.findall(if_match) if not weak}:
        raise StaleVersion(current)
