"""What users ask of frequency tests."""

import math
from uuid import UUID

from sqlalchemy.orm import Session

from advice.frequency import FrequencyCase, frequency_case
from historian.sample_store import SampleStore
from loop.controller import PID, Action
from service.frequencies.schemas import ReadFrequencyTest
from service.loops.store import loop_with_id
from service.samples import samples_of


def read_frequency_test(
    reading: Session, samples: SampleStore, *, loop_id: UUID, wanted: ReadFrequencyTest
) -> FrequencyCase:
    """Read a frequency test out of a loop's samples.

    Raises
    ------
    NotFound, NoSamples, PoorExcitation
        There is no such loop, nothing of it in the period, or the samples carry no response.
    """
    loop = loop_with_id(reading, loop_id)
    found = samples_of(samples, loop, wanted.start, wanted.end)
    stated = wanted.controller
    controller = None
    if stated is not None:
        controller = PID(
            Kc=stated.Kc,
            Ti=math.inf if stated.Ti is None else stated.Ti,
            Td=stated.Td,
            N=stated.N,
            action=Action(loop.action),
        )
    return frequency_case(
        found.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit), controller
    )
