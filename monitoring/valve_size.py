"""Where the valve works in its range: too large, too small, or right."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from monitoring.basis import Basis, graded, refusal
from monitoring.loop_signals import FEWEST_SAMPLES, LoopSignals

# Nearly always below the first, or above the second, part of its range.
OVERSIZED_BELOW, UNDERSIZED_ABOVE = 0.2, 0.8
NEARLY_ALWAYS = 0.95


class ValveSize(StrEnum):
    """Size of the valve for its duty."""

    RIGHT = "right"
    OVERSIZED = "oversized"
    UNDERSIZED = "undersized"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True, kw_only=True)
class ValveRange:
    """Where the output lay in automatic.

    Attributes
    ----------
    size : ValveSize
        Oversized if OP stays in the lowest fifth of its range for 95 % of the time, undersized
        if it stays in the highest.
    low, middle, high : float or None
        2.5 %, 50 % and 97.5 % quantiles of OP in percent of its range. [%]
    basis : Basis
        What this rests on.
    """

    size: ValveSize
    low: float | None
    middle: float | None
    high: float | None
    basis: Basis


def valve_range(signals: LoopSignals) -> ValveRange:
    """Judge the size of the valve from the outputs in automatic.

    A controller whose output goes to a set point, or a range split over two valves, is not judged
    rightly by this.
    """
    used = np.isfinite(signals.op) & signals.automatic
    op = (signals.op[used] - signals.op_range[0]) / signals.op_span
    settings = (("oversized below", OVERSIZED_BELOW), ("undersized above", UNDERSIZED_ABOVE))
    if op.size < FEWEST_SAMPLES:
        why = f"{op.size} outputs in automatic are too few"
        return ValveRange(
            size=ValveSize.UNDECIDED, low=None, middle=None, high=None,
            basis=refusal(why, settings=settings),
        )  # fmt: skip
    size = ValveSize.RIGHT
    if np.count_nonzero(op < OVERSIZED_BELOW) >= NEARLY_ALWAYS * op.size:
        size = ValveSize.OVERSIZED
    elif np.count_nonzero(op > UNDERSIZED_ABOVE) >= NEARLY_ALWAYS * op.size:
        size = ValveSize.UNDERSIZED
    low, middle, high = (100 * float(q) for q in np.quantile(op, [0.025, 0.5, 0.975]))
    return ValveRange(
        size=size,
        low=low,
        middle=middle,
        high=high,
        basis=graded(op.size / signals.op.size, settings=settings),
    )
