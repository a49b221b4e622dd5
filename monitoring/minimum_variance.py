"""Minimum-variance index: how much of the error no controller could have removed."""

import contextlib
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import scipy.fft

from loop.autoregression import autocovariance
from loop.errors import PoorExcitation
from loop.regression import lagged, least_squares
from loop.signals import Real
from monitoring.basis import Basis, Setting, graded, refusal

ORDER = 20
FEWEST_PER_ORDER = 15
MOST_BLOCKS = 8
# 97.5 % points of Student's t for four to eight blocks, and what they are widened by: eta of a
# finite record is a little too high.
T_975 = (3.182, 2.776, 2.571, 2.447, 2.365)
WIDER = 1.18
# Above this many samples the sums of products come from the autocorrelation by FFT.
FAST_FROM = 5000
# Lags up to which products by matrices are faster than by transforms.
FEW_LAGS = 100
# Samples of a line of such a matrix. [samples]
LINE = 16
# The extended horizon is judged where eta has risen by less than this over half its delay again.
FLAT = 0.02


class Estimator(StrEnum):
    """Which regression gave the index."""

    LEAST_SQUARES = "least squares on y[t-b], y[t-b-1] ..."
    AUTOCORRELATION = "normal equations of the autocorrelation at the lags b, b+1 ..."


@dataclass(frozen=True, slots=True, kw_only=True)
class MinimumVariance:
    """Minimum-variance index of one loop, with everything that decides it.

    Attributes
    ----------
    eta : float or None
        sigma_mv^2/sigma_y^2: 1 is the best any controller can do, 0 the worst. [-]
    low, high : float or None
        About a 95 % interval from blocks of the record. [-]
    minimum_variance : float or None
        sigma_mv^2. [PV^2]
    delay : int
        Delay b, sample-and-hold included. [samples]
    order : int
        Coefficients m of the regression.
    estimator : Estimator
        Regression used.
    extended : bool
        The delay is not known and was extended to where eta flattens: eta is then a comparison of
        the loop with itself, not with a best possible controller.
    comparable : bool
        Fit for ranking: not averaging level, not saturated, not sticking.
    basis : Basis
        What this rests on.
    """

    eta: float | None
    low: float | None
    high: float | None
    minimum_variance: float | None
    delay: int
    order: int
    estimator: Estimator
    extended: bool
    comparable: bool
    basis: Basis


