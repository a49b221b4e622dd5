"""Take every decision about a file from its start; look further only for an open date order."""

import csv
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from historian.archives import LimitedReader, opened
from historian.assignment import Assignment
from historian.encoding import HEAD_BYTES, Block, Encoding, blocks, decide_encoding, keeps_ascii
from historian.errors import ExportRefused
from historian.layout import assign
from historian.number_format import decide_numbers
from historian.numbers import NumberFormat
from historian.options import ReadOptions
from historian.plan import Plan
from historian.quality import Scheme, decide_scheme, plain_word
from historian.table_shape import Table, find_table
from historian.time_format import (
    IN_STAMPS,
    OpenOrder,
    TimeFormat,
    decide_numeric,
    decide_stamps,
    is_time_kind,
    possible_orders,
)
from historian.timestamps import SECOND, StampReader, date_fields

_EXTENSIONS = re.compile(r"(?:\.(?:csv|txt|tsv|dat|asc|prn|gz|zip))+\Z", re.IGNORECASE)


def read_head(reader: LimitedReader) -> bytes:
    """Read the start of a file, as much as decisions are taken from."""
    head = b""
    while len(head) < HEAD_BYTES:
        piece = reader.read(HEAD_BYTES - len(head))
        if not piece:
            break
        head += piece
    return head


def plan_for(path: Path, options: ReadOptions) -> Plan:
    """Decide how a file is read.

    Raises
    ------
    ExportRefused
        Where the file is no export, or the user must state a decision.
    """
    with opened(path, options.max_bytes) as (reader, container):
        head = read_head(reader)
    encoding = decide_encoding(head, options.encoding)
    table = find_table(_whole_lines(head, encoding), encoding.line_end, options)
    assignment = assign(table, options, fallback_tag=_EXTENSIONS.sub("", path.name))
    numbers = decide_numbers(table, assignment, options)
    return Plan(
        container=container,
        encoding=encoding,
        table=table,
        numbers=numbers,
        time=_decide_time(path, encoding, table, assignment, numbers, options),
        assignment=assignment,
        schemes=_decide_schemes(table, assignment, options),
        options=options,
        expected_rows=_expected_rows(path, head, encoding) if container == "plain" else 0,
    )


def _expected_rows(path: Path, head: bytes, encoding: Encoding) -> int:
    lines = head.count(b"\r" if encoding.line_end == "CR" else b"\n")
    return int(path.stat().st_size / len(head) * (lines + 1) * 1.02)


def _whole_lines(head: bytes, encoding: Encoding) -> str:
    text = head.removeprefix(encoding.mark).decode(encoding.name, errors="replace")
    if len(head) < HEAD_BYTES:
        return text
    cut = max(text.rfind("\n"), text.rfind("\r"))
    if cut < 0:
        raise ExportRefused(
            f"The first line is longer than {HEAD_BYTES:,} bytes; this is no table.", line=1
        )
    return text[:cut]


def _decide_schemes(
    table: Table, assignment: Assignment, options: ReadOptions
) -> dict[int, Scheme]:
    columns = [s.quality for s in assignment.signals if s.quality is not None]
    if assignment.long is not None and assignment.long.quality is not None:
        columns.append(assignment.long.quality)
    schemes = {}
    for column in columns:
        if options.good_quality is not None:
            schemes[column] = Scheme.STATED
            continue
        cells = table.column(column)
        header = table.names[column] if table.header_line is not None else ""
        scheme = decide_scheme(header, cells)
        if scheme is None:
            seen = ", ".join(sorted({cell for cell in cells if cell})[:10])
            raise ExportRefused(
                f"The quality codes ({seen}) do not tell which of them are good; state those "
                "with good_quality={...}.",
                column=table.names[column],
            )
        schemes[column] = scheme
    return schemes


