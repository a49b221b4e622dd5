"""No request body is larger than it may be, whether or not it says its size beforehand."""

import re
from collections.abc import Iterable

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class BodyLimit:
    """Middleware that stops reading a body at its limit.

    The framework's own limit answers in plain text, and only from within its outermost layer.

    Parameters
    ----------
    app : ASGIApp
        What it surrounds.
    limit : int
        Largest body. [byte]
    upload_limit : int
        Largest body of an upload. [byte]
    uploads : iterable of pattern
        Addresses that take uploads.
    """

    def __init__(
        self, app: ASGIApp, limit: int, upload_limit: int, uploads: Iterable[re.Pattern[str]]
    ) -> None:
        self.app = app
        self.limit = limit
        self.upload_limit = upload_limit
        self.uploads = tuple(uploads)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on with its body counted."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        limit = self._limit(scope)
        stated = Headers(scope=scope).get("content-length", "")
        if stated.isdecimal() and int(stated) > limit:
            raise _too_large(limit)
        read = 0

        async def receive_counted() -> Message:
            nonlocal read
            message = await receive()
            if message["type"] == "http.request":
                read += len(message.get("body", b""))
                if read > limit:
                    raise _too_large(limit)
            return message

        await self.app(scope, receive_counted, send)

    def _limit(self, scope: Scope) -> int:
        if any(pattern.fullmatch(scope["path"]) for pattern in self.uploads):
            return self.upload_limit
        return self.limit


def _too_large(limit: int) -> HTTPException:
    """Refuse a body, with an error that the framework does not take for broken JSON."""
    return HTTPException(
        413, f"It may have at most {limit} bytes. Send less at a time, or have the limit raised."
    )
