"""What was read from an export: loops, signals, decisions, and what became of every row."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from historian.accounting import Accounting
from historian.errors import AmbiguousColumns, ColumnNotFound, ExportRefused
from historian.options import Layout
from historian.streams import Instants, Values
from historian.timestamps import SECOND
from loop.record import Record
from loop.signals import Codes, Real

Times = npt.NDArray[np.datetime64] | npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Decisions:
    """Everything the reader decided or was told, value by value.

    Attributes
    ----------
    container : str
        "plain", "gzip" or "zip: member".
    encoding, line_end : str
        How bytes become lines of text.
    delimiter, decimal, thousands : str
        What separates cells, marks decimals and groups digits; thousands may be "".
    layout : Layout
        Wide, long or pairs.
    header_line : int or None
        Line that names the columns; none for a file without names.
    first_line : int
        Line of the first sample.
    columns : tuple of str
        Names of the columns.
    time_columns : tuple of str
        Columns that make up the time.
    time_format : str
        A key of `TIME_FORMATS`.
    time_zone : str or None
        "UTC" or the zone as stated; none for elapsed time and for local time of unknown zone.
    words : tuple of str
        The same in sentences, with the reasons, and everything else that was noticed.
    """

    container: str
    encoding: str
    line_end: str
    delimiter: str
    decimal: str
    thousands: str
    layout: Layout
    header_line: int | None
    first_line: int
    columns: tuple[str, ...]
    time_columns: tuple[str, ...]
    time_format: str
    time_zone: str | None
    words: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TagSignal:
    """Samples of one tag.

    Attributes
    ----------
    tag, unit : str
        Name and unit; the unit may be empty.
    time : ndarray, shape (n,)
        UTC (or local time of unknown zone) as datetime64[ns], or elapsed seconds as float64;
        strictly increasing.
    value : ndarray, shape (n,)
        Values, NaN for gaps; modes as int8 numbers of `loop.record.Mode`.
    is_mode : bool
        Whether the values are modes.
    """

    tag: str
    unit: str
    time: Times
    value: Values
    is_mode: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopSamples:
    """One loop on the times of its process variable.

    Attributes
    ----------
    tag : str
        Name of the loop.
    time : ndarray, shape (n,)
        As in `TagSignal`.
    pv, op : ndarray, shape (n,)
        Process variable and output, NaN for gaps. [PV], [OP]
    sp : ndarray, shape (n,), or None
        Set point. [PV]
    mode : ndarray of int8, shape (n,), or None
        Numbers of `loop.record.Mode`.
    pv_unit, op_unit : str
        Units, empty where unknown.
    tags : mapping of str to str
        Tag of every part: pv, sp, op, mode.
    held : tuple of str
        Parts whose samples have other times than PV; their last value is held.
    accounting : Accounting
        What became of the rows of this loop.
    """

    tag: str
    time: Times
    pv: Real
    op: Real
    sp: Real | None
    mode: Codes | None
    pv_unit: str
    op_unit: str
    tags: Mapping[str, str]
    held: tuple[str, ...]
    accounting: Accounting


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Export:
    """One file, read.

    Attributes
    ----------
    decisions : Decisions
        How the file was read.
    signals : mapping of str to TagSignal
        Every tag of the file.
    loops : mapping of str to LoopSamples
        Every loop that has a PV and an OP, by name; the name may be empty.
    incomplete : mapping of str to str
        Loops that lack a part or name one twice, and why they are no records.
    accounting : Accounting
        What became of the rows of the file.
    time_zone : str or None
        "UTC" or the stated zone if instants are known; else none.
    """

    decisions: Decisions
    signals: Mapping[str, TagSignal]
    loops: Mapping[str, LoopSamples]
    incomplete: Mapping[str, ExportRefused]
    accounting: Accounting
    time_zone: str | None

    def record(self, tag: str | None = None) -> Record:
        """Take one loop as a record.

        Parameters
        ----------
        tag : str, optional
            Name of the loop; needed where the file holds several.

        Raises
        ------
        ColumnNotFound
            Where no loop is recognised, or the loop lacks its PV or OP.
        AmbiguousColumns
            Where several loops are in the file and none is named, or a part is named twice.
        """
        samples = self._loop(tag)
        start, t = _since_start(samples.time, known=self.time_zone is not None)
        return Record(
            t=t,
            pv=samples.pv,
            op=samples.op,
            sp=samples.sp,
            mode=samples.mode,
            start=start,
            tag=samples.tag,
            pv_unit=samples.pv_unit,
            op_unit=samples.op_unit,
        )

    def _loop(self, tag: str | None) -> LoopSamples:
        if tag is not None and tag in self.incomplete:
            raise self.incomplete[tag]
        if tag is not None and tag not in self.loops:
            raise ColumnNotFound(
                f"loop {tag!r}", tuple(self.loops) or tuple(self.signals), "name one of the loops"
            )
        if tag is not None:
            return self.loops[tag]
        if not self.loops and self.incomplete:
            raise next(iter(self.incomplete.values()))
        if not self.loops:
            raise ColumnNotFound(
                "the PV and OP of a loop",
                tuple(self.signals),
                "name them with columns pv=... and op=..., by name or number",
            )
        if len(self.loops) > 1:
            raise AmbiguousColumns("the loop", tuple(self.loops), "name the loop")
        return next(iter(self.loops.values()))


def _since_start(time: Times, *, known: bool) -> tuple[datetime | None, Real]:
    """Split times into a start in UTC and seconds since then."""
    if not time.size:
        raise ExportRefused("The loop has no samples with a time; nothing can be learned from it.")
    if time.dtype == np.float64:
        return None, time.astype(np.float64)
    ticks = time.astype("datetime64[ns]").astype(np.int64)
    if not known:
        return None, (ticks - ticks[0]) / SECOND
    second = int(ticks[0]) // SECOND
    part = (int(ticks[0]) - second * SECOND) // 1000 * 1000  # datetime keeps microseconds
    t = (ticks - second * SECOND - part) / SECOND
    return datetime.fromtimestamp(second, tz=UTC).replace(microsecond=part // 1000), t


def as_times(instants: Instants) -> Times:
    """Show instants as datetime64[ns], elapsed seconds as they are."""
    if instants.dtype == np.int64:
        return instants.view("datetime64[ns]")
    return instants.astype(np.float64)
