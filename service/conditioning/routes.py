"""HTTP routes of conditioning."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Viewer
from service.audit import declares
from service.conditioning import actions
from service.conditioning.schemas import ConditioningBody, ConditionLoop
from service.database import Reading
from service.limits import HEAVY
from service.samples import Samples

router = APIRouter(prefix="/v1", tags=["conditioning"])


@router.post(
    "/conditioning",
    response_model=ConditioningBody,
    openapi_extra=declares(None),
    dependencies=[HEAVY],
)
def condition(body: ConditionLoop, _: Viewer, reading: Reading, samples: Samples) -> Body:
    """Work out scan time, filters, N, b and Tt, and what noise does to the output."""
    return actions.condition(reading, samples, wanted=body)
