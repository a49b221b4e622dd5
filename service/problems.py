"""Every error answer of the API, as RFC 9457 problem details."""

import errno
import re
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, NamedTuple

import fastapi
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from psycopg.errors import DiskFull as DatabaseFull
from pydantic import BaseModel, ConfigDict
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from sqlalchemy.orm.exc import StaleDataError
from starlette.exceptions import HTTPException
from starlette.routing import compile_path

from historian.errors import ExportTooLarge
from loop.errors import DiskFull, LoopError, NoSamples, StoreBusy, StoreDamaged
from service import errors
from service.plain_json import plain

CATALOGUE = "/problems/"
PAGES = Path(__file__).parent.parent / "docs" / "problems"


class Kind(NamedTuple):
    """How one kind of error is answered."""

    status: int
    slug: str


PROBLEMS: dict[type[Exception], Kind] = {
    errors.NotAuthenticated: Kind(401, "not-authenticated"),
    errors.Forbidden: Kind(403, "forbidden"),
    errors.SelfApproval: Kind(403, "self-approval"),
    errors.NotTheAuthor: Kind(403, "not-the-author"),
    errors.NoProcess: Kind(422, "no-process"),
    errors.NotFound: Kind(404, "not-found"),
    errors.TagTaken: Kind(409, "tag-taken"),
    errors.LastAdminKey: Kind(409, "last-admin-key"),
    errors.SheetDecided: Kind(409, "sheet-decided"),
    errors.NeverInForce: Kind(409, "never-in-force"),
    errors.BlockChanged: Kind(409, "block-changed"),
    errors.JobEnded: Kind(409, "job-ended"),
    errors.StaleVersion: Kind(412, "stale-version"),
    StaleDataError: Kind(412, "stale-version"),
    errors.TooManyRequests: Kind(429, "too-many-requests"),
    errors.IfMatchMissing: Kind(428, "if-match-missing"),
    errors.InvalidRequest: Kind(422, "invalid-request"),
    RequestValidationError: Kind(422, "invalid-request"),
    errors.NotReady: Kind(503, "not-ready"),
    NoSamples: Kind(404, "no-samples"),
    ExportTooLarge: Kind(413, "export-too-large"),
    StoreDamaged: Kind(500, "store-damaged"),
    StoreBusy: Kind(503, "store-busy"),
    DiskFull: Kind(507, "storage-full"),
    OperationalError: Kind(503, "database-unavailable"),
    PoolTimeout: Kind(503, "database-unavailable"),
}
INTERNAL = Kind(500, "internal-error")
STORAGE_FULL = Kind(507, "storage-full")
TOO_LARGE = Kind(413, "content-too-large")
# Answers of the framework itself. Names of our own: Python's change between versions.
FROM_FRAMEWORK = {
    404: "not-found",
    405: "method-not-allowed",
    413: "content-too-large",
}
_TITLES = {
    "not-found": "There is nothing at this address.",
    "method-not-allowed": "This address does not take this method.",
    "content-too-large": "The request is larger than this service takes.",
    "bad-request": "The request cannot be read.",
    "stale-version": "Somebody changed this in the meantime.",
    "database-unavailable": "The database does not answer.",
    "storage-full": "The disk is full.",
}
_DETAILS = {
    "database-unavailable": "Nothing was stored. Try again shortly.",
    "storage-full": "Nothing was stored. Make room and send it again.",
    "stale-version": "Read it again first.",
}
_HEADERS = {401: {"WWW-Authenticate": "Bearer"}, 503: {"Retry-After": "5"}}


class FieldFault(BaseModel):
    """One field that is wrong."""

    pointer: str
    detail: str


class Problem(BaseModel):
    """Shape of every error answer. Extension members vary with the type."""

    model_config = ConfigDict(extra="allow")

    type: str
    title: str
    status: int
    detail: str | None = None
    errors: list[FieldFault] | None = None


_ANSWER: dict[str, object] = {
    "description": "The request cannot be served.",
    "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
}
PROBLEM_ANSWERS: dict[int | str, dict[str, object]] = {"4XX": _ANSWER, "5XX": _ANSWER}


def kind_of(error: Exception) -> Kind | None:
    """Look up how an error is answered; none for one that nobody foresaw.

    An engineering refusal without an entry of its own answers 422 under the name of its class.
    """
    if _means_full(error):
        return STORAGE_FULL
    for ancestor in type(error).__mro__:
        if ancestor in PROBLEMS:
            return PROBLEMS[ancestor]
        if ancestor is LoopError:
            return Kind(422, slug_of(type(error).__name__))
    if isinstance(error, HTTPException):
        return Kind(error.status_code, FROM_FRAMEWORK.get(error.status_code, "bad-request"))
    return None


