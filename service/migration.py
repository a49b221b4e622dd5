"""Bringing a database to the state this version needs, and proving that it is there."""

from functools import cache
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import URL, Connection, text

import migrations
from service.database import Database
from service.errors import NotReady
from service.triggers import assert_triggers

# Any number will do, as long as every start of the service uses the same one.
_MIGRATION_LOCK = 7_203_451


def alembic_config(connection: Connection | None = None) -> Config:
    """Set up Alembic for a connection, wherever the package is installed."""
    config = Config()
    config.set_main_option("script_location", str(Path(migrations.__file__).parent))
    config.attributes["connection"] = connection
    return config


def migrate(url: URL | str) -> str:
    """Bring a database to the newest state, all or nothing, and answer its revision.

    Two at once wait for each other. A database that is there already is left as it is.
    """
    held = Database.at(url, create=True)
    try:
        with held.engine.begin() as connection:
            if connection.dialect.name == "postgresql":
                connection.execute(
                    text("SELECT pg_advisory_xact_lock(:key)"), {"key": _MIGRATION_LOCK}
                )
            command.upgrade(alembic_config(connection), "head")
            return str(MigrationContext.configure(connection).get_current_revision())
    finally:
        held.engine.dispose()


@cache
def newest_revision() -> str | None:
    """Name the state this version of the service needs."""
    return ScriptDirectory.from_config(alembic_config()).get_current_head()


def assert_ready(held: Database) -> None:
    """Refuse a database that is not in the state this version needs.

    Raises
    ------
    NotReady
        It is not migrated, or a trigger that guards rows written once is missing.
    """
    newest = newest_revision()
    with held.readings() as session:  # it waits for no writer
        connection = session.connection()
        found = MigrationContext.configure(connection).get_current_revision()
        if found != newest:
            raise NotReady(
                [
                    f"The database is at {found or 'no'} migration, this version needs {newest}: "
                    "run 'loopwright migrate'."
                ]
            )
        assert_triggers(connection)
