"""HTTP routes of cascades."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Engineer
from service.audit import declares
from service.cascades import actions
from service.cascades.schemas import CascadeBody, TuneCascade
from service.limits import HEAVY

router = APIRouter(prefix="/v1", tags=["beyond one loop"])


@router.post(
    "/cascades", response_model=CascadeBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def tune_cascade(body: TuneCascade, _: Engineer) -> Body:
    """Tune a cascade from inside out and sweep both loops; nothing is stored."""
    return actions.tune_cascade(body)
