"""`loopwright import`: an export on the server's disk, stored as if it were uploaded."""

from datetime import datetime
from typing import Annotated

import typer
from fastapi.exceptions import RequestValidationError
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from service.actors import Role
from service.cli import reading
from service.cli.installation import DataFolder, acting, loop_tagged, opened, settings_for
from service.cli.listing import moment
from service.records.local_file import store_file
from service.records.progress import Stage
from service.samples import open_samples
from service.tables import RecordRow

STAGES = {"receiving": "Hashing", "reading": "Reading", "storing": "Storing"}


def import_export(
    file: reading.ExportFile,
    loop: Annotated[str, typer.Option(metavar="TAG", help="Loop the samples belong to.")],
    time: reading.TimeColumn = None,
    pv: reading.PVColumn = None,
    op: reading.OPColumn = None,
    sp: reading.SPColumn = None,
    mode: reading.ModeColumn = None,
    tag: reading.Tag = None,
    delimiter: reading.Delimiter = None,
    decimal: reading.Decimal = None,
    time_format: reading.TimeFormat = None,
    time_zone: reading.TimeZone = None,
    day_first: reading.DayFirst = None,
    layout: reading.LayoutChoice = None,
    mode_code: reading.ModeCode = None,
    start: Annotated[
        datetime | None,
        typer.Option(
            formats=["%Y-%m-%dT%H:%M:%S%z", "%Y-%m-%dT%H:%M%z"],
            metavar="STAMP",
            help="Instant of time 0, such as 2026-01-31T08:00:00Z, for a file of elapsed time.",
        ),
    ] = None,
    data: DataFolder = None,
) -> int:
    """Store an export as a record of a loop; stored again, it changes nothing.

    LOOPWRIGHT_KEY holds your API key, of an engineer or higher: the audit trail says who stored it.
    """
    if not file.is_file():
        raise typer.BadParameter(f"there is no file {file}")
    stated: dict[str, object] = {
        "time": time, "pv": pv, "op": op, "sp": sp, "mode": mode, "tag": tag,
        "delimiter": delimiter, "decimal": decimal, "time_format": time_format,
        "time_zone": time_zone, "day_first": day_first, "layout": layout,
        "start": None if start is None else start.isoformat(),
    }  # fmt: skip
    fields: dict[str, tuple[str, ...]] = {
        name: (str(value),) for name, value in stated.items() if value is not None
    }
    if mode_code:
        fields["mode_code"] = tuple(mode_code)
    settings = settings_for(data=data)
    with opened(settings) as held:
        actor = acting(held, Role.ENGINEER)
        with held.readings() as session:
            loop_id = loop_tagged(session, loop).id
        with _Bar() as bar:
            try:
                row, is_new = store_file(
                    held,
                    open_samples(settings),
                    settings,
                    actor=actor,
                    loop_id=loop_id,
                    file=file,
                    fields=fields,
                    teller=bar.tell,
                )
            except RequestValidationError as error:
                raise typer.BadParameter(_faults(error)) from error
    _say(row, loop, is_new=is_new)
    return 0


class _Bar(Progress):
    """One bar on standard error that starts anew with each stage."""

    def __init__(self) -> None:
        super().__init__(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._stage = ""
        self._shown = self.add_task("Importing", total=None)

    def tell(self, stage: Stage, done: int, total: int | None) -> None:
        """Show how far a stage is."""
        if stage != self._stage:
            self._stage = stage
            self.reset(self._shown, description=STAGES[stage], total=total)
        self.update(self._shown, completed=done, total=total)


def _say(row: RecordRow, loop: str, *, is_new: bool) -> None:
    typer.echo(f"Record {row.id} of {loop}" + ("" if is_new else ", which was stored before"))
    typer.echo(f"  {row.samples} samples, {moment(row.first_time)} to {moment(row.last_time)}")
    counts = row.accounting
    typer.echo(
        f"  {counts['rows_read']} rows: {counts['rows_kept']} kept, "
        f"{counts['rows_rejected']} rejected, {counts['duplicates']} duplicates; "
        f"{counts['gaps']} gaps"
    )
    tags = row.decisions["tags"]
    parts = tags.items() if isinstance(tags, dict) else ()
    typer.echo(f"  taken from the file: {', '.join(f'{part} {tag}' for part, tag in parts)}")
    words = row.decisions["words"]
    for sentence in words if isinstance(words, list) else []:
        typer.echo(f"  {sentence}")


def _faults(error: RequestValidationError) -> str:
    return "; ".join(
        f"{'.'.join(str(part) for part in fault['loc'][1:])}: "
        f"{str(fault['msg']).removeprefix('Value error, ')}".removeprefix(": ")
        for fault in error.errors()
    )
