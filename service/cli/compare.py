"""`loopwright compare`: two periods of a file, and whether the control error changed."""

import json
from datetime import UTC, datetime
from typing import Annotated, TypeAlias

import typer

from advice.assessment_body import fields_body
from advice.effect import Effect, effect
from loop.record import Record
from monitoring.before_after import Change
from service.cli import reading

REFUSED = 3

Span: TypeAlias = tuple[float, float]


def compare(
    file: reading.ExportFile,
    before: Annotated[
        str, typer.Option(metavar="FROM..TO", help="First period: instants (UTC), or seconds.")
    ],
    after: Annotated[str, typer.Option(metavar="FROM..TO", help="Second period.")],
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    sp: reading.SPColumn = None,
    mode: reading.ModeColumn = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the `effect` that the API answers.")
    ] = False,
    tag: reading.Tag = None,
    delimiter: reading.Delimiter = None,
    decimal: reading.Decimal = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
    mode_code: reading.ModeCode = None,
) -> int:
    """Compare the control error of two periods of a file, such as before and after a change.

    Exit code 0: answered. 3: they cannot be compared, with the reason. 2: called wrongly.
    1: failed.
    """
    stated = reading.Stated(
        time=time, pv=pv, op=op, sp=sp, mode=mode, tag=tag, delimiter=delimiter, decimal=decimal,
        time_format=time_format, time_zone=time_zone, day_first=day_first, layout=layout,
        mode_code=mode_code,
    )  # fmt: skip
    record, _ = reading.read_record(file, stated)
    first, second = (_part(record, text) for text in (before, after))
    found = effect(first, second)
    if as_json:
        typer.echo(json.dumps(fields_body(found), indent=1, allow_nan=False))
    else:
        print_effect(found)
    return REFUSED if found.comparison.change is Change.NOT_COMPARABLE else 0


def print_effect(found: Effect) -> None:
    """Say in words what two periods show."""
    one = found.comparison
    typer.echo(f"The control error afterwards: {one.change}")
    if one.ratio is not None and one.low is not None and one.high is not None:
        typer.echo(
            f"Its root mean square is {one.ratio:.3g} times that before "
            f"(95 %: {one.low:.3g} to {one.high:.3g})"
        )
    typer.echo(
        f"In control for {found.controlled_before:.0%} of the time before, "
        f"{found.controlled_after:.0%} after"
    )
    for reason in one.basis.reasons:
        typer.echo(f"  {reason}")


def _part(record: Record, text: str) -> Record:
    """Cut a period out of a record."""
    first, middle, last = text.partition("..")
    if not middle:
        raise typer.BadParameter(f"a period is FROM..TO, got {text!r}")
    start, end = _seconds(record, first), _seconds(record, last)
    if not start < end:
        raise typer.BadParameter(f"a period ends after it begins, got {text!r}")
    try:
        # The end itself belongs to what comes after.
        return record.between(start, end - 1e-9 * max(abs(end), 1.0))
    except ValueError as error:
        raise typer.BadParameter(f"no sample lies within {text}") from error


def _seconds(record: Record, text: str) -> float:
    """Read an instant as time since the start of a record. [s]"""
    try:
        return float(text)
    except ValueError:
        pass
    if record.start is None:
        raise typer.BadParameter(f"this file has elapsed time: state seconds, got {text!r}")
    try:
        at = datetime.fromisoformat(text.strip())
    except ValueError as error:
        raise typer.BadParameter(
            f"an instant is such as 2026-01-31T08:00:00Z, or seconds; got {text!r}"
        ) from error
    at = at if at.tzinfo is not None else at.replace(tzinfo=UTC)
    return (at - record.start).total_seconds()