def _decide_time(
    path: Path,
    encoding: Encoding,
    table: Table,
    assignment: Assignment,
    numbers: NumberFormat,
    options: ReadOptions,
) -> TimeFormat:
    columns = [time.columns for time in assignment.times]
    first = columns[0]
    filled = [cell for cell in table.column(first[0]) if cell]
    header = table.names[first[0]] if table.header_line is not None else ""
    numeric = options.time_format is not None and options.time_format not in IN_STAMPS
    if numeric or not any(is_time_kind(cell) for cell in filled):
        decided: TimeFormat | OpenOrder = decide_numeric(filled, header, numbers, options)
    else:
        cells = [cell for group in columns for cell in table.column(group[0]) if cell]
        decided = decide_stamps(cells, options)
    if isinstance(decided, TimeFormat):
        return decided
    settled = _settled_by_day_numbers(table, first[0], decided)
    if settled is not None:
        return settled
    scanned = tuple(dict.fromkeys(group[0] for group in columns))
    return _settled_by_rows(path, encoding, table, scanned, decided, options)


def _settled_by_day_numbers(table: Table, column: int, left: OpenOrder) -> TimeFormat | None:
    """Compare stamps with the day numbers that some exports carry beside them."""
    beside = [j for j, name in enumerate(table.names) if plain_word(name) == "time_ms"]
    if not beside:
        return None
    stamps = pa.array(table.column(column), pa.string())
    try:
        days = np.array([float(c.replace(",", ".")) / 1e6 for c in table.column(beside[0]) if c])
    except ValueError:
        return None
    fitting = []
    for order in left.orders:
        instants, good = StampReader(order).read(stamps)
        found = instants[good] / SECOND / 86400 + 25569
        if found.size == days.size and np.all(np.abs(found - days) < 1):
            fitting.append(order)
    return left.settled(tuple(fitting), f"both the stamps and the day numbers of {beside[0] + 1}")


def _settled_by_rows(
    path: Path,
    encoding: Encoding,
    table: Table,
    columns: tuple[int, ...],
    left: OpenOrder,
    options: ReadOptions,
) -> TimeFormat:
    """Look through the whole file for a date that exists in one order only."""
    orders = left.orders
    read = _stamp_source(table, columns)
    with opened(path, options.max_bytes) as (reader, _):
        head = read_head(reader)
        for block in blocks(reader, head, encoding):
            for stamps in read(block, encoding):
                fields = date_fields(stamps)
                if len(fields):
                    orders = tuple(o for o in orders if o in possible_orders(fields))
            settled = left.settled(orders, "all dates of the file")
            if settled is not None:
                return settled
            if not orders:
                raise ExportRefused(
                    f"The dates, such as {left.example!r}, fit no single order of day, month and "
                    "year; state time_format='D/M/Y' or 'M/D/Y' to reject the others."
                )
    raise left.refusal(table.first_line, table.names[columns[0]])


def _stamp_source(
    table: Table, columns: tuple[int, ...]
) -> Callable[[Block, Encoding], list[pa.Array]]:
    names = [str(j) for j in range(table.width)]

    def read(block: Block, encoding: Encoding) -> list[pa.Array]:
        try:
            found = pa_csv.read_csv(
                pa.BufferReader(block.data),
                read_options=pa_csv.ReadOptions(
                    column_names=names, block_size=len(block.data) + 1, use_threads=False
                ),
                parse_options=pa_csv.ParseOptions(delimiter=table.delimiter),
                convert_options=pa_csv.ConvertOptions(
                    check_utf8=False,
                    include_columns=[str(j) for j in columns],
                    column_types={str(j): pa.string() for j in columns},
                ),
            )
        except pa.ArrowInvalid:
            name = encoding.name if keeps_ascii(encoding.name) else "utf-8"
            text = block.data.decode(name, errors="replace").replace("\0", "")
            rows = list(csv.reader(text.splitlines(), delimiter=table.delimiter))
            return [pa.array([r[j] for r in rows if len(r) > j], pa.string()) for j in columns]
        return [found.column(str(j)).combine_chunks() for j in columns]

    return read
