"""The audit trail, also against somebody who owns the database."""

import hashlib
import json
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import URL, text
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session, sessionmaker
from structlog.testing import capture_logs

from service import audit
from service.actors import Actor, Role
from service.audit import actions
from service.audit.chain import GENESIS, Break, line_hash, verify_chain, verify_export
from service.database import Database
from service.errors import UnauditedChange
from service.tables import AuditRow, LoopRow
from service.triggers import drop_statements

ANNA = Actor(owner="Anna", role=Role.ENGINEER, key_id="0123456789ab")
Body = dict[str, Any]


@pytest.fixture
def five_lines(held: Database) -> Database:
    """Write five lines of audit trail, each in its own transaction."""
    for n in range(1, 6):
        write_line(held, n)
    return held


def write_line(held: Database, n: int) -> None:
    with held.sessions.begin() as session:
        audit.record(
            session,
            actor=ANNA,
            action="loop.changed",
            subject=f"loops/{n}",
            before={"gain": n / 3, "tags": ["Ä", None]},
            after={"gain": n * 1e21, "on": True, "at": {"b": 1, "a": 2.0}},
        )


def as_owner(held: Database, *statements: str) -> None:
    """Do what only the owner of the database can: take the triggers away, then anything."""
    with held.engine.begin() as connection:
        for statement in (*drop_statements(held.engine.dialect.name), *statements):
            connection.exec_driver_sql(statement)


def verdict(held: Database, known_head: str | None = None) -> tuple[bool, int, Break | None]:
    with held.readings() as session:
        found = actions.verify(session, known_head=known_head)
    return found.intact, found.rows, found.first_broken


def test_an_untouched_chain_is_intact(five_lines: Database) -> None:
    assert verdict(five_lines) == (True, 5, None)


def test_an_empty_chain_is_intact(held: Database) -> None:
    with held.readings() as session:
        found = actions.verify(session, known_head=GENESIS)

    assert (found.intact, found.rows, found.head, found.known_head_row) == (True, 0, GENESIS, 0)


TAMPERINGS = {
    "a name": "UPDATE audit SET actor = 'Mallory' WHERE id = 3",
    "a number": 'UPDATE audit SET after = \'{"gain": 3, "on": true}\' WHERE id = 3',
    "null for values": "UPDATE audit SET before = NULL WHERE id = 3",
    "the key": "UPDATE audit SET key_id = NULL WHERE id = 3",
    "the time": "UPDATE audit SET at = '2020-01-01 00:00:00.000000' WHERE id = 3",
    "the loop": "UPDATE audit SET loop_id = '00000000000000000000000000000001' WHERE id = 3",
    "the hash": "UPDATE audit SET hash = 'f' WHERE id = 3",
    "the link": "UPDATE audit SET previous = 'f' WHERE id = 3",
    "no number at all": "UPDATE audit SET before = '{\"gain\": 1e999}' WHERE id = 3",
    "a line gone": "DELETE FROM audit WHERE id = 3",
    "a line pushed in": "INSERT INTO audit SELECT 0, at, actor, key_id, action, subject, loop_id, "
    "before, after, 'e', 'f' FROM audit WHERE id = 3",
    "a line before the first": "INSERT INTO audit SELECT -7, at, actor, key_id, action, subject, "
    "loop_id, before, after, 'e', 'f' FROM audit WHERE id = 3",
    "a line after the last": "INSERT INTO audit SELECT 6, at, actor, key_id, action, subject, "
    "loop_id, before, after, 'e', 'f' FROM audit WHERE id = 3",
}
BROKEN_AT = {"a line pushed in": 1, "a line before the first": 1, "a line after the last": 6}


@pytest.mark.parametrize("what", TAMPERINGS)
def test_a_change_by_the_owner_of_the_database_is_named(five_lines: Database, what: str) -> None:
    as_owner(five_lines, TAMPERINGS[what])

    intact, rows, broken = verdict(five_lines)

    assert not intact
    assert broken is not None
    assert broken.row == BROKEN_AT.get(what, 3)
    assert rows == broken.row - 1
    assert broken.reason


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE audit SET before = '{\"gain\": ' WHERE id = 3",
        "UPDATE audit SET before = '{\"gain\": NaN}' WHERE id = 3",
        "UPDATE audit SET before = '[1]' WHERE id = 3",
        "UPDATE audit SET before = '{\"\\ud800\": 1}' WHERE id = 3",
        "UPDATE audit SET at = 'yesterday' WHERE id = 3",
        "UPDATE audit SET loop_id = 'no id' WHERE id = 3",
    ],
)
def test_what_sqlite_lets_in_and_nobody_can_read_is_named_too(
    sqlite_held: Database, statement: str
) -> None:
    for n in range(1, 6):
        write_line(sqlite_held, n)
    as_owner(sqlite_held, statement)

    intact, rows, broken = verdict(sqlite_held)

    assert (intact, rows) == (False, 2)
    assert broken is not None
    assert broken.row == 3


