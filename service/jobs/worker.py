"""The worker: takes one job after the other, does it, and notes how it ended."""

import os
import socket
import threading
from collections.abc import Callable, Mapping
from uuid import UUID, uuid4

import structlog
from sqlalchemy.exc import OperationalError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from historian.sample_store import SampleStore
from loop.errors import LoopError, StoreBusy
from service import audit
from service.actors import Actor, Role
from service.database import Database
from service.errors import NotReady, ServiceError
from service.jobs import store
from service.jobs.actions import end_job
from service.jobs.task import Kind, Task, TaskCancelled, TaskLost

log = structlog.get_logger()

# What passes: the same step may well succeed in a minute.
_AWAY = (OperationalError, PoolTimeout, NotReady, StoreBusy)
IDLE = 2.0  # s between two looks for work: a daily run waits hours, a person watches seconds


class Worker:
    """Does jobs until it is told to stop.

    Parameters
    ----------
    held : Database
        Where the jobs are.
    kinds : mapping of str to callable
        What to do for each kind of job.
    schedule : callable, optional
        Called between jobs; it adds those that are due.
    """

    def __init__(
        self,
        held: Database,
        kinds: Mapping[str, Kind],
        schedule: Callable[[], None] | None = None,
    ) -> None:
        self._held = held
        self._kinds = kinds
        self._schedule = schedule
        self.stopping = threading.Event()

    def run(self) -> None:
        """Work until told to stop; nothing else ends it, and a database that is away is waited for.

        Whatever goes wrong is logged and tried again: a worker that died of it would leave the
        service answering, and no job done.
        """
        while not self.stopping.is_set():
            try:
                if self._schedule is not None:
                    self._schedule()
                if self.work_once():
                    continue
            except (SQLAlchemyError, NotReady) as error:
                log.warning("job database", reason=type(error).__name__)
            except Exception:
                log.exception("jobs")
            self.stopping.wait(IDLE)

    def work_once(self, job_id: UUID | None = None) -> bool:
        """Do the oldest job that nobody does, or a certain one; false when there is none."""
        owner = f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:8]}"
        with self._held.transaction() as session:
            row = store.claim_job(session, owner, job_id)
            if row is None:
                return False
            task = Task(
                held=self._held,
                job_id=row.id,
                owner=owner,
                request=row.request,
                author=row.author,
                done=row.done,
                stopping=self.stopping,
            )
            kind, attempts, cancelled = row.kind, row.attempts, row.cancel
        if attempts > store.MOST_ATTEMPTS:
            self._end(task, "failed", f"It was begun {attempts - 1} times and never ended.")
        elif cancelled:
            self._end(task, "cancelled", "Cancelled.")
        else:
            self._work(task, kind)
        return True

    def _work(self, task: Task, kind: str) -> None:
        try:
            with task.signs_of_life():
                result = self._kinds[kind](task)
        except TaskLost:
            log.warning("job lost", job=str(task.job_id))
        except TaskCancelled:
            self._put_down(task)
        except _AWAY as error:
            # Not the job's fault: it stays held until its lease ends, and then goes on.
            log.warning("job interrupted", job=str(task.job_id), reason=type(error).__name__)
        except (LoopError, ServiceError, ValueError) as error:
            self._end(task, "failed", str(error))
        except Exception:
            incident = uuid4().hex[:12]
            log.exception("job failed", job=str(task.job_id), incident=incident)
            self._end(task, "failed", f"It failed unexpectedly; the log tells why at {incident}.")
        else:
            self._end(task, "done", "Done.", result)

    def _put_down(self, task: Task) -> None:
        """End a job that was cancelled; one that only its service leaves is anybody's again."""
        with self._held.transaction() as session:
            row = store.held_job(session, task.job_id, task.owner)
            if row is not None and not row.cancel:
                row.state, row.owner, row.lease_until = "queued", None, None
                row.attempts -= 1
                return
        self._end(task, "cancelled", "Cancelled; what was finished is stored.")

    def _end(
        self, task: Task, state: str, message: str, result: Mapping[str, object] | None = None
    ) -> None:
        with self._held.transaction() as session:
            row = store.held_job(session, task.job_id, task.owner)
            if row is None:
                return
            end_job(row, state, message, result)
            audit.record(
                session,
                actor=Actor(owner="worker", role=Role.ENGINEER),
                action=f"job.{state}",
                subject=f"jobs/{task.job_id}",
                after={"message": message, "done": row.done, "total": row.total},
            )
        log.info("job ended", job=str(task.job_id), state=state, done=task.done)


def tidy_samples(samples: SampleStore, task: Task) -> Mapping[str, object]:
    """Join small files of the sample store and remove those that were replaced long ago."""
    done = samples.tidy()
    with task.step(done=1, total=1, message="The sample store is tidy."):
        pass
    return {"joined": done.joined, "deleted": done.deleted}
