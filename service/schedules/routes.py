"""HTTP routes of schedules."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Engineer
from service.audit import declares
from service.limits import HEAVY
from service.schedules import actions
from service.schedules.schemas import ScheduleBody, ScheduleSettings

router = APIRouter(prefix="/v1", tags=["beyond one loop"])


@router.post(
    "/schedules", response_model=ScheduleBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def schedule(body: ScheduleSettings, _: Engineer) -> Body:
    """Tune at every operating point, and say whether the points are close enough."""
    return actions.schedule(body)
