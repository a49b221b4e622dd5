"""Did a change of settings help? The control error before and after it, compared."""

from dataclasses import dataclass

import numpy as np

from historian.resampling import even_record
from loop.record import Mode, Record
from loop.signals import Real
from monitoring.before_after import BeforeAfter, before_after

# A gap of so many samples is bridged, as in an assessment.
LARGEST_GAP = 3.5
# Of a grid with more points than so many times the samples, nearly all would be invented.
MOST_POINTS = 20
# The controller that was changed sets OP in these modes, and in no other.
CONTROLLED = (Mode.AUTO, Mode.CAS, Mode.REMOTE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """What a change did to the control error.

    Attributes
    ----------
    comparison : BeforeAfter
        Error after over before, with its interval and the verdict.
    sample_time : float or None
        Of the grid that both periods were put on; None where there is none. [s]
    controlled_before, controlled_after : float
        Share of each period with a known error and the controller in charge. [-]
    """

    comparison: BeforeAfter
    sample_time: float | None
    controlled_before: float
    controlled_after: float


def effect(before: Record, after: Record) -> Effect:
    """Compare the control errors of two periods of one loop.

    Both are put on the coarser of their two sample times; only samples with the controller in
    charge count. Periods that cannot be compared answer so, with the reason.

    Parameters
    ----------
    before, after : Record
        Routine data from before and after the change.
    """
    if min(len(before), len(after)) < 2:
        return _nothing()
    dt = max(before.sample_time, after.sample_time)
    if any(record.span / dt > MOST_POINTS * len(record) for record in (before, after)):
        return _nothing()
    first, second = (_error(record, dt) for record in (before, after))
    return Effect(
        comparison=before_after(first, second),
        sample_time=dt,
        controlled_before=float(np.mean(np.isfinite(first))),
        controlled_after=float(np.mean(np.isfinite(second))),
    )


def _nothing() -> Effect:
    nothing = np.empty(0)
    return Effect(
        comparison=before_after(nothing, nothing), sample_time=None, controlled_before=0.0,
        controlled_after=0.0,
    )  # fmt: skip


def _error(record: Record, dt: float) -> Real:
    """Control error on an even grid, NaN where the controller was not in charge."""
    even = even_record(record, dt, max_gap=LARGEST_GAP * dt)
    if even.sp is None:
        return np.full(len(even), np.nan)
    # A mode that is known nowhere says no more than none at all, as in an assessment.
    if even.mode is None or np.all(even.mode == Mode.UNKNOWN):
        return even.sp - even.pv
    return np.where(np.isin(even.mode, CONTROLLED), even.sp - even.pv, np.nan)
