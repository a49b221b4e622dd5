"""`loopwright key`: API keys, made on the server itself."""

from typing import Annotated

import typer
from pydantic import ValidationError

from service.actors import Actor, Role
from service.cli.installation import DataFolder, faults, opened, settings_for, writing
from service.cli.listing import moment, print_columns
from service.keys import actions, store
from service.keys.schemas import NewKey

app = typer.Typer()
SERVER = Actor(owner="command line", role=Role.ADMIN)


@app.command()
def create(
    owner: Annotated[str, typer.Option(metavar="NAME", help="Person the key belongs to.")],
    role: Annotated[Role, typer.Option(help="What the person may do.")],
    data: DataFolder = None,
) -> int:
    """Make an API key and print it, this once; the service keeps only a hash of it.

    Standard output carries the key and nothing else, so that a script can take it.
    """
    try:
        wanted = NewKey(owner=owner, role=role)
    except ValidationError as error:
        raise typer.BadParameter("; ".join(f"--{fault}" for fault in faults(error))) from error
    with opened(settings_for(data=data)) as held:
        with writing(held) as session:
            row, token = actions.create_key(session, owner=wanted.owner, role=wanted.role)
        typer.echo(
            f"Key {row.id} of {row.owner}, {row.role}. It is shown this once; keep it.", err=True
        )
        typer.echo(token)
    return 0


@app.command("list")
def list_keys(data: DataFolder = None) -> int:
    """List all keys, revoked ones included, without their secrets."""
    with opened(settings_for(data=data)) as held, held.readings() as session:
        rows, last = [], None
        while page := store.all_keys(session, after=last, limit=1000):
            rows += page
            last = page[-1].id
    print_columns(
        ("ID", "OWNER", "ROLE", "CREATED", "REVOKED"),
        [
            (row.id, row.owner, row.role, moment(row.created_at), moment(row.revoked_at))
            for row in rows
        ],
    )
    return 0


@app.command()
def revoke(
    key_id: Annotated[str, typer.Argument(metavar="ID", help="Public part of the key.")],
    data: DataFolder = None,
) -> int:
    """Put a key out of force for good. It stays on the list; a second time changes nothing."""
    with opened(settings_for(data=data)) as held, writing(held) as session:
        row = actions.revoke_key(session, actor=SERVER, key_id=key_id)
    typer.echo(f"Key {row.id} of {row.owner} is out of force since {moment(row.revoked_at)}.")
    return 0
