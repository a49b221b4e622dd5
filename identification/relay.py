"""Ultimate gain and period from a relay test, by the describing function.

References
----------
.. [1] K. J. Åström and T. Hägglund, "Automatic tuning of simple regulators with specifications on
   phase and amplitude margins," Automatica, vol. 20, no. 5, pp. 645-651, 1984.
   doi:10.1016/0005-1098(84)90014-1
"""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from loop.errors import NoLimitCycle
from loop.record import Record
from loop.signals import Flags, Real

# What the describing function's Ku is off by on first order plus dead time: -19 % at
# theta/tau = 0.05, +22 % at 10 (4/(pi K (1 - e^(-theta/tau))) against the exact value).
LOWEST_ERROR, HIGHEST_ERROR = -0.19, 0.22
# Two cycles show that the third is like them; one cycle alone could be anything.
FEWEST_CYCLES = 2
# A settled cycle's period and amplitude differ from the median of the settled ones by no more.
SETTLED = 0.1
# Part of the samples from the first switch on that may lie between the two levels, as a slow
# output does on its way.
BETWEEN, NEAR = 0.1, 0.15
# A half cycle under a fifth of the usual one is the relay chattering on noise.
CHATTER = 0.2
FEWEST_SAMPLES = 8
# The median absolute deviation of normal noise is so many standard deviations.
MEDIAN_DEVIATION = 0.6745
FEWEST_BEFORE = 5
# The mean output must be off the one before the test by this part of d for a static gain to show.
BIASED = 0.05


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
        to 10 time constants: Ku/1.22 and Ku/0.81. [OP/PV]
    gain_sign : float
        +1 where PV follows OP, -1 where it goes against it.
    K : float or None
        Static gain, where the relay was biased and the record shows the rest before the test.
        [PV/OP]
    amplitude : float
        Half of PV's peak-to-peak value over the mean settled cycle. [PV]
    relay_amplitude : float
        d, half of the output's peak-to-peak value. [OP]
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
    amplitude: float
    relay_amplitude: float
    hysteresis: float
    cycles: int
    discarded: int
    period_spread: float
    amplitude_spread: float
    noise_sd: float
    remarks: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Cycles:
    """Samples, output levels and the samples at which the output goes up."""

    t: Real
    pv: Real
    op: Real
    low: float
    high: float
    rises: npt.NDArray[np.intp]
    first_switch: int


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
    cycles = _read_cycles(record)
    edges = cycles.rises
    periods = np.diff(cycles.t[edges])
    heights = np.array([_height(cycles.pv[a:b]) for a, b in pairwise(edges)])
    settled = _settled(periods, heights)
    used = edges[settled:]
    phase, pv = _folded(cycles, used)
    wave, noise = _mean_cycle(phase, pv)
    a = float(np.ptp(wave)) / 2
    if a <= hysteresis:
        raise NoLimitCycle(
            f"PV swings by {a:.3g} about its middle, less than the hysteresis of {hysteresis:.3g}."
        )
    d = (cycles.high - cycles.low) / 2
    Ku = 4 * d / (math.pi * math.sqrt(a**2 - hysteresis**2))
    K, why = _static_gain(cycles, used, d)
    count = used.size - 1
    remarks = (
        f"{count} settled cycles are used, {settled} before them are left out",
        "the describing function is off by -19 % to +22 % in Ku for a dead time of 0.05 to 10 time "
        f"constants: the true Ku lies within {Ku / (1 + HIGHEST_ERROR):.3g} and "
        f"{Ku / (1 + LOWEST_ERROR):.3g}",
        why,
    )
    return RelayResult(
        Ku=Ku,
        Pu=float(np.mean(periods[settled:])),
        Ku_low=Ku / (1 + HIGHEST_ERROR),
        Ku_high=Ku / (1 + LOWEST_ERROR),
        gain_sign=_gain_sign(wave),
        K=K,
        amplitude=a,
        relay_amplitude=d,
        hysteresis=hysteresis,
        cycles=count,
        discarded=settled,
        period_spread=float(np.std(periods[settled:]) / np.mean(periods[settled:])),
        amplitude_spread=float(np.std(heights[settled:]) / np.mean(heights[settled:])),
        noise_sd=noise,
        remarks=remarks,
    )


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


