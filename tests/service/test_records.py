"""Uploads of exports: what is kept, what is refused, and that nothing is ever half stored."""

import gzip
import hashlib
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from sqlalchemy import URL, select
from sqlalchemy.orm import Session, sessionmaker

from service.tables import AuditRow, RecordRow

HEADINGS = "time,TIC-101.PV,TIC-101.SP,TIC-101.OP,TIC-101.MODE\n"


def export(rows: int = 5, *, first: int = 0, pv: float = 50.0) -> bytes:
    """Write an export of one row a minute."""
    lines = (
        f"2026-01-31T{8 + n // 60:02d}:{n % 60:02d}:00Z,{pv + n},50.0,{40 + n / 10},AUTO\n"
        for n in range(first, first + rows)
    )
    return (HEADINGS + "".join(lines)).encode()


@pytest.fixture
def database_url(sqlite_url: URL) -> URL:
    """Say which database: files and forms know nothing of it, test_records_stored.py tries both."""
    return sqlite_url


@pytest.fixture
def records(tic101: dict[str, Any]) -> str:
    """Give the address of the loop's records."""
    return f"/v1/loops/{tic101['id']}/records"


@pytest.fixture
def samples(tic101: dict[str, Any]) -> str:
    """Give the address of the loop's samples."""
    return f"/v1/loops/{tic101['id']}/samples"


@pytest.fixture
def stored(sessions: sessionmaker[Session], client: TestClient, samples: str) -> Callable[[], Any]:
    """Count what is stored: records, lines about them in the trail, samples."""

    def count() -> tuple[int, int, int]:
        with sessions() as session:
            rows = len(session.scalars(select(RecordRow)).all())
            lines = session.scalars(select(AuditRow).where(AuditRow.action == "record.stored"))
            return rows, len(lines.all()), client.get(samples).json()["samples"]

    return count


def send(
    client: TestClient,
    address: str,
    content: bytes,
    *,
    name: str = "export.csv",
    **fields: str | list[str],
) -> Any:
    return client.post(address, files={"file": (name, content)}, data=fields)


def left_behind(folder: Path) -> list[str]:
    """List what waits in the folder of uploads and in the store's own."""
    return [str(p) for f in ("uploads", "samples/_staging") for p in (folder / f).glob("*")]


def test_an_upload_is_stored_and_tells_everything_about_itself(
    client: TestClient, records: str, stored: Callable[[], Any], data_folder: Path
) -> None:
    content = export()

    answer = send(client, records, content)

    assert answer.status_code == 201, answer.text
    body = answer.json()
    assert answer.headers["location"] == f"{records}/{body['id']}"
    assert client.get(answer.headers["location"]).json() == body
    assert (body["state"], body["samples"], body["file_name"]) == ("stored", 5, "export.csv")
    assert (body["bytes"], body["sha256"]) == (len(content), hashlib.sha256(content).hexdigest())
    assert (body["first_time"], body["last_time"]) == (
        "2026-01-31T08:00:00Z",
        "2026-01-31T08:04:00Z",
    )
    assert body["decisions"]["delimiter"] == ","
    assert body["decisions"]["tags"]["op"] == "TIC-101.OP"
    assert body["accounting"]["rows_kept"] == 5
    assert body["accounting"]["stored"] == {
        "new": 5, "replaced": 0, "unchanged": 0, "repeated": 0
    }  # fmt: skip
    assert body["author"] == "admin person"
    assert stored() == (1, 1, 5)
    assert left_behind(data_folder) == []


def test_the_trail_has_one_line_about_it(
    client: TestClient, records: str, sessions: sessionmaker[Session]
) -> None:
    body = send(client, records, export()).json()

    with sessions() as session:
        line = session.scalars(select(AuditRow).where(AuditRow.action == "record.stored")).one()
    assert line.subject == f"{records.removeprefix('/v1/')}/{body['id']}"
    assert line.after is not None
    assert line.after["sha256"] == body["sha256"]
    assert line.after["samples"] == 5
    assert client.get("/v1/audit/verify").json()["intact"] is True


def test_the_same_file_again_is_the_same_record(
    client: TestClient, records: str, stored: Callable[[], Any]
) -> None:
    first = send(client, records, export())

    again = send(client, records, export(), name="copy of export.csv")

    assert (first.status_code, again.status_code) == (201, 200)
    assert again.json() == first.json()
    assert again.headers["location"] == first.headers["location"]
    assert stored() == (1, 1, 5)


