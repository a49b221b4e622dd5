"""Tables whose rows are written once: the triggers that hold it, and the proof that they are there.

Triggers stop the application and every honest mistake; they do not stop the owner of the database,
who can drop them. Against that there is the hash chain of the audit trail.
"""

import re

from sqlalchemy import Connection, text

from service.errors import NotReady

# Table -> columns that no two rows may share. SQLite's INSERT OR REPLACE removes the old row
# without firing a DELETE trigger, so the insert itself has to be refused.
APPEND_ONLY = {
    "audit": ("id", "previous", "hash"),
    "sheet": ("loop_id, version",),
    "sheet_decision": ("loop_id, version", "loop_id, approval"),
}
HEAD = "audit_head"

_POSTGRESQL_FUNCTIONS = {
    "loopwright_refuse": "BEGIN RAISE EXCEPTION '% is append-only', TG_TABLE_NAME; END",
    "loopwright_head": (
        "BEGIN IF NEW.id = OLD.id AND NEW.lines = OLD.lines + 1 THEN RETURN NEW; END IF; "
        "RAISE EXCEPTION 'the head of the audit chain only moves on by one'; END"
    ),
}


def create_statements(dialect: str) -> list[str]:
    """List the statements that make every trigger, for `sqlite` or `postgresql`."""
    if dialect == "sqlite":
        return list(_sqlite_triggers().values())
    functions = [
        f"CREATE FUNCTION {name}() RETURNS trigger LANGUAGE plpgsql AS $${body}$$"
        for name, body in _POSTGRESQL_FUNCTIONS.items()
    ]
    statements = []
    for (table, name), (event, function) in _postgresql_triggers().items():
        statements += [
            f"CREATE TRIGGER {name} BEFORE {event} EXECUTE FUNCTION {function}()",
            # ALWAYS: also when a session calls itself a replica.
            f"ALTER TABLE {table} ENABLE ALWAYS TRIGGER {name}",
        ]
    return functions + statements


def drop_statements(dialect: str) -> list[str]:
    """List the statements that take every trigger away."""
    if dialect == "sqlite":
        return [f"DROP TRIGGER {name}" for name in _sqlite_triggers()]
    return [f"DROP TRIGGER {name} ON {table}" for table, name in _postgresql_triggers()] + [
        f"DROP FUNCTION {name}()" for name in _POSTGRESQL_FUNCTIONS
    ]


def missing_triggers(connection: Connection) -> list[str]:
    """Name every trigger that is absent, switched off, or not what it should be."""
    if connection.dialect.name == "sqlite":
        found = {
            str(name): str(sql)
            for name, sql in connection.execute(
                text("SELECT name, sql FROM sqlite_master WHERE type = 'trigger'")
            )
        }
        return [name for name, sql in _sqlite_triggers().items() if found.get(name) != sql]
    there = {
        (str(table), str(name)): (str(function), str(body), str(enabled), str(definition))
        for table, name, function, body, enabled, definition in connection.execute(
            text(
                "SELECT c.relname, t.tgname, p.proname, p.prosrc, t.tgenabled::text, "
                "pg_get_triggerdef(t.oid) FROM pg_trigger t "
                "JOIN pg_class c ON c.oid = t.tgrelid JOIN pg_proc p ON p.oid = t.tgfoid "
                "WHERE NOT t.tgisinternal AND pg_table_is_visible(c.oid)"
            )
        )
    }
    return [
        name
        for (table, name), (event, function) in _postgresql_triggers().items()
        if not _as_made(there.get((table, name)), event, function)
    ]


def assert_triggers(connection: Connection) -> None:
    """Refuse a database that would let the audit trail or a loop sheet be changed.

    Raises
    ------
    NotReady
        At least one trigger is missing.
    """
    missing = missing_triggers(connection)
    if missing:
        raise NotReady(
            [
                f"The database lacks {', '.join(missing)}: rows that are written once could be "
                "changed. Find out who removed them, verify the audit chain, then restore them."
            ]
        )


def _sqlite_triggers() -> dict[str, str]:
    triggers = {}
    for table, unique in APPEND_ONLY.items():
        refuse = f"BEGIN SELECT RAISE(ABORT, '{table} is append-only'); END"
        for verb in ("UPDATE", "DELETE"):
            name = f"{table}_no_{verb.lower()}"
            triggers[name] = f"CREATE TRIGGER {name} BEFORE {verb} ON {table} {refuse}"
        same = " OR ".join(_same(columns) for columns in unique)
        name = f"{table}_no_replace"
        triggers[name] = (
            f"CREATE TRIGGER {name} BEFORE INSERT ON {table} WHEN {_exists(table, same)} {refuse}"
        )
    refuse = "BEGIN SELECT RAISE(ABORT, 'the head of the audit chain only moves on by one'); END"
    triggers[f"{HEAD}_moves_on"] = (
        f"CREATE TRIGGER {HEAD}_moves_on BEFORE UPDATE ON {HEAD} "
        f"WHEN NEW.id <> OLD.id OR NEW.lines <> OLD.lines + 1 {refuse}"
    )
    triggers[f"{HEAD}_no_delete"] = (
        f"CREATE TRIGGER {HEAD}_no_delete BEFORE DELETE ON {HEAD} {refuse}"
    )
    triggers[f"{HEAD}_no_replace"] = (
        f"CREATE TRIGGER {HEAD}_no_replace BEFORE INSERT ON {HEAD} "
        f"WHEN {_exists(HEAD, 'true')} {refuse}"
    )
    return triggers


def _exists(table: str, condition: str) -> str:
    return f"EXISTS (SELECT 1 FROM {table} WHERE {condition})"  # noqa: S608 - our own names


def _same(columns: str) -> str:
    return "(" + " AND ".join(f"{name} = NEW.{name}" for name in columns.split(", ")) + ")"


def _postgresql_triggers() -> dict[tuple[str, str], tuple[str, str]]:
    """(table, trigger) -> (what fires it, function)."""
    triggers = {}
    for table in APPEND_ONLY:
        triggers[table, f"{table}_append_only"] = (
            f"DELETE OR UPDATE ON {table} FOR EACH ROW",
            "loopwright_refuse",
        )
    for table in (*APPEND_ONLY, HEAD):
        triggers[table, f"{table}_no_truncate"] = (
            f"TRUNCATE ON {table} FOR EACH STATEMENT",
            "loopwright_refuse",
        )
    triggers[HEAD, f"{HEAD}_no_delete"] = (f"DELETE ON {HEAD} FOR EACH ROW", "loopwright_refuse")
    triggers[HEAD, f"{HEAD}_moves_on"] = (f"UPDATE ON {HEAD} FOR EACH ROW", "loopwright_head")
    return triggers


def _as_made(found: tuple[str, str, str, str] | None, event: str, function: str) -> bool:
    if found is None:
        return False
    name, body, enabled, definition = found
    return (
        name == function
        and body == _POSTGRESQL_FUNCTIONS[function]
        and enabled == "A"
        # The server writes the table's schema, too; a WHEN or a column list would stand between.
        and re.sub(r" ON \w+\.", " ON ", definition).endswith(
            f" BEFORE {event} EXECUTE FUNCTION {function}()"
        )
    )
