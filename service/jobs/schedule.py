"""What is due by the clock: yesterday's assessment of all loops, and tidying the sample store.

A daily run is a job under the key of its date. However often and in however many processes this
looks, each date gets one; dates on which the service stood still are caught up.
"""

from collections.abc import Callable
from datetime import UTC, date, datetime, time, timedelta

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from service.database import Database
from service.jobs.actions import SCHEDULE, add_job
from service.tables import JobRow, now

DAILY = "daily:"
# Older days are history that a person asks for when they want it.
CATCH_UP = timedelta(days=7)


def due_days(at: time, clock: datetime, last: date | None) -> list[date]:
    """List the days whose daily run is due: after the last one there was, up to yesterday.

    Parameters
    ----------
    at : time
        Time of the daily run, UTC.
    clock : datetime
        The time now.
    last : date, optional
        Day of the last run; none when there never was one, and then only yesterday is due.
    """
    today = clock.astimezone(UTC)
    newest = today.date() - timedelta(days=1 if today.time() >= at else 2)
    if last is None:
        return [newest]
    first = max(last + timedelta(days=1), newest - CATCH_UP + timedelta(days=1))
    return [first + timedelta(days=n) for n in range((newest - first).days + 1)]


def daily(held: Database, at: time, clock: Callable[[], datetime] = now) -> Callable[[], None]:
    """Give the function that adds the daily jobs that are due."""

    def add_due() -> None:
        moment = clock()
        with held.readings() as session:
            days = due_days(at, moment, _last_day(session, moment))
        for day in days:
            with held.transaction() as session:
                start = datetime.combine(day, time(), UTC)
                add_job(
                    session,
                    actor=SCHEDULE,
                    kind="assess",
                    key=f"{DAILY}{day.isoformat()}",
                    request={"start": start, "end": start + timedelta(days=1)},
                )
                add_job(
                    session,
                    actor=SCHEDULE,
                    kind="tidy",
                    key=f"tidy:{day.isoformat()}",
                    request={},
                )

    return add_due


def _last_day(session: Session, clock: datetime) -> date | None:
    """Name the last day there was a run for; days to come, from a clock once wrong, don't count."""
    today = f"{DAILY}{clock.astimezone(UTC).date().isoformat()}"
    runs = JobRow.key.startswith(DAILY) & (JobRow.key <= today)
    key = session.scalar(select(func.max(JobRow.key)).where(runs))
    return None if key is None else date.fromisoformat(key.removeprefix(DAILY))