def _means_full(error: Exception) -> bool:
    """Tell whether there is no room, neither on our own disk nor on the database's."""
    if isinstance(error, OSError):
        return error.errno in (errno.ENOSPC, errno.EDQUOT)
    cause = error.orig if isinstance(error, OperationalError) else None
    if isinstance(cause, sqlite3.Error):
        # The driver leaves the code out of errors that are its own.
        return getattr(cause, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL
    return isinstance(cause, DatabaseFull)


def slug_of(name: str) -> str:
    """Write a class name as the last part of its address, RuleNotApplicable as rule-not-applicable.

    Examples
    --------
    >>> slug_of("RuleNotApplicable")
    'rule-not-applicable'
    """
    return re.sub(r"(?<!^)(?=[A-Z])", "-", name).lower()


def problem(
    kind: Kind,
    *,
    title: str,
    detail: str | None = None,
    headers: Mapping[str, str] | None = None,
    members: Mapping[str, object] | None = None,
) -> JSONResponse:
    """Build one problem document, with extension members such as the offending fields."""
    body: dict[str, object] = {
        **{str(name): _writable(value) for name, value in (members or {}).items()},
        "type": f"{CATALOGUE}{kind.slug}",
        "title": title,
        "status": kind.status,
    }
    if detail is not None:
        body["detail"] = _writable(detail)
    return JSONResponse(body, kind.status, headers, media_type="application/problem+json")


def answer_to(error: Exception) -> JSONResponse | None:
    """Answer an error with its problem document; none for one that nobody foresaw."""
    kind = kind_of(error)
    if kind is None:
        return None
    if isinstance(error, RequestValidationError):
        return problem(kind, title="The request is not valid.", members={"errors": _faults(error)})
    if isinstance(error, HTTPException):
        # The framework's own words say no more than the title, those of ours name the limit.
        detail = error.detail if kind == TOO_LARGE else None
        return problem(kind, title=_TITLES[kind.slug], detail=detail, headers=error.headers)
    headers = _HEADERS.get(kind.status)
    if isinstance(error, errors.TooManyRequests):
        headers = {"Retry-After": str(error.retry_after)}
    if isinstance(error, errors.ServiceError | LoopError):
        title = (type(error).__doc__ or kind.slug).partition("\n")[0]
        return problem(kind, title=title, detail=str(error), headers=headers, members=vars(error))
    return problem(kind, title=_TITLES[kind.slug], detail=_DETAILS[kind.slug], headers=headers)


def internal_error(request_id: str) -> JSONResponse:
    """Answer what nobody foresaw: an id that is also in the log, and nothing else."""
    return problem(
        INTERNAL,
        title="Something went wrong in the service.",
        detail=f"Nothing was stored. The log has the cause under the id {request_id}.",
        members={"id": request_id},
    )


def add_problem_handlers(app: FastAPI) -> None:
    """Answer every expected error with a problem document, and serve the page of each type."""

    def known(request: Request, error: Exception) -> Response:
        answer = answer_to(error)
        if answer is None:
            raise error
        if answer.status_code == 405:
            # The framework names the methods of one route; the address may have several.
            answer.headers["Allow"] = ", ".join(_methods(app, request.url.path)) or "GET"
        return answer

    for kind in (*PROBLEMS, LoopError, OSError, HTTPException):
        app.add_exception_handler(kind, known)

    @app.get("/problems/{slug}", include_in_schema=False)
    def page(slug: Annotated[str, fastapi.Path(pattern="^[a-z0-9-]{1,60}$")]) -> Response:
        text = PAGES / f"{slug}.md"
        if not text.is_file():
            raise errors.NotFound("problem type", slug)
        return PlainTextResponse(text.read_text("utf-8"), media_type="text/markdown")


def _methods(app: FastAPI, path: str) -> list[str]:
    """List the methods an address takes."""
    return sorted(
        method.upper()
        for pattern, operations in app.openapi()["paths"].items()
        if compile_path(pattern)[0].fullmatch(path)
        for method in operations
    )


def _faults(error: RequestValidationError) -> list[dict[str, object]]:
    return [
        {
            "pointer": "/".join(str(part) for part in fault["loc"]),
            # Our own validators' sentences come without pydantic's "Value error, ".
            "detail": str(fault["msg"]).removeprefix("Value error, "),
        }
        for fault in error.errors()
    ]


def _writable(value: object) -> object:
    """Make a value safe to answer with, lone surrogates of a hostile request included."""
    match plain(value):
        case str() as text:
            return text.encode("utf-8", "backslashreplace").decode()
        case dict() as mapping:
            return {str(_writable(name)): _writable(item) for name, item in mapping.items()}
        case list() as items:
            return [_writable(item) for item in items]
        case other:
            return other
