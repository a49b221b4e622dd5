"""What a loop did over time: set point, process variable, output and mode."""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from enum import IntEnum
from typing import Self

import numpy as np

from loop.signals import Codes, Flags, Real


class Mode(IntEnum):
    """Who decided the controller output."""

    UNKNOWN = -1
    MAN = 0
    AUTO = 1
    CAS = 2
    REMOTE = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record:
    """One loop over one stretch of time.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time since `start`, strictly increasing, not necessarily even. [s]
    pv : ndarray, shape (n,)
        Process variable, NaN where the historian has no good value. [PV]
    op : ndarray, shape (n,)
        Controller output, NaN where the historian has no good value. [OP]
    sp : ndarray, shape (n,), optional
        Set point, NaN where the historian has no good value. [PV]
    mode : ndarray of int8, shape (n,), optional
        `Mode` of every sample.
    start : datetime, optional
        Instant of t = 0 in UTC; none for elapsed time.
    op_before : float, optional
        Output before the first sample, where the user states it. It is never guessed. [OP]
    tag, pv_unit, op_unit : str
        Name of the loop and units of PV and OP; empty where unknown.
    """

    t: Real
    pv: Real
    op: Real
    sp: Real | None = None
    mode: Codes | None = None
    start: datetime | None = None
    op_before: float | None = None
    tag: str = ""
    pv_unit: str = ""
    op_unit: str = ""

    def __post_init__(self) -> None:
        self._copy_signals()
        if self.t.size == 0:
            raise ValueError("a record needs at least one sample, got none")
        if not np.all(np.isfinite(self.t)):
            raise ValueError("every time of a record must be finite")
        if np.any(np.diff(self.t) <= 0):
            late = int(np.argmax(np.diff(self.t) <= 0)) + 1
            raise ValueError(f"times must increase strictly, sample {late} does not")
        if self.start is not None and self.start.utcoffset() != timedelta(0):
            raise ValueError(f"start must be in UTC, got {self.start.isoformat()}")
        if self.op_before is not None and not np.isfinite(self.op_before):
            raise ValueError(f"op_before must be finite, got {self.op_before}")

    def _copy_signals(self) -> None:
        """Keep own read-only copies, so that a frozen record stays what it was."""
        for name in ("t", "pv", "op", "sp"):
            signal = getattr(self, name)
            if signal is not None:
                values = np.array(signal, dtype=np.float64)
                self._keep(name, values)
                if np.any(np.isinf(values)):
                    raise ValueError(f"{name} must not hold infinite values; gaps are NaN")
        if self.mode is not None:
            self._keep("mode", np.array(self.mode, dtype=np.int8))

    def _keep(self, name: str, values: Real | Codes) -> None:
        if values.ndim != 1:
            raise ValueError(f"{name} must have one dimension, got {values.ndim}")
        if name != "t" and values.size != self.t.size:
            raise ValueError(f"{name} must be as long as t, got {values.size} and {self.t.size}")
        values.setflags(write=False)
        object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return self.t.size

    @property
    def span(self) -> float:
        """Time from the first to the last sample. [s]"""
        return float(self.t[-1] - self.t[0])

    @property
    def sample_time(self) -> float:
        """Median spacing of the samples, NaN for a single sample. [s]"""
        return float(np.median(np.diff(self.t))) if self.t.size > 1 else float("nan")

    def between(self, first: float, last: float) -> Self:
        """Cut out the samples with first <= t <= last. [s]"""
        inside = (self.t >= first) & (self.t <= last)
        if not np.any(inside):
            raise ValueError(f"no sample lies between {first} s and {last} s")
        return self._only(inside)

    def without_gaps(self) -> Self:
        """Keep the samples where both PV and OP are known."""
        known = np.isfinite(self.pv) & np.isfinite(self.op)
        if not np.any(known):
            raise ValueError("no sample has both a PV and an OP")
        return self._only(known)

    def _only(self, kept: Flags) -> Self:
        return replace(
            self,
            t=self.t[kept],
            pv=self.pv[kept],
            op=self.op[kept],
            sp=None if self.sp is None else self.sp[kept],
            mode=None if self.mode is None else self.mode[kept],
        )
