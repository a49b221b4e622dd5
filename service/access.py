"""Who is asking: API keys at the door, roles at each route."""

from collections.abc import Callable
from typing import Annotated, TypeAlias

import structlog
from fastapi import Depends, Request, Security
from fastapi.security import HTTPBearer
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from service.actors import Actor, Role
from service.database import Database
from service.errors import Forbidden, NotAuthenticated
from service.keys.actions import actor_with_token
from service.limits import Limits

_READING = frozenset({"GET", "HEAD", "OPTIONS"})
# Questions too long for an address: posted, worked out, answered, and nothing is kept.
ASKING = frozenset(
    {
        "/v1/analysis",
        "/v1/analysis/batch",
        "/v1/analysis/export",
        "/v1/analysis/interactions",
        "/v1/analysis/pole-regions",
        "/v1/conditioning",
        "/v1/plans",
        "/v1/plantwide",
        "/v1/simulations",
    }
)


class Door:
    """Middleware that lets nobody into /v1 without a key, before a byte of the body is read.

    Without it an upload from anybody would fill the disk first and be refused after. For the
    same reason a viewer's request to change something ends here.
    """

    def __init__(self, app: ASGIApp, held: Database, limits: Limits) -> None:
        self.app = app
        self.held = held
        self.limits = limits

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Find the actor of a request and keep it in the request's state."""
        if scope["type"] == "http" and _is_private(scope["path"]):
            token = _token(Headers(scope=scope))
            address = scope["client"][0] if scope.get("client") else ""
            with self.limits.trying(token, address):
                actor = await run_in_threadpool(self._actor, token)
            structlog.contextvars.bind_contextvars(actor=actor.owner, key=actor.key_id)
            scope.setdefault("state", {})["actor"] = actor
            if scope["method"] not in _READING and scope["path"] not in ASKING:
                _require(actor, Role.ENGINEER)
        await self.app(scope, receive, send)

    def _actor(self, token: str) -> Actor:
        with self.held.readings() as session:
            return actor_with_token(session, token)


def _is_private(path: str) -> bool:
    return path == "/v1" or path.startswith("/v1/")


def _token(headers: Headers) -> str:
    scheme, _, token = headers.get("authorization", "").partition(" ")
    if not token:
        raise NotAuthenticated("There is no API key.")
    if scheme.lower() != "bearer":
        raise NotAuthenticated("The API key must come as a bearer token.")
    return token.strip()


def _require(actor: Actor, role: Role) -> None:
    if not actor.role.covers(role):
        raise Forbidden(actor.role.value, role.value)


_scheme = HTTPBearer(
    bearerFormat="lw_...", auto_error=False, scheme_name="API key", description="An API key."
)


def _at_least(role: Role) -> Callable[[Request, object], Actor]:
    def actor_of(request: Request, _: Annotated[object, Security(_scheme)]) -> Actor:
        actor = getattr(request.state, "actor", None)
        if not isinstance(actor, Actor):
            raise NotAuthenticated("There is no API key.")
        _require(actor, role)
        return actor

    return actor_of


Viewer: TypeAlias = Annotated[Actor, Depends(_at_least(Role.VIEWER))]
Engineer: TypeAlias = Annotated[Actor, Depends(_at_least(Role.ENGINEER))]
Approver: TypeAlias = Annotated[Actor, Depends(_at_least(Role.APPROVER))]
Admin: TypeAlias = Annotated[Actor, Depends(_at_least(Role.ADMIN))]
