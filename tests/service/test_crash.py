"""The service is killed with -9 amid uploads and approvals: what it answered is there, once.

Two clients upload to one loop while a third drafts and approves its sheets. Each sends what was not
answered again to the service that is started after, as a person would.
"""

import itertools
import os
import random
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx2
import numpy as np
import pytest
from sqlalchemy import URL, func, select
from sqlalchemy.orm import Session

from historian.sample_store import SampleStore
from service.actors import Role
from service.audit.actions import verify
from service.audit.store import head
from service.database import Database
from service.keys.actions import create_key
from service.records.waiting import DEAD_AFTER, JUST_MADE
from service.settings import Settings
from service.tables import AuditRow, RecordRow, SheetDecisionRow, SheetRow
from tests.service.served import Running, Services

KILLS = {"sqlite": 40, "postgresql": 10}
PATIENCE = 60.0  # s
ANSWERS = 2  # to wait for, at most, before a kill
ROWS = 24
START = datetime(2026, 1, 31, 22, tzinfo=UTC)
LOOP = {
    "tag": "TIC-101", "pv_low": 0.0, "pv_high": 1.0, "pv_unit": "degC", "action": "reverse",
    "form": "isa", "time_unit": "s", "gain_basis": "eu",
}  # fmt: skip


def start_of(number: int) -> datetime:
    return START + timedelta(minutes=10 * number)


def times_of(number: int) -> list[datetime]:
    """Give upload n ten minutes of its own; every 144th of them reaches into the next day."""
    return [start_of(number) + timedelta(seconds=25 * row - 5) for row in range(ROWS)]


def export(number: int) -> bytes:
    rows = [f"{time:%Y-%m-%dT%H:%M:%SZ},{number},40\n" for time in times_of(number)]
    return f"time,PV,OP\n{''.join(rows)}".encode()


@dataclass(kw_only=True)
class Client(ABC):
    """Somebody who works with the service until it is killed, and goes on once it is back."""

    token: str
    loop: str
    numbers: Iterator[int]
    answers: threading.Semaphore = field(init=False)
    waiting: int | None = None
    cut_off: int = 0

    def work(self, running: Running, *, until_answered: bool = False) -> None:
        """Send one thing after the other until the connection breaks, or all is answered."""
        headers = {"Authorization": f"Bearer {self.token}"}
        with httpx2.Client(base_url=running.address, headers=headers, timeout=PATIENCE) as http:
            try:
                while not until_answered or self.waiting is not None:
                    if self.waiting is None:
                        self.waiting = next(self.numbers)
                    self.send(http, self.waiting)
                    self.waiting = None
                    self.answers.release()
            except httpx2.ConnectError:
                return
            except httpx2.TransportError:
                self.cut_off += 1
            finally:
                self.answers.release(ANSWERS)  # nobody waits for one who is gone

    @abstractmethod
    def send(self, http: httpx2.Client, number: int) -> None:
        """Do one piece of work; it may have been done before."""


@dataclass(kw_only=True)
class Uploader(Client):
    records: dict[int, str] = field(default_factory=dict)
    landed: bool = False

    def send(self, http: httpx2.Client, number: int) -> None:
        answer = http.post(
            f"/v1/loops/{self.loop}/records", files={"file": (f"{number}.csv", export(number))}
        )
        assert answer.status_code == (200 if self.landed else 201), answer.text
        self.landed = False
        self.records[number] = answer.json()["id"]


