"""HTTP routes of frequency tests."""

from uuid import UUID

from fastapi import APIRouter

from advice.frequency import frequency_body
from service.access import Engineer
from service.audit import declares
from service.database import Reading
from service.frequencies.actions import read_frequency_test
from service.frequencies.schemas import FrequencyBody, ReadFrequencyTest
from service.limits import HEAVY
from service.samples import Samples

router = APIRouter(prefix="/v1/loops/{loop_id}", tags=["models"])


@router.post("/frequency-responses", openapi_extra=declares(None), dependencies=[HEAVY])
def measure_frequency_response(
    loop_id: UUID, body: ReadFrequencyTest, _: Engineer, reading: Reading, samples: Samples
) -> FrequencyBody:
    """Read a chirp, sine steps or a multisine: response, model, margins; nothing is stored."""
    case = read_frequency_test(reading, samples, loop_id=loop_id, wanted=body)
    return FrequencyBody.model_validate(frequency_body(case))
