"""The job that assesses many loops of one period, out of the sample store."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from datetime import UTC, datetime, time, timedelta
from typing import TypeAlias
from uuid import UUID

from advice.fleet import Crew, FleetLoop, LoopResult, assess_fleet
from historian.sample_store import SampleStore
from historian.samples import Samples
from loop.errors import NoSamples
from monitoring.known_loop import KnownLoop
from service.assessments import store
from service.assessments.actions import assessment_row, fleet_loop
from service.assessments.schemas import AssessLoop, AssessLoops
from service.jobs.task import Task
from service.sheets.in_force import known_loops
from service.tables import LoopRow

Teller: TypeAlias = Callable[[list[LoopResult], int, int], None]
# Loops stored in one transaction: seldom enough for the database, often enough to watch.
LOOPS_A_STEP = 32
# To start processes takes as long as to assess some loops here.
WORTH_PROCESSES = 16


def assess_period(
    samples: SampleStore, crew: Crew | None, task: Task, tell: Teller | None = None
) -> Mapping[str, object]:
    """Assess the loops of a job that are not stored yet, and store them step by step.

    Parameters
    ----------
    samples : SampleStore
        Routine data.
    crew : callable or None
        What to work with; None for this process alone.
    task : Task
        The job.
    tell : callable, optional
        Told what was stored just now, and how many of how many loops are done.
    """
    wanted = AssessLoops.model_validate(task.request)
    period = AssessLoop(start=wanted.start, end=wanted.end)
    with task.held.readings() as session:
        loops = {str(row.id): row for row in store.loops_to_assess(session, wanted.loop_ids)}
        stored = {str(loop_id) for loop_id in store.assessed_loops(session, task.job_id)}
        known = known_loops(
            session, [row.id for row in loops.values()], start=period.start, end=period.end
        )
    total, left = len(loops), {name: row for name, row in loops.items() if name not in stored}
    step: list[LoopResult] = []
    done = total - len(left)

    def store_step() -> None:
        with task.step(done=done, total=total, message=f"{done} of {total} loops") as session:
            session.add_all(
                assessment_row(
                    one,
                    loop_id=UUID(one.name),
                    job_id=task.job_id,
                    period=period,
                    author=task.author,
                )
                for one in step
            )
        if tell is not None:
            tell(step.copy(), done, total)
        step.clear()

    store_step()
    helpers = crew if len(left) >= WORTH_PROCESSES else None
    ready = _with_samples(samples, left, period, known)
    with closing(assess_fleet(ready, crew=helpers)) as found:
        for one in found:
            step.append(one)
            done += 1
            if len(step) == LOOPS_A_STEP:
                store_step()
    assessed = done
    store_step()
    return {"loops": total, "assessed": assessed, "without_samples": total - assessed}


def _with_samples(
    samples: SampleStore,
    loops: Mapping[str, LoopRow],
    period: AssessLoop,
    known: Mapping[UUID, KnownLoop],
) -> Iterator[FleetLoop]:
    """Read the loops that have samples in the period."""
    for name, found in _samples(samples, loops, period):
        if len(found):
            yield fleet_loop(loops[name], found, known.get(loops[name].id))


def _samples(
    samples: SampleStore, loops: Mapping[str, LoopRow], period: AssessLoop
) -> Iterator[tuple[str, Samples]]:
    start = period.start.astimezone(UTC)
    midnight = datetime.combine(start.date(), time(), UTC)
    if start == midnight and period.end - period.start == timedelta(days=1):
        # The store keeps a day of all loops together: far quicker than one loop after the other.
        yield from (
            (name, found) for name, found in samples.read_day(start.date()) if name in loops
        )
        return
    for name in loops:
        try:
            yield name, samples.read(name, period.start, period.end)
        except NoSamples:
            continue
