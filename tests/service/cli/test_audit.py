"""The audit trail on the command line: proved, taken away, proved again without the service."""

import json
import re
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from service.cli import run

Said = Callable[[], tuple[str, str]]


@pytest.mark.usefixtures("either_database")
def test_an_intact_trail_is_proved_with_a_known_head(said: Said) -> None:
    for owner in ("Anna", "Berta"):
        assert run(["key", "create", "--owner", owner, "--role", "admin"]) == 0
    logged = re.findall(r"head=([0-9a-f]{64}) row=(\d)", re.sub(r"\x1b\[\d*m", "", said()[1]))
    assert [row for _, row in logged] == ["1", "2"]

    assert run(["audit", "verify", "--head", logged[0][0]]) == 0

    out, _ = said()
    assert out.startswith(f"The chain is intact: 2 rows, head {logged[1][0]}\n")
    assert "row 1" in out


def test_a_changed_line_and_an_unknown_head_are_refusals(installation: Path, said: Said) -> None:
    for owner in ("Anna", "Berta", "Carla"):
        assert run(["key", "create", "--owner", owner, "--role", "admin"]) == 0
    said()
    assert run(["audit", "verify", "--head", "ab" * 32]) == 3
    assert "lines were removed or rewritten" in said()[0]

    with sqlite3.connect(installation / "loopwright.sqlite") as connection:
        triggers = connection.execute(
            "SELECT name, sql FROM sqlite_master WHERE type = 'trigger' AND tbl_name = 'audit'"
        ).fetchall()
        for name, _ in triggers:
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute("UPDATE audit SET actor = 'somebody' WHERE id = 2")
        for _, sql in triggers:
            connection.execute(sql)
    connection.close()
    assert run(["audit", "verify"]) == 3
    assert said()[0].startswith("The chain is broken at row 2.")


def test_a_trail_whose_guards_are_gone_is_not_read(
    installation: Path, sentence: Callable[[], str]
) -> None:
    with sqlite3.connect(installation / "loopwright.sqlite") as connection:
        connection.execute("DROP TRIGGER audit_no_update")
    connection.close()
    assert run(["audit", "verify"]) == 1
    assert "audit_no_update" in sentence()


@pytest.mark.usefixtures("installation")
def test_an_export_is_proved_without_the_service(
    tmp_path: Path, said: Said, monkeypatch: pytest.MonkeyPatch, sentence: Callable[[], str]
) -> None:
    for owner in ("Anna", "Berta"):
        assert run(["key", "create", "--owner", owner, "--role", "admin"]) == 0
    said()
    file = tmp_path / "trail.jsonl"
    assert run(["audit", "export", str(file)]) == 0
    head = said()[0].split()[-1]
    assert json.loads(file.read_text("utf-8").splitlines()[0])["head"] == head
    assert list(tmp_path.glob("*.part")) == []

    monkeypatch.setenv("LOOPWRIGHT_DATA", str(tmp_path / "gone"))
    assert run(["audit", "verify", "--export", str(file), "--head", head]) == 0
    assert said()[0].startswith(f"The chain is intact: 2 rows, head {head}")

    file.write_text(file.read_text("utf-8").replace("Berta", "Bruno"), "utf-8")
    assert run(["audit", "verify", "--export", str(file)]) == 3
    assert "broken at row 2" in said()[0]

    file.write_text("Time,PV\n", "utf-8")
    assert run(["audit", "verify", "--export", str(file)]) == 1
    assert "first line of an audit export" in sentence()
    assert run(["audit", "verify", "--export", str(tmp_path / "none")]) == 2
    assert "there is no file" in sentence()


@pytest.mark.usefixtures("installation")
def test_an_export_that_cannot_be_written_leaves_nothing(
    tmp_path: Path, sentence: Callable[[], str]
) -> None:
    target = tmp_path / "folder" / "trail.jsonl"
    assert run(["audit", "export", str(target)]) == 1
    assert "No such file or directory" in sentence()
    assert not target.parent.exists()


@pytest.mark.usefixtures("installation")
@pytest.mark.parametrize("head", ["12", "g" * 64, "A" * 64])
def test_a_head_that_is_no_hash_is_a_wrong_call(head: str, sentence: Callable[[], str]) -> None:
    assert run(["audit", "verify", "--head", head]) == 2
    assert "64 hexadecimal digits" in sentence()
