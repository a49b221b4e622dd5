"""HTTP routes of simulations."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Viewer
from service.audit import declares
from service.database import Reading
from service.limits import HEAVY
from service.samples import Samples
from service.simulations import actions
from service.simulations.schemas import Simulate, SimulationBody

router = APIRouter(prefix="/v1/simulations", tags=["simulations"])


@router.post("", response_model=SimulationBody, openapi_extra=declares(None), dependencies=[HEAVY])
def simulate(body: Simulate, _: Viewer, reading: Reading, samples: Samples) -> Body:
    """Simulate settings before they are typed; nothing is stored."""
    return actions.simulate(reading, samples, wanted=body)
