"""Commands on an installation: its database, its keys, the address of the service."""

import asyncio
import re
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import URL

from service.actors import Actor, Role
from service.cli import run
from service.cli.serving import listening
from service.database import Database
from service.keys.actions import actor_with_token
from service.migration import newest_revision
from service.settings import Settings

Said = Callable[[], tuple[str, str]]


def test_a_new_key_is_all_that_standard_output_carries(either_database: URL, said: Said) -> None:
    assert run(["key", "create", "--owner", "Anna Berg", "--role", "engineer"]) == 0

    out, err = said()
    token = out.strip()
    assert re.fullmatch(r"lw_[0-9a-f]{12}_[\w-]{43}", token)
    assert out == f"{token}\n"
    assert "Anna Berg" in err
    assert token not in err
    held = Database.at(either_database)
    with held.readings() as session:
        actor = actor_with_token(session, token)
    held.engine.dispose()
    assert actor == Actor(owner="Anna Berg", role=Role.ENGINEER, key_id=token.split("_")[1])


@pytest.mark.usefixtures("installation")
def test_keys_are_listed_without_secrets_and_revoked_for_good(said: Said) -> None:
    tokens = []
    for owner, role in (("Anna", "admin"), ("Berta", "approver")):
        assert run(["key", "create", "--owner", owner, "--role", role]) == 0
        tokens.append(said()[0].strip())
    _, public, secret = tokens[1].split("_", 2)

    assert run(["key", "revoke", public]) == 0
    assert "Berta is out of force" in said()[0]
    assert run(["key", "list"]) == 0

    out, _ = said()
    lines = {line.split()[1]: line for line in out.splitlines()}
    assert lines["Anna"].endswith(" -")
    assert re.search(r"approver .*Z .*Z$", lines["Berta"])
    assert secret not in out


@pytest.mark.usefixtures("installation")
def test_the_last_admin_key_and_an_unknown_one_are_not_revoked(
    said: Said, sentence: Callable[[], str]
) -> None:
    assert run(["key", "create", "--owner", "Anna", "--role", "admin"]) == 0
    public = said()[0].split("_")[1]

    assert run(["key", "revoke", public]) == 1
    assert "last key with the role admin" in sentence()
    assert run(["key", "revoke", "0" * 12]) == 1
    assert sentence() == "loopwright: There is no key 000000000000."


@pytest.mark.usefixtures("installation")
@pytest.mark.parametrize(
    ("arguments", "because"),
    [
        (["--owner", "A", "--role", "god"], "'god' is not one of 'viewer', 'engineer'"),
        (["--owner", "", "--role", "admin"], "--owner: String should have at least 1 character"),
        (["--owner", "A\nB", "--role", "admin"], "must be one line of printable characters"),
        (["--owner", "A"], "Missing option '--role'"),
    ],
)
def test_a_key_that_cannot_be_is_a_wrong_call(
    arguments: list[str], because: str, sentence: Callable[[], str]
) -> None:
    assert run(["key", "create", *arguments]) == 2
    assert because in sentence()


@pytest.mark.parametrize(
    "command",
    ["key list", "audit verify", "sheet history TIC-101", "key create --owner A --role admin"],
)
def test_a_wrong_folder_is_said_and_not_filled(
    tmp_path: Path, command: str, sentence: Callable[[], str]
) -> None:
    folder = tmp_path / "nowhere"
    assert run([*command.split(), "--data", str(folder)]) == 1

    assert "There is no database" in sentence()
    assert not folder.exists()


def test_migrate_makes_the_database_and_a_second_time_changes_nothing(
    tmp_path: Path, said: Said
) -> None:
    for _ in range(2):
        assert run(["migrate", "--data", str(tmp_path / "plant")]) == 0
        assert str(newest_revision()) in said()[0]
    assert run(["audit", "verify", "--data", str(tmp_path / "plant")]) == 0
    assert said()[0].startswith("The chain is intact: 0 rows")


