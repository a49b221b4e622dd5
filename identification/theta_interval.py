"""Intervals of the dead time that do not rest on a parabola: profile likelihood and bootstrap.

The sum of squares over theta is flat where a lag can stand in for a dead time and ends abruptly at
0. Standard errors describe it by a parabola; these follow it as it is.
"""

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import f as fisher

from identification.condense import Samples
from identification.held_input import lag_response
from identification.identify import Identification
from identification.least_squares import LeastSquaresFit, fopdt_least_squares
from loop.errors import FitNotTrusted
from loop.signals import Real

# Beyond so many standard errors the profile is not followed.
FURTHEST = 12.0
# Repeats of a bootstrap; the 2.5 % points are then known to a twentieth of the interval.
BOOTSTRAPS = 400


def profile_interval(identification: Identification, *, level: float = 0.95) -> tuple[float, float]:
    """Interval of theta from the profile of the sum of squares.

    All theta whose smallest sum of squares, over K, tau and everything else, is within

        SSE(theta) <= SSE_min (1 + F_level(1, f) c/f)

    f being the values less parameters and c the inflation by the colour of the residual.

    Parameters
    ----------
    identification : Identification
        First order plus dead time, with its data.
    level : float
        Confidence, between 0 and 1. [-]

    Returns
    -------
    low, high : float
        [s]

    Raises
    ------
    FitNotTrusted
        The record carried no first-order model.
    ValueError
        The level is no probability.
    """
    _require_level(level)
    fit, samples, inflation = _first_order(identification)
    quantile = float(fisher.ppf(level, 1, fit.freedom)) * inflation
    threshold = _fixed_dead_time(fit, samples, fit.theta) * (1 + quantile / fit.freedom)
    error = float(fit.standard_errors[2]) * math.sqrt(inflation)
    width = max(error, 1e-9 * float(samples.t[-1] - fit.t0))

    def excess(theta: float) -> float:
        return _fixed_dead_time(fit, samples, theta) - threshold

    return _crossing(excess, fit.theta, -width), _crossing(excess, fit.theta, width)


def bootstrap_intervals(
    identification: Identification, *, level: float = 0.95, n: int = BOOTSTRAPS, seed: int = 0
) -> Real:
    """Intervals of K, tau and theta from tests repeated with the model and its own residual.

    Residuals are drawn in blocks as long as they are correlated, so that coloured noise stays
    coloured; each repeat is fitted anew.

    Parameters
    ----------
    identification : Identification
        First order plus dead time, with its data.
    level : float
        Confidence. [-]
    n : int
        Repeats, 20 at least. [-]
    seed : int
        Of the random numbers.

    Returns
    -------
    ndarray, shape (3, 2)
        Of K [PV/OP], tau [s], theta [s].

    Raises
    ------
    FitNotTrusted
        The record carried no first-order model.
    ValueError
        The level is no probability, or there are too few repeats.
    """
    _require_level(level)
    if n < 20:
        raise ValueError(f"a bootstrap needs at least 20 repeats, got {n}")
    fit, samples, inflation = _first_order(identification)
    model = fit.predict(samples.t)
    root = np.ones_like(model) if samples.weight is None else np.sqrt(samples.weight)
    # Of equal variance, whatever the number of readings behind each value.
    left = (samples.pv - model) * root
    left = (left - left.mean()) * math.sqrt(left.size / max(left.size - 4, 1))
    block = min(max(round(2 * inflation), 1), max(left.size // 10, 1))
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(n):
        starts = rng.integers(0, left.size, size=-(-left.size // block))
        order = (starts[:, None] + np.arange(block)).ravel()[: left.size] % left.size
        again = fopdt_least_squares(
            samples.t, model + left[order] / root, fit.held, weight=samples.weight,
            drift=fit.drift_fitted, start=fit.start_fitted,
        )  # fmt: skip
        found.append([again.K, again.tau, again.theta])
    tail = (1 - level) / 2
    return np.asarray(np.quantile(np.array(found), [tail, 1 - tail], axis=0).T)


def _crossing(excess: Callable[[float], float], theta: float, width: float) -> float:
    """Where the profile passes the threshold, 0 or the furthest looked at where it does not. [s]"""
    inside = theta
    for _ in range(round(FURTHEST)):
        outside = max(inside + width, 0.0)
        if excess(outside) > 0:
            return float(brentq(excess, inside, outside, xtol=0.01 * abs(width)))
        if outside == 0:
            break
        inside = outside
    return outside


def _require_level(level: float) -> None:
    if not 0 < level < 1:
        raise ValueError(f"the level must lie between 0 and 1, got {level}")


def _first_order(identification: Identification) -> tuple[LeastSquaresFit, Samples, float]:
    structure, t, pv = identification.structure, identification.t, identification.pv
    if structure is None or not isinstance(structure.fit, LeastSquaresFit):
        raise FitNotTrusted("An interval of the dead time needs a first-order model with its data.")
    assert t is not None  # noqa: S101 - a fit has data
    assert pv is not None  # noqa: S101 - a fit has data
    samples = Samples(t=t, pv=pv, weight=identification.weight)
    return structure.fit, samples, structure.colour.inflation


def _fixed_dead_time(fit: LeastSquaresFit, samples: Samples, theta: float) -> float:
    """Smallest sum of squares at a dead time, tau searched about the fit's. [PV^2]"""
    root = np.ones_like(samples.t) if samples.weight is None else np.sqrt(samples.weight)
    since = samples.t - fit.t0
    # Whatever depends on neither tau nor theta is taken out once, the rest one by one.
    fixed = [root, since * root] if fit.drift_fitted else [root]
    basis = np.linalg.qr(np.stack(fixed, axis=1))[0].T

    def without_fixed(signal: Real) -> Real:
        return np.asarray(signal - (basis @ signal) @ basis)

    y = without_fixed(samples.pv * root)

    def squares(ln_tau: float) -> float:
        tau = math.exp(ln_tau)
        left, answer = y, without_fixed(lag_response(fit.held, samples.t, tau, theta)[0] * root)
        if fit.start_fitted:
            dying = without_fixed(np.exp(-since / tau) * root)
            left, answer = _without(left, dying), _without(answer, dying)
        left = _without(left, answer)
        return float(left @ left)

    about = math.log(fit.tau)
    found = minimize_scalar(
        squares, bounds=(about - 1.0, about + 1.0), method="bounded", options={"xatol": 1e-5}
    )
    return float(found.fun)


def _without(signal: Real, column: Real) -> Real:
    """Rest of a signal beside a column; the signal itself beside a column of nothing."""
    size = float(column @ column)
    return np.asarray(signal - (float(signal @ column) / size) * column) if size > 0 else signal
