"""HTTP routes of plans."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Viewer
from service.audit import declares
from service.limits import HEAVY
from service.plans import actions
from service.plans.schemas import PlanBody, PlanTest

router = APIRouter(prefix="/v1", tags=["plans"])


@router.post("/plans", response_model=PlanBody, openapi_extra=declares(None), dependencies=[HEAVY])
def plan_test(body: PlanTest, _: Viewer) -> Body:
    """Plan a test: moves or relay, expected errors, limits at which to stop; nothing is stored."""
    return actions.plan(body)
