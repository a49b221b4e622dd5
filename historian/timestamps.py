"""Turn whole columns of stamps into instants, every distinct shape at once."""

from typing import TypeVar

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from historian.arrow_views import different
from historian.stamp_shape import MONTHS, Shape, Span, shape_of
from loop.signals import Flags

Nanoseconds = npt.NDArray[np.int64]
Bytes = npt.NDArray[np.uint8]
Counts = npt.NDArray[np.int64]
Whole = TypeVar("Whole", np.int32, np.int64)

SECOND = 1_000_000_000
FIRST_YEAR, LAST_YEAR = 1900, 2199
NUMERIC_ORDERS = ("Y/M/D", "D/M/Y", "M/D/Y")

_STARTS = (
    np.arange(f"{FIRST_YEAR}-01", f"{LAST_YEAR + 1}-02", dtype="datetime64[M]")
    .astype("datetime64[D]")
    .astype(np.int64)
)
_LENGTHS = np.diff(_STARTS)
_WORD_KEYS = np.array(
    sorted((word.encode()[0] << 16 | word.encode()[1] << 8 | word.encode()[2]) for word in MONTHS)
)
_WORD_MONTHS = np.array(
    [MONTHS[bytes((key >> 16, key >> 8 & 255, key & 255)).decode()] for key in _WORD_KEYS.tolist()]
)


class StampReader:
    """Read stamps of one column; shapes that were met once are found again without a search.

    Parameters
    ----------
    order : str
        "Y/M/D", "D/M/Y" or "M/D/Y": the order of dates in digits with the year not in front.
    zoned : bool or None
        Whether stamps state their offset from UTC; others are refused. None takes both.
    dated : bool
        Whether stamps state a date; others are refused.
    """

    def __init__(self, order: str, *, zoned: bool | None = None, dated: bool = True) -> None:
        self._order = order
        self._zoned = zoned
        self._dated = dated
        self._shapes: dict[int, list[Shape]] = {}

    def read(self, stamps: pa.Array) -> tuple[Nanoseconds, Flags]:
        """Read stamps.

        Parameters
        ----------
        stamps : pyarrow string array, length n

        Returns
        -------
        instants : ndarray of int64, shape (n,)
            Since 1970, in UTC where the stamp states its offset, else as the clock showed. [ns]
        good : ndarray of bool, shape (n,)
            False where a cell is no stamp.
        """
        instants = np.zeros(len(stamps), dtype=np.int64)
        good = np.zeros(len(stamps), dtype=np.bool_)
        for rows, matrix in _by_width(stamps):
            found, fine = self._read_width(matrix)
            if rows is None:
                instants, good = found, fine
            else:
                instants[rows], good[rows] = found, fine
        return instants, good

    def _read_width(self, matrix: Bytes) -> tuple[Nanoseconds, Flags]:
        """Read stamps of one width: a matrix of bytes, one row a character."""
        width, count = matrix.shape
        instants = np.zeros(count, dtype=np.int64)
        good = np.zeros(count, dtype=np.bool_)
        left = np.arange(count)
        shapes = self._shapes.setdefault(width, [])
        for shape in shapes:
            if left.size:
                left = self._apply(shape, matrix, left, instants, good)
        while left.size:
            text = matrix[:, left[0]].tobytes().decode("latin-1")
            new_shape = shape_of(text)
            if new_shape is None:
                left = left[1:]
                continue
            shapes.append(new_shape)
            left = self._apply(new_shape, matrix, left, instants, good)
        return instants, good

    def _apply(
        self, shape: Shape, matrix: Bytes, left: Counts, instants: Nanoseconds, good: Flags
    ) -> Counts:
        part = matrix if left.size == matrix.shape[1] else matrix[:, left]
        fits = _fits(shape, part)
        if fits.all():
            found, fine = self._instants(shape, part)
            other_zone = self._zoned is not None and (shape.utc_sign is not None) != self._zoned
            if other_zone or shape.has_date != self._dated:
                fine[:] = False
            if left.size == instants.size:
                instants[:], good[:] = found, fine
            else:
                instants[left], good[left] = found, fine
            return left[:0]
        if fits.any():
            self._apply(shape, matrix, left[fits], instants, good)
        return left[~fits]

    def _instants(self, shape: Shape, matrix: Bytes) -> tuple[Nanoseconds, Flags]:
        seconds, fine = _clock_seconds(shape, matrix)
        if shape.has_date:
            days, real = _day_numbers(shape, matrix, self._order)
            seconds += days * 86400
            fine &= real
        found = seconds * SECOND
        if "fraction" in shape.spans:
            start, stop = shape.spans["fraction"]
            found += _digits(matrix, (start, stop), np.int64) * 10 ** (9 - (stop - start))
        return found, fine


def date_fields(stamps: pa.Array) -> npt.NDArray[np.int64]:
    """Find the three numbers of dates in digits whose order is open.

    Returns
    -------
    fields : ndarray of int64, shape (m, 3)
        Only for stamps that have three such numbers.
    """
    found = [np.zeros((0, 3), dtype=np.int64)]
    for _, matrix in _by_width(stamps):
        left = np.arange(matrix.shape[1])
        while left.size:
            shape = shape_of(matrix[:, left[0]].tobytes().decode("latin-1"))
            if shape is None:
                left = left[1:]
                continue
            part = matrix[:, left]
            fits = _fits(shape, part)
            if "first" in shape.spans:
                names = ("first", "second", "third")
                chosen = part[:, fits]
                found.append(
                    np.stack(
                        [_digits(chosen, shape.spans[name], np.int64) for name in names], axis=1
                    )
                )
            left = left[~fits]
    return np.concatenate(found)


