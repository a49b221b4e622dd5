"""Exact ultimate gain and period of a fitted first-order model, with their errors."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from loop.process import FOPDT
from loop.signals import Real

# Step of the numerical derivatives: the cube root of the rounding error.
STEP = 6e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class UltimateEstimate:
    """Ultimate point of a fitted model.

    Attributes
    ----------
    Ku, Ku_error : float
        Ultimate gain, positive, and its standard error. [OP/PV]
    Pu, Pu_error : float
        Ultimate period and its standard error. [s]
    """

    Ku: float
    Ku_error: float
    Pu: float
    Pu_error: float


def fitted_ultimate(process: FOPDT, covariance: Real) -> UltimateEstimate | None:
    """Work out Ku and Pu of a fitted process and what its errors leave uncertain in them.

    w180 theta + atan(w180 tau) = pi, Ku = sqrt(1 + (w180 tau)^2)/|K|, Pu = 2 pi/w180. The errors
    follow from those of K, tau and theta by the slopes of both, which matters: K and tau of a slow
    process may be known badly and Ku, which rests on K/tau, well.

    Parameters
    ----------
    process : FOPDT
        Fitted process.
    covariance : ndarray, shape (3, 3)
        Of K, tau, theta.

    Returns
    -------
    UltimateEstimate or None
        None without dead time: the phase never reaches -180°.

    Examples
    --------
    >>> found = fitted_ultimate(FOPDT(K=2.0, tau=120.0, theta=30.0), np.zeros((3, 3)))
    >>> f"{found.Ku:.3f} {found.Pu:.1f}"
    '3.467 109.9'
    """
    if process.theta == 0:
        return None
    at = np.array([process.K, process.tau, process.theta])
    slopes = np.empty((2, 3))
    for i in range(3):
        up, down = at.copy(), at.copy()
        up[i] *= 1 + STEP
        down[i] *= 1 - STEP
        slopes[:, i] = np.subtract(
            ultimate_gain_and_period(*up.tolist()), ultimate_gain_and_period(*down.tolist())
        ) / (up[i] - down[i])
    Ku, Pu = ultimate_gain_and_period(*at.tolist())
    variances = np.einsum("ij,jk,ik->i", slopes, covariance, slopes)
    Ku_error, Pu_error = np.sqrt(np.maximum(variances, 0.0)).tolist()
    return UltimateEstimate(Ku=Ku, Ku_error=Ku_error, Pu=Pu, Pu_error=Pu_error)


def ultimate_gain_and_period(K: float, tau: float, theta: float) -> tuple[float, float]:
    """Ku [OP/PV] and Pu [s] of first order plus dead time, exactly.

    Parameters
    ----------
    K, tau, theta : float
        Process, theta above 0. [PV/OP], [s], [s]
    """
    # x = w theta keeps the unknown between 0 and pi.
    x = brentq(lambda x: x + math.atan(x * tau / theta) - math.pi, 0.0, math.pi, xtol=1e-15)
    w180 = x / theta
    return math.hypot(1.0, w180 * tau) / abs(K), 2 * math.pi / w180
