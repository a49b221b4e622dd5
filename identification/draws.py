"""Draws of a model's parameters from what a record leaves uncertain, for tuning to sweep."""

from dataclasses import astuple

import numpy as np

from identification.identify import Identification
from loop.process import TransferFunction
from loop.signals import Real

# No tuning can be verified for a gain or a time constant a hundred times off; it keeps products of
# the draws finite.
FURTHEST = 100.0


def parameter_draws(identification: Identification, *, n: int = 200, seed: int = 0) -> Real:
    """Draw processes that the record cannot tell from the fitted one.

    The logarithms of K and of the lags, and theta itself, are drawn from the normal distribution
    with the covariance of the fit, widened where its residual is not white. The logarithms keep
    the sign of K and the lags positive; a dead time below 0 becomes 0. The errors move together as
    the record has them: K with tau after a short test, tau against theta after any.

    Parameters
    ----------
    identification : Identification
        A fitted model with its errors.
    n : int
        Number of draws. [-]
    seed : int
        Of the random numbers, so that the same record gives the same draws.

    Returns
    -------
    ndarray, shape (n, p)
        Parameters of each draw in the order of the process's own: K [PV/OP], tau [s] and theta [s]
        for FOPDT, shape (n, 3); K, tau1, tau2, theta for SOPDT; K, theta for the integrators.

    Raises
    ------
    ValueError
        The record carried no model, the model is the simplification of another structure, or n is
        below 1.

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
    fitted, structure = identification.fitted, identification.structure
    if fitted is None or structure is None:
        raise ValueError("draws of the parameters need a fitted model with its errors")
    if isinstance(fitted, TransferFunction):
        raise ValueError(  # noqa: TRY004 - what a record carries is no wrong type of an argument
            "draws are of lags and dead times, not of a process that swings"
        )
    if fitted != structure.process:
        raise ValueError(
            f"the record speaks for {structure.structure.name}; the errors of its simplification "
            "are not known, so there is nothing to draw"
        )
    values = np.array(astuple(fitted))
    # Relative errors of gain and lags are those of their logarithms; a sign turns correlations.
    scale = np.append(values[:-1], 1.0)
    spread = structure.covariance / np.outer(scale, scale)
    sizes, directions = np.linalg.eigh(spread)
    root = directions * np.sqrt(np.maximum(sizes, 0.0))
    off = np.random.default_rng(seed).standard_normal((n, values.size)) @ root.T
    limit = np.log(FURTHEST)
    factors = np.exp(np.clip(off[:, :-1], -limit, limit))
    theta = np.maximum(values[-1] + off[:, -1], 0.0)
    return np.column_stack((values[:-1] * factors, theta))
