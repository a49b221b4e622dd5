"""One job in the hands of a worker: its signs of life, its steps, and whether to stop."""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import timedelta
from typing import TypeAlias
from uuid import UUID

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from service.database import Database
from service.errors import NotReady
from service.jobs import store

# Several signs of life in a lease, so that one slow write does not lose the job.
HEARTBEAT = store.LEASE / 6


class TaskLost(Exception):
    """Another worker has taken the job over, because this one showed no life for too long."""


class TaskCancelled(Exception):
    """Somebody asked the job to stop, or the service does."""


@dataclass(slots=True, kw_only=True)
class Task:
    """A job that this worker holds.

    Attributes
    ----------
    held : Database
        Where the job and its results are kept.
    job_id : UUID
        The job.
    owner : str
        Name of this worker's hold on it.
    request : mapping
        What was asked for.
    author : str
        Who asked for it.
    done : int
        Steps that are stored already; work goes on after them.
    stopping : threading.Event
        Set when the service stops: the job is put down, and anybody may go on with it.
    """

    held: Database
    job_id: UUID
    owner: str
    request: Mapping[str, object]
    author: str
    done: int
    stopping: threading.Event
    _cancelled: bool = field(default=False, init=False)

    @contextmanager
    def step(self, *, done: int, total: int, message: str) -> Iterator[Session]:
        """Store results and how far the job is now, in one transaction.

        Raises
        ------
        TaskLost
            The job has another worker; nothing was stored.
        TaskCancelled
            What was stored stays, and the work ends here.
        """
        with self.held.transaction() as session:
            row = store.held_job(session, self.job_id, self.owner)
            if row is None:
                raise TaskLost
            yield session
            row.done, row.total, row.message = done, total, message
            row.lease_until = store.lease_end(session)
            cancelled = row.cancel
        self.done = done
        if cancelled or self.stopping.is_set():
            raise TaskCancelled

    def is_alive(self) -> bool:
        """Give a sign of life; false when the job is another worker's, or should stop."""
        with self.held.transaction() as session:
            row = store.held_job(session, self.job_id, self.owner)
            if row is None:
                return False
            row.lease_until = store.lease_end(session)
            return not row.cancel

    @contextmanager
    def signs_of_life(self, every: timedelta = HEARTBEAT) -> Iterator[None]:
        """Give signs of life from a thread of its own while the work goes on.

        A database that is away for a moment costs one of them and not all that would follow.
        """
        over = threading.Event()

        def beat() -> None:
            while not over.wait(every.total_seconds()):
                with suppress(SQLAlchemyError, NotReady):
                    if not self.is_alive():
                        return

        thread = threading.Thread(target=beat, name="signs of life", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


Kind: TypeAlias = Callable[[Task], Mapping[str, object]]
"""What one kind of job does: it works through its steps and answers a summary."""
