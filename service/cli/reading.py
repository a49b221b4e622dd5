"""Options that every command which reads an export shares, and the file as one loop's record."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, TypeAlias

import typer
from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn

from historian.csv_file import read_export
from historian.errors import AmbiguousColumns, ColumnNotFound
from historian.export import Export
from historian.options import Columns, Layout, ReadOptions
from loop.record import Mode, Record

# A bar for less than this would only flash.
WORTH_A_BAR = 20_000_000

ExportFile: TypeAlias = Annotated[
    Path, typer.Argument(metavar="FILE", help="Historian export: CSV or text, also .gz or .zip.")
]


def _column(name: str, what: str) -> typer.models.OptionInfo:
    option: typer.models.OptionInfo = typer.Option(
        f"--{name}", metavar="COL", help=f"Column with the {what}, by name or number from 1."
    )
    return option


TimeColumn: TypeAlias = Annotated[str | None, _column("time", "time: seconds or any stamp")]
PVColumn: TypeAlias = Annotated[str | None, _column("pv", "process variable")]
OPColumn: TypeAlias = Annotated[str | None, _column("op", "controller output")]
SPColumn: TypeAlias = Annotated[str | None, _column("sp", "set point")]
ModeColumn: TypeAlias = Annotated[str | None, _column("mode", "mode")]
OpBefore: TypeAlias = Annotated[
    float | None,
    typer.Option(metavar="X", help="Output before the first row, if the step is at that row."),
]
Tag: TypeAlias = Annotated[
    str | None, typer.Option(help="Loop to take, where the file has several.")
]
Delimiter: TypeAlias = Annotated[
    str | None, typer.Option(help="What separates cells, such as ';' or tab.")
]
Decimal: TypeAlias = Annotated[str | None, typer.Option(help="What marks decimals: '.' or ','.")]
TimeFormat: TypeAlias = Annotated[
    str | None, typer.Option(help="Kind of time, such as D/M/Y, Y/M/D, elapsed_s, epoch_ms.")
]
TimeZone: TypeAlias = Annotated[
    str | None, typer.Option(help="Zone of stamps that state none, such as Europe/Berlin.")
]
DayFirst: TypeAlias = Annotated[
    bool | None,
    typer.Option("--day-first/--month-first", help="Settles dates such as 03/04/2024."),
]
LayoutChoice: TypeAlias = Annotated[
    Layout | None, typer.Option("--layout", help="How samples lie in the file.")
]
ModeCode: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(metavar="CODE=MODE", help="Meaning of a mode code, such as 1=AUTO; repeatable."),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """What the user stated about a file."""

    time: str | None = None
    pv: str | None = None
    op: str | None = None
    sp: str | None = None
    mode: str | None = None
    op_before: float | None = None
    tag: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    time_format: str | None = None
    time_zone: str | None = None
    day_first: bool | None = None
    layout: Layout | None = None
    mode_code: list[str] | None = None

    def options(self) -> ReadOptions:
        """Turn the command's options into the reader's."""
        return ReadOptions(
            delimiter="\t" if self.delimiter in ("tab", "\\t") else self.delimiter,
            decimal=self.decimal,
            layout=self.layout,
            time_format=self.time_format,
            day_first=self.day_first,
            time_zone=self.time_zone,
            columns=Columns(
                time=_by_number(self.time),
                pv=_by_number(self.pv),
                op=_by_number(self.op),
                sp=_by_number(self.sp),
                mode=_by_number(self.mode),
            ),
            mode_codes=dict(_mode_code(text) for text in self.mode_code or ()),
        )


def _by_number(column: str | None) -> str | int | None:
    return int(column) if column is not None and column.isdecimal() else column


def _mode_code(text: str) -> tuple[int | str, Mode]:
    code, _, name = text.rpartition("=")
    if not code or name.upper() not in Mode.__members__:
        raise typer.BadParameter(
            f"--mode-code must be CODE=MODE with a MODE of {', '.join(Mode.__members__)}, "
            f"got {text!r}"
        )
    return (int(code) if code.lstrip("-").isdecimal() else code), Mode[name.upper()]


def read_file(file: Path, stated: Stated) -> Export:
    """Read an export, with a progress bar where it takes a while.

    Raises
    ------
    typer.BadParameter
        There is no such file or column, or an option cannot be.
    """
    if not file.is_file():
        raise typer.BadParameter(f"there is no file {file}")
    try:
        options = stated.options()
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    try:
        if file.stat().st_size < WORTH_A_BAR:
            return read_export(file, options=options)
        columns = ("Reading", BarColumn(), DownloadColumn(), TimeRemainingColumn())
        with Progress(*columns, transient=True) as bar:
            task = bar.add_task("", total=file.stat().st_size)
            return read_export(
                file, options=options, progress=lambda done: bar.update(task, completed=done)
            )
    except (ColumnNotFound, AmbiguousColumns) as error:
        raise typer.BadParameter(str(error)) from error


def read_record(file: Path, stated: Stated) -> tuple[Record, Export]:
    """Read one loop of an export as a record, with the export it comes from.

    Raises
    ------
    typer.BadParameter
        There is no such file, column or loop, or several loops and none is named.
    """
    export = read_file(file, stated)
    try:
        record = export.record(stated.tag)
    except (ColumnNotFound, AmbiguousColumns) as error:
        raise typer.BadParameter(str(error)) from error
    return replace(record, op_before=stated.op_before), export
