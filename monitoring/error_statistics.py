"""How far PV was from its set point."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from monitoring.basis import Basis, graded, refusal
from monitoring.loop_signals import LoopSignals


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorStatistics:
    """The control error e = sp - pv in automatic; None where it is not known.

    Attributes
    ----------
    mean, sd : float or None
        Mean and standard deviation. [PV]
    mean_absolute : float or None
        IAE over time, mean |e|. [PV]
    mean_percent, sd_percent, mean_absolute_percent : float or None
        The same in percent of the PV span, where that is known. [%]
    outside : float or None
        Part of the known PV outside the limits given. [-]
    basis : Basis
        What the numbers rest on.
    """

    mean: float | None
    sd: float | None
    mean_absolute: float | None
    mean_percent: float | None
    sd_percent: float | None
    mean_absolute_percent: float | None
    outside: float | None
    basis: Basis


def error_statistics(
    signals: LoopSignals, *, limits: tuple[float, float] | None = None
) -> ErrorStatistics:
    """Measure the control error in automatic.

    Parameters
    ----------
    signals : LoopSignals
        The loop on an even grid.
    limits : tuple of float, optional
        Lowest and highest PV that the process allows. [PV]
    """
    error = signals.error
    outside = None
    pv = signals.pv[np.isfinite(signals.pv)]
    if limits is not None and pv.size:
        outside = float(np.count_nonzero((pv < limits[0]) | (pv > limits[1])) / pv.size)
    used: Real = np.zeros(0)
    if error is not None:
        used = error[np.isfinite(error) & signals.automatic]
    if used.size < 2:
        why = "no set point was recorded" if error is None else "no error is known in automatic"
        return ErrorStatistics(
            mean=None, sd=None, mean_absolute=None, mean_percent=None, sd_percent=None,
            mean_absolute_percent=None, outside=outside, basis=refusal(why),
        )  # fmt: skip
    mean, sd = float(np.mean(used)), float(np.std(used))
    absolute = float(np.mean(np.abs(used)))
    percent = None if signals.pv_span is None else 100 / signals.pv_span
    doubts = () if percent is not None else ("the range of PV was not given",)
    return ErrorStatistics(
        mean=mean,
        sd=sd,
        mean_absolute=absolute,
        mean_percent=None if percent is None else mean * percent,
        sd_percent=None if percent is None else sd * percent,
        mean_absolute_percent=None if percent is None else absolute * percent,
        outside=outside,
        basis=graded(used.size / signals.pv.size, doubts),
    )
