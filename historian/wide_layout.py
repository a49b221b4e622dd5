"""Wide files: a row is one instant, a column is one tag."""

import re

from historian.assignment import Assignment
from historian.column_view import COUNTER_NAMES, NUMBERED, VALUE_NAMES, ColumnView, distinct
from historian.errors import ColumnNotFound
from historian.options import Layout
from historian.tag_map import Part, part_of, split_unit
from historian.time_columns import find_time

_DAY_NUMBERS = "time_ms"
_UNIT = re.compile(
    r"[\[(]?(?:%|°?[CFKR]|deg ?[CFKR]?|bar[ag]?|m?bar|psi[ag]?|k?Pa|MPa|m3/h|m³/h|l/(?:h|min|s)"
    r"|t/h|kg/(?:h|s|m3)|rpm|V|m?A|k?W|MW|mm|cm|m|s|sec|min|h|Hz|pH|ppm|none|seconds|-|m/s|gpm"
    r"|Nm3/h|SCFH|MMSCFD|lb/h|kg|l|m3|g/l|mol|vol%|wt%|EU|PCT|date|time|timestamp)[\])]?\Z",
    re.IGNORECASE,
)


def assign_wide(view: ColumnView, times: list[int]) -> Assignment:
    """Assign the columns of a wide file.

    Raises
    ------
    ColumnNotFound, AmbiguousColumns
        Where there is no time or no value.
    """
    time = find_time(view, times)
    used = {*time.columns, time.milliseconds}
    wanted = _stated_values(view)
    qualities = _qualities(view, used)
    free = [j for j in view.every if j not in used and j not in qualities]
    values = [j for j in free if j in wanted or _is_value(view, j, times)]
    if not values:
        raise ColumnNotFound("a value", view.table.names, "state them with columns pv=..., op=...")
    of_value = {max(v for v in values if v < q): q for q in qualities if min(values) < q}
    names = distinct(view, values, [_name(view, j, len(values)) for j in values])
    signals = [
        view.signal(name, j, time, of_value.get(j)) for j, name in zip(values, names, strict=True)
    ]
    return Assignment(
        layout=Layout.WIDE, signals=tuple(signals), long=None, ignored=tuple(view.ignored)
    )


def _stated_values(view: ColumnView) -> set[int]:
    stated = {part.value: getattr(view.stated, part.value) for part in Part}
    stated["the value"] = view.stated.value
    return {view.resolve(c, role) for role, c in stated.items() if c is not None}


def _qualities(view: ColumnView, used: set[int | None]) -> list[int]:
    stated = view.stated.quality
    if stated is not None:
        chosen = stated if isinstance(stated, tuple) else (stated,)
        return [view.resolve(column, "the quality") for column in chosen]
    return [j for j in view.every if j not in used and view.is_quality(j)]


def _is_value(view: ColumnView, index: int, times: list[int]) -> bool:
    part = part_of(view.table.names[index]) if view.named else None
    if index in times:
        view.ignore(index, "another column is the time")
    elif view.plain(index) == _DAY_NUMBERS:
        view.ignore(index, "it repeats the time as a day number")
    elif view.plain(index) in COUNTER_NAMES:
        view.ignore(index, "it counts the rows")
    elif view.is_blank(index):
        return False
    elif part is None and not view.seen[index].is_numeric:
        view.ignore(index, "it holds text; if it names the tag, state it with columns.tag")
    else:
        return True
    return False


def _name(view: ColumnView, index: int, count: int) -> tuple[str, str]:
    name, unit = split_unit(NUMBERED.sub("", view.table.names[index]))
    nameless = not view.named or view.plain(index) in VALUE_NAMES
    if count == 1 and nameless:
        name = view.fallback_tag
    return name, unit or _unit_below(view, index)


def _unit_below(view: ColumnView, index: int) -> str:
    """Take the unit from a second row of headings that holds only units."""
    for heading in view.table.other_headers:
        cells = [cell for cell in heading if cell]
        if cells and all(_UNIT.match(cell) for cell in cells) and index < len(heading):
            return heading[index].strip("[]() ")
    return ""
