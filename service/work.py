"""The installation's worker: every kind of job, and what is due by the clock."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from advice.fleet import Crew, local_crew
from service.assessments.work import assess_period
from service.database import Database
from service.jobs.schedule import daily
from service.jobs.task import Kind
from service.jobs.worker import Worker, tidy_samples
from service.samples import open_samples
from service.settings import Settings

LONGEST_GOODBYE = 30.0  # s for the step at hand; a job put down later is taken over all the same


def kinds(settings: Settings, crew: Crew | None = None) -> Mapping[str, Kind]:
    """List what this installation's jobs do.

    Parameters
    ----------
    settings : Settings
        Where the samples are, and how many processes may work.
    crew : callable, optional
        What to work with in place of processes of this machine.
    """
    samples = open_samples(settings)
    crew = crew or local_crew(settings.job_processes)
    return {
        "assess": partial(assess_period, samples, crew),
        "tidy": partial(tidy_samples, samples),
    }


@contextmanager
def working(settings: Settings) -> Iterator[None]:
    """Do jobs in a thread of its own while the service answers."""
    held = Database.at(settings.url)
    schedule = None if settings.daily_at is None else daily(held, settings.daily_at)
    worker = Worker(held, kinds(settings), schedule)
    thread = threading.Thread(target=worker.run, name="jobs", daemon=True)
    thread.start()
    try:
        yield
    finally:
        worker.stopping.set()
        thread.join(LONGEST_GOODBYE)
        held.engine.dispose()
