"""The resources of the API. A new feature adds its router here, and nothing else.

Routers in UPLOADS take request bodies up to `max_upload_bytes`, all others up to `max_body_bytes`.
"""

import re

from fastapi import APIRouter
from fastapi.routing import APIRoute
from starlette.routing import compile_path

from service.analysis.routes import router as analysis
from service.assessments.routes import router as assessments
from service.audit.routes import router as audit
from service.cascades.routes import router as cascades
from service.conditioning.routes import router as conditioning
from service.detunings.routes import router as detunings
from service.feed_forwards.routes import router as feed_forwards
from service.frequencies.routes import router as frequencies
from service.health import router as operation
from service.jobs.routes import router as jobs
from service.keys.routes import router as keys
from service.loops.routes import router as loops
from service.models.routes import router as models
from service.plans.routes import router as plans
from service.plantwide.routes import router as plantwide
from service.records.routes import router as records
from service.records.routes import samples_router as samples
from service.repeats.routes import router as repeats
from service.schedules.routes import router as schedules
from service.sheets.routes import router as sheets
from service.simulations.routes import router as simulations
from service.smith_predictors.routes import router as smith_predictors
from service.smooth_tunings.routes import router as smooth_tunings
from service.tunings.routes import router as tunings

ROUTERS: tuple[APIRouter, ...] = (
    loops, samples, models, frequencies, repeats, tunings, smooth_tunings, detunings, analysis,
    conditioning, smith_predictors, cascades, feed_forwards, schedules, simulations, plans, sheets,
    assessments, plantwide, jobs, keys, audit, operation
)  # fmt: skip
UPLOADS: tuple[APIRouter, ...] = (records,)


def upload_addresses() -> list[re.Pattern[str]]:
    """List the addresses that take bodies of the size of an upload."""
    return [
        compile_path(route.path)[0]
        for router in UPLOADS
        for route in router.routes
        if isinstance(route, APIRoute)
    ]
