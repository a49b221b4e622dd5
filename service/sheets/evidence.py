"""What a sheet rests on: its block, its controller, its process and the margins they give."""

from dataclasses import asdict
from uuid import UUID

from sqlalchemy.orm import Session

from loop.controller import PID
from loop.margins import margins
from loop.process import Process
from service.blocks import Block
from service.errors import InvalidRequest, NoProcess
from service.models.schemas import process_from
from service.models.store import model_with_id
from service.plain_json import plain
from service.sheets.schemas import BlockBody, Settings
from service.tables import LoopRow
from service.tunings.store import tuning_with_id
from tuning.profiles import PROFILES
from tuning.verification import verify

Stored = dict[str, object]


def block_of(loop: LoopRow) -> Block:
    """Read the controller block off a loop."""
    return Block(**BlockBody.model_validate(loop).model_dump())


def stored_block(stored: Stored) -> Block:
    """Read the controller block that a sheet was written for."""
    return Block(**BlockBody.model_validate(stored).model_dump())


def checked_controller(block: Block, settings: Settings) -> PID:
    """Turn a sheet's settings into the canonical controller, if they are the block's.

    Raises
    ------
    InvalidRequest
        They are of another form, beyond the block's range, or no controller.
    ConversionRefused
        There is no ISA form of them.
    """
    if settings.form != block.form:
        raise InvalidRequest(
            "body/settings/form",
            f"The loop's block has the form {block.form}, these settings have {settings.form}.",
        )
    for name in ("op_low", "op_high"):
        limit = getattr(settings, name)
        if limit is not None and not block.op_low <= limit <= block.op_high:
            raise InvalidRequest(
                f"body/settings/{name}",
                f"{name} must lie within the OP range {block.op_low:g} to {block.op_high:g} "
                f"{block.op_unit}, got {limit:g}",
            )
    try:
        return block.canonical(settings.controller(block.acting))
    except ValueError as error:
        raise InvalidRequest("body/settings", str(error)) from error


def linked_process(
    session: Session, loop_id: UUID, model_id: UUID | None, tuning_id: UUID | None
) -> Stored | None:
    """Find the process model that margins are computed with: the model's, or the tuning's.

    Raises
    ------
    NotFound
        The loop has no such model or tuning.
    NoProcess
        What is linked has no process model.
    InvalidRequest
        Model and tuning are linked, and the tuning came from another model.
    """
    tuning = None if tuning_id is None else tuning_with_id(session, loop_id, tuning_id)
    if model_id is None:
        if tuning is None:
            return None
        return _with_process("tuning", tuning.process)
    model = model_with_id(session, loop_id, model_id)
    if tuning is not None and tuning.model_id not in (None, model_id):
        raise InvalidRequest(
            "body/model_id", f"The tuning came from the model {tuning.model_id}, not from this one."
        )
    parameters = None if model.kind is None else model.parameters
    return _with_process(
        "model", None if parameters is None else {**parameters, "kind": model.kind}
    )


def evidence(
    process: Stored | None, controller: PID, profile: str, scan_time: float | None
) -> Stored | None:
    """Compute margins, and the verdict of the profile over ±50 % of each parameter.

    Parameters
    ----------
    process : mapping or None
        Process model as stored; without one there is no evidence.
    controller : PID
        Canonical controller.
    profile : str
        Name of the target profile.
    scan_time : float or None
        Scan time; the hold adds half of it as dead time. [s]

    Raises
    ------
    UnstableLoop
        The closed loop is unstable at its own model.
    """
    if process is None:
        return None
    model = stored_process(process)
    found = margins(model, controller, sample_time=scan_time)
    swept = verify(model, controller, PROFILES[profile], sample_time=scan_time or 0.0)
    return {"margins": plain(found), "passes": bool(swept.passes), "verdict": swept.verdict}


def canonical_body(block: Block, settings: Settings) -> Stored:
    """Show a sheet's controller in ISA form, seconds and engineering units."""
    return {
        name: plain(value) for name, value in asdict(checked_controller(block, settings)).items()
    }


def stored_process(stored: Stored) -> Process:
    """Read the process that a sheet's margins came from."""
    parameters = {name: value for name, value in stored.items() if name != "kind"}
    return process_from(str(stored.get("kind")), parameters)


def _with_process(kind: str, process: Stored | None) -> Stored:
    if process is None:
        raise NoProcess(kind)
    try:
        stored_process(process)
    except ValueError as error:
        raise NoProcess(kind) from error
    return process
