"""HTTP routes of loop sheets."""

from datetime import timedelta
from typing import Annotated, TypeAlias
from uuid import UUID

from fastapi import APIRouter, Path, Query, Request, Response
from pydantic import TypeAdapter

from service.access import Approver, Engineer, Viewer
from service.audit import declares
from service.database import Reading, Transaction
from service.etags import IfMatch
from service.limits import HEAVY
from service.listing import Cursor, Limit, cursor_after, number_of
from service.loops.store import loop_with_id
from service.samples import Samples
from service.sheets import actions, store
from service.sheets.effect import effect_of_sheet
from service.sheets.evidence import canonical_body, stored_block
from service.sheets.proposal import proposed_settings
from service.sheets.schemas import (
    Change,
    DecisionRequest,
    NewSheet,
    ProposedSettings,
    Settings,
    SheetBody,
    SheetDiff,
    SheetEffect,
    SheetPage,
)
from service.units import Moment, VersionNumber, Word

router = APIRouter(prefix="/v1/loops/{loop_id}/sheets", tags=["sheets"])
Version: TypeAlias = Annotated[VersionNumber, Path(description="Version of the sheet.")]
_SETTINGS: TypeAdapter[Settings] = TypeAdapter(Settings)


@router.post("", status_code=201, openapi_extra=declares("sheet.drafted"))
def draft_sheet(
    loop_id: UUID, body: NewSheet, actor: Engineer, transaction: Transaction, response: Response
) -> SheetBody:
    """Draft a new version of a loop's sheet; the server computes its margins."""
    sheet = actions.draft_sheet(transaction, actor=actor, loop_id=loop_id, new=body)
    response.headers["Location"] = f"/v1/loops/{loop_id}/sheets/{sheet.row.version}"
    return _answer(sheet, response)


@router.get("")
def list_sheets(
    loop_id: UUID, _: Viewer, reading: Reading, cursor: Cursor = None, limit: Limit = 100
) -> SheetPage:
    """List all versions, newest first, with what became of each."""
    loop_with_id(reading, loop_id)
    sheets = store.newest_sheets(reading, loop_id, below=number_of(cursor), limit=limit + 1)
    more = cursor_after(str(sheets[limit - 1].row.version)) if len(sheets) > limit else None
    return SheetPage(items=[_body(sheet) for sheet in sheets[:limit]], next=more)


@router.get("/current")
def read_current_sheet(loop_id: UUID, _: Viewer, reading: Reading, response: Response) -> SheetBody:
    """Read the version in force."""
    return _answer(actions.sheet_in_force(reading, loop_id), response)


@router.get("/diff")
def compare_sheets(
    loop_id: UUID,
    _: Viewer,
    reading: Reading,
    before: Annotated[VersionNumber, Query(alias="from", description="Earlier version.")],
    after: Annotated[VersionNumber, Query(alias="to", description="Later version.")],
) -> SheetDiff:
    """Compare two versions field by field."""
    changes = actions.differences(
        store.sheet_with_version(reading, loop_id, before).row,
        store.sheet_with_version(reading, loop_id, after).row,
    )
    return SheetDiff(
        before=before,
        after=after,
        changes=[
            Change.model_validate({"field": field, "before": old, "after": new})
            for field, old, new in changes
        ],
    )


@router.get("/proposal")
def propose_settings(
    loop_id: UUID,
    _: Viewer,
    reading: Reading,
    tuning_id: UUID,
    rule: Word | None = None,
    structure: Word | None = None,
) -> ProposedSettings:
    """Write a tuning's settings in this loop's form and units, ready to be drafted."""
    return proposed_settings(reading, loop_id, tuning_id, rule=rule, structure=structure)


@router.get("/{version}")
def read_sheet(
    loop_id: UUID, version: Version, _: Viewer, reading: Reading, response: Response
) -> SheetBody:
    """Read one version; its ETag is what a decision on it needs."""
    return _answer(store.sheet_with_version(reading, loop_id, version), response)


@router.get("/{version}/effect", dependencies=[HEAVY])
def compare_before_and_after(
    loop_id: UUID,
    version: Version,
    _: Viewer,
    reading: Reading,
    samples: Samples,
    days: Annotated[
        float, Query(gt=0, le=31, description="Length of each period, at most. [d]")
    ] = 7.0,
    changed_at: Annotated[
        Moment | None,
        Query(description="When the settings were typed in; by default when they were approved."),
    ] = None,
) -> SheetEffect:
    """Ask whether a version helped: the control error before and after it came into force."""
    return SheetEffect.model_validate(
        effect_of_sheet(
            reading, samples, loop_id, version, span=timedelta(days=days), changed_at=changed_at
        )
    )


@router.post("/{version}/approve", openapi_extra=declares("sheet.approved"))
def approve_sheet(
    loop_id: UUID,
    version: Version,
    body: DecisionRequest,
    actor: Approver,
    transaction: Transaction,
    request: Request,
    response: Response,
    if_match: IfMatch = None,
) -> SheetBody:
    """Put a draft in force. Who wrote it may not, unless the site allows that."""
    sheet = actions.approve_sheet(
        transaction,
        actor=actor,
        loop_id=loop_id,
        version=version,
        if_match=if_match,
        reason=body.reason,
        allow_self_approval=request.app.state.settings.allow_self_approval,
    )
    return _answer(sheet, response)


@router.post("/{version}/reject", openapi_extra=declares("sheet.rejected"))
def reject_sheet(
    loop_id: UUID,
    version: Version,
    body: DecisionRequest,
    actor: Approver,
    transaction: Transaction,
    response: Response,
    if_match: IfMatch = None,
) -> SheetBody:
    """Turn a draft down."""
    sheet = actions.reject_sheet(
        transaction,
        actor=actor,
        loop_id=loop_id,
        version=version,
        if_match=if_match,
        reason=body.reason,
    )
    return _answer(sheet, response)


@router.post("/{version}/withdraw", openapi_extra=declares("sheet.withdrawn"))
def withdraw_sheet(
    loop_id: UUID,
    version: Version,
    body: DecisionRequest,
    actor: Engineer,
    transaction: Transaction,
    response: Response,
    if_match: IfMatch = None,
) -> SheetBody:
    """Take one's own draft back."""
    sheet = actions.withdraw_sheet(
        transaction,
        actor=actor,
        loop_id=loop_id,
        version=version,
        if_match=if_match,
        reason=body.reason,
    )
    return _answer(sheet, response)


def _answer(sheet: store.Sheet, response: Response) -> SheetBody:
    response.headers["ETag"] = sheet.etag
    return _body(sheet)


def _body(sheet: store.Sheet) -> SheetBody:
    row = sheet.row
    block, settings = stored_block(row.block), _SETTINGS.validate_python(row.settings)
    return SheetBody.model_validate(
        {
            "loop_id": row.loop_id,
            "version": row.version,
            "status": sheet.status,
            "block": row.block,
            "settings": settings,
            "units": block.units(),
            "canonical": canonical_body(block, settings),
            "model_id": row.model_id,
            "tuning_id": row.tuning_id,
            "process": row.process,
            "evidence": row.evidence,
            "profile": row.profile,
            "reason": row.reason,
            "author": row.author,
            "created_at": row.created_at,
            "decision": sheet.decision,
        }
    )
