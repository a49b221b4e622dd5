"""Autoregressions of evenly sampled signals: least squares, Yule-Walker, Burg, order choice."""

from dataclasses import dataclass

import numpy as np
import scipy.fft
from scipy.linalg import toeplitz

from loop.errors import PoorExcitation
from loop.regression import (
    Criterion,
    check_order,
    lagged,
    least_squares,
    nested_residuals,
    signal_of,
)
from loop.signals import Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AR:
    """Autoregression y[t] = constant + a[0] y[t-delay] + a[1] y[t-delay-1] + ... + e[t].

    Attributes
    ----------
    a : ndarray, shape (order,)
        Coefficients. [-]
    standard_errors : ndarray, shape (order,)
        Standard errors of a. [-]
    constant : float
        Constant term, in the signal's unit.
    delay : int
        Smallest lag. [samples]
    noise_variance : float
        Variance of e.
    residuals : ndarray, shape (n,)
        e, NaN where a lag or y is missing.
    """

    a: Real
    standard_errors: Real
    constant: float
    delay: int
    noise_variance: float
    residuals: Real


def ar_least_squares(y: Real, order: int, *, delay: int = 1) -> AR:
    """Fit an autoregression with a constant by least squares; gaps are left out.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Evenly sampled signal, NaN where missing.
    order : int
        Number of coefficients.
    delay : int
        Smallest lag; with the dead time in samples the residual is what feedback cannot reach.

    Raises
    ------
    PoorExcitation
        Too few rows without a gap, or a signal that does not move.
    """
    check_order("order", order, 1)
    check_order("delay", delay, 1)
    y = signal_of("y", y)
    X = np.column_stack([lagged(y, range(delay, delay + order)), np.ones(y.size)])
    fit = least_squares(X, y)
    return AR(
        a=fit.coefficients[:-1],
        standard_errors=fit.standard_errors[:-1],
        constant=float(fit.coefficients[-1]),
        delay=delay,
        noise_variance=fit.noise_variance,
        residuals=fit.residuals,
    )


def autocovariance(y: Real, lags: int) -> Real:
    """Autocovariance r[0..lags], every lag from the pairs that are known.

    r[k] = (1 - k/n) mean((y[t] - mean)(y[t-k] - mean))

    Without gaps this is the sum over n, a sequence that some process has; with gaps it need not be.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Evenly sampled signal, NaN where missing.
    lags : int
        Largest lag. [samples]

    Returns
    -------
    ndarray, shape (lags + 1,)

    Raises
    ------
    PoorExcitation
        Some lag has no pair of known samples.
    """
    known = np.isfinite(y)
    pairs = np.maximum(y.size - np.arange(lags + 1.0), 0.0)
    if known.all():
        z = y - float(np.sum(y)) / max(y.size, 1)
    else:
        z = np.where(known, y, 0.0)
        z = np.where(known, z - np.sum(z) / max(np.count_nonzero(known), 1), 0.0)
        pairs = np.round(_products(known.astype(np.float64), lags))
    if np.any(pairs < 1):
        raise PoorExcitation(
            f"{np.count_nonzero(known)} known samples hold no pair at lag {int(np.argmin(pairs))}."
        )
    return np.asarray(_products(z, lags) / pairs * (1 - np.arange(lags + 1) / y.size))


def _products(z: Real, lags: int) -> Real:
    """Sum over t of z[t] z[t-k] for k = 0..lags, by FFT."""
    length = scipy.fft.next_fast_len(z.size + lags, real=True)
    spectrum = scipy.fft.rfft(z, length)
    products = np.zeros(lags + 1)
    # Not |spectrum|^2: its root, and the square of that, take as long as the transform.
    found = scipy.fft.irfft(spectrum.real**2 + spectrum.imag**2, length)[: lags + 1]
    products[: min(z.size, lags + 1)] = found[: z.size]
    return products


