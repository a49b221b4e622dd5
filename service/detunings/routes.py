"""HTTP routes of detuning."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Engineer
from service.audit import declares
from service.detunings import actions
from service.detunings.schemas import Detune, DetuningBody
from service.limits import HEAVY

router = APIRouter(prefix="/v1", tags=["tunings"])


@router.post(
    "/detunings", response_model=DetuningBody, openapi_extra=declares(None), dependencies=[HEAVY]
)
def detune(body: Detune, _: Engineer) -> Body:
    """Choose settings by one knob from calm to fast, with the load area that each costs."""
    return actions.detune(body)
