"""Jobs: taken once, seen at work, stopped, taken over from the dead, never done for ever."""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, date, datetime, time, timedelta
from typing import Any

import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError
from sqlalchemy import select, update
from sqlalchemy.exc import OperationalError

from service.actors import Actor, Role
from service.audit.actions import verify
from service.database import Database
from service.errors import NotReady
from service.jobs import store
from service.jobs.actions import add_job
from service.jobs.schedule import daily, due_days
from service.jobs.task import Kind, Task
from service.jobs.worker import Worker
from service.settings import Settings
from service.tables import AuditRow, JobRow, now

ANNA = Actor(owner="Anna", role=Role.ENGINEER)
STEPS = 5
Ask = Callable[..., JobRow]


def count_to_five(task: Task) -> Mapping[str, object]:
    for n in range(task.done, STEPS):
        with task.step(done=n + 1, total=STEPS, message=f"step {n + 1}"):
            pass
    return {"counted": STEPS}


@pytest.fixture
def ask(held: Database) -> Ask:
    def add(kind: str = "count", key: str = "count:1") -> JobRow:
        with held.sessions.begin() as session:
            return add_job(session, actor=ANNA, kind=kind, key=key, request={"to": STEPS})

    return add


@pytest.fixture
def read(held: Database) -> Callable[[JobRow], JobRow]:
    def again(job: JobRow) -> JobRow:
        with held.readings() as session:
            return store.job_with_id(session, job.id)

    return again


def worker(held: Database, kind: Kind = count_to_five) -> Worker:
    return Worker(held, {"count": kind})


def test_a_job_is_done_step_by_step_and_says_what_came_of_it(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow]
) -> None:
    job = ask()
    assert worker(held).work_once()

    done = read(job)
    assert (done.state, done.done, done.total) == ("done", STEPS, STEPS)
    assert done.result == {"counted": STEPS}
    assert done.finished_at is not None
    assert not worker(held).work_once(), "nothing is left to do"
    with held.readings() as session:
        assert list(session.scalars(select(AuditRow.action))) == ["job.added", "job.done"]
        assert verify(session).intact


def test_what_is_asked_for_twice_is_one_job(held: Database, ask: Ask) -> None:
    assert ask().id == ask().id
    with ThreadPoolExecutor(4) as threads:
        asked = list(threads.map(lambda _: ask(key="count:2").id, range(4)))
    assert len({*asked}) == 1
    with held.readings() as session:
        assert session.query(AuditRow).count() == 2


def test_many_workers_do_each_job_once(held: Database, ask: Ask) -> None:
    for n in range(20):
        ask(key=f"count:{n}")
    begun: list[object] = []

    def note(task: Task) -> Mapping[str, object]:
        begun.append(task.job_id)
        return count_to_five(task)

    def work(_: int) -> None:
        own = worker(held, note)
        while own.work_once():
            pass

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(work, range(4)))
    assert len(begun) == len({*begun}) == 20


def test_the_job_of_a_dead_worker_goes_on_where_it_stood(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow]
) -> None:
    job = ask()
    with held.sessions.begin() as session:
        assert store.claim_job(session, "dead") is not None
    dead = _task(held, job, "dead")
    for n in (1, 2):
        with dead.step(done=n, total=STEPS, message=""):
            pass
    assert not worker(held).work_once(), "as long as its lease runs it is the dead worker's"
    _let_the_lease_end(held)
    steps: list[int] = []

    def go_on(task: Task) -> Mapping[str, object]:
        steps.append(task.done)
        return count_to_five(task)

    assert worker(held, go_on).work_once()
    assert steps == [2]
    assert read(job).state == "done"
    assert read(job).attempts == 2


def test_a_worker_that_was_taken_for_dead_stores_nothing_more(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow]
) -> None:
    job = ask()

    def fall_asleep(task: Task) -> Mapping[str, object]:
        _let_the_lease_end(held)
        with held.sessions.begin() as session:
            assert store.claim_job(session, "another") is not None
        assert not task.is_alive()
        return count_to_five(task)

    assert worker(held, fall_asleep).work_once()
    assert (read(job).done, read(job).owner) == (0, "another")


