"""Waves that last for a part of a record: tones that stand out of every floor around them.

The record is halved in rate again and again; at every rate half-overlapping segments of 64 samples
hold 5 to 22 cycles of a tone, so that the work of all rates together is twice that of the first.
A tone that stands out is fitted: the frequency and the part of the record that give it the most
power. What noise makes of a fitted tone depends on the noise, which is known three ways, each
blind to something else: the smooth spectrum of the record, the spectrum beside the tone within its
own part, and an autoregression of everything outside that part. Their geometric mean is the floor.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from loop.signals import Flags, Real
from monitoring.spectrum import BandFilter, smooth_floor

SEGMENT, HOP = 64, 32
FEWEST, MOST = 5, 22
# The part is looked for within so many segments on either side.
REACH = 4
TRIES = 3
# Places at which a part may begin and end: all pairs of them are tried.
MOST_EDGES = 96
# Bins of the part beside the tone that make its own floor; the nearest ones hold the tone.
BESIDE = np.r_[-8:-1, 2:9]
ORDER = 6
# The autoregression needs this part of the record outside, and so many samples.
OUTSIDE, FEWEST_OUTSIDE = 0.15, 100
# Levels finer than the tone's own at which the outside is modelled: 12 to 50 samples a period.
FINER = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstLimits:
    """What a tone must reach; fixed on simulated healthy and oscillating loops.

    Attributes
    ----------
    candidate : float
        Power of a segment over its floors from which a tone is fitted, in 2,000 samples. [-]
    score : float
        Power of the fitted tone over its floors, in 2,000 samples. [-]
    evenness : float
        Amplitude of the weakest third of the part over that of the whole. [-]
    share : float
        Part of the variance. [-]
    cycles : float
        Cycles in a row. [-]
    """

    candidate: float = 6.0
    score: float = 25.0
    evenness: float = 0.4
    share: float = 0.2
    cycles: float = 4.8

    def of(self, n: int, limit: float) -> float:
        """Raise a limit with the logarithm of the places where noise may exceed it."""
        return limit + float(np.log(max(n / 2000, 1.0)))


BURST = BurstLimits()


@dataclass(frozen=True, slots=True, kw_only=True)
class Burst:
    """A tone in a part of a record.

    Attributes
    ----------
    period : float
        Period. [samples]
    start, end : float
        Where it begins and ends. [samples]
    score : float
        Power over the geometric mean of its floors. [-]
    evenness : float
        Amplitude of its weakest third over that of the whole. [-]
    share : float
        Part of the variance in its part of the record. [-]
    amplitude : float
        Amplitude.
    """

    period: float
    start: float
    end: float
    score: float
    evenness: float
    share: float
    amplitude: float

    @property
    def cycles(self) -> float:
        """Cycles in a row."""
        return (self.end - self.start) / self.period


@dataclass(slots=True, eq=False)
class _Level:
    """The record at a lower rate, and how far its segments stand out.

    Attributes
    ----------
    step : float
        Distance of its samples. [samples of the record]
    signal : ndarray, shape (m,)
        The record below the new rate's half.
    starts : ndarray of int, shape (k,)
        First samples of the segments.
    scores : ndarray, shape (k, 18)
        Power at 5 to 22 cycles a segment over the floors; 0 where there is nothing left to see.
    """

    step: float
    signal: Real
    starts: NDArray[np.int64]
    scores: Real


class BurstSearch:
    """Looks for the strongest tone that is left, again and again.

    Parameters
    ----------
    band_filter : BandFilter
        The record with its spectrum.
    limits : BurstLimits
        What a tone must reach.
    """

    def __init__(self, band_filter: BandFilter, limits: BurstLimits = BURST) -> None:
        self._n = band_filter.n
        self._limits = limits
        # Power a sample of the record at 0, 1, 2 ... cycles; 3/8 is the Hann window's mean square.
        self._floor = smooth_floor(band_filter.power(), apart=2) / (0.375 * band_filter.length)
        self._cycles = band_filter.length
        self._levels = [self._level(*at) for at in _rates(band_filter)]

    def strongest(self, taken: Callable[[Real, float], Flags]) -> Burst | None:
        """Find the next tone, the strongest first; None where there is none.

        Parameters
        ----------
        taken : callable
            Tells of periods [samples] which ones belong to oscillations that were found, told
            apart as well as a number of samples tells them.
        """
        for level in self._levels:
            periods = SEGMENT * level.step / np.arange(FEWEST, MOST + 1)
            level.scores[:, taken(periods, SEGMENT * level.step)] = 0.0
        for _ in range(TRIES if self._levels else 0):
            tops = [float(level.scores.max()) for level in self._levels]
            k = int(np.argmax(tops))
            if tops[k] < self._limits.of(self._n, self._limits.candidate):
                return None
            found = self._fitted(k)
            self._take(found)
            if self._passes(found):
                return found
        return None

    def _passes(self, found: Burst) -> bool:
        limits = self._limits
        return (
            found.score >= limits.of(self._n, limits.score)
            and found.evenness >= limits.evenness
            and found.share >= limits.share
            and found.cycles >= limits.cycles
        )

    def _level(self, step: float, signal: Real) -> _Level:
        last = signal.size - SEGMENT
        starts = np.unique(np.r_[0 : last + 1 : HOP, last])
        power = _segment_power(signal, starts)
        middle = np.arange(FEWEST, MOST + 1)
        floor = self._floor_at(middle / (SEGMENT * step)) * (np.sum(_WINDOW**2) / step)
        beside = np.sqrt(_means(power, *_BELOW) * _means(power, *_ABOVE))
        scores = power[:, FEWEST : MOST + 1] / (0.5 * (floor + beside) + np.finfo(np.float64).tiny)
        return _Level(step, signal, starts, scores)

    def _floor_at(self, frequency: Real) -> Real:
        bins = np.round(frequency * self._cycles).astype(np.int64)
        return self._floor[np.minimum(bins, self._floor.size - 1)]

    def _take(self, found: Burst) -> None:
        """Leave out what the segments see of a tone, whether it passes or not."""
        for level in self._levels:
            periods = SEGMENT * level.step / np.arange(FEWEST, MOST + 1)
            columns = np.abs(np.log2(periods / found.period)) < 0.25
            starts = level.starts * level.step
            rows = (starts < found.end) & (starts + SEGMENT * level.step > found.start)
            level.scores[np.ix_(rows, columns)] = 0.0

    def _fitted(self, k: int) -> Burst:
        """Fit the tone of the highest score of a level, and compare it with its floors."""
        level = self._levels[k]
        row, column = np.unravel_index(int(np.argmax(level.scores)), level.scores.shape)
        begin = int(level.starts[row])
        f, a, b, power = _tone(level.signal, (FEWEST + int(column)) / SEGMENT, begin)
        beside, evenness, share, amplitude = _within(level.signal[a:b], f)
        floors = [float(self._floor_at(np.array([f / level.step]))[0]) / level.step, beside]
        finer = self._levels[max(k - FINER, 0)]
        ratio = level.step / finer.step
        pad = 0.5 / f
        outside = _outside(
            finer.signal, int((a - pad) * ratio), int((b + pad) * ratio) + 1, f / ratio
        )
        if outside is not None:
            floors.append(outside / ratio)
        tiny = np.finfo(np.float64).tiny
        return Burst(
            period=level.step / f,
            start=a * level.step,
            end=min(b * level.step, float(self._n)),
            score=power / float(np.exp(np.mean(np.log(np.maximum(floors, tiny))))),
            evenness=evenness,
            share=share,
            amplitude=amplitude,
        )


_WINDOW = np.sin(np.pi * (np.arange(SEGMENT) + 0.5) / SEGMENT)
# Bins half an octave to an octave or so on either side of every bin of a segment.
_OWN = np.arange(FEWEST, MOST + 1)
_BELOW = (np.ceil(_OWN / 2).astype(int), np.maximum(_OWN / 1.3, np.ceil(_OWN / 2)).astype(int) + 1)
_ABOVE = (np.minimum(np.ceil(1.3 * _OWN), SEGMENT // 2 - 2).astype(int),
          np.minimum(2 * _OWN, SEGMENT // 2) + 1)  # fmt: skip


def _rates(band_filter: BandFilter) -> list[tuple[float, Real]]:
    """Step and signal at the rate of the record and at every half of it that fills a segment."""
    found = [(1.0, band_filter.signal)]
    length = band_filter.length
    while True:
        m = scipy.fft.next_fast_len(max(length >> len(found), 1), real=True)
        step = length / m
        size = int(np.ceil(band_filter.n / step))
        if size < SEGMENT:
            return found if band_filter.n >= SEGMENT else []
        signal = scipy.fft.irfft(band_filter.spectrum[: m // 2 + 1], m) / step
        found.append((step, np.asarray(signal[:size])))


def _segment_power(signal: Real, starts: NDArray[np.int64]) -> Real:
    rows = np.lib.stride_tricks.sliding_window_view(signal, SEGMENT)[starts]
    rows -= rows.mean(axis=1, keepdims=True)
    rows *= _WINDOW
    X = scipy.fft.rfft(rows, axis=1)
    return np.asarray(X.real**2 + X.imag**2)


def _means(power: Real, first: NDArray[np.int64], stop: NDArray[np.int64]) -> Real:
    """Mean of the bins first..stop - 1 of every row, for pairs of both."""
    bins = np.arange(power.shape[1])[:, None]
    return np.asarray(power @ (((bins >= first) & (bins < stop)) / (stop - first)))


def _tone(y: Real, f: float, begin: int) -> tuple[float, int, int, float]:
    """Frequency [cycles a sample], part and power |sum y exp(-iwt)|^2/n of a tone.

    Frequency and part are improved in turn, from the segment that begins at `begin`.
    """
    low, high = max(begin - REACH * SEGMENT, 0), min(begin + (REACH + 1) * SEGMENT, y.size)
    near = y[low:high] - y[begin : begin + SEGMENT].mean()
    t = np.arange(near.size)
    a, b = begin - low, begin - low + SEGMENT
    for step in (SEGMENT // 8, SEGMENT // 8, near.size // MOST_EDGES):
        f = _frequency(near[a:b], f)
        sums = np.cumsum(np.r_[0.0, near * np.exp(-2j * np.pi * f * t)])
        edges = np.arange(0, near.size + 1, max(round(1 / f), step))
        lengths = edges - edges[:, None]
        found = sums[edges] - sums[edges, None]
        power = (found.real**2 + found.imag**2) / np.maximum(lengths, 1)
        power[lengths < FEWEST / f] = 0.0
        if power.max() > 0:
            i, j = np.unravel_index(int(np.argmax(power)), power.shape)
            a, b = int(edges[i]), int(edges[j])
    f = _frequency(near[a:b], f)
    line = near[a:b] @ np.exp(-2j * np.pi * f * np.arange(b - a))
    return f, low + a, low + b, float(abs(line) ** 2) / (b - a)


def _frequency(part: Real, f: float) -> float:
    """Frequency with the most power within 0.8 cycles a part, by a parabola through the best."""
    tried = f + np.linspace(-0.8, 0.8, 9) / part.size
    power = np.abs(np.exp(-2j * np.pi * tried[:, None] * np.arange(part.size)) @ part) ** 2
    k = int(np.clip(np.argmax(power), 1, 7))
    left, mid, right = power[k - 1 : k + 2].tolist()
    bend = left - 2 * mid + right
    shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(tried[k] + np.clip(shift, -1.0, 1.0) * 0.2 / part.size)


def _within(part: Real, f: float) -> tuple[float, float, float, float]:
    """Floor beside a tone, its evenness, its share of the variance and its amplitude."""
    n = part.size
    part = part - part.mean()
    t = np.arange(n)
    beside = f + BESIDE / n
    beside = beside[(beside > 0.5 / n) & (beside < 0.5)]
    floor = float(np.mean(np.abs(np.exp(-2j * np.pi * beside[:, None] * t) @ part) ** 2)) / n
    turned = part * np.exp(-2j * np.pi * f * t)
    line = complex(np.mean(turned))
    along = (turned * np.conj(line)).real / max(abs(line), np.finfo(np.float64).tiny)
    weakest = min(float(np.mean(third)) for third in np.array_split(along, 3))
    amplitude = 2 * abs(line)
    variance = float(np.var(part))
    return (
        floor,
        2 * weakest / amplitude if amplitude > 0 else 0.0,
        amplitude**2 / 2 / variance if variance > 0 else 0.0,
        amplitude,
    )


def _outside(y: Real, a: int, b: int, f: float) -> float | None:
    """Spectrum at f of an autoregression of y without y[a:b]; None where too little is left."""
    parts = [part - part.mean() for part in (y[: max(a, 0)], y[b:]) if part.size > 8 * ORDER]
    size = sum(part.size for part in parts)
    if size < max(OUTSIDE * y.size, FEWEST_OUTSIDE):
        return None
    r = (
        np.array(
            [
                sum(float(part[: part.size - k] @ part[k:]) for part in parts)
                for k in range(ORDER + 1)
            ]
        )
        / size
    )
    # The rest keeps the matrix of a signal without noise, or without anything, invertible.
    r[0] = r[0] * (1 + 1e-6) + np.finfo(np.float64).tiny
    coefficients = solve_toeplitz(r[:-1], r[1:])
    response = 1 - coefficients @ np.exp(-2j * np.pi * f * np.arange(1, ORDER + 1))
    return float((r[0] - coefficients @ r[1:]) / abs(response) ** 2)
