"""Feed-forward of a measured load: static, or a lead-lag with delay, and what it leaves."""

import math
from dataclasses import asdict, dataclass, replace

import numpy as np

from loop.process import FOPDT
from loop.signals import Real
from tuning.sweep import FACTORS

# A lead of more than this multiplies noise as a derivative with N = 10 does.
LARGEST_RATIO = 10.0
POINTS = 1500
# Lags: from where to where a response is looked at after something arrived.
FINEST, RESTS = 1e-3, 14.0
# Lags closer than this are one double lag.
SAME_LAG = 1e-6
# A peak moves by less than a thousandth where only every fifth of them is looked at.
THINNED = 5


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
    worst_part : float
        Largest part of the peak without feed-forward that is left while one parameter of either
        model is off by up to 50 %; above 1 it does harm there. [-]
    worst : str
        Where that is.
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
    worst_part: float
    worst: str
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
    law = _Law(gain=gain, lead=process.tau, lag=lag, delay=delay)
    t = law.times(process, load, POINTS)
    alone = _step(load, t)
    static = alone + gain * _step(process, t)
    compensated = alone + law.answer(process, t)
    # Alone a lag only rises, to its gain.
    peaks = [abs(load.K), *(float(np.max(np.abs(y))) for y in (static, compensated))]
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
    worst_part, worst = _worst(law, process, load)
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
        worst_part=worst_part,
        worst=worst,
        sentence=said,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Law:
    """The feed-forward as it runs, whatever the processes are."""

    gain: float
    lead: float
    lag: float
    delay: float

    def times(self, process: FOPDT, load: FOPDT, points: int) -> Real:
        """Times at which anything arrives, and ever wider after each until all is at rest."""
        lags = [self.lag, process.tau, load.tau]
        since = np.concatenate([[0.0], np.geomspace(FINEST * min(lags), RESTS * sum(lags), points)])
        arrivals = [process.theta, process.theta + self.delay, load.theta]
        return np.unique(np.add.outer(arrivals, since))

    def answer(self, process: FOPDT, t: Real) -> Real:
        """PV that it makes of a unit load step: (lead s + 1)/((lag s + 1)(tau s + 1)) in time."""
        moving = np.maximum(t - process.theta - self.delay, 0.0)
        a, b, lead = self.lag, process.tau, self.lead
        fading = np.exp(-moving / a)
        if abs(a - b) <= SAME_LAG * b:
            course = 1 - fading * (1 + (a - lead) * moving / a**2)
        else:
            course = 1 + ((lead - a) * fading - (lead - b) * np.exp(-moving / b)) / (a - b)
        course = np.where(moving > 0, course, 0.0)
        return np.asarray(self.gain * process.K * course)


def _step(model: FOPDT, t: Real) -> Real:
    """Answer to a unit step."""
    return np.asarray(-model.K * np.expm1(-np.maximum(t - model.theta, 0.0) / model.tau))


def _worst(law: _Law, process: FOPDT, load: FOPDT) -> tuple[float, str]:
    """Largest part of the peak that is left with one parameter off, and where."""
    found = []
    for place, model in (("process", process), ("load", load)):
        for name, value in asdict(model).items():
            for factor in FACTORS if value else ():
                moved = replace(model, **{name: value * factor})
                plant, disturbance = (moved, load) if place == "process" else (process, moved)
                t = law.times(plant, disturbance, POINTS // THINNED)
                alone = _step(disturbance, t)
                left = alone + law.answer(plant, t)
                part = float(np.max(np.abs(left))) / abs(disturbance.K)
                found.append((part, f"{name} of the {place} x {factor:.2g}"))
    return max(found)
