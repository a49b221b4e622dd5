"""What users ask of several loops at once."""

from sqlalchemy.orm import Session

from advice.plantwide import PlantOscillations, plant_oscillations
from historian.sample_store import SampleStore
from loop.errors import NoSamples
from loop.record import Record
from service.loops.store import loop_with_id
from service.plantwide.schemas import LookAtPlant


def look_at_plant(
    reading: Session, samples: SampleStore, *, wanted: LookAtPlant
) -> PlantOscillations:
    """Find what loops have in common over a period.

    Raises
    ------
    NotFound, NoSamples
        A loop is not there, or has nothing in the period.
    """
    records: list[Record] = []
    for loop_id in dict.fromkeys(wanted.loop_ids):
        loop = loop_with_id(reading, loop_id)
        found = samples.read(loop_id, wanted.start, wanted.end)
        if not len(found):
            raise NoSamples(loop.tag)
        records.append(found.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit))
    return plant_oscillations(records)
