"""Decide how times are written, and refuse where two readings remain."""

import re
from dataclasses import dataclass

import numpy as np

from historian.cell_kind import TIMES, kind_of
from historian.errors import AmbiguousTime, ExportRefused
from historian.numbers import NumberFormat
from historian.options import TIME_FORMATS, ReadOptions
from historian.stamp_shape import Shape, is_compact_stamp, shape_of
from loop.signals import Real

EPOCHS = {"epoch_s": 1.0, "epoch_ms": 1e3, "epoch_us": 1e6, "epoch_ns": 1e9}
ELAPSED = {
    "elapsed_ms": 1e-3,
    "elapsed_s": 1.0,
    "elapsed_min": 60.0,
    "elapsed_h": 3600.0,
    "elapsed_d": 86400.0,
}
IN_STAMPS = frozenset({"Y/M/D", "D/M/Y", "M/D/Y", "D-MMM-Y", "clock"})
_EARLIEST, _LATEST = 4.7e8, 4.1e9  # 1984 and 2099, seconds since 1970
_EXCEL_FIRST, _EXCEL_LAST = 30_000, 73_000  # 1982 and 2099, days since 1899-12-30
_TIME_NAME = re.compile(
    r"^(?:(?-i:t)|ts|time.*|.*time|t_?stamp|.*time_?stamp.*|elapsed.*|seconds?|sec|minutes?|hours?|date.*"
    r"|zeit.*|datum.*|horodatage|date_?heure|fecha.*|tempo|t_(?:s|ms|min|h|sec|secs|seconds))\b"
    r"|^(?-i:t) [\(\[]",
    re.IGNORECASE,
)
_UNIT_NAMES = (
    ("elapsed_ms", r"\b(?:ms|msecs?|millisec\w*|milliseconds?)\b|_ms\b"),
    ("elapsed_min", r"\b(?:mins?|minutes?|minuten)\b|_min\b"),
    ("elapsed_h", r"\b(?:h|hrs?|hours?|stunden)\b|_h\b"),
    ("elapsed_d", r"\b(?:d|days?|tage)\b|_d\b"),
    ("elapsed_s", r"\b(?:s|secs?|seconds?|sekunden)\b|_s(?:ec)?\b"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeFormat:
    """How times are written.

    Attributes
    ----------
    name : str
        A key of `TIME_FORMATS`.
    zoned : bool
        Whether stamps state their offset from UTC.
    words : str
        What was decided and why.
    example : str
        The first time as it stands in the file.
    """

    name: str
    zoned: bool
    words: str
    example: str

    @property
    def is_calendar(self) -> bool:
        """Whether stamps are dates and times in words and digits."""
        return self.name in IN_STAMPS - {"clock"}

    @property
    def is_elapsed(self) -> bool:
        """Whether times count from an instant that is not stated."""
        return self.name in ELAPSED or self.name == "clock"

    @property
    def is_utc(self) -> bool:
        """Whether instants are known in UTC without a stated zone."""
        return self.zoned or self.name in EPOCHS

    @property
    def order(self) -> str:
        """Order of dates in digits."""
        return "Y/M/D" if self.name in {"D-MMM-Y", "clock"} else self.name


def names_time(header: str) -> bool:
    """Tell whether a heading speaks of time."""
    return _TIME_NAME.match(header.strip()) is not None


def possible_orders(fields: np.typing.NDArray[np.int64]) -> tuple[str, ...]:
    """List the orders in which all dates in digits exist, from their three numbers."""
    first, second, third = (fields[:, place] for place in range(3))
    is_day = [np.all((f >= 1) & (f <= 31)) for f in (first, second, third)]
    is_month = [np.all((f >= 1) & (f <= 12)) for f in (first, second, third)]
    short = bool(np.all(third < 100))
    orders = []
    if is_day[0] and is_month[1]:
        orders.append("D/M/Y")
    if is_month[0] and is_day[1]:
        orders.append("M/D/Y")
    if short and is_month[1] and is_day[2]:
        orders.append("Y/M/D")
    return tuple(orders)


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenOrder:
    """Dates in digits whose order the start of a file leaves open."""

    example: str
    orders: tuple[str, ...]
    zoned: bool

    def settled(self, orders: tuple[str, ...], where: str) -> TimeFormat | None:
        """Take the order where one remains."""
        left = tuple(order for order in self.orders if order in orders)
        if len(left) != 1:
            return None
        return TimeFormat(
            name=left[0], zoned=self.zoned, example=self.example,
            words=f"{TIME_FORMATS[left[0]]}, the only order in which {where} exist",
        )  # fmt: skip

    def refusal(self, line: int | None, column: str) -> AmbiguousTime:
        """Name both readings."""
        return AmbiguousTime(
            self.example,
            tuple(f"{_reading(self.example, order)} ({order})" for order in self.orders),
            "state it with day_first=True or day_first=False, or with time_format='D/M/Y', "
            "'M/D/Y' or 'Y/M/D'",
            line=line,
            column=column,
        )


def _reading(stamp: str, order: str) -> str:
    shape = shape_of(stamp)
    assert shape is not None  # noqa: S101 - its date was read before
    parts = _fields(stamp, shape)
    places = {"D/M/Y": (2, 1, 0), "M/D/Y": (2, 0, 1), "Y/M/D": (0, 1, 2)}[order]
    year, month, day = (parts[place] for place in places)
    if year < 100:
        year += 2000 if year < 69 else 1900
    months = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"]
    return f"{day} {months[month - 1]} {year}" if 1 <= month <= 12 else stamp


def decide_stamps(cells: list[str], options: ReadOptions) -> TimeFormat | OpenOrder:
    """Decide the format of stamps in words and digits from a sample that has some.

    Raises
    ------
    ExportRefused
        Where no single order fits, or stamps with and without a zone are mixed.
    """
    shapes = [(cell, shape) for cell in cells if (shape := shape_of(cell)) is not None]
    example = shapes[0][0]
    zoned = sum(shape.utc_sign is not None for _, shape in shapes) * 2 > len(shapes)
    stated = options.time_format
    if stated is None and options.day_first is not None:
        stated = "D/M/Y" if options.day_first else "M/D/Y"
    open_dates = [(cell, shape) for cell, shape in shapes if "first" in shape.spans]
    if not open_dates:
        shape = shapes[0][1]
        name = "D-MMM-Y" if "word" in shape.spans else "Y/M/D" if shape.has_date else "clock"
        return TimeFormat(name=name, zoned=zoned, words=TIME_FORMATS[name], example=example)
    if stated is not None:
        return TimeFormat(
            name=stated, zoned=zoned, words=f"{TIME_FORMATS[stated]}, as stated", example=example
        )
    fields = np.array([_fields(cell, shape) for cell, shape in open_dates])
    short_year = all(_width(shape, "third") <= 2 for _, shape in open_dates)
    orders = tuple(o for o in possible_orders(fields) if short_year or o != "Y/M/D")
    if not orders:
        raise ExportRefused(
            f"The dates, such as {open_dates[0][0]!r}, fit no single order of day, month and "
            "year; state time_format='D/M/Y' or 'M/D/Y' to reject the others."
        )
    left = OpenOrder(example=open_dates[0][0], orders=orders, zoned=zoned)
    return left.settled(orders, "all dates at the start of the file") or left


def _fields(cell: str, shape: Shape) -> tuple[int, int, int]:
    a, b, c = (int(cell[slice(*shape.spans[name])]) for name in ("first", "second", "third"))
    return a, b, c


def _width(shape: Shape, name: str) -> int:
    start, stop = shape.spans[name]
    return stop - start


def decide_numeric(
    cells: list[str], header: str, numbers: NumberFormat, options: ReadOptions
) -> TimeFormat:
    """Decide what numbers in a time column count, from their range and the heading."""
    example = next((cell for cell in cells if cell), "")
    if options.time_format is not None:
        words = f"{TIME_FORMATS[options.time_format]}, as stated"
        return TimeFormat(name=options.time_format, zoned=False, words=words, example=example)
    read = [numbers.read(cell) for cell in cells]
    times = np.array([value for value in read if value is not None])
    compact = [cell for cell in cells if is_compact_stamp(cell)]
    if compact and len(compact) == len([cell for cell in cells if cell]):
        return TimeFormat(
            name="Y/M/D", zoned=False, words="year, month, day and time without marks",
            example=example,
        )  # fmt: skip
    for name, per_second in EPOCHS.items():
        fitting = (times >= _EARLIEST * per_second) & (times <= _LATEST * per_second)
        if times.size and np.count_nonzero(fitting) * 10 >= times.size * 9:
            words = f"{TIME_FORMATS[name]}, by the range of the numbers"
            return TimeFormat(name=name, zoned=False, words=words, example=example)
    unit = next(
        (n for n, pattern in _UNIT_NAMES if re.search(pattern, header, re.IGNORECASE)), None
    )
    if unit is None and _is_excel(times):
        return TimeFormat(
            name="excel", zoned=False, example=example,
            words="Excel day numbers, by the range of the numbers and steps under a day",
        )  # fmt: skip
    if unit is None:
        words = "elapsed seconds, since nothing names another unit"
    else:
        words = f"{TIME_FORMATS[unit]}, from the heading {header!r}"
    return TimeFormat(name=unit or "elapsed_s", zoned=False, words=words, example=example)


def _is_excel(times: Real) -> bool:
    if not times.size or np.any((times < _EXCEL_FIRST) | (times > _EXCEL_LAST)):
        return False
    steps = np.abs(np.diff(times))
    fractions = np.any(times != np.round(times))
    return bool(fractions and (not steps.size or np.median(steps) < 0.5))


def is_time_kind(cell: str) -> bool:
    """Tell whether a cell is a date, a time of day or both."""
    return kind_of(cell) in TIMES
