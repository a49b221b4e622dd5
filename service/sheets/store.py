"""Loop sheets in the database. Rows are added and read; nothing changes one."""

from dataclasses import dataclass
from datetime import datetime
from uuid import UUID

from sqlalchemy import ColumnElement, and_, func, select
from sqlalchemy.orm import Session

from service.errors import NotFound
from service.tables import SheetDecisionRow, SheetRow


@dataclass(frozen=True, slots=True)
class Sheet:
    """A version with what became of it.

    Attributes
    ----------
    row : SheetRow
        The version.
    decision : SheetDecisionRow or None
        Its one decision; none for a draft.
    approvals : int
        Approvals of the loop so far.
    """

    row: SheetRow
    decision: SheetDecisionRow | None
    approvals: int

    @property
    def status(self) -> str:
        """Tell what the version is now."""
        if self.decision is None:
            return "draft"
        if self.decision.decision == "approved" and self.decision.approval != self.approvals:
            return "superseded"
        return self.decision.decision

    @property
    def etag(self) -> str:
        """Name the state a decision rests on: the version, its status, and what is in force."""
        return f'"{self.row.version}.{self.status}.{self.approvals}"'


def next_version(session: Session, loop_id: UUID) -> int:
    """Count on within the loop. The caller holds the loop."""
    last = session.scalar(select(func.max(SheetRow.version)).where(SheetRow.loop_id == loop_id))
    return (last or 0) + 1


def sheet_with_version(session: Session, loop_id: UUID, version: int) -> Sheet:
    """Find a version or say that there is none."""
    for sheet in _sheets(session, loop_id, SheetRow.version == version):
        return sheet
    raise NotFound("sheet version", version)


def current_sheet(session: Session, loop_id: UUID) -> Sheet | None:
    """Find the version in force: the one approved last."""
    approvals = _approvals(session, loop_id)
    for sheet in _sheets(session, loop_id, SheetDecisionRow.approval == approvals):
        return sheet
    return None


def next_approval(session: Session, loop_id: UUID, after: SheetDecisionRow) -> datetime | None:
    """Tell when the approval after one came; none while that one is in force."""
    return session.scalar(
        select(SheetDecisionRow.created_at).where(
            SheetDecisionRow.loop_id == loop_id,
            SheetDecisionRow.approval == (after.approval or 0) + 1,
        )
    )


def newest_sheets(session: Session, loop_id: UUID, *, below: int | None, limit: int) -> list[Sheet]:
    """List versions, newest first, below a version."""
    condition = SheetRow.version < below if below is not None else SheetRow.version > 0
    return _sheets(session, loop_id, condition, limit=limit)


def _approvals(session: Session, loop_id: UUID) -> int:
    query = select(func.max(SheetDecisionRow.approval)).where(SheetDecisionRow.loop_id == loop_id)
    return session.scalar(query) or 0


def _sheets(
    session: Session, loop_id: UUID, condition: ColumnElement[bool], *, limit: int = 1
) -> list[Sheet]:
    approvals = _approvals(session, loop_id)
    query = (
        select(SheetRow, SheetDecisionRow)
        .outerjoin(
            SheetDecisionRow,
            and_(
                SheetDecisionRow.loop_id == SheetRow.loop_id,
                SheetDecisionRow.version == SheetRow.version,
            ),
        )
        .where(SheetRow.loop_id == loop_id, condition)
        .order_by(SheetRow.version.desc())
        .limit(limit)
    )
    return [Sheet(row, decision, approvals) for row, decision in session.execute(query)]
