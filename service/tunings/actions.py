"""What users do with tunings."""

import math
from contextlib import suppress
from uuid import UUID

from sqlalchemy.orm import Session

from advice.body import Body
from advice.case_body import case_body
from advice.robust_body import robust_body
from advice.robust_choice import optimal_choices, prove_case
from advice.tune import StatedProcess, TuningCase, tune_process
from loop.controller import PID, Action
from loop.errors import FitNotTrusted, LoopError
from loop.process import gain_sign
from loop.swing import swing_of
from service import audit
from service.actors import Actor
from service.errors import InvalidRequest
from service.loops.store import loop_with_id
from service.models.schemas import process_from, stated_process
from service.models.store import model_with_id
from service.tables import LoopRow, ModelRow, TuningRow
from service.tunings.schemas import (
    MOST_SWINGING,
    RunningBody,
    TuneLoop,
    TuneProcess,
    TuneProcesses,
)


def tune_loop(reading: Session, *, loop_id: UUID, wanted: TuneLoop) -> Body:
    """Work out every rule's settings for a loop; nothing is stored yet.

    Raises
    ------
    NotFound
        There is no such loop or model.
    FitNotTrusted
        The model was refused, so there is nothing to tune.
    """
    loop = loop_with_id(reading, loop_id)
    if wanted.process is not None:
        return _case(stated_process(wanted.process), wanted, loop)
    assert wanted.model_id is not None  # noqa: S101 - the body holds one of the two
    model = model_with_id(reading, loop_id, wanted.model_id)
    if model.kind is None or model.parameters is None:
        raise FitNotTrusted(
            "The model was refused, so nothing is tuned. " + " ".join(model.reasons)
        )
    body = _case(process_from(model.kind, model.parameters), wanted, loop)
    return {**body, "model": _model_of(model)}


def _model_of(model: ModelRow) -> Body:
    return {**model.body, "id": str(model.id)}  # type: ignore[dict-item]


def keep_tuning(
    session: Session, *, actor: Actor, loop_id: UUID, model_id: UUID | None, body: Body
) -> TuningRow:
    """Store a case of a loop."""
    row = TuningRow(
        loop_id=loop_id,
        model_id=model_id,
        process=body["process"],
        profile=body["profile"]["name"],  # type: ignore[index, call-overload]
        body=body,
        recommended=body["recommended"],
        recommended_reason=body["recommended_reason"],
        author=actor.owner,
    )
    session.add(row)
    session.flush()
    audit.record(
        session,
        actor=actor,
        action="tuning.proposed",
        subject=f"loops/{loop_id}/tunings/{row.id}",
        loop_id=loop_id,
        after={
            "model_id": model_id,
            "process": row.process,
            "profile": row.profile,
            "recommended": _settings_only(row.recommended),
            "recommended_reason": row.recommended_reason,
        },
    )
    return row


def _settings_only(recommended: dict[str, object] | None) -> dict[str, object] | None:
    """Leave the sweep's arrays out of the trail; the stored case holds them."""
    if recommended is None:
        return None
    return {name: value for name, value in recommended.items() if name != "sweep"}


def tune_one(wanted: TuneProcess) -> Body:
    """Work out every rule's settings for a process; nothing is stored."""
    return _case(stated_process(wanted.process), wanted, None)


def tune_many(wanted: TuneProcesses) -> list[Body]:
    """Work out every rule's settings for many processes; nothing is stored.

    Raises
    ------
    InvalidRequest
        A process cannot be tuned, or too many of them swing by themselves.
    """
    swinging, bodies = 0, []
    for body in wanted.processes:
        with suppress(ValueError):  # told below, with its place in the list
            swinging += swing_of(stated_process(body)) is not None
    if swinging > MOST_SWINGING:
        raise InvalidRequest(
            "body/processes",
            f"{swinging} of the processes swing by themselves, and a batch takes at most "
            f"{MOST_SWINGING} of those, because their settings are searched and proven one by "
            "one; send the others in a further batch",
        )
    for i, process in enumerate(wanted.processes):
        try:
            bodies.append(_case(stated_process(process), wanted, None))
        except (ValueError, LoopError) as error:
            raise InvalidRequest(f"body/processes/{i}", str(error)) from error
    return bodies


def _case(
    process: StatedProcess, wanted: TuneLoop | TuneProcess | TuneProcesses, loop: LoopRow | None
) -> Body:
    profile = wanted.profile or (loop.profile if loop else "general")
    scan_time = wanted.scan_time
    if scan_time is None:
        scan_time = (loop.sample_time or 0.0) if loop else 0.0
    try:
        case: TuningCase = tune_process(
            process,
            profile=profile,
            tau_c=wanted.tau_c,
            scan_time=scan_time,
            running=running_controller(wanted.running, process),
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return case_body(case) | _on_request(case, wanted, scan_time)


def _on_request(
    case: TuningCase, wanted: TuneLoop | TuneProcess | TuneProcesses, scan_time: float
) -> Body:
    """Proofs and optima of a single process: they take too long for a batch."""
    if isinstance(wanted, TuneProcesses):
        return {}
    return robust_body(
        prove_case(case, scan_time=scan_time) if wanted.proof else None,
        optimal_choices(case, scan_time=scan_time) if wanted.optimal else None,
    )


def running_controller(stated: RunningBody | None, process: StatedProcess) -> PID | None:
    """Read stated settings; their action is the one that gives negative feedback."""
    if stated is None:
        return None
    return PID(
        Kc=stated.Kc,
        Ti=math.inf if stated.Ti is None else stated.Ti,
        Td=stated.Td,
        N=stated.N,
        action=Action.for_gain(gain_sign(process)),
    )
