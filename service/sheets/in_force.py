"""What loop sheets say of a period: the model, and the settings where they ran in all of it."""

from collections.abc import Collection, Sequence
from datetime import datetime
from itertools import groupby
from uuid import UUID

from pydantic import TypeAdapter
from sqlalchemy import and_, select
from sqlalchemy.orm import Session

from loop.controller import PID
from loop.digital_pid import OutputLimits
from loop.errors import ConversionRefused
from monitoring.known_loop import KnownLoop
from service.errors import InvalidRequest
from service.sheets.evidence import checked_controller, stored_block, stored_process
from service.sheets.schemas import Settings
from service.tables import SheetDecisionRow, SheetRow

_SETTINGS: TypeAdapter[Settings] = TypeAdapter(Settings)
# Below so many loops their sheets are asked for by name, above it all are read.
BY_NAME = 200


def known_loops(
    session: Session, loops: Collection[UUID], *, start: datetime, end: datetime
) -> dict[UUID, KnownLoop]:
    """Read models and settings of loops off their approved sheets.

    A period is judged by the version in force all through it. Where there is none, the model of
    the version that came last before its end, or of the first one, still says what the process
    does; which settings ran is then not known.

    Parameters
    ----------
    session : Session
        Database.
    loops : collection of UUID
        Loops; those without an approved sheet, or whose sheet has no model, are left out.
    start, end : datetime
        Period.
    """
    query = (
        select(SheetRow, SheetDecisionRow.created_at)
        .join(
            SheetDecisionRow,
            and_(
                SheetDecisionRow.loop_id == SheetRow.loop_id,
                SheetDecisionRow.version == SheetRow.version,
            ),
        )
        .where(SheetDecisionRow.decision == "approved")
        .order_by(SheetRow.loop_id, SheetDecisionRow.approval)
    )
    if len(loops) <= BY_NAME:
        query = query.where(SheetRow.loop_id.in_(loops))
    wanted = set(loops)
    found = {}
    rows = ((row, at) for row, at in session.execute(query))
    for loop_id, versions in groupby(rows, key=lambda pair: pair[0].loop_id):
        if loop_id in wanted:
            known = _of_period(list(versions), start, end)
            if known is not None:
                found[loop_id] = known
    return found


def _of_period(
    versions: Sequence[tuple[SheetRow, datetime]], start: datetime, end: datetime
) -> KnownLoop | None:
    """Choose the version for a period."""
    began = [at for _, at in versions]
    for k, (row, at) in enumerate(versions):
        if at <= start and (k + 1 == len(versions) or began[k + 1] >= end):
            return known_loop(row, settings_ran=True)
    with_model = [(row, at) for row, at in versions if row.process is not None]
    if not with_model:
        return None
    earlier = [row for row, at in with_model if at < end]
    return known_loop(earlier[-1] if earlier else with_model[0][0], settings_ran=False)


def known_loop(row: SheetRow, *, settings_ran: bool) -> KnownLoop | None:
    """Read model, settings and limits off a version; None where it has no model.

    Parameters
    ----------
    row : SheetRow
        A version.
    settings_ran : bool
        Its settings ran in the period that is asked about.
    """
    if row.process is None:
        return None
    block = stored_block(row.block)
    settings = _SETTINGS.validate_python(row.settings)
    low = block.op_low if settings.op_low is None else settings.op_low
    high = block.op_high if settings.op_high is None else settings.op_high
    controller: PID | None = None
    if settings_ran:
        try:
            controller = checked_controller(block, settings)
        except (InvalidRequest, ConversionRefused):
            controller = None
    try:
        return KnownLoop(
            process=stored_process(row.process),
            controller=controller,
            limits=OutputLimits(low=low, high=high),
            scan_time=settings.scan_time or None,
        )
    except ValueError:
        return None