def test_a_machine_whose_clock_is_wrong_takes_nobodys_job(
    postgresql_held: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    with postgresql_held.transaction() as session:
        job = add_job(session, actor=ANNA, kind="count", key="count", request={})
        store.claim_job(session, "a worker that is alive")

    monkeypatch.setattr(store, "now", lambda: now() + timedelta(days=1))

    assert not worker(postgresql_held).work_once()
    monkeypatch.setattr(store, "now", lambda: now() - timedelta(days=1))
    _let_the_lease_end(postgresql_held)
    with postgresql_held.transaction() as session:
        taken = store.claim_job(session, "another")
        assert taken is not None
        assert taken.id == job.id
        assert taken.lease_until is not None
        assert now() < taken.lease_until <= now() + store.LEASE


def test_a_job_that_kills_its_workers_is_given_up(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow]
) -> None:
    job = ask()
    for _ in range(store.MOST_ATTEMPTS):
        with held.sessions.begin() as session:
            assert store.claim_job(session, "doomed") is not None
        _let_the_lease_end(held)

    assert worker(held).work_once()
    assert read(job).state == "failed"
    assert read(job).message == "It was begun 5 times and never ended."


def test_a_cancelled_job_ends_after_the_step_it_is_at(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow], client: TestClient
) -> None:
    job = ask()

    def cancelled_midway(task: Task) -> Mapping[str, object]:
        answer = client.post(f"/v1/jobs/{job.id}/cancel")
        assert (answer.status_code, answer.json()["cancel"]) == (200, True)
        return count_to_five(task)

    assert worker(held, cancelled_midway).work_once()
    assert (read(job).state, read(job).done) == ("cancelled", 1)


def test_a_queued_job_that_is_cancelled_never_begins(
    held: Database, ask: Ask, client: TestClient
) -> None:
    job = ask()
    answer = client.post(f"/v1/jobs/{job.id}/cancel")

    assert answer.json()["state"] == "cancelled"
    assert not worker(held).work_once()
    again = client.post(f"/v1/jobs/{job.id}/cancel")
    assert (again.status_code, again.json()["type"]) == (409, "/problems/job-ended")


def test_a_service_that_stops_puts_its_job_down_for_the_next(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow]
) -> None:
    job = ask()
    stopped = worker(held)
    stopped.stopping.set()

    assert stopped.work_once()
    assert (read(job).state, read(job).done, read(job).attempts) == ("queued", 1, 0)
    assert worker(held).work_once()
    assert read(job).state == "done"


def test_a_reason_is_told_and_a_surprise_is_only_named(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow]
) -> None:
    def refuse(_: Task) -> Mapping[str, object]:
        raise ValueError("There is no loop to assess.")

    def stumble(_: Task) -> Mapping[str, object]:
        raise RuntimeError("a secret of the code")

    reason, surprise = ask(key="a"), ask(key="b")
    assert worker(held, refuse).work_once()
    assert worker(held, stumble).work_once()

    assert read(reason).message == "There is no loop to assess."
    assert read(surprise).state == "failed"
    assert "secret" not in read(surprise).message


def test_a_job_whose_database_went_away_goes_on_later(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow]
) -> None:
    job = ask()

    def cut_off(_: Task) -> Mapping[str, object]:
        raise OperationalError("select 1", {}, Exception("server closed the connection"))

    assert worker(held, cut_off).work_once()
    assert read(job).state == "running", "a restart of the database is no reason to give up"
    _let_the_lease_end(held)
    assert worker(held).work_once()
    assert read(job).state == "done"


