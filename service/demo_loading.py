"""Loading the demo into a new installation.

Everything goes in through the actions that serve the API: loops, step tests and routine records as
uploaded exports, models, tunings, and loop sheets that one person wrote and another approved. Each
piece is looked up before it is made, so a load that was killed goes on where it stopped.
"""

from collections.abc import Callable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeAlias
from uuid import UUID

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from historian.sample_store import SampleStore
from loop.plants import SimulatedLoop, routine_operation, step_test
from loop.record import Mode, Record
from service import database
from service.audit.store import lines_between
from service.database import Database
from service.demo_plant import APPROVER, DEMO, ENGINEER, DemoLoop, DemoSheet
from service.errors import NotFound
from service.jobs.actions import add_job
from service.loops import actions as loops
from service.loops.schemas import KindName, NewLoop
from service.loops.store import loop_with_id, loop_with_tag
from service.models import actions as models
from service.models.schemas import IPDTBody, NewModel
from service.records.local_file import store_file
from service.settings import Settings
from service.sheets import actions as sheets
from service.sheets.evidence import block_of
from service.sheets.proposal import proposed_settings, written_settings
from service.sheets.schemas import NewSheet
from service.sheets.store import Sheet, sheet_with_version
from service.tables import KeyRow, ModelRow, TuningRow
from service.tunings import actions as tunings
from service.tunings.schemas import RunningBody, TuneLoop

KEY_OWNER = "demo"
TESTS_START = datetime(2026, 3, 2, 6, 0, tzinfo=UTC)
ROUTINE_START = datetime(2026, 3, 3, 6, 0, tzinfo=UTC)
ROUTINE = 8 * 3600.0  # s
# The first letter of a tag says what is measured (ISA-5.1).
KINDS: Mapping[str, KindName] = {
    "F": "flow", "P": "pressure", "L": "level", "T": "temperature", "A": "analyser"
}  # fmt: skip

PIECES = 5 * len(DEMO)  # that `load` tells of, for a progress bar
Teller: TypeAlias = Callable[[str], None]

_writing = contextmanager(database.transaction)


