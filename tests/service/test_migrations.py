import pytest
import sqlalchemy as sa
from alembic import command
from alembic.migration import MigrationContext
from alembic.operations import Operations
from fastapi.testclient import TestClient
from sqlalchemy import URL, inspect, text
from sqlalchemy.exc import DBAPIError

from service.app import create_app
from service.database import Database
from service.errors import NotReady
from service.migration import alembic_config, assert_ready, migrate
from service.settings import Settings
from service.triggers import APPEND_ONLY, missing_triggers

WRITTEN_ONCE = [*APPEND_ONLY, "audit_head"]


def test_the_tables_are_what_the_migrations_make(held: Database) -> None:
    with held.engine.begin() as connection:
        command.check(alembic_config(connection))


def test_migrations_go_down_and_up_again(held: Database) -> None:
    with held.engine.begin() as connection:
        command.downgrade(alembic_config(connection), "base")
    assert inspect(held.engine).get_table_names() == ["alembic_version"]

    with held.engine.begin() as connection:
        command.upgrade(alembic_config(connection), "head")
    assert_ready(held)


def test_migrating_again_changes_nothing(database_url: URL) -> None:
    first = migrate(database_url)
    assert migrate(database_url) == first


def test_a_migration_that_fails_leaves_nothing_behind(held: Database) -> None:
    before = inspect(held.engine).get_table_names()

    def fail_late() -> None:
        with held.engine.begin() as connection:
            command.downgrade(alembic_config(connection), "base")
            raise RuntimeError("the machine stopped")

    with pytest.raises(RuntimeError):
        fail_late()

    assert inspect(held.engine).get_table_names() == before
    assert_ready(held)


def test_the_service_refuses_a_database_that_is_not_migrated(settings: Settings) -> None:
    with pytest.raises(NotReady, match="loopwright migrate"), TestClient(create_app(settings)):
        pass


def test_a_batch_migration_that_drops_the_triggers_is_noticed(
    settings: Settings, sqlite_held: Database
) -> None:
    with sqlite_held.engine.begin() as connection:
        operations = Operations(MigrationContext.configure(connection))
        with operations.batch_alter_table("audit", recreate="always") as batch:
            batch.add_column(sa.Column("note", sa.String()))

    with pytest.raises(NotReady, match="audit_no_update, audit_no_delete, audit_no_replace"):
        assert_ready(sqlite_held)
    with (
        pytest.raises(NotReady, match="written once"),
        TestClient(create_app(settings, sqlite_held)),
    ):
        pass


@pytest.mark.parametrize("table", WRITTEN_ONCE)
@pytest.mark.parametrize(
    "statement",
    ["DELETE FROM {table}", "UPDATE {table} SET {column} = {column}", "TRUNCATE {table} CASCADE"],
)
def test_rows_written_once_refuse_the_rest(held: Database, table: str, statement: str) -> None:
    if statement.startswith("TRUNCATE") and held.engine.dialect.name == "sqlite":
        statement = "DELETE FROM {table}"  # SQLite's own optimisation of it is called truncate
    column = "hash" if table.startswith("audit") else "loop_id"
    with held.engine.begin() as connection:
        connection.execute(text(_INSERTS["loop"]))
        for name in ("sheet", "sheet_decision", "audit"):
            connection.execute(text(_INSERTS[name]))

    with (
        pytest.raises(DBAPIError, match=r"append-only|only moves on"),
        held.engine.begin() as connection,
    ):
        connection.execute(text(statement.format(table=table, column=column)))


@pytest.mark.parametrize("table", [*APPEND_ONLY])
@pytest.mark.parametrize("verb", ["INSERT OR REPLACE", "INSERT OR IGNORE", "REPLACE"])
def test_sqlite_does_not_replace_rows_written_once(
    sqlite_held: Database, table: str, verb: str
) -> None:
    with sqlite_held.engine.begin() as connection:
        connection.execute(text(_INSERTS["loop"]))
        for name in ("sheet", "sheet_decision", "audit"):
            connection.execute(text(_INSERTS[name]))
        again = _INSERTS[table].replace("INSERT", verb, 1)

    with pytest.raises(DBAPIError, match="append-only"), sqlite_held.engine.begin() as connection:
        connection.execute(text(again))
    with pytest.raises(DBAPIError, match="append-only"), sqlite_held.engine.begin() as connection:
        connection.execute(text(f"UPDATE OR REPLACE {table} SET rowid = 1"))  # noqa: S608