@pytest.mark.parametrize("error", [NotReady(["The file is not there."]), TypeError("a surprise")])
def test_the_worker_outlives_whatever_goes_wrong_between_jobs(
    held: Database, ask: Ask, read: Callable[[JobRow], JobRow], error: Exception,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    job = ask()
    looks: list[int] = []

    def schedule() -> None:
        looks.append(1)
        if len(looks) == 1:
            raise error
        if read(job).state == "done":
            own.stopping.set()

    monkeypatch.setattr("service.jobs.worker.IDLE", 0.01)
    own = Worker(held, {"count": count_to_five}, schedule)
    own.run()
    assert read(job).state == "done"


def test_one_sign_of_life_that_fails_does_not_end_the_others(held: Database, ask: Ask) -> None:
    beats: list[int] = []
    again = threading.Event()

    def away_at_first() -> bool:
        beats.append(1)
        if len(beats) == 1:
            raise OperationalError("update job", {}, Exception("database is locked"))
        again.set()
        return True

    task = _Noted(_task(held, ask(), "slow"), away_at_first)
    with task.signs_of_life(timedelta(seconds=0.01)):
        assert again.wait(10)


def test_long_steps_give_signs_of_life(held: Database, ask: Ask) -> None:
    job = ask()
    with held.sessions.begin() as session:
        claimed = store.claim_job(session, "slow")
        assert claimed is not None
        claimed.lease_until = now() + timedelta(seconds=1)
    beaten = threading.Event()
    task = _task(held, job, "slow")
    alive = task.is_alive

    def noted() -> bool:
        answer = alive()
        beaten.set()
        return answer

    task_with_note = _Noted(task, noted)
    with task_with_note.signs_of_life(timedelta(seconds=0.01)):
        assert beaten.wait(30)
    with held.readings() as session:
        lease = store.job_with_id(session, job.id).lease_until
    assert lease is not None
    assert lease > now() + store.LEASE / 2


class _Noted(Task):
    """A task that tells when it gave a sign of life."""

    def __init__(self, task: Task, is_alive: Callable[[], bool]) -> None:
        super().__init__(
            held=task.held, job_id=task.job_id, owner=task.owner, request={}, author="",
            done=0, stopping=task.stopping,
        )  # fmt: skip
        self._noted = is_alive

    def is_alive(self) -> bool:
        return self._noted()


def test_jobs_are_listed_newest_first_in_pages(ask: Ask, client: TestClient) -> None:
    asked = [str(ask(key=f"count:{n}").id) for n in range(5)]
    seen: list[str] = []
    query: dict[str, Any] = {"limit": 2}
    while True:
        page = client.get("/v1/jobs", params=query).json()
        seen += [job["id"] for job in page["items"]]
        if page["next"] is None:
            break
        query["cursor"] = page["next"]
    assert seen == asked[::-1]
    assert client.get(f"/v1/jobs/{asked[0]}").json()["total"] is None


def test_a_job_that_is_not_there_is_said_so(client: TestClient) -> None:
    nowhere = "/v1/jobs/00000000-0000-0000-0000-000000000000"
    assert client.get(nowhere).status_code == 404
    assert client.post(f"{nowhere}/cancel").status_code == 404


@pytest.mark.parametrize(
    ("clock", "last", "days"),
    [
        ("2026-02-03T03:00", None, ["2026-02-02"]),
        ("2026-02-03T01:00", None, ["2026-02-01"]),
        ("2026-02-03T03:00", "2026-02-02", []),
        ("2026-02-03T03:00", "2026-01-30", ["2026-01-31", "2026-02-01", "2026-02-02"]),
        ("2026-02-03T03:00", "2025-01-30", [f"2026-01-{d}" for d in range(27, 32)]
         + ["2026-02-01", "2026-02-02"]),
    ],
)  # fmt: skip
def test_daily_runs_catch_up_a_week_at_most(clock: str, last: str | None, days: list[str]) -> None:
    found = due_days(
        time(2, 0),
        datetime.fromisoformat(clock).replace(tzinfo=UTC),
        None if last is None else date.fromisoformat(last),
    )
    assert [day.isoformat() for day in found] == days


def test_however_often_the_clock_is_looked_at_a_day_is_assessed_once(held: Database) -> None:
    clock = datetime(2026, 2, 3, 3, tzinfo=UTC)
    for _ in range(3):
        daily(held, time(2, 0), lambda: clock)()
    daily(held, time(2, 0), lambda: clock + timedelta(days=2))()

    with held.readings() as session:
        keys = sorted(session.scalars(select(JobRow.key)))
    days = ["2026-02-02", "2026-02-03", "2026-02-04"]
    assert keys == [f"daily:{day}" for day in days] + [f"tidy:{day}" for day in days]


def test_a_clock_that_was_years_ahead_once_does_not_end_the_daily_runs(held: Database) -> None:
    ahead, right = datetime(2099, 2, 3, 3, tzinfo=UTC), datetime(2026, 2, 3, 3, tzinfo=UTC)
    daily(held, time(2, 0), lambda: ahead)()
    daily(held, time(2, 0), lambda: right)()

    with held.readings() as session:
        assert store.job_with_key(session, "daily:2026-02-02") is not None


@pytest.mark.parametrize("stated", ["02:00", "02:00Z"])
def test_the_time_of_the_daily_run_is_utc(stated: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOOPWRIGHT_DAILY_AT", stated)
    at = Settings().daily_at
    assert at is not None
    assert due_days(at, datetime(2026, 2, 3, 3, tzinfo=UTC), None) == [date(2026, 2, 2)]
    monkeypatch.setenv("LOOPWRIGHT_DAILY_AT", "02:00+01:00")
    with pytest.raises(ValidationError, match="daily_at is a time in UTC"):
        Settings()


def _task(held: Database, job: JobRow, owner: str) -> Task:
    return Task(
        held=held, job_id=job.id, owner=owner, request={}, author="Anna", done=0,
        stopping=threading.Event(),
    )  # fmt: skip


def _let_the_lease_end(held: Database) -> None:
    with held.sessions.begin() as session:
        session.execute(update(JobRow).values(lease_until=now() - timedelta(seconds=1)))
