"""What users do with loop sheets: draft, approve, reject, withdraw, compare."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from uuid import UUID

from sqlalchemy.orm import Session

from service import audit
from service.actors import Actor, Role
from service.errors import BlockChanged, NotFound, NotTheAuthor, SelfApproval, SheetDecided
from service.etags import require_match
from service.loops.store import loop_with_id
from service.sheets import store
from service.sheets.evidence import block_of, checked_controller, evidence, linked_process
from service.sheets.schemas import NewSheet
from service.sheets.store import Sheet
from service.tables import SheetDecisionRow, SheetRow


def draft_sheet(session: Session, *, actor: Actor, loop_id: UUID, new: NewSheet) -> Sheet:
    """Write a new version of a loop's sheet, with the margins its model gives it.

    Raises
    ------
    NotFound, NoProcess, InvalidRequest
        The loop, or what is linked, is not there or not usable; the settings are not the block's.
    ConversionRefused, UnstableLoop
        The settings are no controller, or one that the linked model says is unstable.
    """
    loop = loop_with_id(session, loop_id, lock=True)
    block = block_of(loop)
    profile = new.profile or loop.profile
    controller = checked_controller(block, new.settings)
    process = linked_process(session, loop_id, new.model_id, new.tuning_id)
    row = SheetRow(
        loop_id=loop_id,
        version=store.next_version(session, loop_id),
        block=asdict(block),
        settings=new.settings.model_dump(),
        model_id=new.model_id,
        tuning_id=new.tuning_id,
        process=process,
        evidence=evidence(process, controller, profile, new.settings.scan_time),
        profile=profile,
        reason=new.reason,
        author=actor.owner,
    )
    session.add(row)
    audit.record(
        session,
        actor=actor,
        action="sheet.drafted",
        subject=_subject(row),
        loop_id=loop_id,
        after={
            "status": "draft",
            "settings": row.settings,
            "block": row.block,
            "model_id": row.model_id,
            "tuning_id": row.tuning_id,
            "evidence": row.evidence,
            "profile": row.profile,
            "reason": row.reason,
        },
    )
    return store.sheet_with_version(session, loop_id, row.version)


def approve_sheet(
    session: Session,
    *,
    actor: Actor,
    loop_id: UUID,
    version: int,
    if_match: str | None,
    reason: str,
    allow_self_approval: bool,
) -> Sheet:
    """Put a draft in force; the version in force before is superseded.

    Raises
    ------
    NotFound, IfMatchMissing, StaleVersion, SheetDecided
        See there.
    SelfApproval
        The approver wrote the draft, and the site does not allow that.
    BlockChanged
        The loop's block is no longer the one the draft was written for.
    """
    loop = loop_with_id(session, loop_id, lock=True)
    sheet = _matching_draft(session, loop_id, version, if_match)
    if actor.is_same_person(sheet.row.author) and not allow_self_approval:
        raise SelfApproval(sheet.row.author)
    now, then = asdict(block_of(loop)), sheet.row.block
    if now != then:
        raise BlockChanged(sorted(name for name in now if now[name] != then.get(name)))
    before = store.current_sheet(session, loop_id)
    superseded = before.row.version if before else None
    _decide(session, sheet, actor, "approved", reason, approval=sheet.approvals + 1)
    audit.record(
        session,
        actor=actor,
        action="sheet.approved",
        subject=_subject(sheet.row),
        loop_id=loop_id,
        before={"status": "draft", "version_in_force": superseded},
        after={"status": "approved", "version_in_force": version, "reason": reason},
    )
    return store.sheet_with_version(session, loop_id, version)


def reject_sheet(
    session: Session,
    *,
    actor: Actor,
    loop_id: UUID,
    version: int,
    if_match: str | None,
    reason: str,
) -> Sheet:
    """Turn a draft down."""
    loop_with_id(session, loop_id, lock=True)
    sheet = _matching_draft(session, loop_id, version, if_match)
    return _close(session, sheet, actor, "rejected", reason)


def withdraw_sheet(
    session: Session,
    *,
    actor: Actor,
    loop_id: UUID,
    version: int,
    if_match: str | None,
    reason: str,
) -> Sheet:
    """Take one's own draft back.

    Raises
    ------
    NotTheAuthor
        Somebody else wrote it.
    """
    loop_with_id(session, loop_id, lock=True)
    sheet = _matching_draft(session, loop_id, version, if_match)
    if not (actor.is_same_person(sheet.row.author) or actor.role is Role.ADMIN):
        raise NotTheAuthor(sheet.row.author)
    return _close(session, sheet, actor, "withdrawn", reason)


def sheet_in_force(session: Session, loop_id: UUID) -> Sheet:
    """Find the version in force or say that there is none."""
    loop_with_id(session, loop_id)
    sheet = store.current_sheet(session, loop_id)
    if sheet is None:
        raise NotFound("approved sheet of loop", loop_id)
    return sheet


def differences(before: SheetRow, after: SheetRow) -> list[tuple[str, object, object]]:
    """Compare two versions field by field, by the path of each field."""
    old, new = dict(_fields(before)), dict(_fields(after))
    return [
        (field, old.get(field), new.get(field))
        for field in sorted(old.keys() | new.keys())
        if old.get(field) != new.get(field)
    ]


def _fields(row: SheetRow) -> Iterator[tuple[str, object]]:
    for name in ("block", "settings", "process", "evidence"):
        yield from _flat(name, getattr(row, name))
    yield "profile", row.profile
    yield "model_id", None if row.model_id is None else str(row.model_id)
    yield "tuning_id", None if row.tuning_id is None else str(row.tuning_id)


def _flat(path: str, value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from _flat(f"{path}.{name}", item)
    else:
        yield path, value


def _matching_draft(session: Session, loop_id: UUID, version: int, if_match: str | None) -> Sheet:
    sheet = store.sheet_with_version(session, loop_id, version)
    require_match(if_match, sheet.etag)
    if sheet.status != "draft":
        raise SheetDecided(version, sheet.status)
    return sheet


def _close(session: Session, sheet: Sheet, actor: Actor, decision: str, reason: str) -> Sheet:
    _decide(session, sheet, actor, decision, reason)
    audit.record(
        session,
        actor=actor,
        action=f"sheet.{decision}",
        subject=_subject(sheet.row),
        loop_id=sheet.row.loop_id,
        before={"status": "draft"},
        after={"status": decision, "reason": reason},
    )
    return store.sheet_with_version(session, sheet.row.loop_id, sheet.row.version)


def _decide(
    session: Session,
    sheet: Sheet,
    actor: Actor,
    decision: str,
    reason: str,
    *,
    approval: int | None = None,
) -> None:
    session.add(
        SheetDecisionRow(
            loop_id=sheet.row.loop_id,
            version=sheet.row.version,
            decision=decision,
            approval=approval,
            reason=reason,
            author=actor.owner,
        )
    )
    session.flush()


def _subject(row: SheetRow) -> str:
    return f"loops/{row.loop_id}/sheets/{row.version}"
