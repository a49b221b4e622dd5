"""Lines in a spectrum: peaks that stand out of the smooth spectrum around them."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy.fft

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


def _without_line(rows: Real) -> Real:
    """Take mean and slope off every row."""
    way = np.linspace(-1.0, 1.0, rows.shape[1])
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
            np.median(power[:, a : b : max((b - a) // ENOUGH_BINS, 1)], axis=1)
            for a, b in pairwise(edges.tolist())
        ],
        axis=1,
    )
    tiny = np.finfo(np.float64).tiny + 1e-12 * power[:, 1:].mean(axis=1, keepdims=True)
    logs = np.log(levels / MEDIAN_OF_EXPONENTIAL + tiny)
    own = np.clip(
        np.searchsorted(edges, np.arange(first, last + 1), side="right") - 1, 0, logs.shape[1] - 1
    )
    # A line under the Hann window is three bins wide and would fill a narrow neighbour.
    apart = np.where(np.diff(edges)[own] < WIDE_BAND, 2, 1)
    below = np.maximum(own - apart, 0)
    above = np.minimum(own + apart, logs.shape[1] - 1)
    return np.asarray(np.exp((logs[:, below] + logs[:, above]) / 2))


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
    n = signal.size
    way = np.linspace(-1.0, 1.0, n)
    z = signal - signal.mean() - (signal @ way) / float(way @ way) * way
    length = scipy.fft.next_fast_len(n, real=True)
    spectrum = scipy.fft.rfft(z, length)
    octaves = np.abs(np.log(np.maximum(np.arange(spectrum.size), 0.5) * period / length))
    edge = np.log(width)
    gain = np.clip(2 - octaves / edge, 0.0, 1.0)
    return np.asarray(scipy.fft.irfft(spectrum * gain, length)[:n])
