"""All decisions about one file, taken from its start before the walk through it."""

from dataclasses import dataclass

from historian.assignment import Assignment
from historian.encoding import Encoding
from historian.numbers import NumberFormat
from historian.options import ReadOptions
from historian.quality import Scheme
from historian.table_shape import Table
from historian.tag_map import Part, part_of, same_tag
from historian.time_format import TimeFormat


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How a file is read.

    Attributes
    ----------
    container : str
        What the file was packed in.
    encoding : Encoding
        How bytes become text.
    table : Table
        Where the table stands.
    numbers : NumberFormat
        How numbers are written.
    time : TimeFormat
        How times are written.
    assignment : Assignment
        What every column is.
    schemes : dict of int to Scheme
        What the codes of every quality column mean.
    options : ReadOptions
        What the user stated.
    expected_rows : int
        Rows that the length of the file and of its first lines lets expect; 0 if packed.
    """

    container: str
    encoding: Encoding
    table: Table
    numbers: NumberFormat
    time: TimeFormat
    assignment: Assignment
    schemes: dict[int, Scheme]
    options: ReadOptions
    expected_rows: int

    def is_mode_tag(self, tag: str) -> bool:
        """Tell whether a tag of a long file holds modes."""
        stated = self.options.columns.mode
        if stated is not None:
            return same_tag(stated, tag)
        part = part_of(tag)
        return part is not None and part.part is Part.MODE

    def heading_of(self, column: int) -> str | None:
        """Heading of a column, None in a file without headings."""
        return self.table.names[column] if self.table.header_line is not None else None

    @property
    def number_columns(self) -> tuple[int, ...]:
        """Columns that hold numbers."""
        found = [s.column for s in self.assignment.signals if not s.is_mode]
        if self.assignment.long is not None:
            found.append(self.assignment.long.value)
        return tuple(dict.fromkeys(found))

    @property
    def word_columns(self) -> tuple[int, ...]:
        """Columns that hold a few different words: tags, modes, qualities."""
        found = [s.column for s in self.assignment.signals if s.is_mode]
        found += [s.quality for s in self.assignment.signals if s.quality is not None]
        if self.assignment.long is not None:
            found.append(self.assignment.long.tag)
            if self.assignment.long.quality is not None:
                found.append(self.assignment.long.quality)
        return tuple(dict.fromkeys(found))

    @property
    def time_columns(self) -> tuple[int, ...]:
        """Columns that hold times."""
        times = [s.time for s in self.assignment.signals]
        if self.assignment.long is not None:
            times.append(self.assignment.long.time)
        found: list[int] = []
        for time in times:
            found += time.columns
            if time.milliseconds is not None:
                found.append(time.milliseconds)
        return tuple(dict.fromkeys(found))
