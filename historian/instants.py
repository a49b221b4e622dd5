"""Read the time cells of a block: stamps, split date and time, day numbers, epochs, seconds."""

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from historian.arrow_views import as_floats, as_integers, lengths, taken
from historian.assignment import TimeColumns
from historian.cells import Cells
from historian.numbers import LARGEST
from historian.plan import Plan
from historian.streams import Instants, Integers
from historian.time_format import ELAPSED, EPOCHS
from historian.timestamps import SECOND, StampReader
from loop.signals import Flags, Real

EXCEL_ZERO_DAY = -25569  # 1899-12-30, in days since 1970
_FIRST, _LAST = -2_208_988_800, 7_258_118_400  # 1900 and 2200, seconds since 1970


class InstantReader:
    """Read times under one plan.

    Parameters
    ----------
    plan : Plan
        Says how times are written.
    """

    def __init__(self, plan: Plan) -> None:
        self._format = plan.time
        self._decimal = plan.numbers.decimal
        self._stamps = StampReader(
            plan.time.order, zoned=plan.time.zoned, dated=plan.time.name != "clock"
        )
        self._dates = StampReader(plan.time.order, zoned=False)
        self._clocks = StampReader(plan.time.order, zoned=plan.time.zoned, dated=False)

    def read(self, cells: Cells, time: TimeColumns) -> tuple[Instants, Flags, Flags]:
        """Read the times of one block.

        Returns
        -------
        instants : ndarray, shape (n,)
            Nanoseconds since 1970 as int64, or elapsed seconds as float64.
        good : ndarray of bool, shape (n,)
            Where the cell is a time.
        blank : ndarray of bool, shape (n,)
            Where the cell is empty.
        """
        if len(time.columns) == 2:
            days, good, blank = self._calendar(cells.times[time.columns[0]], self._dates)
            clock, fine, _ = self._calendar(cells.times[time.columns[1]], self._clocks)
            instants: Instants = days + clock
            good &= fine
        elif self._format.is_calendar or self._format.name == "clock":
            instants, good, blank = self._calendar(cells.times[time.columns[0]], self._stamps)
        else:
            instants, good, blank = self._numeric(cells.times[time.columns[0]])
        if time.milliseconds is not None:
            parts = _floats(cells.times[time.milliseconds], self._decimal)
            fine = (parts >= 0) & (parts < 1000)
            good &= fine
            instants = instants + np.where(fine, parts, 0).astype(np.int64) * 1_000_000
        if self._format.name == "clock":
            instants = instants / SECOND
        return instants, good, blank

    def _calendar(self, cells: pa.Array, reader: StampReader) -> tuple[Instants, Flags, Flags]:
        if pa.types.is_dictionary(cells.type):
            return _spread(cells.indices, *self._calendar(cells.dictionary, reader))
        instants, good = reader.read(cells)
        blank = np.zeros(len(cells), dtype=np.bool_)
        if not good.all():
            left = np.flatnonzero(~good)
            trimmed = pc.ascii_trim_whitespace(taken(cells, left))
            blank[left] = lengths(trimmed) == 0
            instants[left], good[left] = reader.read(trimmed)
        return instants, good, blank

    def _numeric(self, cells: pa.Array) -> tuple[Instants, Flags, Flags]:
        if pa.types.is_dictionary(cells.type):
            return _spread(cells.indices, *self._numeric(cells.dictionary))
        cells = pc.ascii_trim_whitespace(cells)
        blank = lengths(cells) == 0
        name = self._format.name
        if name in ELAPSED:
            numbers = _floats(cells, self._decimal) * ELAPSED[name]
            return numbers, np.abs(numbers) <= LARGEST, blank
        if name == "excel":
            days = _floats(cells, self._decimal)
            with np.errstate(invalid="ignore"):
                ticks = np.round((days + EXCEL_ZERO_DAY) * 86_400_000)  # Excel keeps milliseconds
            return _from_ticks(ticks, 1000, blank)
        per_second = int(EPOCHS[name])
        whole = _integers(cells)
        if whole is not None:
            good = (whole >= _FIRST * per_second) & (whole <= _LAST * per_second)
            return np.where(good, whole, 0) * (SECOND // per_second), good, blank
        with np.errstate(invalid="ignore"):
            ticks = np.round(_floats(cells, self._decimal) * (1_000_000 / per_second))
        return _from_ticks(ticks, 1_000_000, blank)


def _spread(
    indices: pa.Array, instants: Instants, good: Flags, blank: Flags
) -> tuple[Instants, Flags, Flags]:
    """Give every row the time of its distinct cell."""
    places = as_integers(indices)
    if good.all() and not blank.any():
        every = np.ones(places.size, dtype=np.bool_)
        return instants[places], every, np.zeros(places.size, dtype=np.bool_)
    return instants[places], good[places], blank[places]


def _from_ticks(ticks: Real, per_second: int, blank: Flags) -> tuple[Integers, Flags, Flags]:
    good = (ticks >= _FIRST * per_second) & (ticks <= _LAST * per_second)
    return np.where(good, ticks, 0).astype(np.int64) * (SECOND // per_second), good, blank


def _integers(cells: pa.Array) -> Integers | None:
    try:
        whole = cells.cast(pa.int64())
    except pa.ArrowInvalid:
        return None
    return as_integers(whole)


def _floats(cells: pa.Array, decimal: str) -> Real:
    """Read numbers, NaN where a cell is none."""
    if pa.types.is_dictionary(cells.type):
        places = as_integers(cells.indices)
        return _floats(cells.dictionary, decimal)[places]
    cells = pc.ascii_trim_whitespace(cells)
    if decimal == ",":
        cells = pc.replace_substring(cells, ",", ".")
    try:
        found = cells.cast(pa.float64())
    except pa.ArrowInvalid:
        fits = pc.match_substring_regex(
            cells.cast(pa.binary()), r"^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$"
        )
        found = pc.if_else(fits, cells, pa.scalar(None, pa.string())).cast(pa.float64())
    return as_floats(found)
