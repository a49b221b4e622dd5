"""Structured logs: one event a line, with the request it belongs to, never with a secret."""

import logging
import re
import sys
from collections.abc import MutableMapping

import structlog
from structlog.typing import EventDict, Processor

_SECRET = re.compile(r"lw_([0-9a-f]{12})_[A-Za-z0-9_-]+")


def redact(_: object, __: str, event: EventDict) -> EventDict:
    """Cut the secret out of every API key that found its way into a log event."""
    return {str(name): _without_secrets(value) for name, value in event.items()}


def _without_secrets(value: object) -> object:
    match value:
        case str():
            return _SECRET.sub(r"lw_\1_***", value)
        case MutableMapping():
            return {name: _without_secrets(item) for name, item in value.items()}
        case list() | tuple():
            return [_without_secrets(item) for item in value]
        case _:
            return value


def configure_logging(*, as_json: bool) -> None:
    """Send every log line of the service and of its web server to stderr, in one format.

    Parameters
    ----------
    as_json : bool
        One JSON object a line; otherwise text for a person.
    """
    shared: list[Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    last: list[Processor] = [
        structlog.processors.format_exc_info,
        redact,
        structlog.processors.JSONRenderer()
        if as_json
        else structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty()),
    ]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler()
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *last],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(logging.INFO)
    for name in ("uvicorn", "uvicorn.error"):
        logging.getLogger(name).handlers.clear()
        logging.getLogger(name).propagate = True
    # Uvicorn's own access log would show query strings; ours does not.
    logging.getLogger("uvicorn.access").disabled = True
