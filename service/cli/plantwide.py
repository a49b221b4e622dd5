"""`loopwright plantwide`: routine data of several loops in, what they have in common out."""

import json
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from advice.display import digits
from advice.plantwide import plant_oscillations
from advice.plantwide_body import plantwide_body
from advice.plantwide_result import OscillationGroup, PlantOscillations
from service.cli import reading
from service.cli.listing import print_columns
from service.cli.many_loops import files_of, records_in

REFUSED = 3
HEADINGS = ("", "Loop", "Likely", "Because")


def plantwide(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE|FOLDER...",
            help="Exports (CSV), Parquet files or folders of them, with two loops or more.",
        ),
    ],
    level: Annotated[
        list[str] | None,
        typer.Option(metavar="TAG", help="Loop that controls a level; repeatable."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the document that the API answers.")
    ] = False,
    time: reading.TimeColumn = None,
    tag: reading.Tag = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
    mode_code: reading.ModeCode = None,
) -> int:
    """Find loops that oscillate together, where that likely begins, and cascades.

    Exit code 0: answered. 3: fewer than two loops could be looked at, with the reasons.
    2: called wrongly. 1: failed.
    """
    stated = reading.Stated(
        time=time, tag=tag, time_format=time_format, time_zone=time_zone, day_first=day_first,
        layout=layout, mode_code=mode_code,
    )  # fmt: skip
    files = chain.from_iterable(map(files_of, sources))
    records = [*records_in(files, stated)]
    found = plant_oscillations(records, levels=level or ())
    if as_json:
        typer.echo(json.dumps(plantwide_body(found), indent=1, allow_nan=False))
    else:
        _print(found)
    return 0 if len(records) - len(found.left_out) >= 2 else REFUSED


def _print(found: PlantOscillations) -> None:
    if not found.groups:
        typer.echo("No loops oscillate together.")
    for group in found.groups:
        _print_group(group)
    for pair in found.cascades:
        typer.echo(f"Cascade: {pair.outer} sets the set point of {pair.inner}.")
    for tag, reason in found.left_out:
        typer.echo(f"Left out: {tag}: {reason}.")


def _print_group(group: OscillationGroup) -> None:
    count = len(group.suspects)
    typer.echo(f"{count} loops oscillate together, period {digits(group.period)} s.")
    typer.echo(group.reason)
    rows = [
        (
            f"{place}.",
            one.tag,
            f"{one.probability:.0%}",
            one.reason,
        )
        for place, one in enumerate(group.suspects, start=1)
    ]
    print_columns(HEADINGS, rows)
    typer.echo("")