def minimum_variance(
    error: Real,
    *,
    delay: int | None,
    order: int = ORDER,
    share: float = 1.0,
    marks: tuple[str, ...] = (),
) -> MinimumVariance:
    r"""Estimate the minimum-variance index [1]_ by one regression over the delay.

    .. math:: y_t = c + \sum_{i=1}^{m} a_i\, y_{t-b-i+1} + e_t,\qquad
              \eta = \frac{s_e^2}{\overline{(y-\bar y)^2}}

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error, evenly sampled, NaN in gaps. [PV]
    delay : int, optional
        Delay from OP to PV, one sample at least for the hold. Without it the horizon is extended
        to where eta flattens. [samples]
    order : int
        Coefficients m.
    share : float
        Part of the record that the error covers. [-]
    marks : tuple of str
        Why the index must not be used for ranking, if so.

    References
    ----------
    .. [1] T. J. Harris, "Assessment of control loop performance", Canadian Journal of Chemical
       Engineering 67 (1989); from memory, checked against a closed form.
    """
    if delay is not None and delay < 1:
        raise ValueError(f"delay must be at least one sample, got {delay}")
    if order < 1:
        raise ValueError(f"order must be at least 1, got {order}")
    known = int(np.count_nonzero(np.isfinite(error)))
    fast = error.size >= FAST_FROM and known == error.size
    estimator = Estimator.AUTOCORRELATION if fast else Estimator.LEAST_SQUARES
    settings: tuple[Setting, ...] = (("order", float(order)), ("estimator", str(estimator)))
    most = max(min(known // (4 * order), 200), 1)
    try:
        _check_length(known, order, delay or 1)
        extended = delay is None
        b = _flat_horizon(error, order, most, fast=fast) if delay is None else delay
        if fast:
            eta, low, high, variance = _fast_eta(error, b, order)
        else:
            eta, variance = _eta(error, b, order), float(np.nanvar(error))
            low, high = _interval(_block_etas(error, b, order), eta)
    except PoorExcitation as reason:
        return MinimumVariance(
            eta=None, low=None, high=None, minimum_variance=None, delay=delay or 1, order=order,
            estimator=estimator, extended=delay is None, comparable=False,
            basis=refusal(str(reason), share=share, settings=settings),
        )  # fmt: skip
    doubts = (
        ("the delay is not known: eta uses the horizon at which it flattens",) if extended else ()
    )
    return MinimumVariance(
        eta=eta,
        low=low,
        high=high,
        minimum_variance=eta * variance,
        delay=b,
        order=order,
        estimator=estimator,
        extended=extended,
        comparable=not marks,
        basis=graded(share, (*doubts, *marks), settings=settings),
    )


def _check_length(known: int, order: int, delay: int) -> None:
    if known < FEWEST_PER_ORDER * order + delay:
        raise PoorExcitation(
            f"{known} samples are too few for {order} coefficients and a delay of {delay} samples"
        )


def _fast_eta(
    error: Real, delay: int, order: int
) -> tuple[float, float | None, float | None, float]:
    """Eta, its interval and the variance of the error from the sums of products of eight blocks.

    The products across the seams of the blocks are left out: 8 (b + m) of n.
    """
    blocks = min(error.size // (FEWEST_PER_ORDER * order + delay), MOST_BLOCKS) or 1
    rows = error[: error.size // blocks * blocks].reshape(blocks, -1)
    mean = float(np.mean(error))
    products = _block_products(rows, delay + order, mean=mean)
    rest = error[rows.size :] - mean
    variance = float(products[:, 0].sum() + rest @ rest) / error.size
    # The whole record comes first; a block that does not move says nothing.
    r = np.vstack([products.mean(axis=0), products[products[:, 0] > 0]])
    eta, *of_blocks = _fast_etas(r, [delay], order)[:, 0].tolist()
    return eta, *_interval(of_blocks, eta), variance


def _block_products(rows: Real, lags: int, *, mean: float = 0.0) -> Real:
    """Sum over t of z[t] z[t+k] of every row less the mean for k = 0..lags - 1.

    A row laid out in lines of 16 samples gives sixteen of them by one matrix product of the lines
    with those that lie so many lines ahead, twice as fast as the transform while there are few.
    """
    count, n = rows.shape
    if lags > FEW_LAGS:
        length = scipy.fft.next_fast_len(n + lags, real=True)
        X = scipy.fft.rfft(rows - mean, length, axis=1)
        return np.asarray(scipy.fft.irfft(X.real**2 + X.imag**2, length, axis=1)[:, :lags])
    lines, ahead = -(-n // LINE), -(-(lags - 1) // LINE) + 1
    padded = np.zeros((lines + ahead) * LINE)
    A = padded.reshape(-1, LINE)
    B = np.empty((count, LINE, ahead * LINE))
    for row, found in zip(rows, B, strict=True):
        np.subtract(row, mean, out=padded[:n])
        for k in range(ahead):
            part = found[:, k * LINE : (k + 1) * LINE]
            np.matmul(A[:lines].T, A[k : k + lines], out=part)
    i = np.arange(LINE)
    return np.asarray(B[:, i, i + np.arange(lags)[:, None]].sum(axis=2))


def _eta(error: Real, delay: int, order: int) -> float:
    """Residual over whole variance, at most 1."""
    X = np.column_stack([lagged(error, range(delay, delay + order)), np.ones(error.size)])
    fit = least_squares(X, error)
    variance = float(np.nanvar(error[np.isfinite(fit.residuals)]))
    if not variance > 0:
        raise PoorExcitation("the error does not move")
    return float(min(fit.noise_variance / variance, 1.0))


def _fast_etas(r: Real, delays: list[int], order: int) -> Real:
    """Eta of every row at several delays: toeplitz(r) a = r[b..], eta = 1 - a r[b..]/r[0]."""
    if not r[0, 0] > 0:
        raise PoorExcitation("the error does not move")
    rho = r / r[:, :1]
    i = np.arange(order)
    # A jitter of 1e-12 keeps the matrix of a signal without noise solvable.
    matrices = rho[:, np.abs(i[:, None] - i)] + 1e-12 * np.eye(order)
    right = rho[:, i[:, None] + delays]
    explained = np.sum(right * np.linalg.solve(matrices, right), axis=1)
    return np.asarray(np.clip(1 - explained, 0.0, 1.0))


def _flat_horizon(error: Real, order: int, most: int, *, fast: bool) -> int:
    """First horizon from which half as much again raises eta by less than `FLAT`."""
    horizons = sorted({max(round(1.5**k), 1) for k in range(14)})
    horizons = [b for b in horizons if b <= most] or [1]
    if fast:
        r = autocovariance(error, horizons[-1] + order)
        etas = _fast_etas(r[None], horizons, order)[0].tolist()
    else:
        etas = [_eta(error, b, order) for b in horizons]
    for b, here, ahead in zip(horizons, etas, etas[1:], strict=False):
        if ahead - here < FLAT:
            return b
    return horizons[-1]


def _block_etas(error: Real, delay: int, order: int) -> list[float]:
    """Eta of up to eight blocks of the record."""
    blocks = min(error.size // (FEWEST_PER_ORDER * order + delay), MOST_BLOCKS)
    found = []
    for part in np.array_split(error, max(blocks, 1)):
        with contextlib.suppress(PoorExcitation):
            found.append(_eta(part, delay, order))
    return found


def _interval(found: list[float], eta: float) -> tuple[float | None, float | None]:
    """Interval of about 95 % from the spread of eta over four blocks and more."""
    if len(found) < 4:
        return None, None
    t = WIDER * T_975[min(len(found), MOST_BLOCKS) - 4]
    half = t * float(np.std(found, ddof=1)) / np.sqrt(len(found))
    return max(eta - half, 0.0), min(eta + half, 1.0)
