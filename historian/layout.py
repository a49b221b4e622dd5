"""Decide whether a file is wide, long or paired, and give every column its part."""

from historian.assignment import Assignment
from historian.column_view import ColumnView
from historian.long_layout import assign_long, find_tag_column
from historian.options import ReadOptions
from historian.pairs_layout import assign_pairs, is_paired
from historian.table_shape import Table
from historian.wide_layout import assign_wide


def assign(table: Table, options: ReadOptions, fallback_tag: str) -> Assignment:
    """Give every column its part.

    Parameters
    ----------
    table : Table
        The table as the start of the file shows it.
    options : ReadOptions
        What the user states.
    fallback_tag : str
        Name of the only tag, where the file gives none.

    Raises
    ------
    ColumnNotFound, AmbiguousColumns
        Where a column is missing or several are possible.
    """
    view = ColumnView(table, options, fallback_tag)
    times = [j for j, seen in enumerate(view.seen) if seen.is_time]
    tag = find_tag_column(view, times)
    if tag is not None:
        return assign_long(view, times, tag)
    if is_paired(view, times):
        return assign_pairs(view, times)
    return assign_wide(view, times)
