"""Commands run in this process, on an installation of their own."""

import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import structlog
from sqlalchemy import URL
from sqlalchemy.orm import Session, sessionmaker

from service.actors import Role
from service.cli.installation import log_on_stderr
from service.keys.actions import create_key

Said = Callable[[], tuple[str, str]]


@pytest.fixture(autouse=True)
def logging_as_it_was() -> Iterator[None]:
    """Give the log back: a command points it at the standard error of its own test."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:] = handlers
    root.setLevel(level)
    structlog.reset_defaults()


@pytest.fixture(autouse=True)
def no_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide whatever the person who runs the tests has set."""
    for name in list(os.environ):
        if name.startswith("LOOPWRIGHT_") and name != "LOOPWRIGHT_TEST_POSTGRES":
            monkeypatch.delenv(name)


@pytest.fixture
def installation(
    no_settings: None,  # noqa: ARG001 - it goes first
    sqlite_url: URL,  # noqa: ARG001 - the file in the folder
    monkeypatch: pytest.MonkeyPatch,
    data_folder: Path,
) -> Path:
    """Have the commands work on an embedded installation of their own."""
    monkeypatch.setenv("LOOPWRIGHT_DATA", str(data_folder))
    return data_folder


@pytest.fixture
def either_database(
    no_settings: None,  # noqa: ARG001 - it goes first
    monkeypatch: pytest.MonkeyPatch,
    database_url: URL,
    data_folder: Path,
) -> URL:
    """Have the commands work on a named database, of each kind in turn."""
    monkeypatch.setenv("LOOPWRIGHT_DATA", str(data_folder))
    monkeypatch.setenv(
        "LOOPWRIGHT_DATABASE_URL", database_url.render_as_string(hide_password=False)
    )
    return database_url


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Said:
    """Give what was said since the last look: on standard output, and on standard error."""

    def since_last() -> tuple[str, str]:
        captured = capsys.readouterr()
        return captured.out, captured.err

    return since_last


@pytest.fixture
def sentence(said: Said) -> Callable[[], str]:
    """Give the one sentence a failed command says, beside the log."""

    def spoken() -> str:
        err = said()[1]
        found = [line for line in err.splitlines() if line.startswith("loopwright: ")]
        assert len(found) == 1, err
        assert "Traceback" not in err
        return found[0]

    return spoken


@pytest.fixture
def acting_as(
    either_database: URL,  # noqa: ARG001 - the keys are there
    monkeypatch: pytest.MonkeyPatch,
    sessions: sessionmaker[Session],
) -> Callable[[str, str], str]:
    """Put a new person's key into LOOPWRIGHT_KEY, and give its public part."""

    def become(owner: str, role: str) -> str:
        log_on_stderr()  # a command before the test itself left the log on another stream
        with sessions.begin() as session:
            row, token = create_key(session, owner=owner, role=Role(role))
        monkeypatch.setenv("LOOPWRIGHT_KEY", token)
        return row.id

    return become
