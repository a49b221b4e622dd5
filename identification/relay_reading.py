"""The cycles of a relay test: levels and switches of OP, and where the cycles have settled."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from identification.held_input import Indices
from loop.errors import NoLimitCycle
from loop.record import Record
from loop.signals import Flags, Real

# Two cycles show that the third is like them; one cycle alone could be anything.
FEWEST_CYCLES = 2
# A settled cycle's period and amplitude differ from the median of the settled ones by no more.
SETTLED = 0.1
# ... or by so many samples, or so many standard deviations of noise up to that part of the swing.
SAMPLES, NOISES, NOISY = 1.5, 3.0, 0.25
# The median absolute deviation of normal noise is so many standard deviations.
MEDIAN_DEVIATION = 0.6745
# Part of the samples from the first switch on that may lie between the two levels, as a slow
# output does on its way.
BETWEEN, NEAR = 0.1, 0.15
# A half cycle under a fifth of the usual one is the relay chattering on noise.
CHATTER = 0.2
FEWEST_SAMPLES, FEWEST_BEFORE = 8, 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelayCycles:
    """What OP and PV did in a relay test, cycle by cycle.

    Attributes
    ----------
    t, pv, op : ndarray, shape (n,)
        Samples that have both PV and OP. [s], [PV], [OP]
    low, high : float
        The two outputs. [OP]
    switches, rises : ndarray of int
        Samples at which OP switches, and those of them at which it goes up.
    first_switch : int
        First sample of the test itself, 0 where the record begins with it.
    settled : int
        Cycles before the first settled one.
    periods, heights : ndarray, shape (k,)
        Length [s] and range [PV] of every whole cycle, transient ones included.
    """

    t: Real
    pv: Real
    op: Real
    low: float
    high: float
    switches: Indices
    rises: Indices
    first_switch: int
    settled: int
    periods: Real
    heights: Real

    @property
    def used(self) -> Indices:
        """Samples at which the settled cycles begin, and the one at which the last ends."""
        return self.rises[self.settled :]

    @property
    def amplitude(self) -> float:
        """Half the distance of the two outputs. [OP]"""
        return (self.high - self.low) / 2

    @property
    def rest(self) -> slice:
        """Samples at rest before the test, none where the record does not show it."""
        before = slice(0, self.first_switch)
        still = self.first_switch >= FEWEST_BEFORE and (
            float(np.ptp(self.op[before])) <= NEAR * self.amplitude
        )
        return before if still else slice(0, 0)

    def half_times(self) -> tuple[float, float]:
        """Mean time of OP at its higher and lower level over the settled cycles. [s]"""
        inside = self.switches[(self.switches >= self.used[0]) & (self.switches <= self.used[-1])]
        lengths = np.diff(self.t[inside])
        return float(np.mean(lengths[::2])), float(np.mean(lengths[1::2]))


def read_cycles(record: Record) -> RelayCycles:
    """Find the cycles of a relay test and the first settled one.

    Parameters
    ----------
    record : Record
        Relay test: OP switches between two levels.

    Raises
    ------
    NoLimitCycle
        OP does not switch between two levels, chatters, or the cycles have not settled.
    """
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
    rises = _after_chatter(t, switches, rises)
    periods = np.diff(t[rises])
    heights = np.array([_height(pv[a:b]) for a, b in pairwise(rises)])
    return RelayCycles(
        t=t,
        pv=pv,
        op=op,
        low=low,
        high=high,
        switches=switches,
        rises=rises,
        first_switch=first,
        settled=_settled(periods, heights, float(np.median(np.diff(t))), _noise(pv)),
        periods=periods,
        heights=heights,
    )


def _after_chatter(t: Real, switches: Indices, rises: Indices) -> Indices:
    """Cycles after the last switch that noise made, as it does until PV has left the set point."""
    halves = np.diff(t[switches])
    usual = float(np.median(halves))
    short = np.flatnonzero(halves < CHATTER * usual)
    if not short.size:
        return rises
    kept: Indices = rises[rises > switches[short[-1] + 1]]
    if kept.size < FEWEST_CYCLES + 1:
        raise NoLimitCycle(
            f"OP chatters: it stays for {np.min(halves):.3g} s only, against {usual:.3g} s "
            f"usually, and fewer than {FEWEST_CYCLES} whole cycles follow. A hysteresis of three "
            "times the noise prevents that."
        )
    return kept


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


def _settled(periods: Real, heights: Real, step: float, noise: float) -> int:
    """Number of the first settled cycle: from there on all are like the last ones.

    Sampling may cut a period by more than a sample at either end, and noise moves an extreme.
    """
    usual = [float(np.median(x[-3:])) for x in (periods, heights)]
    alike = np.abs(periods - usual[0]) < max(SETTLED * usual[0], SAMPLES * step)
    alike &= np.abs(heights - usual[1]) < max(
        SETTLED * usual[1], min(NOISES * noise, NOISY * usual[1])
    )
    unlike = np.flatnonzero(~alike)
    first = int(unlike[-1]) + 1 if unlike.size else 0
    if periods.size - first < FEWEST_CYCLES:
        raise NoLimitCycle(
            f"The cycles have not settled: the last periods are {_list(periods[-3:])} s and the "
            f"last swings {_list(heights[-3:])} in PV, and at least {FEWEST_CYCLES} must agree "
            f"within {SETTLED:.0%}."
        )
    return first


def _noise(pv: Real) -> float:
    """Standard deviation of the noise, from second differences. [PV]"""
    rough = np.abs(pv[2:] - 2 * pv[1:-1] + pv[:-2])
    return float(np.median(rough)) / MEDIAN_DEVIATION / math.sqrt(6)


def _list(values: Real) -> str:
    return ", ".join(f"{value:.3g}" for value in values)


def folded(cycles: RelayCycles) -> tuple[Real, slice]:
    """Phase, 0 to 1 from the rise of OP, of the samples of all settled cycles, and where they are.

    Parameters
    ----------
    cycles : RelayCycles
        Cycles of the test.
    """
    edges = cycles.used
    inside = slice(edges[0], edges[-1])
    t = cycles.t[inside]
    k = np.searchsorted(cycles.t[edges], t, side="right") - 1
    starts = cycles.t[edges]
    return (t - starts[k]) / (starts[k + 1] - starts[k]), inside