def test_the_same_file_for_another_loop_or_read_another_way_is_another_record(
    client: TestClient, records: str, tic101: dict[str, Any], stored: Callable[[], Any]
) -> None:
    local = export().replace(b"Z,", b",")
    assert send(client, records, local, time_zone="UTC").status_code == 201
    assert send(client, records, local, time_zone="Europe/Berlin").status_code == 201
    assert stored() == (2, 2, 10)
    other = {k: v for k, v in tic101.items() if k in ("pv_low", "pv_high", "pv_unit", "action")}
    block = {"form": "isa", "time_unit": "s", "gain_basis": "eu"}
    loop = client.post("/v1/loops", json={"tag": "TIC-102", **other, **block}).json()
    assert (
        send(client, f"/v1/loops/{loop['id']}/records", local, time_zone="UTC").status_code == 201
    )
    assert stored() == (3, 3, 10)


def test_overlapping_exports_merge(client: TestClient, records: str, samples: str) -> None:
    send(client, records, export(5))

    body = send(client, records, export(5, first=3, pv=60.0)).json()

    assert body["accounting"]["stored"] == {
        "new": 3, "replaced": 2, "unchanged": 0, "repeated": 0
    }  # fmt: skip
    assert client.get(samples).json()["pv"]["values"] == [50, 51, 52, 63, 64, 65, 66, 67]


def test_records_are_listed_newest_first_a_page_at_a_time(client: TestClient, records: str) -> None:
    ids = [send(client, records, export(2, first=n)).json()["id"] for n in (0, 2, 4)]

    first = client.get(records, params={"limit": 2}).json()
    second = client.get(records, params={"limit": 2, "cursor": first["next"]}).json()

    assert [item["id"] for item in first["items"] + second["items"]] == ids[::-1]
    assert second["next"] is None
    assert client.get(records, params={"cursor": "eHg"}).status_code == 422


def test_a_record_belongs_to_its_loop(client: TestClient, records: str) -> None:
    body = send(client, records, export()).json()
    block = {"form": "isa", "time_unit": "s", "gain_basis": "eu", "action": "direct"}
    loop = {"tag": "FIC-1", "pv_low": 0.0, "pv_high": 1.0, "pv_unit": "t/h", **block}
    other = client.post("/v1/loops", json=loop).json()["id"]

    assert client.get(f"/v1/loops/{other}/records/{body['id']}").status_code == 404
    assert client.get(f"/v1/loops/{other}/records").json()["items"] == []
    assert client.get(f"/v1/loops/{other}/samples").json()["samples"] == 0
    nowhere = f"/v1/loops/{uuid4()}"
    for path in ("records", f"records/{body['id']}", "samples"):
        assert client.get(f"{nowhere}/{path}").status_code == 404
    assert send(client, f"{nowhere}/records", export()).status_code == 404


def test_a_packed_export_is_unpacked(client: TestClient, records: str) -> None:
    archive = BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("../../export.csv", export())
    for content in (gzip.compress(export()), archive.getvalue()):
        assert send(client, records, content).json()["samples"] == 5


def test_what_the_sender_states_decides(client: TestClient, records: str, samples: str) -> None:
    content = (
        b"when;what;how;m\n01.02.2026 08:00;1,5;40;2\n02.02.2026 08:00;2,5;41;2\n"
        b"03.02.2026 08:00;3,5;42;7\n"
    )
    answer = send(
        client, records, content,
        time="when", pv="what", op="3", mode="m", delimiter=";", decimal=",",
        day_first="true", time_zone="Europe/Berlin", mode_code=["2=AUTO", "7=man"],
    )  # fmt: skip

    assert answer.status_code == 201, answer.text
    body = client.get(samples).json()
    assert body["pv"] == {
        "time": [f"2026-02-0{day}T07:00:00.000000Z" for day in (1, 2, 3)],
        "values": [1.5, 2.5, 3.5],
    }
    assert body["mode"] == {
        "time": ["2026-02-01T07:00:00.000000Z", "2026-02-03T07:00:00.000000Z"],
        "values": ["AUTO", "MAN"],
    }
    assert body["sp"] == {"time": [], "values": []}


def test_elapsed_time_needs_its_start(client: TestClient, records: str, samples: str) -> None:
    content = b"t [s],PV,OP\n" + b"".join(b"%d,%d,1\n" % (n, n * n) for n in range(10))

    refused = send(client, records, content)
    taken = send(client, records, content, start="2026-01-31T09:00:00+01:00")

    assert refused.status_code == 422
    assert "start=2026-01-31T08:00:00Z" in refused.json()["detail"]
    assert taken.status_code == 201, taken.text
    assert client.get(samples).json()["first_time"] == "2026-01-31T08:00:00Z"


