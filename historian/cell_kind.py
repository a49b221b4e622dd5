"""What a single cell looks like, before anything is known about its column."""

from enum import Enum
from functools import lru_cache

from historian.modes import is_mode_word
from historian.numbers import looks_numeric
from historian.quality import is_bad_word, is_quality_word
from historian.stamp_shape import is_compact_stamp, shape_of


class Kind(Enum):
    """Kinds of cells."""

    EMPTY = "empty"
    NUMBER = "number"
    STAMP = "date and time"
    DATE = "date"
    CLOCK = "time of day"
    BAD = "bad-quality word"
    QUALITY = "quality word"
    MODE = "mode word"
    TEXT = "text"


TIMES = frozenset({Kind.STAMP, Kind.DATE, Kind.CLOCK})
MEANT = frozenset(Kind) - {Kind.TEXT}
"""Kinds that a cell of a text without meaning cannot have."""


@lru_cache(maxsize=16_384)
def kind_of(cell: str) -> Kind:
    """Classify one cell.

    >>> kind_of("05-Jan-24 10:00"), kind_of("12,5"), kind_of("Good")
    (<Kind.STAMP: 'date and time'>, <Kind.NUMBER: 'number'>, <Kind.QUALITY: 'quality word'>)
    """
    cell = cell.strip()
    if not cell:
        return Kind.EMPTY
    if looks_numeric(cell) and not (len(cell) == 14 and is_compact_stamp(cell)):
        return Kind.NUMBER
    shape = shape_of(cell) if len(cell) <= 64 else None
    if shape is not None:
        if shape.has_date:
            return Kind.STAMP if shape.has_clock else Kind.DATE
        return Kind.CLOCK
    if is_quality_word(cell):
        return Kind.QUALITY
    if is_bad_word(cell):
        return Kind.BAD
    return Kind.MODE if is_mode_word(cell) else Kind.TEXT
