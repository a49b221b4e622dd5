"""`loopwright demo`: the service with a small simulated plant to look at."""

import logging
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

from service.actors import Actor, Role
from service.cli.installation import DataFolder, log_on_stderr, ready, settings_for, writing
from service.cli.serve import Host, Port
from service.cli.serving import address_of, answer, listening
from service.database import Database
from service.demo_loading import KEY_OWNER, PIECES, Installation, is_loaded, load
from service.keys.actions import create_key
from service.migration import migrate
from service.samples import open_samples
from service.settings import Settings


def demo(host: Host = None, port: Port = None, data: DataFolder = None) -> int:
    """Start the service with a small simulated plant to look at, until Ctrl-C.

    The first start loads the plant and prints an API key, once. Everything is in the data folder:
    remove it to begin anew.
    """
    # A demo never touches the database of a plant.
    settings = settings_for(host=host, port=port, data=data).model_copy(
        update={"database_url": None}
    )
    log_on_stderr()
    with listening(settings) as taken:
        address = address_of(taken)
        logging.getLogger().setLevel(logging.WARNING)
        migrate(settings.url)
        with ready(settings) as held:
            token = None if is_loaded(held, settings) else _first_start(held, settings)
        _greet(address, settings.data.resolve(), token)
        logging.getLogger().setLevel(logging.INFO)
        answer(settings, taken)
    return 0


def _first_start(held: Database, settings: Settings) -> str:
    """Load the plant and make the key that says so; in this order, so that a kill costs nothing."""
    typer.echo("Loading the simulated plant ...", err=True)
    bar = Progress(
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.description}"),
        console=Console(stderr=True),
        transient=True,
    )
    with bar:
        task = bar.add_task("The simulated plant", total=PIECES)

        def tell(what: str) -> None:
            bar.update(task, advance=1, description=what)

        load(Installation(held=held, samples=open_samples(settings), settings=settings), tell)
    with writing(held) as session:
        return create_key(
            session,
            owner=KEY_OWNER,
            role=Role.ADMIN,
            actor=Actor(owner="command line", role=Role.ADMIN),
        )[1]


def _greet(address: str, folder: Path, token: str | None) -> None:
    key = (
        "printed at the first start. Another one: "
        f"loopwright key create --owner NAME --role admin --data {folder}"
        if token is None
        else f"{token} (shown this once; keep it)"
    )
    for name, value in (
        ("Address", address),
        ("API docs", f"{address}/docs"),
        ("API key", key),
        ("Data folder", folder),
    ):
        typer.echo(f"{name + ':':13}{value}")
    typer.echo("Stop with Ctrl-C.")