def _read_cycles(record: Record) -> _Cycles:
    known = np.isfinite(record.pv) & np.isfinite(record.op)
    t, pv, op = record.t[known], record.pv[known], record.op[known]
    if t.size < FEWEST_SAMPLES or np.ptp(op) == 0 or np.ptp(pv) == 0:
        raise NoLimitCycle("PV or OP stands still, or there are too few samples for a cycle.")
    middle = (float(op.max()) + float(op.min())) / 2
    up = op > middle
    low, high = float(np.median(op[~up])), float(np.median(op[up]))
    at_level = np.abs(op - np.where(up, high, low)) < NEAR * (high - low)
    # Before the test OP may stand anywhere; from where it first stands at one of the levels, and
    # later at the other, it is the relay's.
    first = _first_switch(up, at_level)
    between = float(np.mean(~at_level[first:]))
    if between > BETWEEN:
        raise NoLimitCycle(
            f"OP is no relay's: {between:.0%} of its samples lie between {low:.4g} and {high:.4g}."
        )
    switches = np.flatnonzero(up[1:] != up[:-1]) + 1
    switches = switches[switches >= first]
    rises = switches[up[switches]]
    if rises.size < FEWEST_CYCLES + 1:
        raise NoLimitCycle(
            f"OP goes up {rises.size} times; {FEWEST_CYCLES + 1} are needed for {FEWEST_CYCLES} "
            "whole cycles."
        )
    halves = np.diff(t[switches])
    if float(np.min(halves)) < CHATTER * float(np.median(halves)):
        raise NoLimitCycle(
            f"OP chatters: it stays for {np.min(halves):.3g} s only, against "
            f"{np.median(halves):.3g} s usually. A hysteresis of twice the noise prevents that."
        )
    return _Cycles(t=t, pv=pv, op=op, low=low, high=high, rises=rises, first_switch=first)


def _first_switch(up: Flags, at_level: Flags) -> int:
    """First sample at one of the two levels that the output later leaves for the other."""
    away = np.flatnonzero(~at_level)
    switches = np.flatnonzero(up[1:] != up[:-1]) + 1
    before = away[away < switches[0]]
    return int(before[-1]) + 1 if before.size else 0


def _height(pv: Real) -> float:
    """Range of one cycle without its outermost twentieths, which noise makes. [PV]"""
    low, high = np.quantile(pv, [0.05, 0.95])
    return float(high - low)


def _settled(periods: Real, heights: Real) -> int:
    """Number of the first settled cycle: from there on all are like the last ones."""
    usual = [float(np.median(x[-3:])) for x in (periods, heights)]
    alike = (np.abs(periods / usual[0] - 1) < SETTLED) & (np.abs(heights / usual[1] - 1) < SETTLED)
    unlike = np.flatnonzero(~alike)
    first = int(unlike[-1]) + 1 if unlike.size else 0
    if periods.size - first < FEWEST_CYCLES:
        raise NoLimitCycle(
            f"The cycles have not settled: the last periods are {_list(periods[-3:])} s and the "
            f"last swings {_list(heights[-3:])} in PV, and at least {FEWEST_CYCLES} must agree "
            f"within {SETTLED:.0%}."
        )
    return first


def _list(values: Real) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def _folded(cycles: _Cycles, edges: npt.NDArray[np.intp]) -> tuple[Real, Real]:
    """Phase, 0 to 1 from the rise of OP, and PV of all settled cycles."""
    inside = slice(edges[0], edges[-1])
    t = cycles.t[inside]
    k = np.searchsorted(cycles.t[edges], t, side="right") - 1
    starts = cycles.t[edges]
    return (t - starts[k]) / (starts[k + 1] - starts[k]), cycles.pv[inside]


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


def _static_gain(
    cycles: _Cycles, edges: npt.NDArray[np.intp], d: float
) -> tuple[float | None, str]:
    """K = int (pv - pv before)/int (op - op before) over whole cycles, and a remark on it."""
    before = slice(0, cycles.first_switch)
    if cycles.first_switch < FEWEST_BEFORE or np.ptp(cycles.op[before]) > NEAR * d:
        return None, "the record does not show the rest before the test, so that K stays unknown"
    inside = slice(edges[0], edges[-1] + 1)
    t = cycles.t[inside]
    span = float(t[-1] - t[0])
    # The output is held from sample to sample; PV is smooth.
    op = float(cycles.op[inside][:-1] @ np.diff(t)) / span - float(np.mean(cycles.op[before]))
    pv = float(np.trapezoid(cycles.pv[inside], t)) / span - float(np.mean(cycles.pv[before]))
    if abs(op) < BIASED * d:
        return None, f"the relay is not biased (OP is off by {op:.2g} on average), K stays unknown"
    return pv / op, f"the relay is biased by {op:.3g} on average, which shows the static gain"
