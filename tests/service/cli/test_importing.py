"""`loopwright import`: a file on the server stored as an upload is, by somebody with a name."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL
from sqlalchemy.orm import Session, sessionmaker

from service.cli import run
from service.cli.keys import SERVER
from service.keys.actions import revoke_key

Said = Callable[[], tuple[str, str]]
HEATER = Path(__file__).parents[3] / "docs" / "tutorial" / "heater-step.csv"
ELAPSED = "t [s],PV,OP\n" + "".join(f"{i},{20 + i % 3},{40 + i % 2}\n" for i in range(50))
AMBIGUOUS = "Time,PV,OP\n03/04/2026 08:00:00,20.5,40\n03/04/2026 08:00:01,20.6,41\n"


@pytest.fixture(params=["sqlite"])
def database_url(request: pytest.FixtureRequest) -> URL:
    """One kind will do, except for what is stored."""
    url: URL = request.getfixturevalue(f"{request.param}_url")
    return url


@pytest.fixture
def anna(acting_as: Callable[[str, str], str]) -> str:
    return acting_as("Anna", "engineer")


def records(client: TestClient, loop: dict[str, Any]) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = client.get(f"/v1/loops/{loop['id']}/records").json()["items"]
    return items


@pytest.mark.parametrize("database_url", ["sqlite", "postgresql"], indirect=True)
@pytest.mark.usefixtures("anna")
def test_an_import_is_the_record_that_an_upload_would_be(
    client: TestClient, tic101: dict[str, Any], said: Said
) -> None:
    assert run(["import", str(HEATER), "--loop", "TIC-101"]) == 0

    out, err = said()
    (record,) = records(client, tic101)
    assert f"Record {record['id']} of TIC-101" in out
    assert "2250 rows: 2250 kept, 0 rejected, 0 duplicates; 0 gaps" in out
    assert "pv TIC-900.PV" in out
    assert "audit head" in err
    assert record["author"] == "Anna"
    assert record["file_name"] == "heater-step.csv"
    with HEATER.open("rb") as file:
        sent = client.post(f"/v1/loops/{tic101['id']}/records", files={"file": file})
    assert sent.status_code == 200  # the same file was stored before
    assert sent.json() == record
    read = client.get(f"/v1/loops/{tic101['id']}/samples").json()
    assert read["samples"] == 2250


def test_an_import_again_changes_nothing(
    client: TestClient, tic101: dict[str, Any], said: Said, anna: str
) -> None:
    assert run(["import", str(HEATER), "--loop", "TIC-101"]) == 0
    (before,) = client.get("/v1/audit?action=record.stored").json()["items"]
    assert (before["actor"], before["key_id"]) == ("Anna", anna)
    said()

    assert run(["import", str(HEATER), "--loop", "TIC-101"]) == 0

    assert "stored before" in said()[0]
    assert len(records(client, tic101)) == 1
    assert client.get("/v1/audit?action=record.stored").json()["items"] == [before]


@pytest.mark.usefixtures("tic101", "anna")
def test_what_the_file_does_not_say_is_stated(
    client: TestClient, tmp_path: Path, said: Said, sentence: Callable[[], str]
) -> None:
    elapsed, ambiguous = tmp_path / "elapsed.csv", tmp_path / "ambiguous.csv"
    elapsed.write_text(ELAPSED)
    ambiguous.write_text(AMBIGUOUS)
    columns = ["--pv", "PV", "--op", "3", "--time", "1"]

    assert run(["import", str(elapsed), "--loop", "TIC-101", *columns]) == 1
    assert "start" in sentence()
    stated = [*columns, "--start", "2026-01-31T08:00:00Z"]
    assert run(["import", str(elapsed), "--loop", "TIC-101", *stated]) == 0
    assert "50 samples, 2026-01-31 08:00:00Z to 2026-01-31 08:00:49Z" in said()[0]

    assert run(["import", str(ambiguous), "--loop", "TIC-101"]) == 1
    assert "03/04/2026" in sentence()
    stated = ["--day-first", "--time-zone", "Europe/Berlin"]
    assert run(["import", str(ambiguous), "--loop", "TIC-101", *stated]) == 0
    assert "2026-04-03 06:00:00Z" in said()[0]
    assert client.get("/v1/audit/verify").json()["intact"] is True


def test_without_a_key_nothing_is_stored(
    sessions: sessionmaker[Session],
    client: TestClient,
    tic101: dict[str, Any],
    acting_as: Callable[[str, str], str],
    monkeypatch: pytest.MonkeyPatch,
    sentence: Callable[[], str],
) -> None:
    call = ["import", str(HEATER), "--loop", "TIC-101"]
    assert run(call) == 2
    assert "set LOOPWRIGHT_KEY to your API key" in sentence()

    monkeypatch.setenv("LOOPWRIGHT_KEY", f"lw_{'0' * 12}_{'A' * 43}")
    assert run(call) == 2
    assert "LOOPWRIGHT_KEY is not valid, or was revoked" in sentence()

    acting_as("Vera", "viewer")
    assert run(call) == 1
    assert sentence() == "loopwright: This needs the role engineer; the key has the role viewer."

    public = acting_as("Egon", "engineer")
    with sessions.begin() as session:
        revoke_key(session, actor=SERVER, key_id=public)
    assert run(call) == 2
    assert "revoked" in sentence()
    assert records(client, tic101) == []


@pytest.mark.usefixtures("tic101", "anna")
@pytest.mark.parametrize(
    ("arguments", "code", "because"),
    [
        ([str(HEATER), "--loop", "TIC-999"], 1, "There is no loop TIC-999"),
        (["no-such.csv", "--loop", "TIC-101"], 2, "there is no file no-such.csv"),
        ([str(HEATER)], 2, "Missing option '--loop'"),
        ([str(HEATER), "--loop", "TIC-101", "--tag", "TIC-4"], 1, "TIC-4"),
        ([str(HEATER), "--loop", "TIC-101", "--pv", "nose"], 1, "nose"),
        ([str(HEATER), "--loop", "TIC-101", "--decimal", ";"], 2, "decimal: "),
        ([str(HEATER), "--loop", "TIC-101", "--mode-code", "1"], 2, "CODE=MODE"),
        ([str(HEATER), "--loop", "TIC-101", "--start", "yesterday"], 2, "--start"),
    ],
)
def test_what_cannot_be_imported_is_said(
    client: TestClient,
    arguments: list[str],
    code: int,
    because: str,
    sentence: Callable[[], str],
) -> None:
    assert run(["import", *arguments]) == code
    assert because in sentence()
    assert client.get("/v1/audit?action=record.stored").json()["items"] == []


@pytest.mark.usefixtures("tic101", "anna")
def test_a_file_beyond_the_limit_is_refused(
    monkeypatch: pytest.MonkeyPatch, sentence: Callable[[], str]
) -> None:
    monkeypatch.setenv("LOOPWRIGHT_MAX_UPLOAD_BYTES", "50000")
    assert run(["import", str(HEATER), "--loop", "TIC-101"]) == 1
    assert "50,000 bytes" in sentence()
