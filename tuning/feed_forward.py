"""Feed-forward of a measured load: static, or a lead-lag with delay, and what it leaves."""

import math
from dataclasses import dataclass

import numpy as np

from loop.open_loop import step_response
from loop.process import FOPDT, TransferFunction
from loop.signals import Real

# A lead of more than this multiplies noise as a derivative with N = 10 does.
LARGEST_RATIO = 10.0
POINTS = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForward:
    """Feed-forward gain (T_lead s + 1)/(T_lag s + 1) e^(-delay s) from the load to OP.

    Attributes
    ----------
    gain : float
        Static feed-forward, -Kd/K. [OP/load]
    T_lead, T_lag : float
        Time constants. [s]
    delay : float
        Dead time to wait before acting. [s]
    late : float
        Dead time by which it comes too late; 0 where it can be perfect. [s]
    realisable : bool
        Whether it cancels the load completely, at the models.
    peak_without, peak_static, peak : float
        Peak of PV for a unit load step without feed-forward, with the static one, and with this
        one, feedback left out. [PV/load]
    sentence : str
        The answer in words.
    """

    gain: float
    T_lead: float
    T_lag: float
    delay: float
    late: float
    realisable: bool
    peak_without: float
    peak_static: float
    peak: float
    sentence: str


def feed_forward(
    process: FOPDT, load: FOPDT, *, largest_ratio: float = LARGEST_RATIO
) -> FeedForward:
    """Work out the feed-forward that cancels a measured load, as far as that can be done.

    F(s) = -(Kd/K) (tau s + 1)/(tau_d s + 1) e^(-(theta_d - theta) s). Where theta_d < theta it
    would have to act before the load is seen, and acts at once; where tau > largest_ratio tau_d
    its lag is raised to tau/largest_ratio.

    Parameters
    ----------
    process : FOPDT
        From OP to PV.
    load : FOPDT
        From the measured load to PV.
    largest_ratio : float
        Largest T_lead over T_lag. [-]
    """
    if not (largest_ratio >= 1 and math.isfinite(largest_ratio)):
        raise ValueError(f"largest_ratio must be 1 or more, got {largest_ratio}")
    gain = -load.K / process.K
    lag = max(load.tau, process.tau / largest_ratio)
    late = max(process.theta - load.theta, 0.0)
    delay = max(load.theta - process.theta, 0.0)
    realisable = late == 0 and lag == load.tau
    slow = process.tau + load.tau + lag
    even = np.linspace(0.0, process.theta + load.theta + 12 * slow, POINTS)
    # The peak left stands where the correction arrives.
    t = np.union1d(even, [process.theta, load.theta])
    alone = step_response(load, t)
    static = alone + gain * step_response(process, t)
    compensated = alone + _answer(process, gain, lag, delay, t)
    peaks = [float(np.max(np.abs(y))) for y in (alone, static, compensated)]
    if realisable:
        said = "It cancels the load completely, as far as the models are right."
    else:
        why = []
        if late:
            why.append(f"it comes {late:.4g} s too late")
        if lag > load.tau:
            why.append(f"its lead is held to {largest_ratio:g} times its lag")
        said = (
            f"It cannot be perfect: {' and '.join(why)}. Of a peak of {peaks[0]:.4g} without it "
            f"{peaks[2]:.4g} is left, with the static gain alone {peaks[1]:.4g}."
        )
    return FeedForward(
        gain=gain,
        T_lead=process.tau,
        T_lag=lag,
        delay=delay,
        late=late,
        realisable=realisable,
        peak_without=peaks[0],
        peak_static=peaks[1],
        peak=peaks[2],
        sentence=said,
    )


def _answer(process: FOPDT, gain: float, lag: float, delay: float, t: Real) -> Real:
    """PV that the feed-forward makes of a unit load step: its lead cancels the process's lag."""
    path = TransferFunction((gain * process.K,), (lag, 1.0), process.theta + delay)
    return step_response(path, t)