def _by_width(stamps: pa.Array) -> list[tuple[Counts | None, Bytes]]:
    """Split a string array by the width of its cells, each as a matrix (width, cells)."""
    count = len(stamps)
    if count == 0:
        return []
    _, offsets_buffer, data_buffer = stamps.buffers()
    offsets = np.frombuffer(offsets_buffer, dtype=np.int32)[
        stamps.offset : stamps.offset + count + 1
    ].astype(np.int64)
    data = np.frombuffer(data_buffer, dtype=np.uint8) if data_buffer else np.zeros(0, np.uint8)
    widths = np.diff(offsets)
    if (widths == widths[0]).all():
        width = int(widths[0])
        flat = data[offsets[0] : offsets[-1]].reshape(count, width)
        return [(None, np.ascontiguousarray(flat.T))] if width else []
    split: list[tuple[Counts | None, Bytes]] = []
    for width in different(widths):
        if 0 < width <= 64:
            rows = np.flatnonzero(widths == width)
            split.append((rows, data[offsets[rows] + np.arange(width)[:, None]]))
    return split


def _fits(shape: Shape, matrix: Bytes) -> Flags:
    fits = np.ones(matrix.shape[1], dtype=np.bool_)
    for place in range(shape.width):
        cell = matrix[place] | 32 if shape.letters[place] else matrix[place]
        low, high = shape.low[place], shape.high[place]
        fits &= (cell == low) if low == high else (cell - low <= high - low)
    return fits


def _digits(matrix: Bytes, span: Span, kind: type[Whole]) -> npt.NDArray[Whole]:
    start, stop = span
    number: npt.NDArray[Whole] = (matrix[start] - 48).astype(kind)
    for place in range(start + 1, stop):
        number *= 10
        number += matrix[place] - 48
    return number


def _clock_seconds(shape: Shape, matrix: Bytes) -> tuple[Counts, Flags]:
    """Read the time of day, less the offset from UTC where it is stated. [s]"""
    count = matrix.shape[1]
    if not shape.has_clock:
        return np.zeros(count, dtype=np.int64), np.ones(count, dtype=np.bool_)
    spans = shape.spans
    hour = _digits(matrix, spans["hour"], np.int32)
    minute = _digits(matrix, spans["minute"], np.int32)
    fine = minute <= 59
    if "half" in spans:
        after_noon = (matrix[spans["half"][0]] | 32) == ord("p")
        fine &= (hour >= 1) & (hour <= 12) & (after_noon | ((matrix[spans["half"][0]] | 32) == 97))
        hour = hour % 12 + 12 * after_noon
    seconds = hour * 3600 + minute * 60
    if "second_" in spans:
        second = _digits(matrix, spans["second_"], np.int32)
        fine &= second <= 59
        seconds += second
    fine &= seconds <= 86400
    if shape.utc_sign:
        offset = _digits(matrix, spans["zone_hour"], np.int32) * 3600
        if "zone_minute" in spans:
            offset += _digits(matrix, spans["zone_minute"], np.int32) * 60
        fine &= offset <= 18 * 3600
        seconds = seconds - shape.utc_sign * offset
    return seconds.astype(np.int64), fine


def _day_numbers(shape: Shape, matrix: Bytes, order: str) -> tuple[Counts, Flags]:
    """Read the date as days since 1970, and whether there is such a day."""
    spans = shape.spans
    if "first" in spans:
        names = {"Y/M/D": (0, 1, 2), "D/M/Y": (2, 1, 0), "M/D/Y": (2, 0, 1)}[order]
        given = [spans["first"], spans["second"], spans["third"]]
        year_span, month_span, day_span = (given[place] for place in names)
        if year_span[1] - year_span[0] not in (2, 4):
            return np.zeros(matrix.shape[1], np.int64), np.zeros(matrix.shape[1], np.bool_)
    else:
        year_span, day_span = spans["year"], spans["day"]
        month_span = spans.get("month", (0, 0))
    year = _digits(matrix, year_span, np.int32)
    if year_span[1] - year_span[0] <= 2:
        year += np.where(year < 69, 2000, 1900)  # the rule of POSIX
    month = (
        _word_months(matrix, spans["word"][0])
        if "word" in spans
        else _digits(matrix, month_span, np.int32)
    )
    day = _digits(matrix, day_span, np.int32)
    real = (year >= FIRST_YEAR) & (year <= LAST_YEAR) & (month >= 1) & (month <= 12)
    place = (year - FIRST_YEAR) * 12 + month - 1
    if not real.all():
        place = np.where(real, place, 0)
    real &= (day >= 1) & (day <= _LENGTHS[place])
    return _STARTS[place] + (day - 1), real


def _word_months(matrix: Bytes, start: int) -> Counts:
    key = np.zeros(matrix.shape[1], dtype=np.int64)
    for place in range(start, start + 3):
        key = key << 8 | (matrix[place] | 32)
    where = np.minimum(np.searchsorted(_WORD_KEYS, key), len(_WORD_KEYS) - 1)
    return np.where(_WORD_KEYS[where] == key, _WORD_MONTHS[where], 0)
