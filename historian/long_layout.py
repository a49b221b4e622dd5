"""Long files: a row is one sample of one tag."""

from historian.assignment import Assignment, LongColumns
from historian.cell_kind import Kind
from historian.column_view import TAG_NAMES, VALUE_NAMES, ColumnView
from historian.errors import ExportRefused
from historian.options import Layout
from historian.time_columns import find_time

_MOST_COLUMNS_WITHOUT_NAMES = 5


def find_tag_column(view: ColumnView, times: list[int]) -> int | None:
    """Find the column that names the tag of every row, None where the file is not long.

    A heading such as Tagname tells, or a column of text in a file without headings. A column of
    text under another heading may be anything, and is not taken.
    """
    layout = view.options.layout
    if view.stated.tag is not None:
        return view.resolve(view.stated.tag, "the tag")
    if layout in (Layout.WIDE, Layout.PAIRS):
        return None
    named = [
        j
        for j in view.every
        if view.plain(j) in TAG_NAMES and view.seen[j].usual in {Kind.TEXT, Kind.NUMBER}
    ]
    if named:
        return view.only(named, "the tag", "columns.tag")
    texts = [j for j in view.every if view.seen[j].usual is Kind.TEXT]
    bare = not view.named and bool(times) and view.table.width <= _MOST_COLUMNS_WITHOUT_NAMES
    if layout is Layout.LONG or (bare and texts):
        return view.only(texts, "the tag", "columns.tag")
    return None


def assign_long(view: ColumnView, times: list[int], tag: int) -> Assignment:
    """Assign the columns of a long file."""
    time = find_time(view, [j for j in times if j != tag])
    used = {*time.columns, tag, time.milliseconds}
    quality = _quality(view, used)
    free = [j for j in view.every if j not in used and j != quality]
    value = _value(view, free)
    for j in free:
        if j != value and not view.is_blank(j):
            view.ignore(j, "a long file has one value column")
    return Assignment(
        layout=Layout.LONG,
        signals=(),
        long=LongColumns(time=time, tag=tag, value=value, quality=quality),
        ignored=tuple(view.ignored),
    )


def _value(view: ColumnView, free: list[int]) -> int:
    if view.stated.value is not None:
        return view.resolve(view.stated.value, "the value")
    numeric = [j for j in free if view.seen[j].is_numeric and view.seen[j].usual is not Kind.EMPTY]
    named = [j for j in numeric if view.plain(j) in VALUE_NAMES]
    modes = [j for j in free if view.seen[j].usual is Kind.MODE]
    return view.only(named or numeric or modes, "the value", "columns.value")


def _quality(view: ColumnView, used: set[int | None]) -> int | None:
    stated = view.stated.quality
    if isinstance(stated, tuple):
        if len(stated) != 1:
            raise ExportRefused("A long file has one quality column; state only one.")
        stated = stated[0]
    if stated is not None:
        return view.resolve(stated, "the quality")
    choice = [j for j in view.every if j not in used and view.is_quality(j)]
    return view.only(choice, "the quality", "columns.quality") if choice else None
