"""What users ask of several loops at once."""

from sqlalchemy.orm import Session

from advice.plantwide import plant_oscillations
from advice.plantwide_result import PlantOscillations
from historian.sample_store import SampleStore
from loop.record import Record
from monitoring.loop_signals import LoopKind
from service.errors import InvalidRequest
from service.loops.store import loop_with_id
from service.plantwide.schemas import LookAtPlant
from service.samples import samples_of

# Some hundred megabytes and a few seconds: a day of 100 loops every five seconds fits.
MOST_SAMPLES = 2_000_000
LEVELS = (LoopKind.LEVEL, LoopKind.AVERAGING_LEVEL)


def look_at_plant(
    reading: Session, samples: SampleStore, *, wanted: LookAtPlant
) -> PlantOscillations:
    """Find what loops have in common over a period.

    Raises
    ------
    NotFound, NoSamples
        A loop is not there, or has nothing in the period.
    InvalidRequest
        The loops have more samples in the period than one answer may look at.
    """
    records: list[Record] = []
    levels: list[str] = []
    room = MOST_SAMPLES
    for loop_id in dict.fromkeys(wanted.loop_ids):
        loop = loop_with_id(reading, loop_id)
        found = samples_of(samples, loop, wanted.start, wanted.end)
        room -= len(found)
        if room < 0:
            raise InvalidRequest(
                "body",
                f"The loops have more than {MOST_SAMPLES:,} samples in the period; ask for a "
                "shorter one, or for fewer loops.",
            )
        if loop.kind in LEVELS:
            levels.append(loop.tag)
        records.append(found.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit))
    return plant_oscillations(records, levels=levels)
