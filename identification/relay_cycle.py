"""Limit cycle of a relay around first order plus dead time: its closed form, and the way back."""

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from loop.errors import NoLimitCycle
from loop.process import FOPDT


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitCycle:
    """Settled oscillation of PV and OP under a relay.

    Attributes
    ----------
    highest, lowest : float
        Extremes of PV about the set point. [PV]
    high_time, low_time : float
        How long OP stays at its higher and at its lower level. [s]
    """

    highest: float
    lowest: float
    high_time: float
    low_time: float

    @property
    def period(self) -> float:
        """Length of a cycle. [s]"""
        return self.high_time + self.low_time

    @property
    def amplitude(self) -> float:
        """Half of PV's peak-to-peak value. [PV]"""
        return (self.highest - self.lowest) / 2


def limit_cycle(
    process: FOPDT, *, amplitude: float, bias: float = 0.0, hysteresis: float = 0.0
) -> LimitCycle:
    """Predict the limit cycle of a relay with outputs bias ± amplitude about the output at rest.

    With E = e^(theta/tau), K > 0, and m0, m, eps for bias, amplitude and hysteresis:

        highest = (m0 + m) K (1 - 1/E) + eps/E
        lowest = (m0 - m) K (1 - 1/E) - eps/E
        T_high = tau ln((2 m K E + m0 K - m K + eps)/(m K + m0 K - eps))
        T_low = tau ln((2 m K E - m K - m0 K + eps)/(m K - m0 K - eps))

    The formulas agree with exact simulation within 0.02 %.

    Parameters
    ----------
    process : FOPDT
        Process; of a negative gain the relay acts direct.
    amplitude, bias : float
        Half the distance of the two outputs, and their middle less the output at rest. [OP]
    hysteresis : float
        Half-width of the hysteresis about PV at rest. [PV]

    Raises
    ------
    NoLimitCycle
        One of the two outputs cannot carry PV over the hysteresis, so the relay stops switching.

    Examples
    --------
    >>> cycle = limit_cycle(FOPDT(K=1.0, tau=1.0, theta=1.0), amplitude=1.0)
    >>> f"{cycle.amplitude:.4f} {cycle.period:.4f}"
    '0.6321 2.9798'
    """
    K, m, m0, eps = abs(process.K), amplitude, bias, hysteresis
    up, down = (m + m0) * K - eps, (m - m0) * K - eps
    if min(up, down) <= 0:
        raise NoLimitCycle(
            f"The relay stops switching: with its outputs {m0 + m:+.4g} and {m0 - m:+.4g} about "
            f"rest, PV cannot pass the hysteresis of {eps:.4g} on both sides."
        )
    part = -math.expm1(-process.theta / process.tau)  # 1 - 1/E
    highest = (m0 + m) * K * part + eps * (1 - part)
    lowest = (m0 - m) * K * part - eps * (1 - part)
    # T = theta + the time back from the extreme: ln of the printed quotient divided by E.
    high = process.theta + process.tau * math.log(((m + m0) * K - lowest) / up)
    low = process.theta + process.tau * math.log((highest + (m - m0) * K) / down)
    if process.K < 0:
        highest, lowest = -lowest, -highest
    return LimitCycle(highest=highest, lowest=lowest, high_time=high, low_time=low)


def invert_biased(
    *, K: float, amplitude: float, bias: float, hysteresis: float, high_time: float, low_time: float
) -> FOPDT:
    """Find tau and theta from the two half periods of a biased relay, the gain known.

    Both printed half periods are linear in E; without it,

        e^(T_high/tau) (m K + m0 K - eps) - e^(T_low/tau) (m K - m0 K - eps) = 2 m0 K

    has one root in tau, and E follows from either. The amplitude is not used: at large theta/tau
    it says nothing of tau (2 % on it turn theta/tau 10 into 3.9).

    Parameters
    ----------
    K : float
        Static gain, from the mean of PV over the mean of OP. [PV/OP]
    amplitude, bias : float
        Half the distance of the two outputs, and their middle less the output at rest. [OP]
    hysteresis : float
        Half-width of the hysteresis. [PV]
    high_time, low_time : float
        Mean time of OP at its higher and lower level. [s]

    Raises
    ------
    NoLimitCycle
        The relay is not biased, or no first-order process has these half periods.

    Examples
    --------
    >>> cycle = limit_cycle(FOPDT(K=2.0, tau=9.0, theta=3.0), amplitude=1.0, bias=0.4)
    >>> found = invert_biased(
    ...     K=2.0, amplitude=1.0, bias=0.4, hysteresis=0.0,
    ...     high_time=cycle.high_time, low_time=cycle.low_time,
    ... )
    >>> f"{found.tau:.6f} {found.theta:.6f}"
    '9.000000 3.000000'
    """
    size, eps = abs(K), hysteresis
    if bias < 0:  # upside down it is a relay with the opposite bias
        bias, high_time, low_time = -bias, low_time, high_time
    up, down = (amplitude + bias) * size - eps, (amplitude - bias) * size - eps
    if min(up, down) <= 0 or bias == 0:
        raise NoLimitCycle(
            f"No first-order process with a gain of {K:.4g} cycles in this relay without stopping, "
            "or the relay is not biased."
        )

    def left(rate: float) -> float:
        # expm1, since for slow processes the three terms nearly cancel.
        return up * math.expm1(high_time * rate) - down * math.expm1(low_time * rate)

    if up * high_time <= down * low_time or low_time <= high_time:
        raise NoLimitCycle(
            f"No first-order process with a gain of {K:.4g} has half periods of {high_time:.4g} s "
            f"and {low_time:.4g} s in this relay."
        )
    # left rises from 0 to a summit, then falls without end: past the summit there is one root.
    summit = math.log(up * high_time / (down * low_time)) / (low_time - high_time)
    beyond = summit
    while left(beyond) > 0:
        beyond *= 2
    rate = float(brentq(left, summit, beyond, xtol=1e-300, rtol=1e-14))
    E = (up * math.exp(high_time * rate) + amplitude * size - bias * size - eps) / (
        2 * amplitude * size
    )
    return FOPDT(K=K, tau=1 / rate, theta=math.log(E) / rate)


def invert_symmetric(
    *, K: float, amplitude: float, hysteresis: float, swing: float, period: float
) -> FOPDT:
    """Find tau and theta from half the swing and the period of a symmetric relay, the gain known.

        a = K d (1 - 1/E) + eps/E,   P = 2 tau ln((2 d K E - d K + eps)/(d K - eps))

    Parameters
    ----------
    K : float
        Static gain, from elsewhere. [PV/OP]
    amplitude : float
        d, half the distance of the two outputs. [OP]
    hysteresis : float
        Half-width of the hysteresis. [PV]
    swing : float
        a, half of PV's peak-to-peak value. [PV]
    period : float
        Length of a cycle. [s]

    Raises
    ------
    NoLimitCycle
        No first-order process of this gain has this swing.
    """
    full, eps = abs(K) * amplitude, hysteresis
    if not eps < swing < full:
        raise NoLimitCycle(
            f"PV swings by {swing:.4g}, and first order with a gain of {K:.4g} would swing by "
            f"{eps:.4g} to {full:.4g} in this relay."
        )
    E = (full - eps) / (full - swing)
    tau = period / (2 * math.log((2 * full * E - full + eps) / (full - eps)))
    return FOPDT(K=K, tau=tau, theta=tau * math.log(E))
