"""The signals of one loop on an even grid, and what forbids judging them."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from loop.record import Mode
from loop.signals import Codes, Flags, Real

# Fewer samples than this carry no statistic worth a name.
FEWEST_SAMPLES = 30
# OP within this part of its range of a limit counts as saturated. A valve rarely reaches the very
# limit, and a controller's limits often stand a little inside.
SATURATION_MARGIN = 0.005
# A percentage that was recorded as a fraction of 1 lies within this part of its range.
LOWEST_PART = 0.01
# Samples that may be missing within a stretch; they are bridged by a straight line.
BRIDGED = 3


class LoopKind(StrEnum):
    """What the loop controls; it decides weights, limits and which indices mean something."""

    FLOW = "flow"
    PRESSURE = "pressure"
    LEVEL = "level"
    AVERAGING_LEVEL = "averaging_level"
    TEMPERATURE = "temperature"
    ANALYSER = "analyser"
    OTHER = "other"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopSignals:
    """One loop on an even grid.

    Attributes
    ----------
    dt : float
        Sample time. [s]
    pv, op : ndarray, shape (n,)
        Process variable and output, NaN where unknown. [PV], [OP]
    sp : ndarray, shape (n,), optional
        Set point, NaN where unknown. [PV]
    mode : ndarray of int8, shape (n,), optional
        `loop.record.Mode` of every sample.
    pv_range : tuple of float, optional
        Lowest and highest PV that the instrument shows. [PV]
    op_range : tuple of float
        Lowest and highest OP. [OP]
    """

    dt: float
    pv: Real
    op: Real
    sp: Real | None = None
    mode: Codes | None = None
    pv_range: tuple[float, float] | None = None
    op_range: tuple[float, float] = (0.0, 100.0)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise ValueError(f"dt must be positive, got {self.dt}")
        for name in ("op", "sp", "mode"):
            signal = getattr(self, name)
            if signal is not None and signal.shape != self.pv.shape:
                raise ValueError(
                    f"{name} must be as long as pv, got {signal.shape} and {self.pv.shape}"
                )
        for name in ("pv_range", "op_range"):
            limits = getattr(self, name)
            if limits is not None and not (np.all(np.isfinite(limits)) and limits[0] < limits[1]):
                raise ValueError(f"{name} must rise from its first to its second number")

    @property
    def pv_span(self) -> float | None:
        """Range of the instrument. [PV]"""
        return None if self.pv_range is None else self.pv_range[1] - self.pv_range[0]

    @property
    def op_span(self) -> float:
        """Range of the output. [OP]"""
        return self.op_range[1] - self.op_range[0]

    @property
    def known(self) -> Flags:
        """Samples with a PV and an OP."""
        return np.isfinite(self.pv) & np.isfinite(self.op)

    @property
    def automatic(self) -> Flags:
        """Samples in AUTO, CAS or REMOTE; all of them where no mode was recorded."""
        if self.mode is None or np.all(self.mode == Mode.UNKNOWN):
            return np.ones(self.pv.size, dtype=np.bool_)
        return np.asarray(self.mode >= Mode.AUTO)

    @property
    def mode_known(self) -> bool:
        """Whether any mode was recorded."""
        return self.mode is not None and bool(np.any(self.mode != Mode.UNKNOWN))

    @property
    def low(self) -> Flags:
        """Samples whose output lies at its lower limit."""
        return np.asarray(self.op <= self.op_range[0] + SATURATION_MARGIN * self.op_span)

    @property
    def high(self) -> Flags:
        """Samples whose output lies at its upper limit."""
        return np.asarray(self.op >= self.op_range[1] - SATURATION_MARGIN * self.op_span)

    @property
    def error(self) -> Real | None:
        """Set point minus PV, none without a set point. [PV]"""
        if self.sp is None or not np.any(np.isfinite(self.sp)):
            return None
        return self.sp - self.pv


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stretch:
    """The longest part of a record in which the controller was free to act, gaps bridged.

    Attributes
    ----------
    first : int
        Index of its first sample.
    dt : float
        Sample time. [s]
    pv, op : ndarray, shape (n,)
        Signals without gaps. [PV], [OP]
    sp : ndarray, shape (n,), or None
        Set point without gaps. [PV]
    share : float
        Part of the record. [-]
    """

    first: int
    dt: float
    pv: Real
    op: Real
    sp: Real | None
    share: float

    @property
    def error(self) -> Real:
        """Set point minus PV; without a set point, mean PV minus PV. [PV]"""
        return (float(np.mean(self.pv)) if self.sp is None else self.sp) - self.pv


def controlled_stretch(signals: LoopSignals) -> Stretch | None:
    """Cut out the longest stretch in automatic, known and not saturated; None for none.

    Up to `BRIDGED` samples in a row may be missing or saturated; missing ones are bridged.
    """
    free = signals.known & signals.automatic & ~signals.low & ~signals.high
    bounds = _longest(free, BRIDGED)
    if bounds is None or bounds[1] - bounds[0] < FEWEST_SAMPLES:
        return None
    part = slice(*bounds)
    sp = None if signals.sp is None else signals.sp[part]
    if sp is not None and not np.any(np.isfinite(sp)):
        sp = None
    return Stretch(
        first=bounds[0],
        dt=signals.dt,
        pv=bridged(signals.pv[part]),
        op=bridged(signals.op[part]),
        sp=None if sp is None else bridged(sp),
        share=(bounds[1] - bounds[0]) / free.size,
    )


def _longest(free: Flags, bridge: int) -> tuple[int, int] | None:
    """First and one past the last index of the longest run of True with short breaks."""
    places = np.flatnonzero(free)
    if places.size == 0:
        return None
    breaks = np.flatnonzero(np.diff(places) > bridge + 1)
    starts = places[np.r_[0, breaks + 1]]
    ends = places[np.r_[breaks, places.size - 1]] + 1
    best = int(np.argmax(ends - starts))
    return int(starts[best]), int(ends[best])


def bridged(signal: Real) -> Real:
    """Fill missing samples by straight lines, the ends by the nearest value.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Signal with at least one value.
    """
    known = np.isfinite(signal)
    if known.all():
        return signal
    places = np.arange(signal.size)
    return np.interp(places, places[known], signal[known])


def unfit(signals: LoopSignals) -> str | None:
    """Say why nothing can be said of these signals, None where something can."""
    known = signals.known
    count = int(np.count_nonzero(known))
    if count < FEWEST_SAMPLES:
        return (
            f"{count} samples have both a PV and an OP; "
            f"{FEWEST_SAMPLES} are the fewest that can be judged"
        )
    pv, op = signals.pv[known], signals.op[known]
    if np.ptp(pv) == 0 and np.ptp(op) == 0:
        return "neither PV nor OP ever moves: the loop was shut down or the data are frozen"
    return (
        _wrong_unit(pv, "PV", signals.pv_range)
        or _wrong_unit(op, "OP", signals.op_range)
        or _lowest_part(pv, "PV", signals.pv_range)
        or _lowest_part(op, "OP", signals.op_range)
    )


def _wrong_unit(values: Real, name: str, limits: tuple[float, float] | None) -> str | None:
    """Find a signal that mostly lies outside its range, by more than a tenth of it."""
    if limits is None:
        return None
    margin = 0.1 * (limits[1] - limits[0])
    outside = (values < limits[0] - margin) | (values > limits[1] + margin)
    share = np.count_nonzero(outside) / values.size
    if share <= 0.5:
        return None
    return (
        f"{share:.0%} of {name} lie outside its range {limits[0]:g} to {limits[1]:g}: "
        "check the unit or the range"
    )


def _lowest_part(values: Real, name: str, limits: tuple[float, float] | None) -> str | None:
    """Find a signal that moves within the lowest hundredth of its range, as a fraction would.

    One that rests at the very end is at its limit, and nothing is wrong with its unit.
    """
    if limits is None or np.ptp(values) == 0:
        return None
    low, end = limits[0], limits[0] + LOWEST_PART * (limits[1] - limits[0])
    resting = np.count_nonzero(values == np.min(values))
    if np.min(values) < low or np.max(values) > end or resting > 0.5 * values.size:
        return None
    return (
        f"{name} never leaves the lowest {LOWEST_PART:.0%} of its range {limits[0]:g} to "
        f"{limits[1]:g}: check the unit (a fraction of 1?) and the range, or the loop was shut down"
    )