@dataclass(kw_only=True)
class Approver(Client):
    """Drafts and approves, one draft a number; the reason of a draft tells its number."""

    drafter_token: str
    approved: list[int] = field(default_factory=list)

    def send(self, http: httpx2.Client, number: int) -> None:
        sheets = f"/v1/loops/{self.loop}/sheets"
        reason = f"draft {number}"
        known = [s for s in http.get(sheets).json()["items"] if s["reason"] == reason]
        assert len(known) <= 1
        if not known:
            known = [self._draft(http, sheets, reason)]
        sheet = known[0]
        if sheet["status"] == "draft":
            answer = http.post(
                f"{sheets}/{sheet['version']}/approve",
                json={"reason": "fine"},
                headers={"If-Match": http.get(f"{sheets}/{sheet['version']}").headers["etag"]},
            )
            assert answer.status_code == 200, answer.text
            sheet = answer.json()
        assert sheet["status"] == "approved"
        self.approved.append(sheet["version"])

    def _draft(self, http: httpx2.Client, sheets: str, reason: str) -> dict[str, object]:
        settings = {"form": "isa", "Kc": 1.0, "Ti": 60.0, "anti_windup": "clamping"}
        answer = http.post(
            sheets,
            json={"settings": settings, "reason": reason},
            headers={"Authorization": f"Bearer {self.drafter_token}"},
        )
        assert answer.status_code == 201, answer.text
        self.answers.release()
        drafted: dict[str, object] = answer.json()
        return drafted


@dataclass(kw_only=True)
class Plant:
    """One installation, the clients that work with it, and what they were answered."""

    settings: Settings
    uploaders: list[Uploader]
    approver: Approver
    known_head: str = "0" * 64

    @property
    def clients(self) -> list[Client]:
        return [*self.uploaders, self.approver]

    def check(self) -> None:
        """Hold everything that was answered so far against what is stored."""
        with self.reading() as session:
            names = list(session.scalars(select(RecordRow.file_name)))
            approvals = set(
                session.scalars(select(SheetDecisionRow.version).where(
                    SheetDecisionRow.decision == "approved"
                ))
            )  # fmt: skip
            chain = verify(session, known_head=self.known_head)
            self.known_head = head(session).hash
        assert chain.intact, chain
        assert len(names) == len({*names}), "an upload is there twice"
        assert {*self.approver.approved} <= approvals, "an approval that was answered is lost"
        for uploader in self.uploaders:
            answered = {f"{number}.csv" for number in uploader.records}
            assert answered <= {*names}, "an upload that was answered is lost"
            if uploader.waiting is not None:
                uploader.landed = f"{uploader.waiting}.csv" in names
                self._check_all_or_nothing(uploader)

    def _check_all_or_nothing(self, uploader: Uploader) -> None:
        assert uploader.waiting is not None
        times = times_of(uploader.waiting)
        store = SampleStore(self.settings.data / "samples")
        kept = sum(
            len(part)
            for part in store.read_in_parts(
                uploader.loop, times[0], times[-1] + timedelta(seconds=1)
            )
        )
        assert kept in ((ROWS,) if uploader.landed else (0, ROWS))

    @contextmanager
    def reading(self) -> Iterator[Session]:
        held = Database.at(self.settings.url)
        with held.readings() as session:
            yield session
        held.engine.dispose()


@pytest.fixture(scope="module")
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    with Services(tmp_path_factory.mktemp("services") / "log") as services:
        yield services


@pytest.fixture
def plant(database_url: URL, data_folder: Path, services: Services) -> Plant:
    settings = Settings(
        data=data_folder,
        database_url=database_url.render_as_string(hide_password=False),
        daily_at=None,
    )
    held = Database.at(database_url)
    with held.sessions.begin() as session:
        _, engineer = create_key(session, owner="Anna", role=Role.ENGINEER)
        _, approver = create_key(session, owner="Berta", role=Role.APPROVER)
    held.engine.dispose()
    running = services.start(settings)
    headers = {"Authorization": f"Bearer {engineer}"}
    answer = httpx2.post(
        f"{running.address}/v1/loops", json=LOOP, headers=headers, timeout=PATIENCE
    )
    loop = answer.json()["id"]
    services.kill(running)
    numbers = itertools.count()
    return Plant(
        settings=settings,
        uploaders=[Uploader(token=engineer, loop=loop, numbers=numbers) for _ in range(2)],
        approver=Approver(
            token=approver, drafter_token=engineer, loop=loop, numbers=itertools.count()
        ),
    )


