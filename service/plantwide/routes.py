"""HTTP routes of plant-wide questions."""

from fastapi import APIRouter

from service.access import Viewer
from service.audit import declares
from service.database import Reading
from service.limits import HEAVY
from service.plantwide.actions import look_at_plant
from service.plantwide.schemas import LookAtPlant, PlantOscillationsBody
from service.samples import Samples

router = APIRouter(prefix="/v1", tags=["assessments"])


@router.post("/plantwide", openapi_extra=declares(None), dependencies=[HEAVY])
def find_shared_oscillations(
    body: LookAtPlant, _: Viewer, reading: Reading, samples: Samples
) -> PlantOscillationsBody:
    """Find loops that oscillate together, and where it likely begins; nothing is stored."""
    return PlantOscillationsBody.model_validate(look_at_plant(reading, samples, wanted=body))