def test_the_loops_own_tag_chooses_among_several_loops(
    client: TestClient, records: str, samples: str
) -> None:
    both = (
        b"time,TIC-101.PV,TIC-101.OP,TIC-7.PV,TIC-7.OP\n"
        b"2026-01-31T08:00:00Z,1,2,3,4\n2026-01-31T08:01:00Z,1,2,3,4\n"
    )
    body = send(client, records, both).json()
    assert client.get(samples).json()["pv"]["values"] == [1, 1]
    assert body["decisions"]["other_loops"] == ["TIC-7"]
    assert send(client, records, both, tag="TIC-7").status_code == 201
    assert client.get(samples).json()["pv"]["values"] == [3, 3]
    nameless = b"time,PV,OP\n2026-01-31T08:00:00Z,7,2\n2026-01-31T08:01:00Z,7,2\n"
    assert send(client, records, nameless, tag="any name").status_code == 201
    strangers = both.replace(b"TIC-101", b"TIC-8")
    answer = send(client, records, strangers)
    assert answer.status_code == 422
    assert answer.json()["type"] == "/problems/ambiguous-columns"


REFUSED = {
    "empty": (b"", {}, "is empty"),
    "a PDF": (b"%PDF-1.7 x", {}, "a PDF document"),
    "no signals": (b"time,x\n2026-01-31T08:00:00Z,1\n", {}, "PV"),
    "no zone": (export().replace(b"Z,", b","), {}, "time_zone=Europe/Berlin"),
    "unknown zone": (export().replace(b"Z,", b","), {"time_zone": "Mars/Base"}, "Mars/Base"),
    "no such loop": (export(), {"tag": "TIC-9"}, "TIC-9"),
    "no such column": (export(), {"pv": "nothing"}, "nothing"),
    "damaged gzip": (gzip.compress(export() * 99)[:-40], {}, "damaged or cut off"),
    "damaged zip": (b"PK\x03\x04" + b"x" * 50, {}, "damaged or cut off"),
    "too late": (
        b"t [s],PV,OP\n0,1,1\n100,2,2\n200,3,3\n", {"start": "2199-12-31T23:58:00Z"}, "1970 to 2199"
    ),
    "elapsed for ever": (
        b"t [s],PV,OP\n0,1,1\n1e12,2,2\n2e12,3,3\n", {"start": "2026-01-31T08:00:00Z"}, "unit"
    ),
}  # fmt: skip


def test_a_file_that_cannot_be_used_is_refused_in_words_and_leaves_nothing(
    client: TestClient, records: str, stored: Callable[[], Any], data_folder: Path
) -> None:
    for case, (content, fields, words) in REFUSED.items():
        answer = send(client, records, content, **fields)

        assert answer.status_code == 422, (case, answer.text)
        assert answer.headers["content-type"] == "application/problem+json"
        assert words in answer.text, case
        assert left_behind(data_folder) == []
    assert stored() == (0, 0, 0)


WRONG_FIELDS: list[tuple[dict[str, Any], str]] = [
    ({"decimal": ";"}, "body/decimal"),
    ({"nonsense": "1"}, "body/nonsense"),
    ({"header_line": "-1"}, "body/header_line"),
    ({"time_format": "guess"}, "body"),
    ({"mode_code": "AUTO"}, "body"),
    ({"pv": ["1", "2"]}, "body/pv"),
    ({"start": "1769846400"}, "body/start"),
    ({"start": "2026-01-31T08:00:00"}, "body/start"),
    ({"tag": "x" * 201}, "body/tag"),
    ({"layout": "tall"}, "body/layout"),
]


def test_a_form_that_cannot_be_is_refused_with_its_field(client: TestClient, records: str) -> None:
    for fields, pointer in WRONG_FIELDS:
        answer = send(client, records, export(), **fields)

        assert answer.status_code == 422, fields
        assert pointer in [fault["pointer"] for fault in answer.json()["errors"]]


def test_a_viewer_may_read_and_not_upload(
    client_as: Callable[..., TestClient], client: TestClient, records: str, samples: str
) -> None:
    send(client, records, export())
    viewer = client_as("viewer")

    assert send(viewer, records, export(9)).status_code == 403
    assert len(viewer.get(records).json()["items"]) == 1
    assert viewer.get(samples).json()["samples"] == 5
    assert send(client_as("engineer"), records, export(9)).status_code == 201


