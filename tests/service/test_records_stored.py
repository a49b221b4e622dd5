"""Uploads and the database that keeps their records, of both kinds."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import event, select
from sqlalchemy.exc import OperationalError
from sqlalchemy.orm import Session, sessionmaker

from service.records import actions
from service.tables import AuditRow, RecordRow

EXPORT = b"time,PV,OP\n" + b"".join(b"2026-01-31T08:%02d:00Z,%d,40\n" % (n, n) for n in range(5))


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


def test_a_commit_that_fails_stores_no_record_and_the_file_can_be_sent_again(
    client: TestClient, records: str, sessions: sessionmaker[Session], data_folder: Path
) -> None:
    def refuse(_: Session) -> None:
        raise OperationalError("COMMIT", None, Exception("the database is gone"))

    event.listen(sessions, "before_commit", refuse)
    answer = send(client, records)
    event.remove(sessions, "before_commit", refuse)

    assert (answer.status_code, answer.json()["type"]) == (503, "/problems/database-unavailable")
    assert stored(sessions) == (0, 0)
    assert waiting(data_folder) == []
    again = send(client, records)
    assert again.status_code == 201
    assert again.json()["accounting"]["stored"]["unchanged"] == 5
    assert send(client, records).status_code == 200
    assert stored(sessions) == (1, 1)


def test_the_same_file_sent_twice_at_once_is_one_record(
    client: TestClient, records: str, sessions: sessionmaker[Session], patch: pytest.MonkeyPatch
) -> None:
    really, inner = actions.add_record, []

    def overtaken(*arguments: Any, **options: Any) -> tuple[RecordRow, bool]:
        patch.undo()
        inner.append(send(client, records))
        return really(*arguments, **options)

    patch.setattr(actions, "add_record", overtaken)
    outer = send(client, records)

    assert (inner[0].status_code, outer.status_code) == (201, 200)
    assert inner[0].json() == outer.json()
    assert stored(sessions) == (1, 1)
    assert client.get("/v1/audit/verify").json()["intact"] is True
