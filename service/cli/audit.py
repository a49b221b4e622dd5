"""`loopwright audit`: the trail proved intact, or taken away."""

from pathlib import Path
from typing import Annotated

import typer

from service.audit import actions
from service.audit.chain import Verdict, verify_export
from service.cli.installation import DataFolder, opened, settings_for

app = typer.Typer()
BROKEN = 3


@app.command()
def verify(
    head: Annotated[
        str | None,
        typer.Option(
            metavar="HASH",
            help="A head kept elsewhere, from a log or an export. Only with one is it shown that "
            "nothing was cut off or written anew.",
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Prove this export instead, without any database."),
    ] = None,
    data: DataFolder = None,
) -> int:
    """Recompute every hash of the trail and say whether the chain is intact.

    Exit code 0: intact. 3: broken, and where. 2: called wrongly. 1: failed.
    """
    known = _head(head)
    if export is not None:
        if not export.is_file():
            raise typer.BadParameter(f"there is no file {export}")
        with export.open(encoding="utf-8") as lines:
            return _say(verify_export(lines, known_head=known))
    with opened(settings_for(data=data)) as held, held.readings() as session:
        return _say(actions.verify(session, known_head=known))


@app.command("export")
def take_away(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="File to write, as JSON Lines.")],
    data: DataFolder = None,
) -> int:
    """Write the whole trail to a file that can be verified without the service."""
    with opened(settings_for(data=data)) as held:
        head, pieces = actions.export(held.readings)
        unfinished = file.with_name(f"{file.name}.part")
        try:
            with unfinished.open("wb") as target:
                target.writelines(pieces)
            unfinished.replace(file)
        finally:
            unfinished.unlink(missing_ok=True)
    typer.echo(f"{file} ends with the head {head}")
    return 0


def _head(text: str | None) -> str | None:
    if text is not None and (len(text) != 64 or set(text) - set("0123456789abcdef")):
        raise typer.BadParameter("--head must be 64 hexadecimal digits in lower case")
    return text


def _say(verdict: Verdict) -> int:
    if verdict.first_broken is None:
        typer.echo(f"The chain is intact: {verdict.rows} rows, head {verdict.head}")
        if verdict.known_head_row is not None:
            typer.echo(f"The known head is row {verdict.known_head_row}.")
        return 0
    typer.echo(f"The chain is broken at row {verdict.first_broken.row}.")
    typer.echo(verdict.first_broken.reason)
    return BROKEN