def yule_walker(y: Real, order: int) -> AR:
    """Fit an autoregression from the autocovariance; the fast route for long records.

    toeplitz(r[0..p-1]) a = r[1..p]

    Parameters
    ----------
    y : ndarray, shape (n,)
        Evenly sampled signal, NaN where missing.
    order : int
        Number of coefficients.

    Raises
    ------
    PoorExcitation
        Too few known samples, or a signal that does not move.
    """
    check_order("order", order, 1)
    y = signal_of("y", y)
    r = autocovariance(y, order)
    if not r[0] > 0:
        raise PoorExcitation("The signal does not move.")
    a = np.linalg.lstsq(toeplitz(r[:-1]), r[1:], rcond=None)[0]
    if not 0 < r[0] - a @ r[1:] <= r[0]:
        raise PoorExcitation(
            "The gaps leave an autocovariance that no process has; use least squares."
        )
    return _from_coefficients(y, a, r)


def burg(y: Real, order: int) -> AR:
    """Fit an autoregression by Burg's recursion: always stable, good for short records.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Evenly sampled signal without gaps.
    order : int
        Number of coefficients.

    Raises
    ------
    PoorExcitation
        A value is missing, too few samples, or a signal that does not move.
    """
    check_order("order", order, 1)
    y = signal_of("y", y)
    if not np.all(np.isfinite(y)):
        raise PoorExcitation("Burg's recursion needs a record without gaps; use least squares.")
    if y.size < 2 * order + 2:
        raise PoorExcitation(f"{y.size} samples are too few for {order} coefficients.")
    r = autocovariance(y, order)
    forward = backward = y - np.mean(y)
    if not r[0] > 0:
        raise PoorExcitation("The signal does not move.")
    a = np.zeros(0)
    for _ in range(order):
        ahead, behind = forward[1:], backward[:-1]
        power = float(ahead @ ahead + behind @ behind)
        reflection = 2 * float(ahead @ behind) / power if power > 0 else 0.0
        a = np.append(a - reflection * a[::-1], reflection)
        forward, backward = ahead - reflection * behind, behind - reflection * ahead
    return _from_coefficients(y, a, r)


def _from_coefficients(y: Real, a: Real, r: Real) -> AR:
    order = a.size
    constant = float(np.mean(y[np.isfinite(y)]) * (1 - np.sum(a)))
    residuals = y - constant - lagged(y, range(1, order + 1)) @ a
    known = np.isfinite(residuals)
    if np.count_nonzero(known) <= order + 1:
        raise PoorExcitation(
            f"{np.count_nonzero(known)} rows without a gap cannot carry {order} coefficients."
        )
    variance = float(np.sum(residuals[known] ** 2) / (np.count_nonzero(known) - order - 1))
    spread = np.linalg.pinv(toeplitz(r[:-1]), hermitian=True)
    return AR(
        a=a,
        standard_errors=np.sqrt(variance * np.diag(spread) / np.count_nonzero(known)),
        constant=constant,
        delay=1,
        noise_variance=variance,
        residuals=residuals,
    )


def ar_order(y: Real, most: int, *, delay: int = 1, criterion: Criterion = Criterion.BIC) -> int:
    """Choose the order of an autoregression, 0 to `most`, all judged on the same rows.

    One QR factorisation of the largest model holds the residual of every smaller one.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Evenly sampled signal, NaN where missing.
    most : int
        Largest order to consider.
    delay : int
        Smallest lag. [samples]
    criterion : Criterion
        What a further coefficient must earn.

    Raises
    ------
    PoorExcitation
        Too few rows without a gap, or a signal that does not move.
    """
    check_order("most", most, 1)
    check_order("delay", delay, 1)
    y = signal_of("y", y)
    X = np.column_stack([np.ones(y.size), lagged(y, range(delay, delay + most))])
    sums, rows = nested_residuals(X, y)
    return int(np.argmin([criterion.of(rss, k + 1, rows) for k, rss in enumerate(sums.tolist())]))
