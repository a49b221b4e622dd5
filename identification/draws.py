"""Draws of (K, tau, theta) from what a record leaves uncertain, for tuning to sweep."""

import numpy as np

from identification.identify import Identification
from loop.process import FOPDT
from loop.signals import Real

# No tuning can be verified for a gain or a time constant a hundred times off; it keeps products of
# the draws finite.
FURTHEST = 100.0


def parameter_draws(identification: Identification, *, n: int = 200, seed: int = 0) -> Real:
    """Draw processes that the record cannot tell from the fitted one.

    ln(K/K_fit), ln(tau/tau_fit) and theta - theta_fit are drawn from the normal distribution with
    the covariance of the fit, widened where its residual is not white. The logarithms keep the
    sign of K and tau positive; a dead time below 0 becomes 0. The errors move together as the
    record has them: K with tau after a short test, tau against theta after any.

    Parameters
    ----------
    identification : Identification
        First order plus dead time, with its errors.
    n : int
        Number of draws. [-]
    seed : int
        Of the random numbers, so that the same record gives the same draws.

    Returns
    -------
    ndarray, shape (n, 3)
        K [PV/OP], tau [s] and theta [s] of each draw.

    Raises
    ------
    ValueError
        The record carried no such model, or n is below 1.

    Examples
    --------
    >>> from identification.identify import identify
    >>> from loop.record import Record
    >>> t = np.arange(0.0, 600.0)
    >>> pv = 20 + 10 * np.where(t > 80, 1 - np.exp(-(t - 80) / 50), 0) + 0.2 * np.sin(9 * t)
    >>> found = identify(Record(t=t, pv=pv, op=np.where(t < 60, 40.0, 45.0)))
    >>> draws = parameter_draws(found, n=1000)
    >>> draws.shape, bool(abs(draws[:, 0].mean() - found.process.K) < 0.01)
    ((1000, 3), True)
    """
    if n < 1:
        raise ValueError(f"the number of draws must be at least 1, got {n}")
    fitted, errors = identification.fitted, identification.standard_errors
    correlation = identification.correlation
    if not isinstance(fitted, FOPDT) or errors is None or correlation is None:
        raise ValueError("draws of K, tau and theta need a fitted first-order model with errors")
    scale = np.array([fitted.K, fitted.tau, 1.0])
    # Relative errors of K and tau are those of their logarithms; K's sign turns its correlations.
    spread = correlation * np.outer(errors / scale, errors / scale)
    values, directions = np.linalg.eigh(spread)
    root = directions * np.sqrt(np.maximum(values, 0.0))
    off = np.random.default_rng(seed).standard_normal((n, 3)) @ root.T
    limit = np.log(FURTHEST)
    factors = np.exp(np.clip(off[:, :2], -limit, limit))
    theta = np.maximum(fitted.theta + off[:, 2], 0.0)
    return np.column_stack((scale[:2] * factors, theta))