class NotADemo(ValueError):
    """The installation holds somebody's own work."""

    def __init__(self, folder: Path) -> None:
        super().__init__(
            f"{folder} holds an installation that is no demo. Start it with 'loopwright serve', or "
            "name another folder with --data."
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Installation:
    """Where the demo goes.

    Attributes
    ----------
    held : Database
        Database.
    samples : SampleStore
        Sample store.
    settings : Settings
        Settings.
    """

    held: Database
    samples: SampleStore
    settings: Settings


def is_loaded(held: Database, settings: Settings) -> bool:
    """Tell whether the demo was loaded to its end: then somebody has its key.

    Raises
    ------
    NotADemo
        The first line of the audit trail is not the demo's.
    """
    with held.readings() as session:
        first = lines_between(session, 1, 1)
        if first and first[0]["actor"] != ENGINEER.owner:
            raise NotADemo(settings.data)
        return session.scalar(select(KeyRow).where(KeyRow.owner == KEY_OWNER).limit(1)) is not None


def load(into: Installation, tell: Teller) -> None:
    """Put the simulated plant into an installation, as far as it is not there yet.

    Parameters
    ----------
    into : Installation
        Where it goes.
    tell : callable
        Told in words what comes next, `PIECES` times.
    """
    for demo in DEMO:
        plant = demo.plant
        tell(f"{plant.tag}: {plant.description}")
        loop_id = _loop(into, demo)
        tell(f"{plant.tag}: step test")
        test = _record(into, loop_id, step_test(plant, start=TESTS_START), "step-test")
        tell(f"{plant.tag}: routine operation")
        usual = routine_operation(plant, duration=ROUTINE, start=ROUTINE_START)
        _record(into, loop_id, usual, "routine")
        tell(f"{plant.tag}: model and tuning")
        model_id = _model(into, loop_id, NewModel(record_id=test))
        if demo.stated is not None:
            stated = IPDTBody(kind="IPDT", K=demo.stated.K, theta=demo.stated.theta)
            model_id = _model(into, loop_id, NewModel(process=stated))
        tuning_id = _tuning(into, loop_id, model_id, plant)
        tell(f"{plant.tag}: loop sheet")
        for version, written in enumerate(demo.sheets, start=1):
            sheet = _draft(into, loop_id, version, (written, plant, model_id, tuning_id))
            _decide(into, sheet, written)
    _ask_for_assessment(into)


def _ask_for_assessment(into: Installation) -> None:
    """Let the service find out what the routine data say, as soon as it is up."""
    day = datetime.combine(ROUTINE_START.date(), time(), UTC)
    with _writing(into.held) as session:
        add_job(
            session,
            actor=ENGINEER,
            kind="assess",
            key="assess:demo",
            request={"start": day, "end": day + timedelta(days=1)},
        )


def _loop(into: Installation, demo: DemoLoop) -> UUID:
    plant = demo.plant
    with _writing(into.held) as session:
        found = loop_with_tag(session, plant.tag)
        if found is not None:
            return found.id
        new = NewLoop(
            tag=plant.tag,
            description=plant.description,
            area="Demo plant",
            unit=plant.area,
            pv_low=plant.pv_range[0],
            pv_high=plant.pv_range[1],
            pv_unit=plant.pv_unit,
            op_low=plant.op_range[0],
            op_high=plant.op_range[1],
            op_unit="%",
            action=plant.controller.action.value,
            form=demo.form,
            time_unit=demo.time_unit,
            gain_basis=demo.gain_basis,
            sample_time=plant.scan_time,
            largest_load=2 * plant.step,
            kind=KINDS[plant.tag[0]],
        )
        return loops.create_loop(session, actor=ENGINEER, loop=new).id


def _record(into: Installation, loop_id: UUID, record: Record, name: str) -> UUID:
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{record.tag}-{name}.csv"
        file.write_text(export_text(record), "utf-8")
        row, _ = store_file(
            into.held,
            into.samples,
            into.settings,
            actor=ENGINEER,
            loop_id=loop_id,
            file=file,
            fields={},
        )
    return row.id


def export_text(record: Record) -> str:
    """Write a record as a historian exports it, the same bytes every time.

    Raises
    ------
    ValueError
        The record has no start, set point or mode.
    """
    if record.start is None or record.sp is None or record.mode is None:
        raise ValueError("an export needs instants, a set point and a mode")
    start = np.datetime64(record.start.replace(tzinfo=None), "ms")
    stamps = np.datetime_as_string(start + np.round(record.t * 1e3).astype("timedelta64[ms]"))
    rows = zip(
        stamps.tolist(),
        record.pv.tolist(),
        record.op.tolist(),
        record.sp.tolist(),
        record.mode.tolist(),
        strict=True,
    )
    tag = record.tag
    return f"Time,{tag}.PV,{tag}.OP,{tag}.SP,{tag}.MODE\n" + "".join(
        f"{stamp}Z,{pv:.4f},{op:.3f},{sp:.3f},{Mode(mode).name}\n"
        for stamp, pv, op, sp, mode in rows
    )


def _model(into: Installation, loop_id: UUID, wanted: NewModel) -> UUID:
    with into.held.readings() as session:
        query = select(ModelRow.id).where(
            ModelRow.loop_id == loop_id, ModelRow.record_id == wanted.record_id
        )
        found = session.scalars(query).first()
        if found is not None:
            return found
        body = models.work_out_model(session, into.samples, loop_id=loop_id, wanted=wanted)
    with _writing(into.held) as session:
        return models.keep_model(
            session, actor=ENGINEER, loop_id=loop_id, record_id=wanted.record_id, body=body
        ).id


def _tuning(into: Installation, loop_id: UUID, model_id: UUID, plant: SimulatedLoop) -> UUID:
    pid = plant.controller
    running = RunningBody(Kc=pid.Kc, Ti=pid.Ti, Td=pid.Td, N=pid.N)
    with into.held.readings() as session:
        query = select(TuningRow.id).where(TuningRow.model_id == model_id)
        found = session.scalars(query).first()
        if found is not None:
            return found
        wanted = TuneLoop(model_id=model_id, running=running)
        body = tunings.tune_loop(session, loop_id=loop_id, wanted=wanted)
    with _writing(into.held) as session:
        return tunings.keep_tuning(
            session, actor=ENGINEER, loop_id=loop_id, model_id=model_id, body=body
        ).id


def _draft(
    into: Installation,
    loop_id: UUID,
    version: int,
    what: tuple[DemoSheet, SimulatedLoop, UUID, UUID],
) -> Sheet:
    with _writing(into.held) as session:
        try:
            return sheet_with_version(session, loop_id, version)
        except NotFound:
            new = _new_sheet(session, loop_id, *what)
            return sheets.draft_sheet(session, actor=ENGINEER, loop_id=loop_id, new=new)


def _new_sheet(
    session: Session,
    loop_id: UUID,
    sheet: DemoSheet,
    plant: SimulatedLoop,
    model_id: UUID,
    tuning_id: UUID,
) -> NewSheet:
    if sheet.settings == "as found":
        block = block_of(loop_with_id(session, loop_id))
        settings = written_settings(block, plant.controller, scan_time=plant.scan_time)
        return NewSheet(settings=settings, model_id=model_id, reason=sheet.reason)
    rule, structure = (None, None) if sheet.settings == "recommended" else sheet.settings
    proposed = proposed_settings(session, loop_id, tuning_id, rule=rule, structure=structure)
    return NewSheet(settings=proposed.settings, tuning_id=tuning_id, reason=sheet.reason)


def _decide(into: Installation, sheet: Sheet, written: DemoSheet) -> None:
    if written.decision is None or sheet.status != "draft":
        return
    with _writing(into.held) as session:
        if written.decision == "approved":
            sheets.approve_sheet(
                session,
                actor=APPROVER,
                loop_id=sheet.row.loop_id,
                version=sheet.row.version,
                if_match=sheet.etag,
                reason=written.decision_reason,
                allow_self_approval=False,
            )
        else:
            sheets.reject_sheet(
                session,
                actor=APPROVER,
                loop_id=sheet.row.loop_id,
                version=sheet.row.version,
                if_match=sheet.etag,
                reason=written.decision_reason,
            )
