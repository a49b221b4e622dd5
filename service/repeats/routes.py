"""HTTP routes of repeated tests."""

from uuid import UUID

from fastapi import APIRouter

from service.access import Engineer
from service.audit import declares
from service.database import Reading
from service.limits import HEAVY
from service.repeats.actions import pool_tests
from service.repeats.schemas import PoolTests, RepeatsBody
from service.samples import Samples

router = APIRouter(prefix="/v1/loops/{loop_id}", tags=["models"])


@router.post("/repeats", openapi_extra=declares(None), dependencies=[HEAVY])
def pool_repeated_tests(
    loop_id: UUID, body: PoolTests, _: Engineer, reading: Reading, samples: Samples
) -> RepeatsBody:
    """Pool repeated step tests: model, spread, outliers, drift, linearity; nothing is stored."""
    return RepeatsBody.model_validate(pool_tests(reading, samples, loop_id=loop_id, wanted=body))
