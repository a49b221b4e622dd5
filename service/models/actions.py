"""What users do with models."""

from dataclasses import replace
from datetime import timedelta
from uuid import UUID

from sqlalchemy.orm import Session

from advice.body import Body
from advice.bootstrap import bootstrap_body
from advice.identifying import identified
from advice.model_body import data_body, model_body, stated_model_body
from historian.sample_store import SampleStore
from loop.errors import NoSamples
from loop.record import Record
from service import audit
from service.actors import Actor
from service.loops.store import loop_with_id
from service.models import store
from service.models.schemas import NewModel, stated_process
from service.samples import samples_of
from service.tables import ModelRow


def work_out_model(
    reading: Session, samples: SampleStore, *, loop_id: UUID, wanted: NewModel
) -> Body:
    """Identify a process from a record, or take it as stated; nothing is stored yet.

    Raises
    ------
    NotFound
        There is no such loop or record.
    NoSamples
        The record has no samples in the span.
    """
    loop = loop_with_id(reading, loop_id)
    if wanted.process is not None:
        return {**stated_model_body(stated_process(wanted.process)), "data": None}
    assert wanted.record_id is not None  # noqa: S101 - the body holds one of the two
    row = store.record_with_id(reading, loop_id, wanted.record_id)
    if row.first_time is None or row.last_time is None:
        raise NoSamples(loop.tag)
    start = max(filter(None, (row.first_time, wanted.start)))
    # The store reads up to, and without, its second bound.
    end = min(filter(None, (row.last_time + timedelta(microseconds=1), wanted.end)))
    found = samples_of(samples, loop, start, max(start, end))
    record: Record = replace(
        found.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit),
        op_before=wanted.op_before,
    )
    model = identified(record)
    more: Body = {"bootstrap": bootstrap_body(model)} if wanted.bootstrap else {}
    return {**model_body(model), **more, "data": data_body(record)}


def keep_model(
    session: Session, *, actor: Actor, loop_id: UUID, record_id: UUID | None, body: Body
) -> ModelRow:
    """Store a model of a loop; one that was refused is kept as well, with its reasons."""
    row = ModelRow(
        loop_id=loop_id,
        record_id=record_id,
        kind=body["kind"] if body["parameters"] is not None else None,
        parameters=body["parameters"],
        verdict=body["verdict"],
        reasons=body["reasons"],
        body=body,
        author=actor.owner,
    )
    session.add(row)
    session.flush()
    audit.record(
        session,
        actor=actor,
        action="model.added",
        subject=f"loops/{loop_id}/models/{row.id}",
        loop_id=loop_id,
        after={
            "record_id": record_id,
            "kind": row.kind,
            "parameters": row.parameters,
            "verdict": row.verdict,
            "reasons": row.reasons,
        },
    )
    return row
