"""What a sheet version did to its loop: the routine data before and after it, compared."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from uuid import UUID

from sqlalchemy.orm import Session

from advice.assessment_body import fields_body
from advice.effect import Effect, effect
from historian.sample_store import SampleStore
from loop.record import Record
from service.errors import InvalidRequest, NeverInForce
from service.loops.store import loop_with_id
from service.samples import samples_of
from service.sheets import store
from service.tables import LoopRow


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectAround:
    """What the data show before and after an instant, or in two periods."""

    loop_id: UUID
    changed_at: datetime
    before: tuple[datetime, datetime]
    after: tuple[datetime, datetime]
    effect: Effect


def effect_of_sheet(
    reading: Session,
    samples: SampleStore,
    loop_id: UUID,
    version: int,
    *,
    span: timedelta,
    changed_at: datetime | None,
) -> dict[str, object]:
    """Answer `effect_around` as a document.

    Raises
    ------
    NotFound, NoSamples, NeverInForce, InvalidRequest
        As there.
    """
    found = effect_around(reading, samples, loop_id, version, span=span, changed_at=changed_at)
    return {
        "loop_id": loop_id,
        "version": version,
        "changed_at": found.changed_at,
        "before": found.before,
        "after": found.after,
        "effect": fields_body(found.effect),
    }


def effect_around(
    reading: Session,
    samples: SampleStore,
    loop_id: UUID,
    version: int,
    *,
    span: timedelta,
    changed_at: datetime | None,
) -> EffectAround:
    """Compare the control error before and after a version came into force.

    The period after ends where the next version came into force: that is its effect, not this
    one's.

    Raises
    ------
    NotFound, NoSamples, NeverInForce
        The loop, the version or its data are not there, or it was never approved.
    InvalidRequest
        The periods would begin before, or end after, what a calendar holds.
    """
    loop = loop_with_id(reading, loop_id)
    sheet = store.sheet_with_version(reading, loop_id, version)
    if sheet.decision is None or sheet.decision.decision != "approved":
        raise NeverInForce(version, sheet.status)
    changed = changed_at or sheet.decision.created_at
    next_change = store.next_approval(reading, loop_id, sheet.decision)
    try:
        changed = changed.astimezone(UTC)
        begin, end = changed - span, changed + span
    except OverflowError as error:
        raise InvalidRequest("query/changed_at", "There is no calendar so long.") from error
    if next_change is not None:
        end = max(changed, min(next_change, end))
    before, after = (begin, changed), (changed, end)
    found = effect(_record(samples, loop, before), _record(samples, loop, after))
    return EffectAround(
        loop_id=loop_id, changed_at=changed, before=before, after=after, effect=found
    )


def effect_of_periods(
    reading: Session,
    samples: SampleStore,
    loop_id: UUID,
    before: tuple[datetime, datetime],
    after: tuple[datetime, datetime],
) -> dict[str, object]:
    """Compare the control error of two periods of a loop.

    Raises
    ------
    NotFound, NoSamples
        The loop or its data are not there.
    """
    loop = loop_with_id(reading, loop_id)
    found = effect(_record(samples, loop, before), _record(samples, loop, after))
    return {"loop_id": loop_id, "before": before, "after": after, "effect": fields_body(found)}


def _record(samples: SampleStore, loop: LoopRow, period: tuple[datetime, datetime]) -> Record:
    found = samples_of(samples, loop, *period)
    return found.record(tag=loop.tag, pv_unit=loop.pv_unit, op_unit=loop.op_unit)
