"""Assembly of the web application."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import cache

import structlog
from fastapi import APIRouter, Depends, FastAPI
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.routing import BaseRoute

from service.access import Door
from service.body_limit import BodyLimit
from service.database import Database
from service.exchange import Exchange
from service.features import ROUTERS, UPLOADS, upload_addresses
from service.limits import Limits
from service.metrics import Metrics
from service.migration import assert_ready
from service.openapi import describe, docs_page
from service.problems import PROBLEM_ANSWERS, add_problem_handlers
from service.query import refuse_unknown_parameters
from service.settings import Settings

log = structlog.get_logger()


def create_app(settings: Settings | None = None, held: Database | None = None) -> FastAPI:
    """Build the application around its settings and its database.

    Nothing connects before the application starts; then it refuses a database that is not
    migrated, or that would let the audit trail be changed.

    Parameters
    ----------
    settings : Settings, optional
        By default those of the environment.
    held : Database, optional
        By default the one the settings name.
    """
    settings = settings or Settings()
    held = held or Database.at(settings.url)
    metrics = Metrics()
    limits = Limits(settings)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        await run_in_threadpool(assert_ready, held)
        log.info("ready", database=held.engine.dialect.name)
        yield
        held.engine.dispose()

    app = FastAPI(
        title="Loopwright",
        version="0.1.0",
        description="Loop tuning with its evidence: models, verified settings, versioned sheets.",
        docs_url=None,  # FastAPI's own pages load scripts from a CDN; ours works offline
        redoc_url=None,
        lifespan=lifespan,
        middleware=[
            Middleware(Exchange, metrics=metrics),
            Middleware(Door, held=held, limits=limits),
            Middleware(
                BodyLimit,
                limit=settings.max_body_bytes,
                upload_limit=settings.max_upload_bytes,
                uploads=upload_addresses(),
            ),
        ],
    )
    app.state.settings = settings
    app.state.database = held
    app.state.metrics = metrics
    app.state.limits = limits
    app.router.routes.extend(_routes())
    add_problem_handlers(app)
    docs_page(app)
    describe(app)
    return app


@cache
def _routes() -> list[BaseRoute]:
    """Include the features once: for every application anew it would take most of a second."""
    router = APIRouter(dependencies=[Depends(refuse_unknown_parameters)], responses=PROBLEM_ANSWERS)
    for feature in (*ROUTERS, *UPLOADS):
        router.include_router(feature)
    return router.routes