def test_nobody_without_a_key_gets_anywhere(
    anonymous: TestClient, records: str, samples: str
) -> None:
    for answer in (send(anonymous, records, export()), anonymous.get(samples)):
        assert answer.status_code == 401


FILE_NAMES = [
    ("../../../etc/passwd", "passwd"),
    ("C:\\exports\\FIC 7.csv", "FIC 7.csv"),
    ("..", "upload"),
    ("x" * 500 + ".csv", "x" * 200),
    ("a\u202eb.csv", "ab.csv"),
    ("Zulauf Ä.csv", "Zulauf Ä.csv"),
]


def test_a_file_name_is_only_ever_a_name(
    client: TestClient, records: str, data_folder: Path
) -> None:
    before = {path.name for path in data_folder.parent.iterdir()}
    for number, (given, kept) in enumerate(FILE_NAMES):
        body = send(client, records, export(2 + number), name=given).json()
        assert body["file_name"] == kept
    assert {path.name for path in data_folder.parent.iterdir()} == before


def test_a_file_that_unpacks_beyond_the_limit_is_refused(
    client: TestClient, app: FastAPI, records: str, data_folder: Path
) -> None:
    app.state.settings = app.state.settings.model_copy(update={"max_upload_bytes": 1_000_000})
    bomb = gzip.compress(HEADINGS.encode() + b"2026-01-31T08:00:00Z,1,1,1,AUTO\n" * 1_000_000)
    assert len(bomb) < 200_000

    answer = send(client, records, bomb)

    assert answer.status_code == 413
    assert answer.json()["type"] == "/problems/export-too-large"
    assert left_behind(data_folder) == []


def form_of(*parts: bytes, end: bytes = b"--x--\r\n") -> bytes:
    return b"".join(b"--x\r\n" + part + b"\r\n" for part in parts) + end


FILE = b'Content-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\n' + export()
FORM = "multipart/form-data; boundary=x"
BODIES: dict[str, tuple[str | None, bytes, str]] = {
    "no content type": (None, FILE, "multipart/form-data"),
    "json": ("application/json", b"{}", "multipart/form-data"),
    "no boundary": ("multipart/form-data", form_of(FILE), "multipart/form-data"),
    "long boundary": (f"multipart/form-data; boundary={'x' * 300}", b"", "Boundary length"),
    "other boundary": ("multipart/form-data; boundary=y", form_of(FILE), "no multipart form"),
    "cut off": (FORM, form_of(FILE)[:-30], "cut off before its end"),
    "cut off before the last line": (FORM, form_of(FILE, end=b""), "cut off before its end"),
    "nothing": (FORM, b"", "cut off before its end"),
    "no file": (FORM, form_of(b'Content-Disposition: form-data; name="tag"\r\n\r\nx'), "no part"),
    "two files": (FORM, form_of(FILE, FILE), "one file"),
    "a long field": (
        FORM,
        form_of(b'Content-Disposition: form-data; name="tag"\r\n\r\n' + b"x" * 20_000, FILE),
        "longer than",
    ),
    "a field that is no text": (
        FORM, form_of(b'Content-Disposition: form-data; name="tag"\r\n\r\n\xff\xfe', FILE), "UTF-8"
    ),
    "many parts": (
        FORM,
        form_of(*[b'Content-Disposition: form-data; name="tag"\r\n\r\nx'] * 90, FILE),
        "more than 60 parts",
    ),
    "a huge header": (FORM, form_of(b"X: " + b"x" * 9_000 + b"\r\n" + FILE), "no multipart form"),
    "many headers": (FORM, form_of(b"X: 1\r\n" * 50 + FILE), "no multipart form"),
    "no disposition": (FORM, form_of(b"X: 1\r\n\r\nabc", FILE), "body/"),
}  # fmt: skip


def test_a_body_that_is_no_whole_form_is_refused_in_words(
    client: TestClient, records: str, stored: Callable[[], Any], data_folder: Path
) -> None:
    for case, (kind, body, words) in BODIES.items():
        headers = {"content-type": kind} if kind else {}
        answer = client.post(records, content=body, headers=headers)

        assert answer.status_code == 422, (case, answer.text)
        assert words in answer.text, case
        assert left_behind(data_folder) == []
    assert stored() == (0, 0, 0)
