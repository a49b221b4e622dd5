"""The installation a command works on: its settings, its database, and who acts."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, TypeAlias

import typer
from pydantic import ValidationError
from sqlalchemy.orm import Session

from service import database
from service.actors import Actor, Role
from service.database import Database
from service.errors import Forbidden, NotAuthenticated, NotFound, NotReady
from service.keys.actions import actor_with_token
from service.logs import configure_logging
from service.loops.store import loop_with_tag
from service.migration import assert_ready
from service.settings import Settings
from service.tables import LoopRow

KEY = "LOOPWRIGHT_KEY"

DataFolder: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--data",
        metavar="FOLDER",
        help="Folder of samples and embedded database; by default LOOPWRIGHT_DATA, or "
        "loopwright-data.",
    ),
]

# One transaction as a request has it: committed at the end, refused without its audit line.
writing = contextmanager(database.transaction)


def settings_for(
    *, data: Path | None = None, host: str | None = None, port: int | None = None
) -> Settings:
    """Take the environment's settings, with those that the command line states.

    Raises
    ------
    typer.BadParameter
        A setting is not valid.
    """
    stated = {"data": data, "host": host, "port": port}
    try:
        return Settings.model_validate(
            {name: value for name, value in stated.items() if value is not None}
        )
    except ValidationError as error:
        raise typer.BadParameter(
            "; ".join(f"the setting {fault}" for fault in faults(error))
        ) from error


def faults(error: ValidationError) -> list[str]:
    """Say field by field what a body does not allow."""
    return [
        f"{'.'.join(map(str, fault['loc']))}: {fault['msg'].removeprefix('Value error, ')}"
        for fault in error.errors()
    ]


@contextmanager
def opened(settings: Settings) -> Iterator[Database]:
    """Hold the installation's database for one command, with its log on standard error.

    Raises
    ------
    NotReady
        There is none, or it needs a migration.
    """
    log_on_stderr()
    with ready(settings) as held:
        yield held


@contextmanager
def ready(settings: Settings) -> Iterator[Database]:
    """Hold the installation's database, if it is there and in the state this version needs.

    Raises
    ------
    NotReady
        There is none, or it needs a migration.
    """
    # Connecting would make the file: a wrong folder must not look like an empty installation.
    if is_absent(settings):
        raise NotReady(
            [
                f"There is no database {settings.url.database}: name the folder with --data, or "
                "run 'loopwright migrate' to make a new one."
            ]
        )
    held = Database.at(settings.url)
    try:
        assert_ready(held)
        yield held
    finally:
        held.engine.dispose()


def log_on_stderr() -> None:
    """Let a person read the log beside the answer: the new head of the audit trail above all."""
    configure_logging(as_json=False)
    # It tells at every look at the database which kind of database that is.
    logging.getLogger("alembic").setLevel(logging.WARNING)


def is_absent(settings: Settings) -> bool:
    """Tell whether the database is a file that is not there."""
    file = settings.url.database
    return (
        settings.url.get_backend_name() == "sqlite"
        and file is not None
        and not Path(file).is_file()
    )


def acting(held: Database, needed: Role) -> Actor:
    """Find who acts: the owner of the API key in LOOPWRIGHT_KEY.

    Parameters
    ----------
    held : Database
        Database that knows the keys.
    needed : Role
        Role without which the command is refused.

    Raises
    ------
    typer.BadParameter
        No key is set, or it is not a valid one.
    Forbidden
        The key's role does not allow this.
    """
    token = os.environ.get(KEY, "").strip()
    if not token:
        raise typer.BadParameter(
            f"set {KEY} to your API key: the audit trail has to say who acts "
            "('loopwright key create' makes one)"
        )
    try:
        with held.readings() as session:
            actor = actor_with_token(session, token)
    except NotAuthenticated as error:
        raise typer.BadParameter(f"the API key in {KEY} is not valid, or was revoked") from error
    if not actor.role.covers(needed):
        raise Forbidden(actor.role.value, needed.value)
    return actor


def loop_tagged(session: Session, tag: str) -> LoopRow:
    """Find a loop by its tag.

    Raises
    ------
    NotFound
        No loop has this tag.
    """
    row = loop_with_tag(session, tag)
    if row is None:
        raise NotFound("loop", tag)
    return row
