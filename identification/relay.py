"""Ultimate gain and period from a relay test, by the describing function.

References
----------
.. [1] K. J. Åström and T. Hägglund, "Automatic tuning of simple regulators with specifications on
   phase and amplitude margins," Automatica, vol. 20, no. 5, pp. 645-651, 1984.
   doi:10.1016/0005-1098(84)90014-1
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from identification.relay_reading import MEDIAN_DEVIATION, RelayCycles, folded, read_cycles
from identification.relay_ultimate import ultimate_gain_and_period
from loop.errors import NoLimitCycle
from loop.record import Record
from loop.signals import Real

# Ratios of dead time to time constant over which the error of the describing function is stated.
RATIOS = np.geomspace(0.05, 10.0, 40)
READING = 0.004
# PV's mean must stand so many of its errors off the rest for a static gain to show.
SHOWS = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayResult:
    """Limit cycle of a relay test and what it says.

    Attributes
    ----------
    Ku : float
        Ultimate gain by the describing function, positive. [OP/PV]
    Pu : float
        Period of the limit cycle. [s]
    Ku_low, Ku_high : float
        Where the true ultimate gain lies, were the process first order with a dead time of 0.05
        to 10 time constants: Ku/1.22 and Ku/0.81 without hysteresis. [OP/PV]
    gain_sign : float
        +1 where PV follows OP, -1 where it goes against it.
    K : float or None
        Static gain, where the relay was biased and the record shows the rest before the test.
        [PV/OP]
    K_error : float or None
        Its standard error, from noise and sampling. [PV/OP]
    amplitude : float
        Half of PV's peak-to-peak value over the mean settled cycle. [PV]
    relay_amplitude : float
        d, half of the output's peak-to-peak value. [OP]
    bias : float or None
        Middle of the two outputs less the output at rest, where the record shows it. [OP]
    high_time, low_time : float
        Mean time of OP at its higher and at its lower level. [s]
    hysteresis : float
        Half-width of the relay's hysteresis, as stated. [PV]
    cycles, discarded : int
        Settled cycles used, and transient ones left out.
    period_spread, amplitude_spread : float
        Standard deviation from cycle to cycle as a part of the mean. [-]
    noise_sd : float
        Standard deviation of PV about the mean cycle. [PV]
    remarks : tuple of str
        What to know about the result, in words.
    """

    Ku: float
    Pu: float
    Ku_low: float
    Ku_high: float
    gain_sign: float
    K: float | None
    K_error: float | None
    amplitude: float
    relay_amplitude: float
    bias: float | None
    high_time: float
    low_time: float
    hysteresis: float
    cycles: int
    discarded: int
    period_spread: float
    amplitude_spread: float
    noise_sd: float
    remarks: tuple[str, ...]


def relay_test(record: Record, *, hysteresis: float = 0.0) -> RelayResult:
    """Read the ultimate gain and period off the settled cycles of a relay test [1]_.

    Ku = 4 d/(pi a); with a hysteresis eps, -1/N = -(pi/(4 d)) (sqrt(a^2 - eps^2) + j eps) and
    Ku = 4 d/(pi sqrt(a^2 - eps^2)).

    Parameters
    ----------
    record : Record
        Relay test: OP switches between two levels.
    hysteresis : float
        Half-width of the relay's hysteresis. [PV]

    Raises
    ------
    NoLimitCycle
        OP does not switch between two levels, chatters, or the cycles have not settled.
    """
    return read_relay(read_cycles(record), hysteresis=hysteresis)


def read_relay(cycles: RelayCycles, *, hysteresis: float = 0.0) -> RelayResult:
    """Read the ultimate gain and period off cycles that were found already.

    Parameters
    ----------
    cycles : RelayCycles
        Cycles of the test.
    hysteresis : float
        Half-width of the relay's hysteresis. [PV]

    Raises
    ------
    NoLimitCycle
        PV swings by less than the hysteresis.
    """
    settled = cycles.settled
    periods, heights = cycles.periods[settled:], cycles.heights[settled:]
    phase, inside = folded(cycles)
    wave, noise = _mean_cycle(phase, cycles.pv[inside])
    a = float(np.ptp(wave)) / 2
    if a <= hysteresis:
        raise NoLimitCycle(
            f"PV swings by {a:.3g} about its middle, less than the hysteresis of {hysteresis:.3g}."
        )
    d = cycles.amplitude
    Ku = 4 * d / (math.pi * math.sqrt(a**2 - hysteresis**2))
    K, K_error, why = _static_gain(cycles, noise)
    high_time, low_time = cycles.half_times()
    lowest, highest = describing_function_errors(hysteresis / a)
    remarks = (
        f"{periods.size} settled cycles are used, {settled} before them are left out",
        f"with this hysteresis the describing function is off by {100 * lowest:+.0f} % to "
        f"{100 * highest:+.0f} % in Ku for a dead time of 0.05 to 10 time constants: the true Ku "
        f"lies within {Ku / (1 + highest):.3g} and {Ku / (1 + lowest):.3g}",
        why,
    )
    return RelayResult(
        Ku=Ku,
        Pu=float(np.mean(periods)),
        Ku_low=Ku / (1 + highest),
        Ku_high=Ku / (1 + lowest),
        gain_sign=_gain_sign(wave),
        K=K,
        K_error=K_error,
        amplitude=a,
        relay_amplitude=d,
        bias=_bias(cycles),
        high_time=high_time,
        low_time=low_time,
        hysteresis=hysteresis,
        cycles=periods.size,
        discarded=settled,
        period_spread=float(np.std(periods) / np.mean(periods)),
        amplitude_spread=float(np.std(heights) / np.mean(heights)),
        noise_sd=noise,
        remarks=remarks,
    )


def describing_function_errors(part: float) -> tuple[float, float]:
    """Lowest and highest relative error of Ku on first order plus dead time.

    From the exact amplitude a = (1 - 1/E)/(1 - eps/(a E)), E = e^(theta/tau), of a relay of unit
    amplitude on unit gain, against the exact ultimate gain, for theta/tau of 0.05 to 10. A
    hysteresis lowers the frequency of the cycle, and with it the gain that is read off.

    Parameters
    ----------
    part : float
        Hysteresis over half the swing of PV, eps/a. [-]

    Examples
    --------
    >>> low, high = describing_function_errors(0.0)
    >>> f"{low:+.2f} {high:+.2f}"
    '-0.19 +0.23'
    """
    E = np.exp(RATIOS)
    a = (1 - 1 / E) / (1 - part / E)
    off = 4 / (math.pi * a * math.sqrt(1 - part**2)) / _exact_gains() - 1
    # Sampling and noise of a record take a few tenths of a percent.
    return float(off.min()) - READING, float(off.max()) + READING


@cache
def _exact_gains() -> Real:
    """Ultimate gains of 1/(s + 1) e^(-theta s) over the ratios."""
    return np.array([ultimate_gain_and_period(1.0, 1.0, theta)[0] for theta in RATIOS.tolist()])


def looks_like_relay(record: Record) -> bool:
    """Tell whether OP switches regularly between two levels, as a relay's does.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.
    """
    try:
        relay_test(record)
    except NoLimitCycle:
        return False
    return True


def _mean_cycle(phase: Real, pv: Real) -> tuple[Real, float]:
    """Median cycle over equal parts of the phase, and the noise about it.

    The parts are as narrow as the noise allows: averaging n readings takes noise down by sqrt(n)
    but also rounds off the peaks, by about a quarter of what PV moves within a part.
    """
    order = np.argsort(phase, kind="stable")
    phase, pv = phase[order], pv[order]
    rough = float(np.median(np.abs(np.diff(pv)))) / MEDIAN_DEVIATION / math.sqrt(2)
    swing = float(np.ptp(np.quantile(pv, [0.02, 0.98])))
    # Equal errors from both, with n = phase.size/parts: 2 rough/sqrt(n) = swing/(2 parts).
    balance = (swing**2 * phase.size / (16 * max(rough, 1e-12 * swing) ** 2)) ** (1 / 3)
    parts = int(min(max(balance, 16), phase.size // 2, 400))
    starts = np.searchsorted(phase, np.arange(parts) / parts)
    starts = np.unique(starts[starts < phase.size])
    # The median, so that one wild reading does not make a peak.
    wave = np.array([np.median(group) for group in np.split(pv, starts[1:])])
    centres = np.array([np.mean(group) for group in np.split(phase, starts[1:])])
    off = np.abs(pv - np.interp(phase, centres, wave, period=1.0))
    return wave, float(np.median(off)) / MEDIAN_DEVIATION


def _gain_sign(wave: Real) -> float:
    """Whether PV falls (+1) or rises (-1) when OP goes up: a relay acts against PV."""
    near = max(wave.size // 20, 1)
    return 1.0 if wave[:near].mean() < wave[-near:].mean() else -1.0


def _bias(cycles: RelayCycles) -> float | None:
    """Middle of the two outputs less the output at rest. [OP]"""
    rest = cycles.op[cycles.rest]
    return (cycles.high + cycles.low) / 2 - float(np.mean(rest)) if rest.size else None


def _static_gain(cycles: RelayCycles, noise: float) -> tuple[float | None, float | None, str]:
    """K = int (pv - pv before)/int (op - op before) over whole cycles, its error, a remark."""
    rest, edges = cycles.rest, cycles.used
    before = cycles.pv[rest]
    if not before.size:
        return None, None, "the record does not show the rest before the test, nor the static gain"
    inside = slice(edges[0], edges[-1] + 1)
    t = cycles.t[inside]
    span = float(t[-1] - t[0])
    # The output is held from sample to sample; PV is smooth.
    op = float(cycles.op[inside][:-1] @ np.diff(t)) / span - float(np.mean(cycles.op[rest]))
    pv = float(np.trapezoid(cycles.pv[inside], t)) / span - float(np.mean(before))
    error = noise * math.sqrt(1 / t.size + 1 / before.size)
    if abs(pv) < SHOWS * error or abs(op) * t.size < SHOWS * cycles.amplitude:
        return None, None, (
            f"the relay is hardly biased (OP is off by {op:.2g} and PV by {pv:.2g} on average), so "
            "that its means do not show the static gain"
        )  # fmt: skip
    K = pv / op
    # A mean of OP is known to about one sample of its two levels in the record.
    relative = math.hypot(error / pv, cycles.amplitude / (op * t.size))
    return K, abs(K) * relative, f"the relay is biased by {op:.3g} on average, which shows K"
