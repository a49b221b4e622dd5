"""Paired files: every tag has a time column and a value column, with its own number of rows."""

import re

from historian.assignment import Assignment, TimeColumns
from historian.cell_kind import Kind
from historian.column_view import NUMBERED, VALUE_NAMES, ColumnView, distinct
from historian.errors import AmbiguousColumns, ColumnNotFound
from historian.options import Layout
from historian.quality import plain_word
from historian.tag_map import part_of, split_unit
from historian.time_format import names_time

_ENDING = re.compile(r"[ ._-](?:time|timestamp|value|zeit|wert)\Z", re.IGNORECASE)


def is_paired(view: ColumnView, times: list[int]) -> bool:
    """Tell whether several time columns are each followed by a value."""
    if view.options.layout is not None:
        return view.options.layout is Layout.PAIRS
    if view.stated.time is not None:
        return False
    full = [j for j in times if view.seen[j].usual is not Kind.CLOCK] or numeric_times(view)
    ends = [*full[1:], view.table.width]
    return len(full) >= 2 and all(b - a >= 2 for a, b in zip(full, ends, strict=True))


def numeric_times(view: ColumnView) -> list[int]:
    """Find the columns of numbers whose headings speak of time."""
    return [
        j
        for j in view.every
        if view.named
        and view.seen[j].usual is Kind.NUMBER
        and names_time(NUMBERED.sub("", view.table.names[j]))
        and part_of(view.table.names[j]) is None
    ]


def assign_pairs(view: ColumnView, times: list[int]) -> Assignment:
    """Assign the columns of a paired file.

    Raises
    ------
    ColumnNotFound, AmbiguousColumns
        Where a time has no value or several.
    """
    times = times or numeric_times(view)
    if not times:
        raise ColumnNotFound("the times of pairs", view.table.names, "state another layout")
    found: list[tuple[int, int, int | None]] = []
    for start, end in zip(times, [*times[1:], view.table.width], strict=True):
        inside = [j for j in range(start + 1, end) if not view.is_blank(j)]
        quality = next((j for j in inside if view.is_quality(j)), None)
        values = [j for j in inside if j != quality]
        if not values:
            view.ignore(start, "no value stands beside it")
            continue
        if len(values) > 1:
            several = tuple(view.table.names[j] for j in values)
            raise AmbiguousColumns("the value of one pair", several, "state another layout")
        found.append((start, values[0], quality))
    if not found:
        raise ColumnNotFound("the values of pairs", view.table.names, "state another layout")
    columns = [value for _, value, _ in found]
    names = distinct(view, columns, [_name(view, start, value) for start, value, _ in found])
    signals = [
        view.signal(name, value, TimeColumns(columns=(start,)), quality)
        for name, (start, value, quality) in zip(names, found, strict=True)
    ]
    return Assignment(
        layout=Layout.PAIRS, signals=tuple(signals), long=None, ignored=tuple(view.ignored)
    )


def _name(view: ColumnView, time: int, value: int) -> tuple[str, str]:
    """Take tag and unit from whichever heading is more than "Time" or "Value"."""
    headings = [view.table.names, *view.table.other_headers] if view.named else []
    for column in (value, time):
        for heading in headings:
            cell = heading[column] if column < len(heading) else ""
            name, unit = split_unit(NUMBERED.sub("", cell))
            name = _ENDING.sub("", name)
            plain = plain_word(name)
            generic = plain in VALUE_NAMES or plain.startswith("column") or names_time(name)
            if plain and (part_of(name) is not None or not generic):
                return name, unit
    return f"column {value + 1}", ""