def test_lines_cut_off_at_the_end_show_against_the_stated_head(five_lines: Database) -> None:
    as_owner(five_lines, "DELETE FROM audit WHERE id > 3")

    assert verdict(five_lines) == (
        False,
        3,
        Break(row=4, reason="The trail ends after 3 lines, its head states 5."),
    )


def test_lines_cut_off_with_their_head_show_only_against_a_known_head(
    five_lines: Database,
) -> None:
    with five_lines.readings() as session:
        known = actions.verify(session).head
        third = session.get_one(AuditRow, 3).hash
    as_owner(
        five_lines,
        "DELETE FROM audit WHERE id > 3",
        f"UPDATE audit_head SET lines = 3, hash = '{third}'",  # noqa: S608
    )

    assert verdict(five_lines)[0], "nothing inside the database can show it"
    intact, rows, broken = verdict(five_lines, known)
    assert (intact, rows) == (False, 3)
    assert broken is not None
    assert "known head" in broken.reason
    assert verdict(five_lines, third)[0]


def test_a_chain_written_anew_shows_only_against_a_known_head(five_lines: Database) -> None:
    """The strongest attack: every hash recomputed after a change of the second line."""
    with five_lines.readings() as session:
        known = actions.verify(session).head
    with five_lines.engine.begin() as connection:
        for statement in drop_statements(five_lines.engine.dialect.name):
            connection.exec_driver_sql(statement)
    with five_lines.sessions.begin() as session:
        from service.audit import store

        previous = GENESIS
        for n in range(1, 6):
            row = session.get_one(AuditRow, n)
            row.actor = "Mallory" if n == 2 else row.actor
            row.previous = previous
            row.hash = previous = line_hash(store.line(row))
            session.flush()
        store.head(session).hash = previous

    assert verdict(five_lines)[0], "the chain itself is consistent"
    assert not verdict(five_lines, known)[0]


def test_a_known_head_is_found_where_it_was(five_lines: Database) -> None:
    with five_lines.readings() as session:
        heads = [session.get_one(AuditRow, n).hash for n in range(1, 6)]
    for n, head in enumerate(heads, start=1):
        with five_lines.readings() as session:
            assert actions.verify(session, known_head=head).known_head_row == n


def test_a_second_line_after_the_same_one_is_refused(five_lines: Database) -> None:
    """Even without triggers and locks a fork has no place: `previous` is unique."""
    with five_lines.readings() as session:
        fourth = session.get_one(AuditRow, 4).hash
    statement = (
        "INSERT INTO audit SELECT 6, at, actor, key_id, action, subject, loop_id, before, after, "
        "'fourth', 'f' FROM audit WHERE id = 5"
    ).replace("fourth", fourth)

    with pytest.raises(IntegrityError):
        as_owner(five_lines, statement)


def test_the_head_moves_on_by_one_only(five_lines: Database) -> None:
    for change in ("lines = lines + 2", "lines = lines - 1", "hash = 'x'", "id = 2"):
        with (
            pytest.raises(Exception, match=r"only moves on|ck_audit_head_single|single"),
            five_lines.engine.begin() as connection,
        ):
            connection.execute(text(f"UPDATE audit_head SET {change}"))  # noqa: S608


def test_threads_at_once_never_fork_the_chain(held: Database) -> None:
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda n: write_line(held, n), range(1, 41)))

    assert verdict(held) == (True, 40, None)


def write_many(url: URL, count: int) -> None:
    held = Database.at(url)
    for n in range(1, count + 1):
        write_line(held, n)
    held.engine.dispose()


