"""`loopwright migrate`: the database brought to the state this version needs."""

import typer

from service.cli.installation import DataFolder, settings_for
from service.migration import migrate as migrate_database


def migrate(data: DataFolder = None) -> int:
    """Bring the database to the state this version needs, all of it or nothing.

    It makes the database where there is none, and leaves one in the right state as it is.
    LOOPWRIGHT_DATABASE_URL names the database; by default it is a file in the data folder.
    """
    settings = settings_for(data=data)
    revision = migrate_database(settings.url)
    typer.echo(f"The database is at migration {revision}: {settings.url.render_as_string()}")
    return 0
