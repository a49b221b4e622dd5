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
# Median of an exponential distribution over its mean.
MEDIAN_OF_EXPONENTIAL = float(np.log(2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spectra:
    """Spectra of overlapping segments over their smooth floors.

    Attributes
    ----------
    length : int
        Length of a segment. [samples]
    starts : tuple of int
        First samples of the segments.
    first : int
        Cycles a segment of the first column.
    scores : ndarray, shape (m, k)
        Power over floor, about exponential with mean 1 for noise with a smooth spectrum. [-]
    power : ndarray, shape (m, length // 2 + 1)
        Power at 0, 1, 2 ... cycles a segment.
    """

    length: int
    starts: tuple[int, ...]
    first: int
    scores: Real
    power: Real

    def share(self, row: int, period: float, width: float) -> float:
        """Part of a segment's power within the band that `band_pass` keeps."""
        middle = self.length / period
        whole = float(np.sum(self.power[row]))
        part = slice(int(middle / width**2), int(np.ceil(middle * width**2)) + 1)
        return float(np.sum(self.power[row, part])) / whole if whole > 0 else 0.0


def segment_spectra(signal: Real, length: int, *, fewest_cycles: int, shortest: float) -> Spectra:
    """Compare the spectra of half-overlapping Hann segments with their smooth floors.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Evenly sampled signal without gaps.
    length : int
        Length of a segment, at most n. [samples]
    fewest_cycles : int
        Lowest frequency that is judged. [cycles a segment]
    shortest : float
        Shortest period that is judged. [samples]
    """
    count = max(round(2 * signal.size / length) - 1, 1)
    starts = np.round(np.linspace(0, signal.size - length, count)).astype(np.int64)
    rows = np.lib.stride_tricks.sliding_window_view(signal, length)[starts]
    power = _power(rows)
    last = max(int(length / shortest), fewest_cycles)
    return Spectra(
        length=length,
        starts=tuple(starts.tolist()),
        first=fewest_cycles,
        scores=power[:, fewest_cycles : last + 1] / _floor(power, fewest_cycles, last),
        power=power,
    )


def power_spectrum(signal: Real) -> Real:
    """Power of the whole signal under a Hann window at 0, 1, 2 ... cycles, mean and slope off.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Evenly sampled signal without gaps.
    """
    return np.asarray(_power(signal[None])[0])


def _power(rows: Real) -> Real:
    X = scipy.fft.rfft(_without_line(rows) * _hann(rows.shape[1]), axis=1)
    return np.asarray(X.real**2 + X.imag**2)


@lru_cache(maxsize=16)
def _hann(length: int) -> Real:
    return np.asarray(np.hanning(length + 1)[:-1])


@lru_cache(maxsize=16)
def _way(length: int) -> Real:
    return np.linspace(-1.0, 1.0, length)


def _without_line(rows: Real) -> Real:
    """Take mean and slope off every row."""
    way = _way(rows.shape[1])
    slopes = rows @ way / float(way @ way)
    return np.asarray(rows - rows.mean(axis=1, keepdims=True) - slopes[:, None] * way)


def _floor(power: Real, first: int, last: int) -> Real:
    """Smooth spectrum at the bins first..last, from the bands on either side of each bin's own.

    The geometric mean of two neighbours is exact for a power law; a line in the band itself does
    not lift its own floor.
    """
    bins = power.shape[1]
    edges = np.unique(np.round(2 ** np.arange(1, np.log2(bins) + 0.5 / BANDS, 1 / BANDS)))
    edges = np.unique(np.minimum(edges, bins)).astype(np.int64)
    levels = np.stack(
        [
            _medians(power[:, a : b : max((b - a) // ENOUGH_BINS, 1)])
            for a, b in pairwise(edges.tolist())
        ],
        axis=1,
    )
    tiny = np.finfo(np.float64).tiny + 1e-12 * power[:, 1:].mean(axis=1, keepdims=True)
    logs = np.log(levels / MEDIAN_OF_EXPONENTIAL + tiny)
    # A line under the Hann window is three bins wide and would fill a narrow neighbour.
    apart = np.where(np.diff(edges) < WIDE_BAND, 2, 1)
    own = np.arange(logs.shape[1])
    below = np.maximum(own - apart, 0)
    above = np.minimum(own + apart, logs.shape[1] - 1)
    floors = np.exp((logs[:, below] + logs[:, above]) / 2)
    # Bins before the first edge and behind the last belong to the outermost bands.
    inner = np.clip(edges[1:-1], first, last + 1)
    return np.repeat(floors, np.diff(np.r_[first, inner, last + 1]), axis=1)


def _medians(rows: Real) -> Real:
    """Median of every row; np.median spends most of its time on other things than short rows."""
    count = rows.shape[1]
    low, high = (count - 1) // 2, count // 2
    parted = np.partition(rows, (low, high), axis=1)
    return np.asarray((parted[:, low] + parted[:, high]) / 2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BandFilter:
    """A signal's spectrum, mean and slope off, from which any band can be cut.

    Attributes
    ----------
    n : int
        Samples of the signal.
    length : int
        Length of the transform, n or a little more. [samples]
    spectrum : ndarray of complex, shape (length // 2 + 1,)
        Transform of the signal.
    """

    n: int
    length: int
    spectrum: NDArray[np.complex128]

    @classmethod
    def of(cls, signal: Real) -> Self:
        """Transform an evenly sampled signal without gaps."""
        length = scipy.fft.next_fast_len(signal.size, real=True)
        spectrum = scipy.fft.rfft(_without_line(signal[None])[0], length)
        return cls(n=signal.size, length=length, spectrum=np.asarray(spectrum))

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

    def _wave(self, period: float, width: float, length: int) -> Real:
        middle = self.length / period
        part = slice(
            max(int(middle / width**2), 0), min(int(middle * width**2) + 2, length // 2 + 1)
        )
        cycles = np.maximum(np.arange(part.start, part.stop), 0.5)
        octaves = np.abs(np.log(cycles * period / self.length))
        gain = np.clip(2 - octaves / np.log(width), 0.0, 1.0)
        kept = np.zeros(length // 2 + 1, dtype=np.complex128)
        kept[part] = self.spectrum[part] * gain
        return np.asarray(scipy.fft.irfft(kept, length))


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