def test_the_service_leaves_a_named_database_to_migrate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, sentence: Callable[[], str]
) -> None:
    monkeypatch.setenv("LOOPWRIGHT_DATABASE_URL", f"sqlite:///{tmp_path / 'named.sqlite'}")
    assert run(["serve", "--port", "0", "--data", str(tmp_path)]) == 1
    assert "run 'loopwright migrate'" in sentence()

    (tmp_path / "named.sqlite").touch()
    assert run(["serve", "--port", "0", "--data", str(tmp_path)]) == 1
    assert "run 'loopwright migrate'" in sentence()


@pytest.mark.parametrize("command", ["serve", "demo"])
def test_a_taken_port_is_said_before_anything_is_made(
    tmp_path: Path, command: str, sentence: Callable[[], str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        assert run([command, "--port", str(port), "--data", str(tmp_path / "plant")]) == 1

    spoken = sentence()
    assert f"127.0.0.1 port {port}" in spoken
    assert "--port" in spoken
    assert not (tmp_path / "plant").exists()


def test_an_address_of_another_machine_is_said(tmp_path: Path, sentence: Callable[[], str]) -> None:
    assert run(["serve", "--host", "192.0.2.1", "--data", str(tmp_path)]) == 1  # RFC 5737
    assert "Cannot listen on 192.0.2.1" in sentence()


@pytest.mark.parametrize(
    ("name", "value", "because"),
    [
        ("PORT", "eighty", "port: Input should be a valid integer"),
        ("MAX_BODY_BYTES", "0", "max_body_bytes: Input should be greater than 0"),
        ("DATABASE_URL", "plant", "database_url: the database's address must look like"),
    ],
)
def test_a_setting_that_cannot_be_is_named(
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    value: str,
    because: str,
    sentence: Callable[[], str],
) -> None:
    monkeypatch.setenv(f"LOOPWRIGHT_{name}", value)
    assert run(["key", "list"]) == 2
    assert because in sentence()


def test_a_database_of_another_make_is_refused(
    monkeypatch: pytest.MonkeyPatch, sentence: Callable[[], str]
) -> None:
    monkeypatch.setenv("LOOPWRIGHT_DATABASE_URL", "mysql://plant/loops")
    assert run(["key", "list"]) == 1
    assert "must be SQLite or PostgreSQL" in sentence()


def test_a_database_that_does_not_answer_is_said_without_its_password(
    monkeypatch: pytest.MonkeyPatch, sentence: Callable[[], str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as freed:
        port = freed.getsockname()[1]
    monkeypatch.setenv("LOOPWRIGHT_DATABASE_URL", f"postgresql://anna:hunter2@127.0.0.1:{port}/x")
    assert run(["audit", "verify"]) == 1

    spoken = sentence()
    assert "The database cannot be used" in spoken
    assert "hunter2" not in spoken


def test_a_file_that_is_no_database_is_said(tmp_path: Path, sentence: Callable[[], str]) -> None:
    (tmp_path / "loopwright.sqlite").write_text("This is a letter, not a database. " * 40)
    assert run(["key", "list", "--data", str(tmp_path)]) == 1
    assert "file is not a database" in sentence()


def test_an_answer_does_not_wait_for_the_other_side_to_confirm_its_beginning() -> None:
    async def delays_nothing() -> bool:
        accepted: asyncio.Future[asyncio.BaseTransport] = asyncio.Future()

        class Taker(asyncio.Protocol):
            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                accepted.set_result(transport)

        with listening(Settings(port=0)) as taken:
            server = await asyncio.get_running_loop().create_server(Taker, sock=taken)
            with socket.create_connection(taken.getsockname()):
                transport = await accepted
                own = transport.get_extra_info("socket")
                no_delay = own.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
                transport.close()
            server.close()
        return bool(no_delay)

    assert asyncio.run(delays_nothing())
