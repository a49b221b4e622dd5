"""Waves that last for a part of a record: tones that stand out of the noise around them.

The record is halved in rate again and again; at every rate half-overlapping segments of 64 samples
hold 5 to 22 cycles of a tone, so that the work of all rates together is twice that of the first.
A tone that stands out is fitted beside an autoregression, which tells the noise. A record has as
many places for a tone in every octave as it has cycles there: the limits rise with the logarithm
of their number, so that noise exceeds them equally often in every octave and in every record.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from loop.signals import Flags, Real
from monitoring.spectrum import BandFilter, smooth_floor
from monitoring.tones import FEWEST, fit_tone, part_of

SEGMENT, HOP = 64, 32
MOST = 22
SHORTEST_PERIOD = 4.0
# The part is looked for within so many segments on either side.
REACH = 4
FITTED_REACH = 8
# The tone is fitted at a rate so many levels finer: 6 to 26 samples a period.
FINER = 1
TRIES = 3
# A sine as large as the sd of what it is added to makes a third of the variance. A smaller share
# costs evidence by its logarithm, a larger one earns it up to a half.
USUAL_SHARE, ENOUGH_SHARE, ECHO = 0.3, 0.5, 9.0


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstLimits:
    """What a tone must reach; fixed on simulated healthy and oscillating loops.

    Attributes
    ----------
    candidate : float
        Power of a segment over its floors from which a tone is fitted, less the logarithm of the
        record's cycles. [-]
    evidence : float
        What the fitted tone must have. [-]
    evenness : float
        Amplitude of the weakest third of the part over that of the whole. [-]
    share : float
        Part of the variance. [-]
    cycles : float
        Cycles in a row. [-]
    """

    candidate: float = 3.0
    evidence: float = 16.5
    evenness: float = 0.4
    share: float = 0.2
    cycles: float = 4.8


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
        Power over the spectrum of the noise. [-]
    likelihood : float
        Logarithm of its likelihood over that of noise alone. [-]
    standing : float
        Power of the segment that it was seen in over the smooth spectra around it. [-]
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
    likelihood: float
    standing: float
    evenness: float
    share: float
    amplitude: float

    @property
    def cycles(self) -> float:
        """Cycles in a row."""
        return (self.end - self.start) / self.period

    def evidence(self, n: int) -> float:
        """Likelihood less the logarithm of the cycles of a record of n samples.

        The larger its share of the variance, the less a tone can be an accident of a load's or a
        set-point move's long echo, which the noise does not tell. Lags predict a strong wave
        themselves and leave no likelihood to it; then half of what it stands out by speaks.
        """
        share = min(self.share, ENOUGH_SHARE) / USUAL_SHARE
        echo = ECHO * float(np.log(max(share, np.finfo(np.float64).tiny)))
        likelihood = max(self.likelihood, self.score / 2, self.standing / 2)
        return likelihood - float(np.log(n / self.period)) + echo


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
        Power at 5 to 22 cycles a segment over the floors, less the logarithm of the record's
        cycles; minus infinity where there is nothing left to see.
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
            level.scores[:, taken(periods, SEGMENT * level.step)] = -np.inf
        for _ in range(TRIES if self._levels else 0):
            tops = [float(level.scores.max()) for level in self._levels]
            k = int(np.argmax(tops))
            if tops[k] < self._limits.candidate:
                return None
            found = self._fitted(k)
            self._take(found)
            if self._passes(found):
                return found
        return None

    def _passes(self, found: Burst) -> bool:
        limits = self._limits
        return (
            found.evidence(self._n) >= limits.evidence
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
        periods = SEGMENT * step / middle
        scores -= np.log(self._n / periods)
        scores[:, periods < SHORTEST_PERIOD] = -np.inf
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
            level.scores[np.ix_(rows, columns)] = -np.inf

    def _fitted(self, k: int) -> Burst:
        """Fit the tone of the highest score of a level, at a finer rate."""
        level = self._levels[k]
        row, column = np.unravel_index(int(np.argmax(level.scores)), level.scores.shape)
        cycles = self._n * (FEWEST + int(column)) / (SEGMENT * level.step)
        standing = float(level.scores[row, column] + np.log(cycles))
        level.scores[row, column] = -np.inf
        begin = int(level.starts[row])
        f, a, b = part_of(
            level.signal, (FEWEST + int(column)) / SEGMENT, begin, begin + SEGMENT,
            reach=REACH * SEGMENT,
        )  # fmt: skip
        finer = self._levels[max(k - FINER, 0)]
        ratio = level.step / finer.step
        tone = fit_tone(
            finer.signal, f / ratio, int(a * ratio), min(int(b * ratio), finer.signal.size),
            reach=int(FITTED_REACH * SEGMENT * ratio),
        )  # fmt: skip
        evenness, share, amplitude = _within(finer.signal[tone.first : tone.stop], tone.f)
        return Burst(
            period=finer.step / tone.f,
            start=tone.first * finer.step,
            end=min(tone.stop * finer.step, float(self._n)),
            score=tone.score,
            likelihood=tone.likelihood,
            standing=standing,
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


def _within(part: Real, f: float) -> tuple[float, float, float]:
    """Evenness of a tone, its share of the variance and its amplitude."""
    part = part - part.mean()
    turned = part * np.exp(-2j * np.pi * f * np.arange(part.size))
    line = complex(np.mean(turned))
    along = (turned * np.conj(line)).real / max(abs(line), np.finfo(np.float64).tiny)
    weakest = min(float(np.mean(third)) for third in np.array_split(along, 3))
    amplitude = 2 * abs(line)
    variance = float(np.var(part))
    return (
        2 * weakest / amplitude if amplitude > 0 else 0.0,
        amplitude**2 / 2 / variance if variance > 0 else 0.0,
        amplitude,
    )
