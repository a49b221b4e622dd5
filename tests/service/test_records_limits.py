"""Uploads that are cut off, too large, watched, or meet a full disk: nothing is half stored."""

import errno
import json
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from fastapi.testclient import TestClient
from pyarrow.parquet import ParquetWriter
from sqlalchemy import URL, select
from sqlalchemy.orm import Session, sessionmaker
from starlette.types import Message

from service.records import actions, receiving
from service.records.export import LoopExport
from service.settings import Settings
from service.tables import AuditRow, RecordRow

EXPORT = b"time,PV,OP\n" + b"".join(b"2026-01-31T08:%02d:00Z,%d,40\n" % (n, n) for n in range(5))


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """Say which database: it knows nothing of what these tests are about."""
    return sqlite_url


@pytest.fixture
def settings(data_folder: Path) -> Settings:
    return Settings(data=data_folder, max_upload_bytes=300_000)


@pytest.fixture
def records(tic101: dict[str, Any]) -> str:
    return f"/v1/loops/{tic101['id']}/records"


@pytest.fixture
def patch(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Change something for a while only."""
    with monkeypatch.context() as context:
        yield context


def send(client: TestClient, address: str, content: bytes = EXPORT, **query: str) -> Any:
    return client.post(address, files={"file": ("a.csv", content)}, params=query)


def stored(sessions: sessionmaker[Session]) -> tuple[int, int]:
    with sessions() as session:
        lines = session.scalars(select(AuditRow).where(AuditRow.action == "record.stored"))
        return len(session.scalars(select(RecordRow)).all()), len(lines.all())


def waiting(folder: Path) -> list[Path]:
    return [*(folder / "uploads").glob("*"), *(folder / "samples" / "_staging").glob("*")]


def full(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("place", [(receiving._Form, "write_to"), (ParquetWriter, "write_table")])
def test_a_full_disk_is_said_so_and_leaves_nothing(
    client: TestClient,
    records: str,
    sessions: sessionmaker[Session],
    data_folder: Path,
    patch: pytest.MonkeyPatch,
    place: tuple[type, str],
) -> None:
    patch.setattr(*place, full)
    answer = send(client, records)
    patch.undo()

    assert (answer.status_code, answer.json()["type"]) == (507, "/problems/storage-full")
    assert "Nothing was stored" in answer.json()["detail"]
    assert stored(sessions) == (0, 0)
    assert waiting(data_folder) == []
    assert send(client, records).json()["accounting"]["stored"]["new"] == 5


def test_its_progress_can_be_read_and_nobody_waits_for_it(
    client: TestClient, records: str, tic101: dict[str, Any], patch: pytest.MonkeyPatch
) -> None:
    record, seen = str(uuid4()), []
    really = LoopExport

    def watched(*arguments: Any, **options: Any) -> Any:
        options["progress"]._told = -1.0  # so that it is told at once
        options["progress"].tell("reading", 60, len(EXPORT))
        seen.append(client.get(f"{records}/{record}").json())
        other = {**tic101, "tag": "TIC-102"}
        body = {k: v for k, v in other.items() if k in ("tag", "pv_low", "pv_high", "pv_unit")}
        block = {"action": "direct", "form": "isa", "time_unit": "s", "gain_basis": "eu"}
        loop = client.post("/v1/loops", json={**body, **block})
        seen.append(loop.status_code)
        elsewhere = client.get(f"/v1/loops/{loop.json()['id']}/records/{record}")
        seen.append(elsewhere.status_code)
        return really(*arguments, **options)

    patch.setattr(actions, "LoopExport", watched)
    answer = send(client, records, id=record)

    pending = {"id": record, "loop_id": tic101["id"], "state": "pending"}
    told = {"stage": "reading", "done": 60, "total": len(EXPORT)}
    assert seen == [{**pending, "progress": told}, 201, 404]
    assert answer.json()["id"] == record
    assert client.get(f"{records}/{record}").json() == answer.json()


def test_an_id_that_is_taken_is_refused(client: TestClient, records: str) -> None:
    record = str(uuid4())
    assert send(client, records, id=record).status_code == 201
    assert send(client, records, id=record).status_code == 200
    answer = send(client, records, EXPORT.replace(b",40", b",41"), id=record)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == "query/id"
    assert client.get(f"{records}/{record}").json()["bytes"] == len(EXPORT)


def test_what_killed_processes_left_is_swept_and_their_progress_forgotten(
    client: TestClient, records: str, tic101: dict[str, Any], data_folder: Path
) -> None:
    folder = data_folder / "uploads"
    folder.mkdir()
    record = uuid4()
    note = {"loop_id": tic101["id"], "stage": "reading", "done": 1, "total": None}
    (folder / f"{record}.json").write_text(json.dumps(note))
    young, dead, note_of_dead = folder / "young", folder / "dead", folder / "dead.json"
    for path, age in ((young, 10.0), (dead, 100_000.0)):
        path.mkdir()
        (path / "upload.csv").write_bytes(b"half a file")
        os.utime(path, (time.time() - age,) * 2)
    note_of_dead.write_text("{}")
    os.utime(note_of_dead, (time.time() - 100_000.0,) * 2)

    assert client.get(f"{records}/{record}").json()["progress"]["total"] is None
    os.utime(folder / f"{record}.json", (time.time() - 3600,) * 2)
    assert client.get(f"{records}/{record}").status_code == 404
    assert send(client, records).status_code == 201
    assert young.exists()
    assert not dead.exists()
    assert not note_of_dead.exists()


def test_an_upload_that_is_cut_off_leaves_nothing(
    client: TestClient, records: str, sessions: sessionmaker[Session], data_folder: Path
) -> None:
    headers = {
        "authorization": client.headers["authorization"],
        "content-type": "multipart/form-data; boundary=x",
        "content-length": "200000",
    }
    start = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\n'
    waited: list[list[Path]] = []
    messages = iter([start + EXPORT, b"x" * 1000])
    sent: list[Message] = []

    async def receive() -> Message:
        waited.append(waiting(data_folder))
        piece = next(messages, None)
        if piece is None:
            return {"type": "http.disconnect"}
        return {"type": "http.request", "body": piece, "more_body": True}

    async def answer(message: Message) -> None:
        sent.append(message)

    scope = {
        "type": "http",
        "method": "POST",
        "path": records,
        "query_string": b"",
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
        "state": {},
    }
    assert client.portal is not None
    client.portal.call(client.app, scope, receive, answer)

    assert sent[0]["status"] == 422
    assert b"cut off before its end" in sent[1]["body"]
    assert waited[0]
    assert waiting(data_folder) == []
    assert stored(sessions) == (0, 0)


def test_an_upload_beyond_the_limit_is_refused_with_and_without_its_size(
    client: TestClient, records: str, data_folder: Path
) -> None:
    large = b"x" * 400_000
    head = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\n'

    def pieces() -> Iterator[bytes]:
        yield head
        for _ in range(400):
            yield b"x" * 1000

    kind = {"content-type": "multipart/form-data; boundary=x"}
    stated = send(client, records, large)
    unstated = client.post(records, content=pieces(), headers=kind)
    for answer in (stated, unstated):
        assert answer.status_code == 413
        assert answer.json()["type"] == "/problems/content-too-large"
    assert waiting(data_folder) == []


def test_of_large_files_one_is_worked_on_at_a_time(
    client: TestClient, records: str, patch: pytest.MonkeyPatch
) -> None:
    patch.setattr(actions, "LARGE", 10)
    answers: list[Any] = []
    contents = [EXPORT.replace(b",40", b",%d" % n) for n in range(3)]
    threads = [
        threading.Thread(target=lambda c=content: answers.append(send(client, records, c)))
        for content in contents
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [answer.status_code for answer in answers] == [201] * 3


def test_stored_uploads_are_counted_once(
    client: TestClient, anonymous: TestClient, records: str
) -> None:
    send(client, records)
    send(client, records)
    metrics = anonymous.get("/metrics").text
    assert "loopwright_uploads_total 1.0" in metrics
    assert f"loopwright_upload_bytes_total {len(EXPORT)}.0" in metrics
    assert "loopwright_upload_samples_total 5.0" in metrics
