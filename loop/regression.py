"""Least squares on evenly sampled signals, and ARX models by it.

Signals are evenly sampled; a missing value is NaN, and every row of the regression that touches
one is left out, so that a gap is never bridged.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import product

import numpy as np
from scipy.linalg import solve_triangular

from loop.errors import PoorExcitation
from loop.signals import Flags, Real

# Beyond 1/sqrt(machine epsilon) less than half of the digits of a coefficient mean anything.
LARGEST_CONDITION = 1 / np.sqrt(np.finfo(np.float64).eps)


class Criterion(StrEnum):
    """What a further coefficient must earn."""

    AIC = "AIC"
    BIC = "BIC"

    def of(self, rss: float, k: int, n: int) -> float:
        """Judge a fit of k coefficients on n rows by n ln(RSS/n) + k penalty; smaller is better.

        The penalty is 2 for AIC and ln n for BIC.
        """
        penalty = 2.0 if self is Criterion.AIC else np.log(n)
        return float(n * np.log(max(rss / n, np.finfo(np.float64).tiny)) + penalty * k)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regression:
    """Linear least-squares fit of y on the columns of X.

    Attributes
    ----------
    coefficients : ndarray, shape (k,)
        One for every column.
    covariance : ndarray, shape (k, k)
        Covariance of the coefficients.
    residuals : ndarray, shape (n,)
        y minus its prediction, NaN in the rows left out.
    noise_variance : float
        Residual sum of squares over degrees of freedom.
    rows : int
        Rows used.
    condition : float
        Condition number of X with its columns scaled to unit length. [-]
    """

    coefficients: Real
    covariance: Real
    residuals: Real
    noise_variance: float
    rows: int
    condition: float

    @property
    def standard_errors(self) -> Real:
        """Standard error of every coefficient, shape (k,)."""
        return np.sqrt(np.diag(self.covariance))

    def criterion(self, kind: Criterion) -> float:
        """Worth of the fit by AIC or BIC; smaller is better. [-]"""
        k, n = self.coefficients.size, self.rows
        return kind.of(self.noise_variance * (n - k), k, n)


def least_squares(X: Real, y: Real, *, rows: Flags | None = None) -> Regression:
    """Fit y = X b + e by a QR factorisation of [X y].

    Parameters
    ----------
    X : ndarray, shape (n, k)
        Regressors; a row with a NaN is left out.
    y : ndarray, shape (n,)
        Signal to explain; a row with a NaN is left out.
    rows : ndarray of bool, shape (n,), optional
        Rows that may be used.

    Raises
    ------
    PoorExcitation
        Too few rows without a gap, or columns that are almost dependent.
    """
    n, k = X.shape
    used = complete_rows(X) & np.isfinite(y)
    if rows is not None:
        used &= rows
    R, condition = _triangle(X[used], y[used])
    b = solve_triangular(R[:k, :k], R[:k, k])
    count = int(np.count_nonzero(used))
    variance = float(R[k, k] ** 2) / (count - k)
    inverse = solve_triangular(R[:k, :k], np.eye(k))
    residuals = np.full(n, np.nan)
    residuals[used] = y[used] - X[used] @ b
    return Regression(
        coefficients=b,
        covariance=variance * inverse @ inverse.T,
        residuals=residuals,
        noise_variance=variance,
        rows=count,
        condition=condition,
    )


def nested_residuals(X: Real, y: Real) -> tuple[Real, int]:
    """Residual sums of squares of y on the first 1, 2 ... k columns, and the rows they rest on.

    One QR factorisation of [X y] holds them all.

    Parameters
    ----------
    X : ndarray, shape (n, k)
        Regressors; a row with a NaN is left out.
    y : ndarray, shape (n,)
        Signal to explain; a row with a NaN is left out.

    Raises
    ------
    PoorExcitation
        Too few rows without a gap, or columns that are almost dependent.
    """
    used = complete_rows(X) & np.isfinite(y)
    R, _ = _triangle(X[used], y[used])
    return np.cumsum(R[::-1, -1] ** 2)[-2::-1], int(np.count_nonzero(used))


def complete_rows(X: Real) -> Flags:
    """Rows without a NaN, shape (n,)."""
    return np.asarray(np.all(np.isfinite(X), axis=1))


def _triangle(X: Real, y: Real) -> tuple[Real, float]:
    """R of [X y] and the condition number of X, refused where it is hopeless."""
    n, k = X.shape
    if n < k + 2:
        raise PoorExcitation(
            f"{n} rows without a gap cannot carry {k} coefficients; at least {k + 2} are needed."
        )
    lengths = np.linalg.norm(X, axis=0)
    R: Real = np.asarray(np.linalg.qr(np.column_stack([X, y]), mode="r"))
    condition = np.inf
    if np.all(lengths > 0):
        sizes = np.linalg.svd(R[:k, :k] / lengths, compute_uv=False)
        condition = float(sizes[0] / sizes[-1]) if sizes[-1] > 0 else np.inf
    if condition > LARGEST_CONDITION:
        raise PoorExcitation(
            f"The regressors are almost dependent (condition number {condition:.1e}): a signal "
            "hardly moves, or the order is too high for it."
        )
    return R, condition


def lagged(signal: Real, lags: Sequence[int]) -> Real:
    """Columns signal[t - lag], NaN before the first sample.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Signal.
    lags : sequence of int, length k
        Lags, 0 or positive. [samples]

    Returns
    -------
    ndarray, shape (n, k)
    """
    columns = np.full((signal.size, len(lags)), np.nan)
    for column, lag in enumerate(lags):
        columns[lag:, column] = signal[: max(signal.size - lag, 0)]
    return columns


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ARX:
    """y[t] = constant + sum a[i] y[t-1-i] + sum b[j] u[t-nk-j] + e[t].

    Attributes
    ----------
    a : ndarray, shape (na,)
        Coefficients of the past y. [-]
    b : ndarray, shape (nb,)
        Coefficients of the past u, the first at lag nk. [y/u]
    nk : int
        Delay from u to y; 1 for a sampled process without dead time. [samples]
    constant : float
        Constant term, in the unit of y.
    fit : Regression
        The regression behind it, coefficients in the order a, b, constant.
    """

    a: Real
    b: Real
    nk: int
    constant: float
    fit: Regression

    @property
    def gain(self) -> float:
        """Steady-state gain, sum b / (1 - sum a); infinite with its sign if it integrates. [y/u]"""
        rest = 1 - float(np.sum(self.a))
        return float(np.sum(self.b)) / rest if rest else float(np.copysign(np.inf, np.sum(self.b)))


def arx(y: Real, u: Real, *, na: int, nb: int, nk: int = 1) -> ARX:
    """Fit an ARX model with a constant by least squares; gaps are left out.

    The estimate is biased where the noise is not what A(q) colours it to; see the residuals.

    Parameters
    ----------
    y, u : ndarray, shape (n,)
        Evenly sampled output and input, NaN where missing.
    na, nb : int
        Number of coefficients of y and u.
    nk : int
        Delay from u to y. [samples]

    Raises
    ------
    PoorExcitation
        Too few rows without a gap, or an input that does not move.
    """
    y, u = _pair(y, u)
    return _arx(y, u, na, nb, nk, rows=None)


def choose_arx(
    y: Real,
    u: Real,
    *,
    na: Sequence[int],
    nb: Sequence[int],
    nk: Sequence[int],
    criterion: Criterion = Criterion.BIC,
) -> ARX:
    """Fit every combination of orders on the same rows and keep the best by the criterion.

    The criterion judges one-step prediction only. A delay found this way needs a second proof,
    for example the simulation error.

    Parameters
    ----------
    y, u : ndarray, shape (n,)
        Evenly sampled output and input, NaN where missing.
    na, nb, nk : sequence of int
        Candidates, as in `arx`.
    criterion : Criterion
        What a further coefficient must earn.

    Raises
    ------
    PoorExcitation
        No combination could be fitted: too few rows, or an input that does not move.
    """
    y, u = _pair(y, u)
    if not (na and nb and nk):
        raise ValueError("na, nb and nk need at least one candidate each")
    rows = complete_rows(_regressors(y, u, max(na), max(nb) + max(nk) - min(nk), min(nk)))
    fits, last = [], PoorExcitation("No ARX model could be fitted.")
    for orders in product(na, nb, nk):
        try:
            fits.append(_arx(y, u, *orders, rows=rows))
        except PoorExcitation as refusal:
            last = refusal
    if not fits:
        raise last
    return min(fits, key=lambda model: model.fit.criterion(criterion))


def _regressors(y: Real, u: Real, na: int, nb: int, nk: int) -> Real:
    past_y, past_u = lagged(y, range(1, na + 1)), lagged(u, range(nk, nk + nb))
    return np.column_stack([past_y, past_u, np.ones(y.size)])


def _arx(y: Real, u: Real, na: int, nb: int, nk: int, *, rows: Flags | None) -> ARX:
    for name, value, least in (("na", na, 0), ("nb", nb, 1), ("nk", nk, 0)):
        check_order(name, value, least)
    fit = least_squares(_regressors(y, u, na, nb, nk), y, rows=rows)
    b = fit.coefficients
    return ARX(a=b[:na], b=b[na : na + nb], nk=nk, constant=float(b[-1]), fit=fit)


def check_order(name: str, value: int, least: int) -> None:
    """Refuse an order below the least that means something."""
    if value < least:
        raise ValueError(f"{name} must be at least {least}, got {value}")


def signal_of(name: str, signal: Real) -> Real:
    """Take a signal as one list of numbers, NaN where missing."""
    values = np.asarray(signal, dtype=np.float64)
    if values.ndim != 1 or np.any(np.isinf(values)):
        raise ValueError(f"{name} must be one list of finite values, NaN where missing")
    return values


def _pair(y: Real, u: Real) -> tuple[Real, Real]:
    y, u = signal_of("y", y), signal_of("u", u)
    if y.size != u.size:
        raise ValueError(f"y and u must be equally long, got {y.size} and {u.size}")
    return y, u
