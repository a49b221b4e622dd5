"""Decide decimal and thousands marks from the numbers at the start of a file."""

import re
from dataclasses import dataclass

from historian.assignment import Assignment
from historian.errors import AmbiguousNumber
from historian.numbers import NumberFormat, grouping_of
from historian.options import ReadOptions
from historian.table_shape import Table

_ONE_GROUP = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}\Z", re.ASCII)
_PLAIN = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\Z", re.ASCII)
_IN_NO_NUMBER = re.compile(r"[^0-9eE+\-.,'\s\u00a0\u202f\u2009\u2019\u2212]")
_POINT_GROUP = re.compile(r"[+-]?[1-9]\d{0,2}\.\d{3}\Z", re.ASCII)
_EXPONENT = re.compile(r"[eE][+-]?\d+\Z", re.ASCII)


def decide_numbers(table: Table, assignment: Assignment, options: ReadOptions) -> NumberFormat:
    """Decide how numbers are written.

    A point is the decimal mark unless commas say otherwise. A comma before exactly three digits in
    every number that has one may mark decimals or thousands: that is refused.

    Raises
    ------
    AmbiguousNumber
        Where both readings are possible.
    """
    marks = _marks(table, assignment)
    texts = [_EXPONENT.sub("", cell) for _, cell in marks.cells]
    groupings = {grouping_of(text) for text in texts} - {""}
    blank = next((mark for mark in (" ", "'") if mark in groupings), "")
    if options.decimal is not None:
        other = "," if options.decimal == "." else "."
        grouped = any(grouping_of(t) == other and _fits(t, options.decimal) for t in texts)
        grouped = grouped or (other == "." and marks.grouping and not marks.pointed)
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
    points_group = not marks.pointed and (marks.grouping or "." in groupings)
    if any(_ONE_GROUP.match(text) is None for text in with_comma):
        return NumberFormat(",", "." if points_group else blank)
    if marks.pointed or points_group:
        return NumberFormat(".", ",")
    line, cell = next((line, cell) for line, cell in marks.cells if "," in cell)
    raise AmbiguousNumber(
        cell,
        (f"{cell.replace(',', '.')} (decimal comma)", f"{cell.replace(',', '')} (thousands)"),
        line=line,
        column=None,
    )


def _fits(text: str, decimal: str) -> bool:
    return NumberFormat(decimal, "," if decimal == "." else ".").read(text) is not None


@dataclass(frozen=True, slots=True)
class _Marks:
    """Numbers that have marks beside one point, and what the others show.

    Attributes
    ----------
    cells : list of (int, str)
        Line and text of numbers with commas, blanks or several points.
    pointed : bool
        Whether a point must be the decimal mark of some number.
    grouping : bool
        Whether a point may as well group the digits of some number.
    """

    cells: list[tuple[int, str]]
    pointed: bool
    grouping: bool


def _marks(table: Table, assignment: Assignment) -> _Marks:
    columns = [s.column for s in assignment.signals if not s.is_mode]
    if assignment.long is not None:
        columns.append(assignment.long.value)
    columns += [column for time in assignment.times for column in time.columns]
    cells, pointed, grouping = [], False, False
    for line, row in table.rows:
        for column in dict.fromkeys(columns):
            cell = row[column] if column < len(row) else ""
            if _PLAIN.match(cell) is None:
                if _is_number(cell):
                    cells.append((line, cell))
            elif "." in cell:
                may_group = _POINT_GROUP.match(cell) is not None
                pointed, grouping = pointed or not may_group, grouping or may_group
    return _Marks(cells, pointed, grouping)


def _is_number(cell: str) -> bool:
    if _IN_NO_NUMBER.search(cell):  # quickly, as every stamp comes by here
        return False
    formats = (NumberFormat(), NumberFormat(","))
    return grouping_of(cell) != "" or any(f.read(cell) is not None for f in formats)
