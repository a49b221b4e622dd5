"""What the user may state about an export; everything left out is decided from the file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from loop.record import Mode

GIBIBYTE = 1024**3

TIME_FORMATS: Mapping[str, str] = {
    "Y/M/D": "year, month, day, in digits",
    "D/M/Y": "day, month, year, in digits",
    "M/D/Y": "month, day, year, in digits",
    "D-MMM-Y": "day, month as a word, year",
    "elapsed_ms": "elapsed milliseconds",
    "elapsed_s": "elapsed seconds",
    "elapsed_min": "elapsed minutes",
    "elapsed_h": "elapsed hours",
    "elapsed_d": "elapsed days",
    "clock": "time of day without a date",
    "epoch_s": "seconds since 1970 in UTC",
    "epoch_ms": "milliseconds since 1970 in UTC",
    "epoch_us": "microseconds since 1970 in UTC",
    "epoch_ns": "nanoseconds since 1970 in UTC",
    "excel": "Excel day number",
}


class Layout(StrEnum):
    """How samples lie in the file."""

    WIDE = "wide"  # a row is one instant, a column is one tag
    LONG = "long"  # a row is one sample of one tag
    PAIRS = "pairs"  # a time column and a value column for every tag


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Which column is what, by name or by number counted from 1.

    `pv`, `sp`, `op` and `mode` name the signals of one loop: columns of a wide file, tags of a
    long or paired one. `quality` takes several columns in a wide file; each belongs to the value
    column before it.
    """

    time: str | int | None = None
    date: str | int | None = None
    tag: str | int | None = None
    value: str | int | None = None
    quality: str | int | tuple[str | int, ...] | None = None
    pv: str | int | None = None
    sp: str | int | None = None
    op: str | int | None = None
    mode: str | int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """Override what the reader would decide by itself.

    Attributes
    ----------
    encoding : str, optional
        Name of the text encoding, as Python knows it.
    delimiter, decimal : str, optional
        What separates cells, and what marks decimals: "." or ",".
    layout : Layout, optional
        Wide, long or pairs.
    header_line : int, optional
        Line that names the columns, counted from 1; 0 for a file without names.
    first_line : int, optional
        Line of the first sample, counted from 1.
    time_format : str, optional
        A key of `TIME_FORMATS`.
    day_first : bool, optional
        Settles 03/04/2024: True for 3 April, False for March 4.
    time_zone : str, optional
        Zone of stamps that state none, such as "Europe/Berlin" or "UTC".
    columns : Columns
        Which column is what.
    mode_codes : mapping
        Meaning of mode codes, such as {1: Mode.AUTO}. A code is never guessed.
    good_quality : frozenset of str, optional
        Cells of the quality column that mean good; all others are gaps.
    tag : str, optional
        Name of the loop, or of the only tag, where the file gives none.
    pv_unit, op_unit : str, optional
        Units, where the file gives none or wrong ones.
    max_bytes : int
        Largest file, after unpacking. [bytes]
    max_rejections : int
        Rejections that are listed one by one; all are counted.
    """

    encoding: str | None = None
    delimiter: str | None = None
    decimal: str | None = None
    layout: Layout | None = None
    header_line: int | None = None
    first_line: int | None = None
    time_format: str | None = None
    day_first: bool | None = None
    time_zone: str | None = None
    columns: Columns = field(default_factory=Columns)
    mode_codes: Mapping[int | str, Mode] = field(default_factory=dict)
    good_quality: frozenset[str] | None = None
    tag: str | None = None
    pv_unit: str | None = None
    op_unit: str | None = None
    max_bytes: int = 4 * GIBIBYTE
    max_rejections: int = 100

    def __post_init__(self) -> None:
        if self.time_format is not None and self.time_format not in TIME_FORMATS:
            raise ValueError(
                f"time_format must be one of {', '.join(TIME_FORMATS)}, got {self.time_format!r}"
            )
        if self.decimal not in (None, ".", ","):
            raise ValueError(f"decimal must be '.' or ',', got {self.decimal!r}")
        if self.delimiter is not None and (
            len(self.delimiter) != 1 or self.delimiter in '"\r\n' or not self.delimiter.isascii()
        ):
            raise ValueError(f"delimiter must be one ASCII character, got {self.delimiter!r}")
        if self.delimiter is not None and self.delimiter == self.decimal:
            raise ValueError(f"delimiter and decimal must differ, both are {self.decimal!r}")
        if self.max_bytes <= 0:
            raise ValueError(f"max_bytes must be positive, got {self.max_bytes}")
        for name in ("header_line", "first_line"):
            line = getattr(self, name)
            if line is not None and line < (0 if name == "header_line" else 1):
                raise ValueError(f"{name} counts from 1, got {line}")
