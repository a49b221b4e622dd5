"""Give every column its part: time, tag, value, quality; wide, long or a pair of columns a tag."""

import re
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

from historian.cell_kind import TIMES, Kind, kind_of
from historian.errors import AmbiguousColumns, ColumnNotFound, ExportRefused
from historian.options import Layout, ReadOptions
from historian.quality import is_good_word, plain_word
from historian.table_shape import Table
from historian.tag_map import Part, part_of, split_unit
from historian.time_format import names_time

_TAG_NAMES = frozenset(
    {"tag", "tags", "tagname", "tagid", "tag_id", "varname", "variable", "name", "point",
     "pointname", "pointid", "itemid", "item", "signal", "sensor", "fqn", "path", "tagpath",
     "channel", "kanal", "messstelle", "variablenname", "nom"}
)  # fmt: skip
_VALUE_NAMES = frozenset(
    {"value", "varvalue", "floatvalue", "val", "v", "wert", "valeur", "valor", "vvalue", "tagval",
     "data"}
)  # fmt: skip
_QUALITY_NAMES = frozenset(
    {"quality", "dataquality", "validity", "dataintegrity", "opcquality", "opcqualitycode",
     "qualitycode", "tagquality", "status", "valid", "isgood", "good", "qualität", "l",
     "questionable", "ip_input_quality"}
)  # fmt: skip
_COUNTER_NAMES = frozenset({"id", "index", "idx", "row", "no", "no.", "nr", "nr.", "#", "rowid"})
_SUBSECOND_NAMES = frozenset({"milliseconds", "millisecond", "ms", "msec", "millis", "time_ms"})
_QUALITY_ENDING = re.compile(
    r"[ ._:/-](?:quality|status|validity|q|qual|opcquality)\Z", re.IGNORECASE
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeColumns:
    """Columns that make up one time.

    Attributes
    ----------
    columns : tuple of int
        One column, or a date and a time of day.
    milliseconds : int or None
        Column with the milliseconds, where they stand apart.
    """

    columns: tuple[int, ...]
    milliseconds: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """One tag of a wide or paired file.

    Attributes
    ----------
    tag, unit : str
        Its name and unit, from the heading.
    column : int
        Column of its values.
    time : TimeColumns
        Columns of its times.
    quality : int or None
        Column of its quality.
    is_mode : bool
        Whether cells are controller modes.
    """

    tag: str
    unit: str
    column: int
    time: TimeColumns
    quality: int | None
    is_mode: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LongColumns:
    """Columns of a long file."""

    time: TimeColumns
    tag: int
    value: int
    quality: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """What every column of a file is.

    Attributes
    ----------
    layout : Layout
        Wide, long or pairs.
    signals : tuple of Signal
        Tags of a wide or paired file, empty for a long one.
    long : LongColumns or None
        Columns of a long file.
    ignored : tuple of (str, str)
        Columns that are not read, and why.
    """

    layout: Layout
    signals: tuple[Signal, ...]
    long: LongColumns | None
    ignored: tuple[tuple[str, str], ...]

    @property
    def time(self) -> TimeColumns:
        """The first time of the file."""
        return self.long.time if self.long is not None else self.signals[0].time


@dataclass(frozen=True, slots=True)
class _Seen:
    """What the sample shows of one column."""

    kinds: Counter[Kind]
    good_words: bool

    @property
    def usual(self) -> Kind:
        filled = Counter({k: n for k, n in self.kinds.items() if k is not Kind.EMPTY})
        return filled.most_common(1)[0][0] if filled else Kind.EMPTY

    @property
    def is_time(self) -> bool:
        return self.usual in TIMES

    @property
    def is_quality(self) -> bool:
        return self.usual is Kind.QUALITY and self.good_words and not self.kinds[Kind.NUMBER]

    @property
    def is_numeric(self) -> bool:
        """Numbers, or only words that stand for missing numbers."""
        filled = sum(n for kind, n in self.kinds.items() if kind is not Kind.EMPTY)
        other = self.kinds[Kind.TEXT] + self.kinds[Kind.MODE]
        return self.kinds[Kind.NUMBER] * 5 >= filled or other * 2 < filled or filled == 0


class Assigner:
    """Assign the columns of one table.

    Parameters
    ----------
    table : Table
        The table as the start of the file shows it.
    options : ReadOptions
        What the user states.
    fallback_tag : str
        Name of the only tag, where the file gives none.
    """

    def __init__(self, table: Table, options: ReadOptions, fallback_tag: str) -> None:
        self._table = table
        self._options = options
        self._columns = options.columns
        self._fallback_tag = fallback_tag
        self._named = table.header_line is not None
        self._seen = [self._look_at(j) for j in range(table.width)]
        self._ignored: list[tuple[str, str]] = []

    def assign(self) -> Assignment:
        """Give every column its part.

        Raises
        ------
        ColumnNotFound, AmbiguousColumns
            Where a column is missing or several are possible.
        """
        times = [j for j, seen in enumerate(self._seen) if seen.is_time]
        tag = self._tag_column(times)
        if tag is not None:
            return self._long(times, tag)
        if self._is_paired(times):
            return self._pairs(times)
        return self._wide(times)

    def _look_at(self, index: int) -> _Seen:
        cells = self._table.column(index)
        kinds = Counter(kind_of(cell) for cell in cells)
        return _Seen(kinds, any(is_good_word(cell) for cell in cells))

    def resolve(self, column: str | int, role: str) -> int:
        """Find a column by name or number counted from 1."""
        names = self._table.names
        if isinstance(column, int) or (column not in names and column.isdigit()):
            number = int(column)
            if not 1 <= number <= len(names):
                raise ColumnNotFound(role, names, f"there is no column number {number}")
            return number - 1
        for fold in (str, _plain_name):
            found = [j for j, name in enumerate(names) if fold(name) == fold(column)]
            if len(found) == 1:
                return found[0]
            if found:
                raise AmbiguousColumns(
                    role, tuple(names[j] for j in found), "state the column by its number"
                )
        raise ColumnNotFound(role, names, f"there is no column named {column!r}")

    def _plain(self, index: int) -> str:
        return plain_word(self._table.names[index]) if self._named else ""

    # --- time -----------------------------------------------------------------------------

    def _time_columns(self, times: list[int]) -> TimeColumns:
        stated = self._columns
        if stated.time is not None:
            chosen: tuple[int, ...] = (self.resolve(stated.time, "time"),)
            if stated.date is not None:
                chosen = (self.resolve(stated.date, "date"), *chosen)
            return TimeColumns(columns=chosen, milliseconds=self._milliseconds(chosen[-1]))
        if not times:
            return TimeColumns(columns=(self._numeric_time(),))
        dates = [j for j in times if self._seen[j].usual is Kind.DATE]
        clocks = [j for j in times if self._seen[j].usual is Kind.CLOCK]
        stamps = [j for j in times if self._seen[j].usual is Kind.STAMP]
        if not stamps and len(dates) == 1 and len(clocks) == 1:
            return TimeColumns(
                columns=(dates[0], clocks[0]), milliseconds=self._milliseconds(clocks[0])
            )
        choice = stamps or dates or clocks
        if len(choice) > 1:
            raise AmbiguousColumns(
                "the time",
                tuple(self._table.names[j] for j in choice),
                "state it with columns.time",
            )
        return TimeColumns(columns=(choice[0],), milliseconds=self._milliseconds(choice[0]))

    def _milliseconds(self, clock: int) -> int | None:
        after = clock + 1
        if after < self._table.width and self._plain(after) in _SUBSECOND_NAMES:
            cells = [cell for cell in self._table.column(after) if cell]
            if cells and all(cell.isdigit() and int(cell) < 1000 for cell in cells):
                return after
        return None

    def _numeric_time(self) -> int:
        """Choose among numeric columns: by heading, else the first one if it only rises."""
        numeric = [
            j
            for j, seen in enumerate(self._seen)
            if seen.usual is Kind.NUMBER and self._plain(j) not in _COUNTER_NAMES
        ]
        named = [j for j in numeric if self._named and names_time(self._table.names[j])]
        if len(named) > 1:
            raise AmbiguousColumns(
                "the time",
                tuple(self._table.names[j] for j in named),
                "state it with columns.time",
            )
        if named:
            return named[0]
        if numeric and self._is_ordered(numeric[0]):
            return numeric[0]
        raise ColumnNotFound("time", self._table.names, "state it with columns.time")

    def _is_ordered(self, index: int) -> bool:
        values = []
        for cell in self._table.column(index):
            try:
                values.append(float(cell.replace(",", ".")))
            except ValueError:
                continue
        steps = [b - a for a, b in pairwise(values)]
        if not steps:
            return len(values) == 1
        return any(steps) and (all(s >= 0 for s in steps) or all(s <= 0 for s in steps))

    # --- long -----------------------------------------------------------------------------

    def _tag_column(self, times: list[int]) -> int | None:
        layout = self._options.layout
        if self._columns.tag is not None:
            return self.resolve(self._columns.tag, "the tag")
        if layout in (Layout.WIDE, Layout.PAIRS):
            return None
        texts = [j for j, seen in enumerate(self._seen) if seen.usual is Kind.TEXT]
        named = [
            j
            for j in range(self._table.width)
            if self._plain(j) in _TAG_NAMES
            and self._seen[j].usual in {Kind.TEXT, Kind.NUMBER}
            and not self._seen[j].is_time
        ]
        if named:
            return self._one(named, "the tag", "columns.tag")
        if layout is Layout.LONG or (not self._named and times and self._table.width <= 5):
            if texts:
                return self._one(texts, "the tag", "columns.tag")
            if layout is Layout.LONG:
                raise ColumnNotFound("the tag", self._table.names, "state it with columns.tag")
        return None

    def _one(self, choice: list[int], role: str, option: str) -> int:
        if len(choice) > 1:
            names = tuple(self._table.names[j] for j in choice)
            raise AmbiguousColumns(role, names, f"state it with {option}")
        return choice[0]

    def _long(self, times: list[int], tag: int) -> Assignment:
        time = self._time_columns([j for j in times if j != tag])
        used = {*time.columns, tag, time.milliseconds}
        quality = self._quality_of_long(used)
        free = [j for j in range(self._table.width) if j not in used and j != quality]
        if self._columns.value is not None:
            value = self.resolve(self._columns.value, "the value")
        else:
            named = [j for j in free if self._plain(j) in _VALUE_NAMES and self._seen[j].is_numeric]
            numeric = [
                j
                for j in free
                if self._seen[j].is_numeric and self._seen[j].usual is not Kind.EMPTY
            ]
            choice = named or numeric or [j for j in free if self._seen[j].usual is Kind.MODE]
            if not choice:
                raise ColumnNotFound("the value", self._table.names, "state it with columns.value")
            value = self._one(choice, "the value", "columns.value")
        for j in free:
            if j != value:
                self._ignore(j, "a long file has one value column")
        return Assignment(
            layout=Layout.LONG,
            signals=(),
            long=LongColumns(time=time, tag=tag, value=value, quality=quality),
            ignored=tuple(self._ignored),
        )

    def _quality_of_long(self, used: set[int | None]) -> int | None:
        stated = self._columns.quality
        if isinstance(stated, tuple):
            if len(stated) != 1:
                raise ExportRefused("A long file has one quality column; state one.")
            return self.resolve(stated[0], "quality")
        if stated is not None:
            return self.resolve(stated, "quality")
        choice = [j for j in range(self._table.width) if j not in used and self._is_quality(j)]
        return self._one(choice, "the quality", "columns.quality") if choice else None

    def _is_quality(self, index: int) -> bool:
        return self._plain(index) in _QUALITY_NAMES - {"l"} or self._seen[index].is_quality

    # --- pairs ----------------------------------------------------------------------------

    def _is_paired(self, times: list[int]) -> bool:
        if self._options.layout is not None:
            return self._options.layout is Layout.PAIRS
        if self._columns.time is not None or len(times) < 2:
            return False
        full = [j for j in times if self._seen[j].usual is not Kind.CLOCK]
        ends = [*full[1:], self._table.width]
        return len(full) >= 2 and all(b - a >= 2 for a, b in zip(full, ends, strict=True))

    def _pairs(self, times: list[int]) -> Assignment:
        if not times:
            raise ColumnNotFound(
                "the time of a pair", self._table.names, "state another layout than pairs"
            )
        signals: list[Signal] = []
        for start, end in zip(times, [*times[1:], self._table.width], strict=True):
            inside = [j for j in range(start + 1, end) if not self._is_blank(j)]
            quality = next((j for j in inside if self._is_quality(j)), None)
            values = [j for j in inside if j != quality]
            if not values:
                self._ignore(start, "it has no value column")
                continue
            if len(values) > 1:
                names = tuple(self._table.names[j] for j in values)
                raise AmbiguousColumns("the value of one pair", names, "state another layout")
            name, unit = self._name_of_pair(start, values[0])
            time = TimeColumns(columns=(start,))
            signals.append(self._signal(name, unit, values[0], time, quality))
        return Assignment(
            layout=Layout.PAIRS,
            signals=tuple(signals),
            long=None,
            ignored=tuple(self._ignored),
        )

    def _is_blank(self, index: int) -> bool:
        headed = self._named and not self._table.names[index].startswith("column ")
        return self._seen[index].usual is Kind.EMPTY and not headed

    def _name_of_pair(self, time: int, value: int) -> tuple[str, str]:
        headings = [self._table.names, *self._table.other_headers]
        for column in (value, time):
            for heading in headings:
                cell = heading[column] if column < len(heading) else ""
                cell = re.sub(r" \(column \d+\)\Z", "", cell)
                name, unit = split_unit(cell)
                shorter = re.sub(
                    r"[ ._-](?:time|timestamp|value|zeit|wert)\Z", "", name, flags=re.IGNORECASE
                )
                plain = plain_word(shorter)
                if (
                    plain
                    and not plain.startswith("column")
                    and plain not in _VALUE_NAMES
                    and not names_time(shorter)
                ):
                    return shorter, unit
        return f"column {value + 1}", ""

    # --- wide -----------------------------------------------------------------------------

    def _wide(self, times: list[int]) -> Assignment:
        time = self._time_columns(times)
        used = {*time.columns, time.milliseconds}
        stated = self._stated_signals()
        qualities = self._qualities_of_wide(used)
        values = [j for j in range(self._table.width) if j not in used and j not in qualities]
        if self._columns.value is not None:
            values = [self.resolve(self._columns.value, "the value")]
        values = [j for j in values if j in stated or self._is_value(j, times)]
        if not values:
            raise ColumnNotFound("a value", self._table.names, "state them with columns.pv and op")
        of_value = {max(v for v in values if v < q): q for q in qualities if min(values) < q}
        signals = []
        for j in values:
            name, unit = self._name_of_wide(j, len(values))
            signals.append(self._signal(name, unit, j, time, of_value.get(j)))
        return Assignment(
            layout=Layout.WIDE, signals=tuple(signals), long=None, ignored=tuple(self._ignored)
        )

    def _stated_signals(self) -> set[int]:
        stated = {part: getattr(self._columns, part.value) for part in Part}
        return {self.resolve(c, part.value) for part, c in stated.items() if c is not None}

    def _qualities_of_wide(self, used: set[int | None]) -> list[int]:
        stated = self._columns.quality
        if stated is not None:
            chosen = stated if isinstance(stated, tuple) else (stated,)
            return [self.resolve(column, "quality") for column in chosen]
        found = []
        for j in range(self._table.width):
            if j in used:
                continue
            ending = self._named and _QUALITY_ENDING.search(self._table.names[j]) is not None
            level = self._plain(j) == "l" and "v" in map(self._plain, range(self._table.width))
            if self._is_quality(j) or ending or level:
                found.append(j)
        return found

    def _is_value(self, index: int, times: list[int]) -> bool:
        seen = self._seen[index]
        part = part_of(self._table.names[index]) if self._named else None
        if index in times:
            self._ignore(index, "another time column is read")
        elif self._plain(index) in _COUNTER_NAMES:
            self._ignore(index, "it counts the rows")
        elif self._is_blank(index):
            return False
        elif part is None and not seen.is_numeric:
            self._ignore(index, "it holds text; if it names the tag, state it with columns.tag")
        else:
            return True
        return False

    def _name_of_wide(self, index: int, count: int) -> tuple[str, str]:
        name, unit = split_unit(self._table.names[index])
        if not unit:
            unit = self._unit_below(index)
        nameless = not self._named or self._plain(index) in _VALUE_NAMES
        if count == 1 and nameless:
            name = self._options.tag or self._fallback_tag
        return name, unit

    def _unit_below(self, index: int) -> str:
        for heading in self._table.other_headers:
            cells = [cell for cell in heading if cell]
            if cells and all(_reads_as_unit(cell) for cell in cells) and index < len(heading):
                return heading[index].strip("[]() ")
        return ""

    # --- both -----------------------------------------------------------------------------

    def _signal(
        self, name: str, unit: str, column: int, time: TimeColumns, quality: int | None
    ) -> Signal:
        mode = self._columns.mode
        if mode is not None:
            is_mode = mode == name or (
                self._options.layout is not Layout.PAIRS
                and (mode == column + 1 or mode == self._table.names[column])
            )
        else:
            part = part_of(name)
            is_mode = part is not None and part.part is Part.MODE
        return Signal(
            tag=name, unit=unit, column=column, time=time, quality=quality, is_mode=is_mode
        )

    def _ignore(self, index: int, why: str) -> None:
        self._ignored.append((self._table.names[index], why))


def _plain_name(name: str) -> str:
    return plain_word(split_unit(name)[0])


_UNIT_WORDS = re.compile(
    r"[\[(]?(?:%|°?[CFKR]|deg ?[CFKR]?|bar[ag]?|m?bar|psi[ag]?|k?Pa|MPa|m3/h|m³/h|l/(?:h|min|s)"
    r"|t/h|kg/(?:h|s|m3)|rpm|V|m?A|k?W|MW|mm|cm|m|s|sec|min|h|Hz|pH|ppm|none|seconds|-|m/s|gpm"
    r"|Nm3/h|SCFH|MMSCFD|lb/h|kg|l|m3|g/l|mol|vol%|wt%|EU|PCT|date|time|timestamp)[\])]?\Z",
    re.IGNORECASE,
)


def _reads_as_unit(cell: str) -> bool:
    return _UNIT_WORDS.match(cell) is not None
