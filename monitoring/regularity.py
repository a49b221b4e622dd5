"""How regular a band of a signal is: the crossings of its autocorrelation, and what lasts of it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from loop.autoregression import autocovariance
from loop.signals import Real
from monitoring.spectrum import BandFilter, Envelope, Lags

# Samples a period from which crossings and activity are read; a longer period is thinned to it.
POINTS = 48
# A band of more samples than this, at so many a period, is read from its slow envelope.
MOST_POINTS = 20_000
ENVELOPE_POINTS = 2.5
# Enough for how large the wave is from cycle to cycle.
FEW_POINTS = 1.3
# Reach of the interpolation between the lags of an envelope [samples of it], and its window.
REACH = 6
WINDOW = 10.0
# Periods up to which the autocorrelation is looked at.
LAGS = 6.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BandWave:
    """A band of a signal, sampled finely where it is short and as an envelope where it is long.

    Attributes
    ----------
    period : float
        Expected period. [samples of the signal]
    step : float
        Distance of the samples. [samples of the signal]
    square : ndarray, shape (m,)
        Square of the wave; of an envelope, its mean over a cycle.
    fine : ndarray, shape (m,), or None
        The wave.
    slow : Envelope or None
        Its envelope.
    """

    period: float
    step: float
    square: Real
    fine: Real | None = None
    slow: Envelope | None = None

    def regularity(self, start: int, stop: int) -> tuple[float, float, float]:
        """Period [samples of the signal], regularity and what lasts, of its samples start..stop."""
        if self.fine is not None:
            found = acf_regularity(self.fine[start:stop], self.period / self.step)
            return found[0] * self.step, *found[1:]
        assert self.slow is not None  # noqa: S101 - one of both is there
        return envelope_regularity(self.slow, start, stop, self.period)


def is_long(samples: int, period: float) -> bool:
    """Whether a band is read from its envelope; a short record never is."""
    return POINTS * samples / period > MOST_POINTS and samples > MOST_POINTS


def band_wave(
    band_filter: BandFilter, period: float, *, width: float, points: float = ENVELOPE_POINTS
) -> BandWave:
    """Cut a band out, in the form in which the rest costs least.

    Parameters
    ----------
    band_filter : BandFilter
        Signal with its spectrum.
    period : float
        Centre of the band. [samples]
    width : float
        Upper over middle frequency, above 1. [-]
    points : float
        Samples a period of an envelope. [-]
    """
    if is_long(band_filter.n, period):
        slow = band_filter.envelope(period, width=width, points=points)
        square = (slow.z.real**2 + slow.z.imag**2) / 2
        return BandWave(period=period, step=slow.step, square=square, slow=slow)
    fine, step = band_filter.thinned(period, width=width, points=POINTS)
    return BandWave(period=period, step=step, square=fine * fine, fine=fine)


def acf_regularity(wave: Real, period: float) -> tuple[float, float, float]:
    """Period, regularity and what lasts of the autocorrelation of a filtered signal.

    r = Tp/(3 sigma), Tp = 2 mean, sigma = 2 sd of the first ten distances between crossings of 0.

    Parameters
    ----------
    wave : ndarray, shape (n,)
        Signal filtered to one band.
    period : float
        Expected period. [samples]

    Returns
    -------
    period, regularity, lasting : float
        Period [samples], r [-], largest |autocorrelation| from 2.5 to 5 periods [-].
    """
    lags = max(min(int(LAGS * period), wave.size - 2), 1)
    covariance = autocovariance(wave, lags)
    if not covariance[0] > 0:
        return period, 0.0, 0.0
    rho = covariance / covariance[0] / (1 - np.arange(lags + 1) / wave.size)
    return _crossings(rho, period)


def envelope_regularity(
    slow: Envelope, start: int, stop: int, period: float
) -> tuple[float, float, float]:
    """The same from an envelope, whose autocovariance turned by its carrier is that of the wave.

    Parameters
    ----------
    slow : Envelope
        Envelope of the band.
    start, stop : int
        Part of its samples that counts.
    period : float
        Expected period. [samples of the signal]

    Returns
    -------
    period, regularity, lasting : float
        Period [samples of the signal], r [-], largest |autocorrelation| from 2.5 to 5 periods [-].
    """
    z = slow.z[start:stop]
    lags = min(_lags(period / slow.step), z.size - 1)
    r = np.array([np.vdot(z[: z.size - k], z[k:]) for k in range(lags + 1)])
    r /= z.size - np.arange(r.size)
    return _of_lags(Lags(r=r, cycles=slow.cycles), period, slow.step)


def spectrum_regularity(
    band_filter: BandFilter, period: float, *, width: float
) -> tuple[float, float, float]:
    """The same of a whole long signal from its spectrum alone: no wave is needed to say no.

    Parameters
    ----------
    band_filter : BandFilter
        Signal with its spectrum.
    period : float
        Centre of the band. [samples]
    width : float
        Upper over middle frequency, above 1. [-]

    Returns
    -------
    period, regularity, lasting : float
        Period [samples], r [-], largest |autocorrelation| from 2.5 to 5 periods [-].
    """
    step = period / ENVELOPE_POINTS
    lags = band_filter.lag_products(period, width=width, step=step, lags=_lags(ENVELOPE_POINTS))
    return _of_lags(lags, period, period / ENVELOPE_POINTS)


def _lags(points: float) -> int:
    return int(np.ceil(LAGS * points)) + REACH


def _of_lags(lags: Lags, period: float, step: float) -> tuple[float, float, float]:
    """Read an autocovariance between its lags; period and step in samples of the signal."""
    if not lags.r[0].real > 0:
        return period, 0.0, 0.0
    both = np.r_[np.conj(lags.r[REACH:0:-1]), lags.r]
    at = np.arange(int(LAGS * POINTS) + 1) * (period / step / POINTS)
    between = _between(period / step, lags.r.size)
    turned = (between @ both) * np.exp(2j * np.pi * lags.cycles * at)
    found = _crossings(turned.real / lags.r[0].real, POINTS)
    return found[0] * period / POINTS, *found[1:]


@lru_cache(maxsize=16)
def _between(points: float, lags: int) -> Real:
    """Weights of the lags -6, -5 ... at every 48th of a period, of so many lags a period.

    A sinc under a window that falls to nothing at the reach and leaves the band alone.
    """
    at = np.arange(int(LAGS * POINTS) + 1) * (points / POINTS)
    away = at[:, None] - np.arange(-REACH, lags)
    window = np.exp(WINDOW * (np.sqrt(np.maximum(1 - (away / REACH) ** 2, 0.0)) - 1))
    return np.asarray(np.sinc(away) * window)


def _crossings(rho: Real, period: float) -> tuple[float, float, float]:
    """Period, regularity and what lasts of an autocorrelation; period in its lags."""
    turns = np.flatnonzero((rho[1:] > 0) != (rho[:-1] > 0))
    crossings = turns + rho[turns] / (rho[turns] - rho[turns + 1])
    distances = np.diff(crossings[:11])
    tail = np.abs(rho[min(int(2.5 * period), rho.size - 1) : int(5 * period) + 1])
    lasting = float(min(np.max(tail, initial=0.0), 1.0))
    if distances.size < 4:
        return period, 0.0, lasting
    mean, spread = float(np.mean(distances)), float(np.std(distances))
    # A sampled autocorrelation is never more regular than its crossings can be read.
    return 2 * mean, mean / (3 * max(spread, 1e-3 * mean)), lasting
