"""What users ask about the details around settings; nothing is stored."""

from sqlalchemy.orm import Session

from advice.body import Body
from advice.conditioning import Wanted, conditioning, measured_noise
from advice.conditioning_body import conditioning_body
from historian.sample_store import SampleStore
from service.conditioning.schemas import ConditionLoop
from service.errors import InvalidRequest
from service.models.schemas import stated_process
from service.records.stretches import record_of


def condition(reading: Session, samples: SampleStore, *, wanted: ConditionLoop) -> Body:
    """Work out the details around a controller.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    UnstableLoop
        The loop is unstable before any detail.
    NotFound, NoSamples
        There is no such record, or nothing in it.
    """
    process = stated_process(wanted.process)
    record = None if wanted.record is None else record_of(wanted.record, reading, samples)
    try:
        measured = None if record is None else measured_noise(record)
        found = conditioning(
            process,
            wanted.controller.settings(process),
            Wanted(
                scan_time=wanted.scan_time,
                computation=wanted.computation,
                noise=wanted.noise if measured is None else measured.sd,
                travel=wanted.travel,
                phase_cost=wanted.phase_cost,
                overshoot=wanted.overshoot,
                attenuation=wanted.attenuation,
                order=wanted.order,
                swing=wanted.swing,
            ),
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return conditioning_body(found, measured)
