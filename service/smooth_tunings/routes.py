"""HTTP routes of smooth tuning."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Engineer
from service.audit import declares
from service.limits import HEAVY
from service.smooth_tunings import actions
from service.smooth_tunings.schemas import SmoothBody, TuneSmoothly

router = APIRouter(prefix="/v1", tags=["tunings"])


@router.post(
    "/smooth-tunings", response_model=SmoothBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def tune_smoothly(body: TuneSmoothly, _: Engineer) -> Body:
    """Tune as slowly as a load permits: smooth and averaging tuning; nothing is stored."""
    return actions.tune_smoothly(body)
