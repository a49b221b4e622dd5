"""A stretch of a stored record, as questions about a loop's data name it."""

from datetime import timedelta

from pydantic import Field
from sqlalchemy.orm import Session

from historian.sample_store import SampleStore
from loop.errors import NoSamples
from loop.record import Record
from service.loops.store import loop_with_id
from service.models.schemas import Id, Moment
from service.records.store import record_with_id
from service.samples import samples_of
from service.schemas import Strict


class Stretch(Strict):
    """A stored record, or a part of it."""

    loop_id: Id
    record_id: Id
    start: Moment | None = Field(None, description="Use the record from here on.")
    end: Moment | None = Field(None, description="Use the record up to here.")


def record_of(stretch: Stretch, reading: Session, samples: SampleStore) -> Record:
    """Read a stretch.

    Raises
    ------
    NotFound
        There is no such loop or record.
    NoSamples
        The record has no samples in the span.
    """
    loop = loop_with_id(reading, stretch.loop_id)
    row = record_with_id(reading, stretch.loop_id, stretch.record_id)
    if row.first_time is None or row.last_time is None:
        raise NoSamples(loop.tag)
    start = max(filter(None, (row.first_time, stretch.start)))
    # The store reads up to, and without, its second bound.
    end = min(filter(None, (row.last_time + timedelta(microseconds=1), stretch.end)))
    found = samples_of(samples, loop, start, max(start, end))
    return found.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit)
