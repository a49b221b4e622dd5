"""Decide decimal and thousands marks from the numbers at the start of a file."""

import re

from historian.assignment import Assignment
from historian.errors import AmbiguousNumber
from historian.numbers import NumberFormat, grouping_of
from historian.options import ReadOptions
from historian.table_shape import Table

_ONE_GROUP = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}\Z")
_PLAIN = re.compile(r"[+-]?\d+(?:\.(?:\d{0,2}|\d{4,}))?\Z")  # one reading only
_EXPONENT = re.compile(r"[eE][+-]?\d+\Z")


def decide_numbers(table: Table, assignment: Assignment, options: ReadOptions) -> NumberFormat:
    """Decide how numbers are written.

    A point is the decimal mark unless commas say otherwise. A comma before exactly three digits in
    every number that has one may mark decimals or thousands: that is refused.

    Raises
    ------
    AmbiguousNumber
        Where both readings are possible.
    """
    cells, pointed = _marked_cells(table, assignment)
    texts = [_EXPONENT.sub("", cell) for _, cell in cells]
    groupings = {grouping_of(text) for text in texts} - {""}
    blank = next((mark for mark in (" ", "'") if mark in groupings), "")
    if options.decimal is not None:
        other = "," if options.decimal == "." else "."
        grouped = any(grouping_of(t) == other and _fits(t, options.decimal) for t in texts)
        return NumberFormat(options.decimal, other if grouped else blank)
    with_comma = [text for text in texts if "," in text]
    if not with_comma:
        several = any(text.count(".") > 1 for text in texts)
        return NumberFormat(",", ".") if several else NumberFormat(".", blank)
    with_both = [text for text in with_comma if "." in text]
    if with_both:
        comma_last = with_both[0].rfind(",") > with_both[0].rfind(".")
        return NumberFormat(",", ".") if comma_last else NumberFormat(".", ",")
    if any(text.count(",") > 1 for text in with_comma):
        return NumberFormat(".", ",")
    points_group = not pointed and any(grouping_of(text) == "." for text in texts)
    if any(_ONE_GROUP.match(text) is None for text in with_comma):
        return NumberFormat(",", "." if points_group else blank)
    if pointed or points_group:
        return NumberFormat(".", ",")
    line, cell = next((line, cell) for line, cell in cells if "," in cell)
    raise AmbiguousNumber(
        cell,
        (f"{cell.replace(',', '.')} (decimal comma)", f"{cell.replace(',', '')} (thousands)"),
        line=line,
        column=None,
    )


def _fits(text: str, decimal: str) -> bool:
    return NumberFormat(decimal, "," if decimal == "." else ".").read(text) is not None


def _marked_cells(table: Table, assignment: Assignment) -> tuple[list[tuple[int, str]], bool]:
    """List the numbers whose marks need thought, and tell whether others have a decimal point."""
    columns = [s.column for s in assignment.signals if not s.is_mode]
    if assignment.long is not None:
        columns.append(assignment.long.value)
    columns += [column for time in assignment.times for column in time.columns]
    cells, pointed = [], False
    for line, row in table.rows:
        for column in dict.fromkeys(columns):
            cell = row[column] if column < len(row) else ""
            if _PLAIN.match(cell) is not None:
                pointed = pointed or "." in cell
            elif _is_number(cell):
                cells.append((line, cell))
    return cells, pointed


def _is_number(cell: str) -> bool:
    formats = (NumberFormat(), NumberFormat(","))
    return grouping_of(cell) != "" or any(f.read(cell) is not None for f in formats)
