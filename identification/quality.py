"""How well a model fits: fit percentage, colour of the residual, size of the systematic error."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.stats import chi2

from loop.signals import Real

# Lags of the whiteness test, as usual for a few hundred to many thousand samples.
LAGS = 20
# A record has some hundred stretches to look at; three standard errors leave little to chance.
BEYOND_CHANCE = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Colour:
    """Whether a residual is white noise, and what it costs where it is not.

    Attributes
    ----------
    lag1 : float
        Correlation of neighbours. [-]
    statistic : float
        Ljung-Box statistic Q = n (n + 2) sum rho_k^2/(n - k). [-]
    lags : int
        Lags in it; Q of white noise has a chi-squared distribution with as many degrees.
    p_value : float
        Chance of a larger Q in white noise. [-]
    inflation : float
        Factor on the variance of slowly varying averages, 1 + 2 sum rho_k, at least 1. [-]
    """

    lag1: float
    statistic: float
    lags: int
    p_value: float
    inflation: float

    @property
    def white(self) -> bool:
        """Whether white noise would look like this once in a thousand times or more often."""
        return self.p_value >= 1e-3


def residual_colour(residual: Real) -> Colour:
    """Test a residual for whiteness (Ljung and Box [1]_) and measure its correlation time.

    Q = n (n + 2) sum_{k=1..m} rho_k^2/(n - k)

    The inflation sums the correlations up to the first one within two standard errors of nothing.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        PV less model, each value times the root of its weight. [PV]

    References
    ----------
    .. [1] G. M. Ljung and G. E. P. Box, "On a measure of lack of fit in time series models,"
       Biometrika, vol. 65, no. 2, pp. 297-303, 1978. doi:10.1093/biomet/65.2.297
    """
    n = residual.size
    lags = min(LAGS, n // 5)
    about_mean = residual - residual.mean()
    power = float(about_mean @ about_mean)
    if lags < 1 or power <= 0:
        return Colour(lag1=0.0, statistic=0.0, lags=0, p_value=1.0, inflation=1.0)
    spectrum = rfft(about_mean, next_fast_len(2 * n))
    rho = np.asarray(irfft(np.abs(spectrum) ** 2, next_fast_len(2 * n)))[: n // 2] / power
    k = np.arange(1, lags + 1)
    statistic = n * (n + 2) * float(np.sum(rho[1 : lags + 1] ** 2 / (n - k)))
    small = np.flatnonzero(rho[1:] < 2 / math.sqrt(n))
    end = 1 + int(small[0]) if small.size else rho.size
    return Colour(
        lag1=float(rho[1]),
        statistic=statistic,
        lags=lags,
        p_value=float(chi2.sf(statistic, lags)),
        inflation=max(1 + 2 * float(rho[1:end].sum()), 1.0),
    )


def fit_percent(pv: Real, residual: Real, weight: Real | None = None) -> float:
    """Part of PV's variation that the model explains, 100 (1 - |residual|/|pv - mean|). [%]

    It says nothing about the model's dead time and is no evidence of a good model.

    Parameters
    ----------
    pv : ndarray, shape (n,)
        Process values. [PV]
    residual : ndarray, shape (n,)
        PV less model. [PV]
    weight : ndarray, shape (n,), optional
        Readings behind each value. [-]
    """
    about_mean = pv - np.average(pv, weights=weight)
    w = np.ones_like(pv) if weight is None else weight
    total = math.sqrt(float(w @ about_mean**2))
    return 100 * (1 - math.sqrt(float(w @ residual**2)) / total) if total > 0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """Largest error of the model that is no noise.

    Attributes
    ----------
    size : float
        Mean residual over the worst stretch, less three standard errors of that mean. [PV]
    start, end : float
        The stretch. [s]
    """

    size: float
    start: float
    end: float


def worst_misfit(
    t: Real, residual: Real, *, noise_sd: float, width: float, weight: Real | None = None
) -> Misfit:
    """Find the stretch over which the model is off most, beyond what noise can do to a mean.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    residual : ndarray, shape (n,)
        PV less model. [PV]
    noise_sd : float
        Standard deviation of a reading about the model. [PV]
    width : float
        Length of a stretch. [s]
    weight : ndarray, shape (n,), optional
        Readings behind each value. [-]
    """
    w = np.ones_like(t) if weight is None else weight
    starts = np.flatnonzero(np.diff(np.floor((t - t[0]) / width), prepend=-1.0))
    readings = np.add.reduceat(w, starts)
    mean = np.abs(np.add.reduceat(residual * w, starts) / readings)
    excess = np.maximum(mean - BEYOND_CHANCE * noise_sd / np.sqrt(readings), 0.0)
    worst = int(np.argmax(excess))
    ends = np.append(starts[1:], t.size) - 1
    return Misfit(
        size=float(excess[worst]), start=float(t[starts[worst]]), end=float(t[ends[worst]])
    )
