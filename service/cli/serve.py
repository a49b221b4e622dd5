"""`loopwright serve`: the service until it is told to stop."""

from inspect import cleandoc
from typing import Annotated, TypeAlias

import structlog
import typer

from service.cli.installation import DataFolder, log_on_stderr, ready, settings_for
from service.cli.serving import address_of, answer, listening
from service.logs import configure_logging
from service.migration import migrate
from service.settings import Settings

Host: TypeAlias = Annotated[
    str | None,
    typer.Option(help="Address to listen on; by default LOOPWRIGHT_HOST, or 127.0.0.1."),
]
Port: TypeAlias = Annotated[
    int | None,
    typer.Option(
        min=0, max=65535, help="Port; by default LOOPWRIGHT_PORT, or 8000. 0: any free one."
    ),
]


def serve(host: Host = None, port: Port = None, data: DataFolder = None) -> int:
    """Start the service, until SIGTERM or Ctrl-C.

    The embedded database (SQLite in the data folder) is made and migrated by itself. One that
    LOOPWRIGHT_DATABASE_URL names needs 'loopwright migrate' first.

    Settings in the environment; an option goes before them:
    """
    settings = settings_for(host=host, port=port, data=data)
    log_on_stderr()
    configure_logging(as_json=settings.log_json)
    with listening(settings) as taken:
        # Nobody else uses the embedded database, so nobody is surprised by its migration. A
        # database that the site names is migrated when the site says so.
        if settings.database_url is None:
            migrate(settings.url)
        with ready(settings):
            pass
        structlog.get_logger().info("listening", address=address_of(taken))
        answer(settings, taken)
    return 0


def _settings_help() -> str:
    """List the settings as a block that is not wrapped anew."""
    lines = ["\b"]
    for name, field in Settings.model_fields.items():
        default = "" if field.default is None else f" Default: {field.default}."
        lines += [f"  LOOPWRIGHT_{name.upper()}", f"    {field.description}{default}"]
    return "\n".join(lines)


serve.__doc__ = f"{cleandoc(serve.__doc__ or '')}\n\n{_settings_help()}\n"
