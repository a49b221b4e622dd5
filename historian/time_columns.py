"""Find the time of an export: a stamp, a date beside a time of day, or a rising number."""

from itertools import pairwise

from historian.assignment import TimeColumns
from historian.cell_kind import Kind, kind_of
from historian.column_view import COUNTER_NAMES, ColumnView
from historian.errors import ExportRefused
from historian.stamp_shape import is_midnight
from historian.tag_map import part_of
from historian.time_format import names_time

_SUBSECOND_NAMES = frozenset({"milliseconds", "millisecond", "ms", "msec", "millis"})


def find_time(view: ColumnView, times: list[int]) -> TimeColumns:
    """Find the columns that make up the time.

    Parameters
    ----------
    view : ColumnView
    times : list of int
        Columns of dates and times.

    Raises
    ------
    ColumnNotFound, AmbiguousColumns
    """
    if view.stated.time is not None:
        chosen: tuple[int, ...] = (view.resolve(view.stated.time, "the time"),)
        if view.stated.date is not None:
            chosen = (view.resolve(view.stated.date, "the date"), *chosen)
        return TimeColumns(columns=chosen, milliseconds=_milliseconds(view, chosen[-1]))
    if not times:
        return TimeColumns(columns=(_rising_number(view),))
    dates = [j for j in times if view.seen[j].usual is Kind.DATE]
    clocks = [j for j in times if view.seen[j].usual is Kind.CLOCK]
    stamps = [j for j in times if view.seen[j].usual is Kind.STAMP]
    if not stamps and len(clocks) == 1:
        days = dates
    else:
        days = [j for j in stamps if _only_midnights(view, j)] if len(stamps) == 1 else []
    if len(days) == 1 and len(clocks) == 1:
        return TimeColumns(
            columns=(days[0], clocks[0]), milliseconds=_milliseconds(view, clocks[0])
        )
    chosen_one = view.only(stamps or dates or clocks, "the time", "columns.time")
    return TimeColumns(columns=(chosen_one,), milliseconds=_milliseconds(view, chosen_one))


def _only_midnights(view: ColumnView, index: int) -> bool:
    """Tell whether a spreadsheet wrote dates with an empty time of day."""
    return all(is_midnight(cell) for cell in view.table.column(index) if cell)


def _milliseconds(view: ColumnView, clock: int) -> int | None:
    after = clock + 1
    if after < view.table.width and view.plain(after) in _SUBSECOND_NAMES:
        cells = [cell for cell in view.table.column(after) if cell]
        fitting = sum(cell.isdecimal() and int(cell) < 1000 for cell in cells)
        if cells and fitting * 2 >= len(cells):
            return after
    return None


def _rising_number(view: ColumnView) -> int:
    """Choose among numeric columns: by heading, else the first one if it only rises or falls.

    Where another heading speaks of time, its cells are times in an unknown format, and a number
    that happens to rise is none.
    """
    numeric = [
        j
        for j, seen in enumerate(view.seen)
        if seen.usual is Kind.NUMBER and view.plain(j) not in COUNTER_NAMES
    ]
    named = [j for j in numeric if view.named and names_time(view.table.names[j])]
    if not named:
        _refuse_unknown_format(view)
        first = numeric[:1]
        if first and _is_ordered(view.table.column(first[0])) and not _is_part(view, first[0]):
            named = first
    return view.only(named, "the time", "columns.time")


def _refuse_unknown_format(view: ColumnView) -> None:
    for j in view.every:
        if view.named and names_time(view.table.names[j]) and view.seen[j].usual is Kind.TEXT:
            cells = view.table.column(j)
            example = next(cell for cell in cells if kind_of(cell) is Kind.TEXT)
            raise ExportRefused(
                f"The times, such as {example!r}, are in no known format; export them as "
                "YYYY-MM-DD hh:mm:ss, or state another time column with columns.time.",
                line=view.table.first_line,
                column=view.table.names[j],
            )


def _is_part(view: ColumnView, index: int) -> bool:
    return view.named and part_of(view.table.names[index]) is not None


def _is_ordered(cells: list[str]) -> bool:
    values = []
    for cell in cells:
        try:
            values.append(float(cell.replace(",", ".")))
        except ValueError:
            continue
    steps = [b - a for a, b in pairwise(values)]
    if not steps:
        return len(values) == 1
    return any(steps) and (all(s >= 0 for s in steps) or all(s <= 0 for s in steps))
