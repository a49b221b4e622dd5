"""Local time to UTC: the hour that repeats in autumn, the hour that is missing in spring."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import lru_cache
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np

from historian.errors import ExportRefused
from historian.streams import Integers
from historian.timestamps import SECOND
from loop.signals import Flags

_DAY = 86400
_SPAN = 400 * _DAY  # whole spans, so that the tags of one file share them
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def zone_named(name: str) -> ZoneInfo:
    """Find a time zone by its name.

    Raises
    ------
    ExportRefused
        For a name that is no zone.
    """
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise ExportRefused(
            f"The time zone {name!r} is not known; use a name such as 'Europe/Berlin' or 'UTC'."
        ) from error


@dataclass(frozen=True, slots=True)
class Change:
    """One change of the offset from UTC.

    Attributes
    ----------
    instant : int
        When, since 1970 in UTC. [s]
    before, after : int
        Offset from UTC before and after. [s]
    """

    instant: int
    before: int
    after: int


@lru_cache(maxsize=64)
def changes_between(zone: ZoneInfo, first: int, last: int) -> tuple[int, tuple[Change, ...]]:
    """List the changes of a zone's offset.

    Parameters
    ----------
    zone : ZoneInfo
    first, last : int
        Seconds since 1970 in UTC.

    Returns
    -------
    offset : int
        Offset at `first`. [s]
    changes : tuple of Change
    """
    start = offset = _offset(zone, first)
    changes = []
    for day in range(first, last + _DAY, _DAY):
        later = _offset(zone, day + _DAY)
        if later != offset:
            low, high = day, day + _DAY
            while high - low > 1:
                middle = (low + high) // 2
                low, high = (low, middle) if _offset(zone, middle) == later else (middle, high)
            changes.append(Change(high, offset, later))
            offset = later
    return start, tuple(changes)


def _offset(zone: ZoneInfo, instant: int) -> int:
    moment = (_EPOCH + timedelta(seconds=instant)).astimezone(zone)
    return int((moment.utcoffset() or timedelta()).total_seconds())


@dataclass(frozen=True, slots=True, eq=False)
class Converted:
    """Local times as instants.

    Attributes
    ----------
    instants : ndarray of int64, shape (n,)
        Since 1970 in UTC. [ns]
    missing : ndarray of bool, shape (n,)
        Local times that the clock jumped over in spring.
    unclear : ndarray of bool, shape (n,)
        Local times that occurred twice in autumn, where the order of rows does not tell which.
    """

    instants: Integers
    missing: Flags
    unclear: Flags


def to_utc(local: Integers, zone: ZoneInfo) -> Converted:
    """Convert local times of one tag, in the order of the file, to UTC.

    In the hour that repeats in autumn the clock steps back exactly once: rows before the step are
    summer time, rows after it winter time. Without such a step, or with several, the hour stays
    unclear.

    Parameters
    ----------
    local : ndarray of int64, shape (n,)
        Since 1970 as the clock showed. [ns]
    zone : ZoneInfo
    """
    missing = np.zeros(local.size, dtype=np.bool_)
    unclear = np.zeros(local.size, dtype=np.bool_)
    if not local.size:
        return Converted(local, missing, unclear)
    first, last = int(local.min()) // SECOND, int(local.max()) // SECOND
    offset, changes = changes_between(
        zone, (first // _SPAN - 1) * _SPAN, (last // _SPAN + 2) * _SPAN
    )
    instants = local - offset * SECOND
    rising = local[-1] >= local[0]
    for change in changes:
        begins = (change.instant + max(change.before, change.after)) * SECOND
        ends = (change.instant + min(change.before, change.after)) * SECOND
        instants[local >= begins] += (change.before - change.after) * SECOND
        low, high = min(begins, ends), max(begins, ends)
        rows = np.flatnonzero((local >= low) & (local < high))
        if not rows.size:
            continue
        if change.after > change.before:
            missing[rows] = True
        else:
            _repeat(local, rows, change, rising, instants, unclear)
    return Converted(instants, missing, unclear)


def _repeat(
    local: Integers,
    rows: Integers,
    change: Change,
    rising: bool,
    instants: Integers,
    unclear: Flags,
) -> None:
    """Tell the two passes through the repeated hour apart by the step back of the clock."""
    steps = np.diff(local[rows])
    back = np.flatnonzero(steps <= 0 if rising else steps >= 0)
    summer = local[rows] - change.before * SECOND
    winter = local[rows] - change.after * SECOND
    if back.size != 1:
        unclear[rows] = True
        instants[rows] = summer
        return
    earlier = np.arange(rows.size) <= back[0]
    instants[rows] = np.where(earlier == rising, summer, winter)
