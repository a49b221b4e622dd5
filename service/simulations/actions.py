"""What users ask to see simulated; nothing is stored."""

import numpy as np
from sqlalchemy.orm import Session

from advice.body import Body
from advice.fan import box_draws
from advice.scenario import Event, LoadChange, Replay, SetPointChange, Transfer
from advice.what_if import what_if
from advice.what_if_body import what_if_body
from historian.sample_store import SampleStore
from loop.process import Process
from loop.signals import Real
from service.errors import InvalidRequest
from service.models.schemas import stated_process
from service.records.stretches import record_of
from service.simulations.schemas import EventBody, FanBody, ReplayBody, Simulate


def simulate(reading: Session, samples: SampleStore, *, wanted: Simulate) -> Body:
    """Run every controller through every event.

    Raises
    ------
    InvalidRequest
        A number cannot be, or the runs would take too long.
    NotFound
        There is no such loop or record.
    NoSamples
        The record has no samples in the span.
    """
    process = stated_process(wanted.process)
    try:
        events = [_event(item, reading, samples) for item in wanted.events]
        found = what_if(
            process,
            {item.name: item.settings(process) for item in wanted.controllers},
            events,
            conditions=wanted.conditions.conditions(),
            draws=None if wanted.fan is None else _draws(wanted.fan, process),
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return what_if_body(found)


def _draws(fan: FanBody, process: Process) -> Real:
    if fan.draws is not None:
        if len({len(row) for row in fan.draws}) > 1:
            raise ValueError("every row of draws must be equally long")
        return np.array(fan.draws)
    assert fan.spread is not None  # noqa: S101 - the body holds one of the two
    return box_draws(process, fan.spread, n=fan.count)


def _event(body: EventBody, reading: Session, samples: SampleStore) -> Event:
    if isinstance(body, ReplayBody):
        return Replay(record=record_of(body, reading, samples))
    values = body.model_dump(exclude={"kind"})
    kinds = {"set point": SetPointChange, "load": LoadChange, "transfer": Transfer}
    event: Event = kinds[body.kind](**values)
    return event
