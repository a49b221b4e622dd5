"""The columns of a table as its start shows them, and how a user names them."""

import re
from collections import Counter
from dataclasses import dataclass

from historian.assignment import Signal, TimeColumns
from historian.cell_kind import TIMES, Kind, kind_of
from historian.errors import AmbiguousColumns, ColumnNotFound
from historian.options import Columns, ReadOptions
from historian.quality import is_good_word, plain_word
from historian.table_shape import Table
from historian.tag_map import Part, part_of, same_tag, split_unit

TAG_NAMES = frozenset(
    {"tag", "tags", "tagname", "tagid", "tag_id", "varname", "variable", "name", "point",
     "pointname", "pointid", "itemid", "item", "signal", "sensor", "fqn", "path", "tagpath",
     "channel", "kanal", "messstelle", "variablenname", "nom"}
)  # fmt: skip
VALUE_NAMES = frozenset(
    {"value", "varvalue", "floatvalue", "val", "v", "wert", "valeur", "valor", "vvalue", "tagval",
     "data"}
)  # fmt: skip
COUNTER_NAMES = frozenset({"id", "index", "idx", "row", "no", "no.", "nr", "nr.", "#", "rowid"})
_QUALITY_NAMES = frozenset(
    {"quality", "dataquality", "validity", "dataintegrity", "opcquality", "opcqualitycode",
     "qualitycode", "tagquality", "status", "valid", "isgood", "good", "qualität",
     "ip_input_quality"}
)  # fmt: skip
NUMBERED = re.compile(r" \(column \d+\)\Z")
_QUALITY_ENDING = re.compile(
    r"[ ._:/-](?:quality|status|validity|q|qual|opcquality)\Z", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class Seen:
    """What the start of a file shows of one column."""

    kinds: Counter[Kind]
    good_words: bool

    @property
    def usual(self) -> Kind:
        """The kind that most cells are of."""
        filled = Counter({k: n for k, n in self.kinds.items() if k is not Kind.EMPTY})
        return filled.most_common(1)[0][0] if filled else Kind.EMPTY

    @property
    def is_time(self) -> bool:
        """Dates or times."""
        return self.usual in TIMES

    @property
    def is_quality(self) -> bool:
        """Words such as Good and Bad, and nothing else."""
        return self.usual is Kind.QUALITY and self.good_words and not self.kinds[Kind.NUMBER]

    @property
    def is_numeric(self) -> bool:
        """Numbers, or only words that stand for missing numbers."""
        filled = sum(n for kind, n in self.kinds.items() if kind is not Kind.EMPTY)
        other = self.kinds[Kind.TEXT] + self.kinds[Kind.MODE]
        return self.kinds[Kind.NUMBER] * 5 >= filled or other * 2 < filled or filled == 0


class ColumnView:
    """Look at the columns of one table.

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
        self.table = table
        self.options = options
        self.fallback_tag = options.tag or fallback_tag
        self.named = table.header_line is not None
        self.seen = [self._look_at(j) for j in range(table.width)]
        self.ignored: list[tuple[str, str]] = []

    def _look_at(self, index: int) -> Seen:
        cells = self.table.column(index)
        return Seen(Counter(map(kind_of, cells)), any(is_good_word(cell) for cell in cells))

    @property
    def stated(self) -> Columns:
        """Columns as the user states them."""
        return self.options.columns

    @property
    def every(self) -> range:
        """All columns."""
        return range(self.table.width)

    def plain(self, index: int) -> str:
        """Heading of a column without case and blanks, empty without headings."""
        return plain_word(self.table.names[index]) if self.named else ""

    def resolve(self, column: str | int, role: str) -> int:
        """Find a column by name or number counted from 1.

        Raises
        ------
        ColumnNotFound, AmbiguousColumns
        """
        names = self.table.names
        if isinstance(column, int) or (column not in names and column.isdecimal()):
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

    def only(self, choice: list[int], role: str, option: str) -> int:
        """Take the only candidate.

        Raises
        ------
        ColumnNotFound, AmbiguousColumns
        """
        names = tuple(self.table.names[j] for j in choice)
        if len(choice) > 1:
            raise AmbiguousColumns(role, names, f"state it with {option}")
        if not choice:
            raise ColumnNotFound(role, self.table.names, f"state it with {option}")
        return choice[0]

    def is_quality(self, index: int) -> bool:
        """Tell whether a column states the quality of values."""
        plain = self.plain(index)
        if plain == "l":  # the level of IP.21, beside v
            return "v" in map(self.plain, self.every)
        ending = self.named and _QUALITY_ENDING.search(self.table.names[index]) is not None
        return plain in _QUALITY_NAMES or ending or self.seen[index].is_quality

    def is_blank(self, index: int) -> bool:
        """Tell whether a column has neither heading nor cells."""
        headed = self.named and not self.table.names[index].startswith("column ")
        return self.seen[index].usual is Kind.EMPTY and not headed

    def ignore(self, index: int, why: str) -> None:
        """Note a column that is not read."""
        self.ignored.append((self.table.names[index], why))

    def signal(
        self, name: tuple[str, str], column: int, time: TimeColumns, quality: int | None
    ) -> Signal:
        """Describe one tag; its name and unit come together."""
        tag, unit = name
        return Signal(
            tag=tag,
            unit=unit,
            column=column,
            time=time,
            quality=quality,
            is_mode=self._is_mode(tag, column),
        )

    def _is_mode(self, tag: str, column: int) -> bool:
        stated = self.stated.mode
        if stated is None:
            part = part_of(tag)
            return part is not None and part.part is Part.MODE
        return (
            same_tag(stated, tag)
            or same_tag(stated, self.table.names[column])
            or str(stated) == str(column + 1)
        )


def _plain_name(name: str) -> str:
    return plain_word(split_unit(name)[0])


def distinct(
    view: ColumnView, columns: list[int], names: list[tuple[str, str]]
) -> list[tuple[str, str]]:
    """Give tags that several columns share their full headings, which are distinct."""
    tags = Counter(tag for tag, _ in names)
    return [
        (view.table.names[column], unit) if tags[tag] > 1 else (tag, unit)
        for column, (tag, unit) in zip(columns, names, strict=True)
    ]
