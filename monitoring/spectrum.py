"""Lines in a spectrum: peaks that stand out of the smooth spectrum around them."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Self

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from loop.signals import Real

# Bands of the smooth spectrum an octave; a line is compared with the bands beside its own.
BANDS = 4
# Bins from which on a band is wide enough to be the neighbour of a line.
WIDE_BAND = 4
# Bins that make a median of a wide band; the rest would only take time.
ENOUGH_BINS = 128
# Samples worked on at once: a day's worth of temporary memory costs more time than the sums.
BLOCK = 8192
# Groups of bins that tell an autocovariance of a few periods.
GROUPS = 128
# Median of an exponential distribution over its mean.
MEDIAN_OF_EXPONENTIAL = float(np.log(2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lines:
    """The spectrum of a signal over its smooth floor.

    Attributes
    ----------
    length : int
        Length of the transform. [samples]
    first : int
        Cycles of the first score.
    scores : ndarray, shape (k,)
        Power over floor, about exponential with mean 1 for noise with a smooth spectrum. [-]
    power : ndarray, shape (length // 2 + 1,)
        Power at 0, 1, 2 ... cycles.
    """

    length: int
    first: int
    scores: Real
    power: Real

    def share(self, period: float, width: float) -> float:
        """Part of the power within the band that `band_pass` keeps."""
        middle = self.length / period
        whole = float(np.sum(self.power))
        part = slice(int(middle / width**2), int(np.ceil(middle * width**2)) + 1)
        return float(np.sum(self.power[part])) / whole if whole > 0 else 0.0


def power_spectrum(signal: Real) -> Real:
    """Power of the whole signal under a Hann window at 0, 1, 2 ... cycles, mean and slope off.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Evenly sampled signal without gaps.
    """
    X = scipy.fft.rfft(_without_line(signal) * _hann(signal.size))
    return np.asarray(X.real**2 + X.imag**2)


@lru_cache(maxsize=16)
def _hann(length: int) -> Real:
    return np.asarray(np.hanning(length + 1)[:-1])


@lru_cache(maxsize=16)
def _way(length: int) -> tuple[Real, float]:
    """Go from -1 to 1 in even steps, and the sum of their squares."""
    way = np.linspace(-1.0, 1.0, length)
    return way, float(way @ way)


def _without_line(signal: Real) -> Real:
    """Take mean and slope off."""
    way, squares = _way(signal.size)
    slope = float(signal @ way) / squares
    mean = float(signal.mean())
    still = np.empty(signal.size)
    for a in range(0, signal.size, BLOCK):
        line = slope * way[a : a + BLOCK]
        line += mean
        np.subtract(signal[a : a + BLOCK], line, out=still[a : a + BLOCK])
    return still


def smooth_floor(power: Real, *, apart: int = 1) -> Real:
    """Smooth spectrum at every bin, from the bands on either side of the bin's own.

    The geometric mean of two neighbours is exact for a power law; a line in the band itself does
    not lift its own floor.

    Parameters
    ----------
    power : ndarray, shape (k,)
        Power at 0, 1, 2 ... cycles.
    apart : int
        Distance of the neighbours. [bands]
    """
    edges, widths = _bands(power.size)
    levels = np.array([_median(power[a:b:step]) for a, b, step in edges])
    tiny = np.finfo(np.float64).tiny + 1e-12 * float(power[1:].mean())
    logs = np.log(levels / MEDIAN_OF_EXPONENTIAL + tiny)
    # A line under the Hann window is three bins wide and would fill a narrow neighbour.
    distance = np.where(widths < WIDE_BAND, 2, apart)
    own = np.arange(logs.size)
    below = np.maximum(own - distance, 0)
    above = np.minimum(own + distance, logs.size - 1)
    floors = np.exp((logs[below] + logs[above]) / 2)
    # Bins before the first edge and behind the last belong to the outermost bands.
    starts = np.array([0, *(a for a, _, _ in edges[1:]), power.size])
    return np.repeat(floors, np.diff(starts))


@lru_cache(maxsize=16)
def _bands(bins: int) -> tuple[tuple[tuple[int, int, int], ...], Real]:
    """First bin, one past the last and step of every band, and their widths. [bins]"""
    edges = np.round(2 ** np.arange(1, np.log2(bins) + 0.5 / BANDS, 1 / BANDS))
    edges = np.unique(np.minimum(edges, bins)).astype(np.int64)
    pairs = pairwise(edges.tolist())
    return tuple((a, b, max((b - a) // ENOUGH_BINS, 1)) for a, b in pairs), np.diff(edges)


def _median(values: Real) -> float:
    """Median of a short row; np.median and np.partition spend their time on other things."""
    row = np.sort(values)
    return float(row[(row.size - 1) // 2] + row[row.size // 2]) / 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Envelope:
    """A band as z(k) of wave(k) = Re(z(k) exp(2 pi i cycles k)).

    Attributes
    ----------
    z : ndarray of complex, shape (m,)
        Envelope.
    step : float
        Distance of its samples. [samples of the signal]
    cycles : float
        Cycles of the carrier a sample of z.
    """

    z: NDArray[np.complex128]
    step: float
    cycles: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lags:
    """An autocovariance as r(k) of Re(r(k) exp(2 pi i cycles k)), in no unit.

    Attributes
    ----------
    r : ndarray of complex, shape (m,)
        Slow part.
    cycles : float
        Cycles of the carrier a lag.
    """

    r: NDArray[np.complex128]
    cycles: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BandFilter:
    """A signal's spectrum, mean and slope off, from which any band can be cut.

    Attributes
    ----------
    signal : ndarray, shape (n,)
        The signal, mean and slope off.
    length : int
        Length of the transform, n or a little more. [samples]
    spectrum : ndarray of complex, shape (length // 2 + 1,)
        Transform of the signal.
    """

    signal: Real
    length: int
    spectrum: NDArray[np.complex128]

    @classmethod
    def of(cls, signal: Real) -> Self:
        """Transform an evenly sampled signal without gaps."""
        length = scipy.fft.next_fast_len(signal.size, real=True)
        still = _without_line(signal)
        spectrum = scipy.fft.rfft(still, length)
        return cls(signal=still, length=length, spectrum=np.asarray(spectrum))

    @property
    def n(self) -> int:
        """Samples of the signal."""
        return self.signal.size

    def power(self) -> Real:
        """Power under a Hann window as long as the transform, at 0, 1, 2 ... cycles.

        The window is a sum of three lines, so that its product with the signal is a weighted sum
        of three neighbours of the spectrum: no second transform.
        """
        X = self.spectrum
        # The neighbours beyond both ends are reflections.
        behind = np.conj(X[-2 if self.length % 2 == 0 else -1])
        edges = np.array([2 * X[0] - np.conj(X[1]) - X[1], 2 * X[-1] - X[-2] - behind]) / 4
        parts = X.view(np.float64)
        power = np.empty(X.size)
        power[[0, -1]] = edges.real**2 + edges.imag**2
        room = np.empty(2 * BLOCK)
        for a in range(1, X.size - 1, BLOCK):
            b = min(a + BLOCK, X.size - 1)
            windowed = room[: 2 * (b - a)]
            np.add(parts[2 * a - 2 : 2 * b - 2], parts[2 * a + 2 : 2 * b + 2], out=windowed)
            windowed *= -0.5
            windowed += parts[2 * a : 2 * b]
            windowed *= windowed
            np.add(windowed[::2], windowed[1::2], out=power[a:b])
        power[1:-1] /= 4
        return power

    def lines(self, *, fewest_cycles: int, shortest: float) -> Lines:
        """Compare the power with its smooth floor.

        Parameters
        ----------
        fewest_cycles : int
            Lowest frequency that is judged. [cycles]
        shortest : float
            Shortest period that is judged. [samples]
        """
        power = self.power()
        judged = slice(fewest_cycles, max(int(self.length / shortest), fewest_cycles) + 1)
        return Lines(
            length=self.length,
            first=fewest_cycles,
            scores=power[judged] / smooth_floor(power)[judged],
            power=power,
        )

    def band(self, period: float, *, width: float) -> Real:
        """Keep the band from 1/width to width times 1/period, on the grid of the signal."""
        return self._wave(period, width, self.length)[: self.n]

    def thinned(self, period: float, *, width: float, points: int) -> tuple[Real, float]:
        """The same on a grid of about `points` samples a period, where that is coarser.

        Returns
        -------
        wave : ndarray
            The band; it holds nothing faster than width^2/period, so that nothing is lost.
        step : float
            Distance of its samples. [samples of the signal]
        """
        length = scipy.fft.next_fast_len(int(points * self.length / period) + 1, real=True)
        length = min(length, self.length)
        step = self.length / length
        wave = self._wave(period, width, length) * (length / self.length)
        return wave[: int(np.ceil(self.n / step))], step

    def envelope(self, period: float, *, width: float, points: float) -> Envelope:
        """The same as a slow complex envelope of about `points` samples a period.

        The band alone is transformed back, shifted to frequency zero: the cost follows the band.

        Parameters
        ----------
        period : float
            Centre of the band. [samples]
        width : float
            Upper over middle frequency, above 1. [-]
        points : float
            Samples a period, more than the band is wide, width^2 - 1/width^2. [-]
        """
        first, kept = self._band(period, width, self.spectrum.size)
        length = scipy.fft.next_fast_len(max(int(points * self.length / period), kept.size) + 1)
        centre = kept.size // 2
        shifted = np.zeros(length, dtype=np.complex128)
        shifted[: kept.size - centre] = kept[centre:]
        shifted[-centre:] = kept[:centre]
        step = self.length / length
        shifted *= 2 / step
        z = np.asarray(scipy.fft.ifft(shifted, overwrite_x=True))
        return Envelope(
            z=z[: int(np.ceil(self.n / step))], step=step,
            cycles=(first + centre) * step / self.length,
        )  # fmt: skip

    def lag_products(self, period: float, *, width: float, step: float, lags: int) -> Lags:
        """The band's autocovariance at lags 0, 1 ... `lags` of `step` samples, as an envelope.

        It is the transform of the band's power, here of `GROUPS` groups of its bins, each at its
        centre of gravity: lags short against the record do not tell the bins of a group apart.

        Parameters
        ----------
        period : float
            Centre of the band. [samples]
        width : float
            Upper over middle frequency, above 1. [-]
        step : float
            Distance of the lags. [samples]
        lags : int
            How many.
        """
        first, gain = self._gain(period, width, self.spectrum.size)
        kept = self.spectrum[first : first + gain.size]
        power = (kept.real**2 + kept.imag**2) * gain**2
        groups = min(GROUPS, power.size)
        starts = np.arange(groups) * power.size // groups
        sums = np.add.reduceat(power, starts)
        places = np.add.reduceat(power * np.arange(power.size), starts)
        away = places / np.maximum(sums, np.finfo(np.float64).tiny) - kept.size // 2
        turns = np.vander(np.exp(2j * np.pi * step / self.length * away), lags + 1, increasing=True)
        r = sums @ turns
        return Lags(r=r, cycles=(first + kept.size // 2) * step / self.length)

    def _wave(self, period: float, width: float, length: int) -> Real:
        first, band = self._band(period, width, length // 2 + 1)
        kept = np.zeros(length // 2 + 1, dtype=np.complex128)
        kept[first : first + band.size] = band
        return np.asarray(scipy.fft.irfft(kept, length))

    def _band(self, period: float, width: float, bins: int) -> tuple[int, NDArray[np.complex128]]:
        """First bin of the band and its part of the spectrum, with soft edges."""
        first, gain = self._gain(period, width, bins)
        return first, self.spectrum[first : first + gain.size] * gain

    def _gain(self, period: float, width: float, bins: int) -> tuple[int, Real]:
        """First bin of the band and its gains, with soft edges in log frequency."""
        middle = self.length / period
        first, stop = max(int(middle / width**2), 0), min(int(middle * width**2) + 2, bins)
        gain = np.ones(stop - first)
        flat = np.clip([middle / width - first, middle * width + 1 - first], 0, gain.size)
        for part in (slice(0, int(flat[0]) + 1), slice(int(flat[1]), None)):
            cycles = np.maximum(np.arange(first, stop)[part], 0.5)
            octaves = np.abs(np.log(cycles / middle))
            gain[part] = np.clip(2 - octaves / np.log(width), 0.0, 1.0)
        return first, gain


def band_pass(signal: Real, period: float, *, width: float) -> Real:
    """Keep the band from 1/width to width times 1/period, with soft edges in log frequency.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Evenly sampled signal without gaps.
    period : float
        Centre of the band. [samples]
    width : float
        Upper over middle frequency, above 1. [-]
    """
    return BandFilter.of(signal).band(period, width=width)