def test_killed_at_random_instants_of_uploads_and_approvals(
    plant: Plant, services: Services, database_url: URL
) -> None:
    chance = random.Random(20260131)  # noqa: S311
    kills = KILLS[database_url.get_backend_name()]

    for _ in range(kills):
        running = services.start(plant.settings)
        plant.check()
        with ThreadPoolExecutor(len(plant.clients)) as threads:
            for client in plant.clients:
                client.answers = threading.Semaphore(0)
            work = [threads.submit(client.work, running) for client in plant.clients]
            watched = chance.choice(plant.clients)
            for _ in range(chance.randint(0, ANSWERS)):
                watched.answers.acquire(timeout=PATIENCE)
            time.sleep(chance.uniform(0, 0.1))
            services.kill(running)
        for done in work:
            done.result()

    grow_old(plant.settings.data)
    running = services.start(plant.settings)
    plant.check()
    for client in plant.clients:
        client.answers = threading.Semaphore(0)
        client.waiting = next(client.numbers) if client.waiting is None else client.waiting
        client.work(running, until_answered=True)
    plant.check()
    assert list((plant.settings.data / "uploads").iterdir()) == []
    assert list((plant.settings.data / "samples").rglob("*#*")) == []
    services.stop(running)
    check_everything(plant)
    assert services.logged(level="error") == []
    assert plant.approver.cut_off > 0
    assert sum(uploader.cut_off for uploader in plant.uploaders) > kills / 2


def grow_old(data: Path) -> None:
    """Let time pass for what killed services left: uploads, notes about them, staging files."""
    ages = {data / "uploads": JUST_MADE, data / "samples": DEAD_AFTER}
    for folder, age in ages.items():
        for path in folder.rglob("*"):
            past = time.time() - 1 - (age if path.is_dir() else DEAD_AFTER)
            os.utime(path, (past, past))


def check_everything(plant: Plant) -> None:
    """Count every row there is: each belongs to one thing that a client did."""
    records = {n: id_ for uploader in plant.uploaders for n, id_ in uploader.records.items()}
    with plant.reading() as session:
        rows = session.scalars(select(RecordRow)).all()
        reasons = list(session.scalars(select(SheetRow.reason).order_by(SheetRow.version)))
        decided = dict(
            session.execute(select(SheetDecisionRow.version, SheetDecisionRow.approval)).all()
        )
        subjects = list(session.scalars(select(AuditRow.subject)))
        actions = dict(
            session.execute(select(AuditRow.action, func.count()).group_by(AuditRow.action)).all()
        )
    assert {row.file_name: str(row.id) for row in rows} == {
        f"{number}.csv": id_ for number, id_ in records.items()
    }
    assert {row.samples for row in rows} == {ROWS}
    drafts = len(plant.approver.approved)
    assert reasons == [f"draft {number}" for number in range(drafts)]
    assert decided == {version: version for version in range(1, drafts + 1)}
    assert plant.approver.approved == sorted(decided)
    assert actions == {
        "key.created": 2, "loop.created": 1, "record.stored": len(rows),
        "sheet.drafted": drafts, "sheet.approved": drafts,
    }  # fmt: skip
    told = [subject for subject in subjects if "/records/" in subject]
    assert sorted(told) == sorted(f"loops/{row.loop_id}/records/{row.id}" for row in rows)

    kept = SampleStore(plant.settings.data / "samples").read(rows[0].loop_id)
    cells = sorted((time, float(number)) for number in records for time in times_of(number))
    stamps = [np.datetime64(time.replace(tzinfo=None), "us") for time, _ in cells]
    assert kept.time.tolist() == np.array(stamps).tolist()
    assert kept.pv.tolist() == [pv for _, pv in cells]
    assert set(kept.op.tolist()) == {40.0}
