"""Samples of one loop with their instants in UTC, as the store takes and gives them."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Self, TypeAlias

import numpy as np
import numpy.typing as npt

from loop.record import Record
from loop.signals import Codes, Real

Times: TypeAlias = npt.NDArray[np.datetime64]

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
EARLIEST = np.datetime64("1970-01-01T00:00:00", "us")
LATEST = np.datetime64("2200-01-01T00:00:00", "us")  # later stamps are typing errors, not data


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """Samples of one loop, in any order.

    Attributes
    ----------
    time : ndarray of datetime64[us], shape (n,)
        Instants in UTC, between 1970 and 2199.
    pv : ndarray, shape (n,)
        Process variable, NaN where there is no good value. [PV]
    sp : ndarray, shape (n,)
        Set point, NaN where there is no good value. [PV]
    op : ndarray, shape (n,)
        Controller output, NaN where there is no good value. [OP]
    mode : ndarray of int8, shape (n,)
        `loop.record.Mode` of every sample, -1 where it is unknown.
    """

    time: Times
    pv: Real
    sp: Real
    op: Real
    mode: Codes

    def __post_init__(self) -> None:
        if self.time.dtype != np.dtype("datetime64[us]"):
            raise ValueError(f"time must be datetime64[us] in UTC, got {self.time.dtype}")
        for name in ("time", "pv", "sp", "op", "mode"):
            signal = getattr(self, name)
            if signal.shape != (self.time.size,):
                raise ValueError(
                    f"{name} must hold one value a sample, got shape {signal.shape} "
                    f"for {self.time.size} samples"
                )
        if self.time.size:
            self._refuse_impossible_values()

    def _refuse_impossible_values(self) -> None:
        first, last = self.time.min(), self.time.max()  # both NaT as soon as one stamp is NaT
        if np.isnat(first):
            raise ValueError("every sample needs a time")
        if first < EARLIEST or last >= LATEST:
            outlier = first if first < EARLIEST else last
            raise ValueError(f"time {outlier} lies outside 1970 to 2199; check the time format")
        for name in ("pv", "sp", "op"):
            if np.isinf(getattr(self, name)).any():
                raise ValueError(f"{name} must not hold infinite values; gaps are NaN")

    def __len__(self) -> int:
        return self.time.size

    def between(self, since: int, until: int) -> Self:
        """Keep those of ordered samples with since <= time < until, since 1970 in UTC. [us]"""
        first, last = np.searchsorted(self.time.astype(np.int64), (since, until))
        if last - first == len(self):
            return self
        return type(self)(
            time=self.time[first:last],
            pv=self.pv[first:last],
            sp=self.sp[first:last],
            op=self.op[first:last],
            mode=self.mode[first:last],
        )

    @classmethod
    def of(cls, record: Record) -> Self:
        """Place a record on the clock.

        Raises
        ------
        ValueError
            The record holds elapsed time only, so nobody knows when it was.
        """
        if record.start is None:
            raise ValueError(
                "the record holds elapsed time only; state the instant it starts at to store it"
            )
        start = np.datetime64(record.start.replace(tzinfo=None), "us")
        missing = np.full(record.t.size, np.nan)
        return cls(
            time=start + np.round(record.t * 1e6).astype("timedelta64[us]"),
            pv=record.pv,
            sp=missing if record.sp is None else record.sp,
            op=record.op,
            mode=np.full(record.t.size, -1, np.int8) if record.mode is None else record.mode,
        )

    def record(self, *, tag: str = "", pv_unit: str = "", op_unit: str = "") -> Record:
        """Turn ordered samples into the record that identification and monitoring take.

        A set point or mode that is known nowhere is left out.
        """
        if not len(self):
            raise ValueError("a record needs at least one sample, got none")
        return Record(
            t=(self.time - self.time[0]).astype(np.int64) / 1e6,
            pv=self.pv,
            op=self.op,
            sp=None if np.all(np.isnan(self.sp)) else self.sp,
            mode=None if np.all(self.mode == -1) else self.mode,
            start=instant(int(self.time[0].astype(np.int64))),
            tag=tag,
            pv_unit=pv_unit,
            op_unit=op_unit,
        )


def instant(time: int) -> datetime:
    """Give a time since 1970 in UTC as a datetime. [us]"""
    return EPOCH + timedelta(microseconds=time)


def microseconds(moment: datetime) -> int:
    """Count the time since 1970 in UTC. [us]

    Raises
    ------
    ValueError
        The moment has no time zone.
    """
    if moment.utcoffset() is None:
        raise ValueError(f"{moment.isoformat()} has no time zone; add one, such as Z for UTC")
    return (moment - EPOCH) // timedelta(microseconds=1)
