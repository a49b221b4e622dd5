"""`loopwright export`: a process model as a script for another tool."""

from pathlib import Path
from typing import Annotated

import typer

from advice.model_export import TARGETS, export_model
from service.cli.stating import PROCESS_HELP, process_from_text


def export(
    process: Annotated[str, typer.Argument(metavar="PROCESS", help=PROCESS_HELP)],
    target: Annotated[str, typer.Argument(metavar="TOOL", help=f"{', '.join(TARGETS)}.")],
    sample_time: Annotated[
        float | None, typer.Option(metavar="S", help="Sample time for gekko and do-mpc, seconds.")
    ] = None,
    to: Annotated[
        Path | None, typer.Option(metavar="FILE", help="File to write; standard output if none.")
    ] = None,
) -> int:
    """Write a process model as a short script for another tool.

    Exit code 0: answered. 2: called wrongly. 1: failed.
    """
    plant = process_from_text(process)
    try:
        script = export_model(plant, target, sample_time=sample_time)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    if to is None:
        typer.echo(script.text, nl=False)
    else:
        to.write_text(script.text, encoding="utf-8")
    return 0
