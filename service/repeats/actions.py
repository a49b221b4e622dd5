"""What users ask of repeated tests."""

from uuid import UUID

from sqlalchemy.orm import Session

from advice.body import Body
from advice.repeats import repeats_body, repeats_case
from historian.sample_store import SampleStore
from service.loops.store import loop_with_id
from service.repeats.schemas import PoolTests
from service.samples import samples_of


def pool_tests(reading: Session, samples: SampleStore, *, loop_id: UUID, wanted: PoolTests) -> Body:
    """Take step tests out of a loop's samples and pool them.

    Raises
    ------
    NotFound, NoSamples, FitNotTrusted
        There is no such loop, nothing of it in a period, or fewer than two tests carry a model.
    """
    loop = loop_with_id(reading, loop_id)
    records = []
    for period in wanted.tests:
        found = samples_of(samples, loop, period.start, period.end)
        records.append(found.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit))
    return repeats_body(repeats_case(records))