@pytest.mark.parametrize(
    "sabotage",
    [
        "DROP TRIGGER audit_append_only ON audit",
        "ALTER TABLE audit DISABLE TRIGGER audit_append_only",
        "ALTER TABLE sheet ENABLE TRIGGER sheet_append_only",
        "ALTER TABLE sheet_decision ENABLE REPLICA TRIGGER sheet_decision_append_only",
        "CREATE OR REPLACE FUNCTION loopwright_refuse() RETURNS trigger LANGUAGE plpgsql "
        "AS $$BEGIN RETURN NEW; END$$",
        "DROP TRIGGER audit_append_only ON audit; CREATE TRIGGER audit_append_only "
        "BEFORE UPDATE ON audit FOR EACH ROW EXECUTE FUNCTION loopwright_refuse(); "
        "ALTER TABLE audit ENABLE ALWAYS TRIGGER audit_append_only",
        "DROP TRIGGER audit_append_only ON audit; CREATE TRIGGER audit_append_only "
        "BEFORE DELETE OR UPDATE ON audit FOR EACH ROW WHEN (false) "
        "EXECUTE FUNCTION loopwright_refuse(); "
        "ALTER TABLE audit ENABLE ALWAYS TRIGGER audit_append_only",
        "DROP TRIGGER audit_head_moves_on ON audit_head; CREATE TRIGGER audit_head_moves_on "
        "BEFORE UPDATE OF id ON audit_head FOR EACH ROW EXECUTE FUNCTION loopwright_head(); "
        "ALTER TABLE audit_head ENABLE ALWAYS TRIGGER audit_head_moves_on",
    ],
)
def test_a_trigger_made_harmless_on_postgresql_is_noticed(
    postgresql_held: Database, sabotage: str
) -> None:
    with postgresql_held.engine.begin() as connection:
        connection.exec_driver_sql(sabotage)
        assert missing_triggers(connection)
    with pytest.raises(NotReady, match=r"_append_only|_no_truncate|_moves_on"):
        assert_ready(postgresql_held)


def test_a_trigger_made_harmless_on_sqlite_is_noticed(sqlite_held: Database) -> None:
    with sqlite_held.engine.begin() as connection:
        connection.exec_driver_sql("DROP TRIGGER audit_no_update")
        connection.exec_driver_sql(
            "CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT 1; END"
        )
        assert missing_triggers(connection) == ["audit_no_update"]


def test_postgresql_refuses_even_a_session_that_calls_itself_a_replica(
    postgresql_held: Database,
) -> None:
    with postgresql_held.engine.begin() as connection:
        connection.execute(text(_INSERTS["audit"]))

    with postgresql_held.engine.connect() as connection:
        connection.exec_driver_sql("SET session_replication_role = replica")
        with pytest.raises(DBAPIError, match="append-only"):
            connection.exec_driver_sql("DELETE FROM audit")


_INSERTS = {
    "loop": "INSERT INTO loop VALUES ('00000000000000000000000000000001', 'TIC-101', '', '', '', "
    "0, 100, '', 0, 100, '%', 'reverse', 'isa', 's', 'eu', NULL, 'general', NULL, false, 1, "
    "'2026-11-22 00:00:00', 'Anna', '2026-11-22 00:00:00', 'other', 1, NULL, NULL, NULL)",
    "sheet": "INSERT INTO sheet VALUES ('00000000000000000000000000000001', 1, '{}', '{}', NULL, "
    "NULL, NULL, NULL, 'general', 'first', 'Anna', '2026-11-22 00:00:00')",
    "sheet_decision": "INSERT INTO sheet_decision VALUES ('00000000000000000000000000000001', 1, "
    "'approved', 1, 'fine', 'Berta', '2026-11-22 00:00:00')",
    "audit": "INSERT INTO audit VALUES (1, '2026-11-22 00:00:00', 'Anna', NULL, 'loop.created', "
    "'loops/1', NULL, NULL, NULL, '0', '1')",
}