def test_processes_at_once_never_fork_the_chain(database_url: URL, held: Database) -> None:
    spawn = multiprocessing.get_context("spawn")
    writers = [spawn.Process(target=write_many, args=(database_url, 15)) for _ in range(3)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join(60)

    assert [writer.exitcode for writer in writers] == [0, 0, 0]
    assert verdict(held) == (True, 45, None)


def test_a_change_that_is_rolled_back_leaves_no_line_and_no_head(five_lines: Database) -> None:
    with capture_logs() as logs, five_lines.sessions() as session:
        audit.record(session, actor=ANNA, action="loop.changed", subject="loops/6")
        session.rollback()

    assert logs == []
    assert verdict(five_lines) == (True, 5, None)
    write_line(five_lines, 6)
    assert verdict(five_lines) == (True, 6, None)


def test_the_head_goes_to_the_log_once_it_is_committed(held: Database) -> None:
    with capture_logs() as logs:
        write_line(held, 1)
    with held.readings() as session:
        head = actions.verify(session).head

    assert logs == [{"event": "audit head", "row": 1, "head": head, "log_level": "info"}]


def test_a_change_without_a_line_is_refused(
    client: TestClient, sessions: sessionmaker[Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit, "record", lambda *_, **__: None)

    answer = client.post("/v1/loops", json=loop_named("TIC-101"))

    assert answer.status_code == 500
    with sessions() as session:
        assert session.query(LoopRow).count() == 0
    assert issubclass(UnauditedChange, Exception)


def test_the_trail_is_listed_newest_first_in_pages(client: TestClient) -> None:
    for n in range(5):
        client.post("/v1/loops", json=loop_named(f"TIC-{n}"))

    seen: list[int] = []
    cursor = None
    while True:
        params = {"limit": 2} | ({"cursor": cursor} if cursor else {})
        page = client.get("/v1/audit", params=params).json()
        seen += [line["id"] for line in page["items"]]
        cursor = page["next"]
        if cursor is None:
            break

    assert seen == [6, 5, 4, 3, 2, 1]


def test_the_trail_is_filtered(client: TestClient, client_as: Callable[..., TestClient]) -> None:
    anna = client_as("engineer", owner="Anna")
    first = client.post("/v1/loops", json=loop_named("TIC-1")).json()
    second = anna.post("/v1/loops", json=loop_named("TIC-2")).json()

    def found(**wanted: str) -> list[str]:
        lines = client.get("/v1/audit", params=wanted).json()["items"]
        return [line["subject"] for line in lines]

    assert found(actor="Anna") == [f"loops/{second['id']}"]
    assert found(loop_id=first["id"]) == found(subject=f"loops/{first['id']}")
    assert found(action="loop.created", since=second["created_at"]) == [f"loops/{second['id']}"]
    assert found(action="loop.created", until=second["created_at"]) == [f"loops/{first['id']}"]
    assert found(actor="Nobody") == []
    for params in (
        {"since": "2026-11-22T00:00:00"},
        {"since": "0.5"},
        {"cursor": "TlVM"},
        {"cursor": "LTE"},
        {"loop_id": "1"},
    ):
        assert client.get("/v1/audit", params=params).status_code == 422, params


def test_an_export_proves_itself_offline(client: TestClient, tic101: Body) -> None:
    client.patch(f"/v1/loops/{tic101['id']}", json={"area": "A9"}, headers={"If-Match": '"1"'})

    answer = client.get("/v1/audit/export")

    head = client.get("/v1/audit/verify").json()["head"]
    lines = answer.text.splitlines()
    assert answer.headers["content-type"] == "application/jsonl"
    assert answer.headers["x-audit-head"] == head
    assert json.loads(lines[0]) == {"format": "loopwright-audit-1", "head": head, "rows": 3}
    assert verify_export(lines, known_head=head).intact

    # The documented recipe, without any of this program's code.
    previous = "0" * 64
    for text_ in lines[1:]:
        line = json.loads(text_)
        assert line["previous"] == previous
        stated = line.pop("hash")
        assert hashlib.sha256(text_.replace(f',"hash":"{stated}"', "").encode()).hexdigest() == (
            stated
        )
        previous = stated
    assert previous == head


def test_an_export_that_was_edited_is_found_out(client: TestClient, tic101: Body) -> None:
    lines = client.get("/v1/audit/export").text.splitlines()
    edited = [line.replace(tic101["area"], "A2") for line in lines]

    assert verify_export(lines).intact
    assert verify_export(edited).first_broken == Break(
        row=2, reason="Its content does not match its hash."
    )
    assert verify_export(lines[:-1]).first_broken is not None
    for broken in ([], ["[]"], ["{}"], ["nonsense"]):
        with pytest.raises(ValueError, match="first line of an audit export"):
            verify_export(broken)


def test_an_export_is_whole_while_others_write(client: TestClient, five_lines: Database) -> None:
    head, pieces = actions.export(five_lines.readings)
    first = next(pieces)
    write_line(five_lines, 7)
    lines = (first + b"".join(pieces)).decode().splitlines()

    assert verify_export(lines, known_head=head).rows == 6
    assert client.get("/v1/audit/verify").json()["rows"] == 7


def test_the_service_proves_its_trail(client: TestClient, held: Database) -> None:
    client.post("/v1/loops", json=loop_named("TIC-1"))
    good = client.get("/v1/audit/verify").json()
    unknown = client.get("/v1/audit/verify", params={"head": "f" * 64}).json()
    as_owner(held, "UPDATE audit SET actor = 'Mallory' WHERE id = 2")
    bad = client.get("/v1/audit/verify").json()

    assert (good["intact"], good["rows"], good["first_broken"]) == (True, 2, None)
    assert not unknown["intact"]
    assert (bad["intact"], bad["rows"], bad["first_broken"]["row"]) == (False, 1, 2)
    assert client.get("/v1/audit/verify", params={"head": "abc"}).status_code == 422
    assert client.get("/health").status_code == 503


def loop_named(tag: str) -> Body:
    return {
        "tag": tag,
        "pv_low": 0.0,
        "pv_high": 100.0,
        "pv_unit": "degC",
        "action": "reverse",
        "form": "isa",
        "time_unit": "s",
        "gain_basis": "eu",
    }


def test_a_chain_may_start_nowhere_but_at_the_beginning() -> None:
    line = {"id": 1, "previous": "f" * 64}

    assert not verify_chain([line | {"hash": line_hash(line)}]).intact
