"""Killed with -9 in the middle of uploads: what was answered is there, and nothing is double."""

import multiprocessing
import os
import random
import signal
import time
from multiprocessing.context import ForkServerContext
from pathlib import Path
from uuid import UUID

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL, select

from historian.sample_store import SampleStore
from loop.errors import NoSamples
from service.actors import Actor, Role
from service.audit.actions import verify
from service.database import Database
from service.records import actions
from service.records.progress import Progress
from service.records.receiving import Upload
from service.records.waiting import uploads_folder
from service.tables import AuditRow, RecordRow

ANNA = Actor(owner="Anna", role=Role.ENGINEER)
ROWS = 30
KILLS = 5


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """Say which database: test_crash.py holds both to their transactions."""
    return sqlite_url


def export(number: int) -> bytes:
    """Write export n, which overlaps the one before it by ten minutes."""
    stamps = np.datetime64("2026-01-31T08:00", "m") + 20 * number + np.arange(ROWS)
    rows = "".join(f"{stamp}:00Z,{number},40\n" for stamp in stamps)
    return f"time,PV,OP\n{rows}".encode()


def store_upload(
    held: Database, store: SampleStore, data: Path, loop_id: UUID, number: int
) -> None:
    """Do what the route does with a file that has come in."""
    path = data / f"{number}.csv"
    path.write_bytes(export(number))
    upload = Upload(
        path=path,
        file_name=path.name,
        sha256=f"{number:064x}",
        size=path.stat().st_size,
        fields={},
        progress=Progress(uploads_folder(data), loop_id=loop_id, record_id=UUID(int=number)),
    )
    stored = actions.store_samples(held, store, loop_id=loop_id, upload=upload, max_bytes=10**6)
    if not isinstance(stored, RecordRow):
        with held.sessions.begin() as session:
            actions.add_record(session, actor=ANNA, loop_id=loop_id, upload=upload, stored=stored)


def upload_without_end(url: URL, data: Path, loop_id: UUID, first: int, answered: Path) -> None:
    held, store = Database.at(url), SampleStore(data / "samples")
    with answered.open("ab", buffering=0) as notes:
        for number in range(first, first + 10_000):
            store_upload(held, store, data, loop_id, number)
            notes.write(f"{number}\n".encode())


def expected(uploads: int) -> list[float]:
    """Lay the first uploads over each other in plain Python."""
    cells = {20 * number + row: float(number) for number in range(uploads) for row in range(ROWS)}
    return [cells[minute] for minute in sorted(cells)]


def check(held: Database, store: SampleStore, loop_id: UUID, answered: int) -> None:
    with held.readings() as session:
        records = [row.file_name for row in session.scalars(select(RecordRow))]
        told = select(AuditRow.after).where(AuditRow.action == "record.stored")
        lines = [str((after or {})["file_name"]) for after in session.scalars(told)]
        assert verify(session).intact
    assert len(records) in (answered, answered + 1)
    assert sorted(records) == sorted(lines) == sorted(f"{n}.csv" for n in range(len(records)))
    try:
        pv = store.read(loop_id).pv.tolist()
    except NoSamples:
        pv = []
    # the samples go in first: at most those of the upload under way are there without a record
    assert pv in (expected(len(records)), expected(answered + 1))


@pytest.fixture(scope="module")
def forking() -> ForkServerContext:
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["service.app", "fastapi.testclient", "pytest", "pandas"])
    return context


def test_killed_at_random_instants_of_uploads(
    forking: ForkServerContext,
    database_url: URL,
    held: Database,
    client: TestClient,
    data_folder: Path,
    tmp_path: Path,
) -> None:
    block = {"action": "reverse", "form": "isa", "time_unit": "s", "gain_basis": "eu"}
    loop = {"tag": "TIC-101", "pv_low": 0.0, "pv_high": 1.0, "pv_unit": "degC", **block}
    loop_id = UUID(client.post("/v1/loops", json=loop).json()["id"])
    answered, done = tmp_path / "answered", 0
    answered.touch()
    chance = random.Random(11)  # noqa: S311 - an instant, not a secret

    for _ in range(KILLS):
        worker = forking.Process(
            target=upload_without_end, args=(database_url, data_folder, loop_id, done, answered)
        )
        worker.start()
        deadline = time.monotonic() + 60
        while len(answered.read_text().split()) == done:
            assert worker.is_alive()
            assert time.monotonic() < deadline
            time.sleep(0.002)
        time.sleep(chance.uniform(0.0, 0.1))
        assert worker.pid is not None
        os.kill(worker.pid, signal.SIGKILL)
        worker.join()

        numbers = [int(line) for line in answered.read_text().split()]
        assert numbers == [*range(len(numbers))]
        done = len(numbers)
        check(held, SampleStore(data_folder / "samples", dead_after=0.0), loop_id, done)

    store = SampleStore(data_folder / "samples")
    for number in range(done + 2):  # simply sent again
        store_upload(held, store, data_folder, loop_id, number)
    check(held, store, loop_id, done + 2)
