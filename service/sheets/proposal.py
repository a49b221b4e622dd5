"""A tuning's settings, written for the block of the loop they are meant for."""

import math
from uuid import UUID

from pydantic import ValidationError
from sqlalchemy.orm import Session

from loop.controller import PID, Action, ParallelPID, SeriesPID
from service.blocks import Block, Controller
from service.errors import InvalidRequest, NotFound
from service.loops.store import loop_with_id
from service.sheets.evidence import block_of
from service.sheets.schemas import (
    IsaSettings,
    ParallelSettings,
    ProposedSettings,
    SeriesSettings,
    Settings,
)
from service.tables import TuningRow
from service.tunings.store import tuning_with_id


def proposed_settings(
    session: Session, loop_id: UUID, tuning_id: UUID, *, rule: str | None, structure: str | None
) -> ProposedSettings:
    """Write one of a tuning's settings as the loop's block has them, ready to be drafted.

    Parameters
    ----------
    session : Session
        Database.
    loop_id, tuning_id : UUID
        Loop, and one of its tunings.
    rule, structure : str or None
        Which settings; none takes the recommended ones.

    Raises
    ------
    NotFound
        There is no such loop, tuning, or settings in it.
    InvalidRequest
        The tuning acts in the other direction than the block.
    ConversionRefused
        The block's form has no equivalent.
    """
    loop = loop_with_id(session, loop_id)
    block = block_of(loop)
    tuning = tuning_with_id(session, loop_id, tuning_id)
    chosen = _chosen(tuning, rule, structure)
    pid = _pid(chosen)
    if pid.action is not block.acting:
        raise InvalidRequest(
            "query/tuning_id",
            f"The tuning needs a {pid.action.value} acting controller, the loop's block is "
            f"{block.action} acting. Check the sign of the process gain and the action.",
        )
    try:
        settings = written_settings(block, pid, scan_time=loop.sample_time)
    except (ValidationError, ValueError) as error:
        raise InvalidRequest(
            "query/tuning_id",
            "These settings are beyond what a sheet can hold in the loop's units.",
        ) from error
    return ProposedSettings(
        rule=_text(chosen.get("rule")),
        structure=_text(chosen.get("structure")),
        settings=settings,
        units=block.units(),
    )


def written_settings(block: Block, pid: PID, *, scan_time: float | None) -> Settings:
    """Write a canonical controller as settings of a block.

    An integral is kept at a limit by back-calculation with Tt = sqrt(Ti Td) for PID and Ti for PI.
    """
    written = block.written(pid)
    Tt = _tracking_time(pid)
    shared: dict[str, object] = {
        "b": written.b,
        "c": written.c,
        "pv_filter": written.tauF,
        "anti_windup": "none" if Tt is None else "back_calculation",
        "Tt": None if Tt is None else Tt / block.seconds,
        "scan_time": scan_time,
    }
    return _formed(written, shared)


def _formed(written: Controller, shared: dict[str, object]) -> Settings:
    if isinstance(written, ParallelPID):
        terms = {"Kp": written.Kp, "Ki": written.Ki, "Kd": written.Kd, "Tf": written.Tf}
        return ParallelSettings.model_validate({"form": "parallel", **terms, **shared})
    shared |= {"Kc": written.Kc, "Ti": _finite(written.Ti), "Td": written.Td}
    if isinstance(written, SeriesPID):
        return SeriesSettings.model_validate({"form": "series", "alpha": written.alpha, **shared})
    return IsaSettings.model_validate({"form": "isa", "N": _finite(written.N), **shared})


def _tracking_time(pid: PID) -> float | None:
    if pid.Ti == math.inf:
        return None
    return math.sqrt(pid.Ti * pid.Td) if pid.Td else pid.Ti


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _chosen(tuning: TuningRow, rule: str | None, structure: str | None) -> dict[str, object]:
    if rule is None and structure is None:
        if tuning.recommended is None:
            raise NotFound("recommendation in tuning", tuning.id)
        return tuning.recommended
    listed = tuning.body.get("tunings")
    for entry in listed if isinstance(listed, list) else []:
        if rule in (None, entry["rule"]) and structure in (None, entry["structure"]):
            return dict(entry)
    wanted = " ".join(word for word in (rule, structure) if word is not None)
    raise NotFound(f"{wanted} in tuning", tuning.id)


def _pid(entry: dict[str, object]) -> PID:
    """Read settings in the ISA form, as every tuning answer writes them."""
    numbers = {
        name: float(value)
        for name, value in entry.items()
        if name in ("Kc", "Ti", "Td", "N", "b", "c", "tauF") and isinstance(value, int | float)
    }
    return PID(**{"Ti": math.inf, "N": math.inf, **numbers}, action=Action(str(entry["action"])))


def _text(value: object) -> str | None:
    return None if value is None else str(value)
