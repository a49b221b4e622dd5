"""What every column of an export is: time, tag, value, quality or mode."""

from dataclasses import dataclass

from historian.options import Layout


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
    def times(self) -> tuple[TimeColumns, ...]:
        """Times of the file: one, or one for every pair."""
        if self.long is not None:
            return (self.long.time,)
        return tuple(dict.fromkeys(signal.time for signal in self.signals))
