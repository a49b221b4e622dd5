"""Engine, sessions and the one transaction of a request. Nothing else in the service commits."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Self

from fastapi import Depends, Request
from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.orm import Session, sessionmaker
from sqlalchemy.pool import ConnectionPoolEntry

from service.audit.trail import announce_head, refuse_unaudited, watch_changes
from service.errors import NotReady
from service.plain_json import dump_strictly

# Longer than any transaction of ours takes, shorter than a client waits.
BUSY_SECONDS = 30


@dataclass(frozen=True, slots=True)
class Database:
    """The database as the application holds it.

    Attributes
    ----------
    engine : Engine
        Connections.
    sessions : sessionmaker
        Transactions that may write. On SQLite they queue up at their first statement, so that
        what was read is still true when it is written.
    readings : sessionmaker
        Transactions that see one moment of the database and cannot write.
    """

    engine: Engine
    sessions: sessionmaker[Session]
    readings: sessionmaker[Session]

    @classmethod
    def at(cls, url: URL | str, *, create: bool = False) -> Self:
        """Describe the database at an address; nothing connects before the first statement.

        Parameters
        ----------
        url : URL or str
            Its address.
        create : bool
            Let SQLite make the file. Otherwise one that was moved away is missed, and not stood in
            for by an empty one.
        """
        engine = _engine(make_url(url), create)
        snapshot = (
            engine.execution_options(reading=True)
            if engine.dialect.name == "sqlite"
            else engine.execution_options(
                isolation_level="REPEATABLE READ", postgresql_readonly=True
            )
        )
        sessions = sessionmaker(engine, expire_on_commit=False)
        event.listen(sessions, "after_flush", watch_changes)
        event.listen(sessions, "after_commit", announce_head)
        return cls(engine, sessions, sessionmaker(snapshot, expire_on_commit=False))

    @contextmanager
    def transaction(self) -> Iterator[Session]:
        """Give work that belongs to no request one transaction, committed at its end."""
        with self.sessions.begin() as session:
            yield session


def _engine(url: URL, create: bool) -> Engine:
    if url.get_backend_name() == "sqlite":
        return _sqlite(url, create)
    if url.get_backend_name() == "postgresql":
        return _postgresql(url.set(drivername="postgresql+psycopg"))
    raise ValueError(f"the database must be SQLite or PostgreSQL, not {url.get_backend_name()}")


def _sqlite(url: URL, create: bool) -> Engine:
    if not url.database or url.database == ":memory:":
        raise ValueError("SQLite needs a file: every connection to :memory: is its own database")
    file = Path(url.database)
    # isolation_level None stops the driver from guessing where transactions begin; we say it.
    engine = create_engine(
        url,
        connect_args={"timeout": BUSY_SECONDS, "isolation_level": None},
        json_serializer=dump_strictly,
        pool_size=10,
        max_overflow=40,
    )

    @event.listens_for(engine, "do_connect")
    def find_file(*_: object) -> None:
        if create:
            file.parent.mkdir(parents=True, exist_ok=True)
        elif not file.is_file():
            # Without its path: anybody may read the answer.
            raise NotReady(
                [
                    "The database's file is not there: put it back, or make a new one with "
                    "'loopwright migrate'."
                ]
            )

    @event.listens_for(engine, "connect")
    def configure(connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
        cursor = connection.cursor()
        cursor.execute("PRAGMA journal_mode = WAL")
        cursor.execute("PRAGMA synchronous = FULL")  # an answered request survives a power cut
        cursor.execute("PRAGMA foreign_keys = ON")
        cursor.close()

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        reading = connection.get_execution_options().get("reading", False)
        connection.exec_driver_sql(f"PRAGMA query_only = {'ON' if reading else 'OFF'}")
        connection.exec_driver_sql("BEGIN" if reading else "BEGIN IMMEDIATE")

    return engine


def _postgresql(url: URL) -> Engine:
    return create_engine(
        url,
        connect_args={
            "connect_timeout": 5,
            "options": f"-c timezone=utc -c lock_timeout={BUSY_SECONDS}s",
        },
        json_serializer=dump_strictly,
        pool_pre_ping=True,  # a restarted server costs no request
        pool_size=10,
        max_overflow=40,
    )


def database(request: Request) -> Database:
    """Find the application's database."""
    held = request.app.state.database
    assert isinstance(held, Database)  # noqa: S101 - create_app put it there
    return held


def transaction(held: Annotated[Database, Depends(database)]) -> Iterator[Session]:
    """Give the request one transaction, committed before the answer is sent."""
    with held.sessions.begin() as session:
        yield session
        session.flush()
        refuse_unaudited(session)


def reading(held: Annotated[Database, Depends(database)]) -> Iterator[Session]:
    """Give the request one moment of the database to read from."""
    with held.readings() as session:
        yield session


# scope="function": a failed commit must become an error answer, not a lost write.
Transaction = Annotated[Session, Depends(transaction, scope="function")]
Reading = Annotated[Session, Depends(reading, scope="function")]
