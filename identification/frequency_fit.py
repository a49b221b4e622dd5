"""First order plus dead time fitted to a measured frequency response."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from identification.frequency_response import FrequencyResponse
from loop.errors import FitNotTrusted
from loop.process import FOPDT
from loop.signals import Complex, Real

# Points that rest on different lines; three parameters, and some freedom to see whether they fit.
FEWEST_POINTS = 5
# Time constants and dead times against the measured frequencies that the search starts from.
STARTS = (0.1, 0.3, 1.0, 3.0, 10.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyFit:
    """Model of a measured response.

    Attributes
    ----------
    process : FOPDT
        Model.
    standard_errors : ndarray, shape (3,)
        Of K [PV/OP], tau [s], theta [s], widened where the model misses the points.
    misfit : float
        Mean squared error over that of the points, 1 where the model fits. [-]
    points : int
        Points used.
    """

    process: FOPDT
    standard_errors: Real
    misfit: float
    points: int


def fit_frequency_response(response: FrequencyResponse) -> FrequencyFit:
    """Fit K e^(-j w theta)/(j w tau + 1) to points that rest on different lines.

    sum |G - model|^2/sd^2 is least; K is found at every tau and theta.

    Parameters
    ----------
    response : FrequencyResponse
        Measured points.

    Raises
    ------
    FitNotTrusted
        There are too few points, or no process has these parameters.
    """
    apart = slice(response.stride // 2, None, response.stride)
    w, G, sd = response.w[apart], response.G[apart], response.sd[apart]
    if w.size < FEWEST_POINTS:
        raise FitNotTrusted(
            f"Only {w.size} points of the response rest on different lines of the spectrum; a "
            f"model needs {FEWEST_POINTS}. Record longer, or move OP over more frequencies."
        )
    middle = float(np.sqrt(w[0] * w[-1]))
    sd = np.maximum(sd, 1e-9 * np.abs(G))

    def misfit(x: Real) -> Real:
        tau, theta = np.exp(x[0]) / middle, x[1] / middle
        shape = np.exp(-1j * w * theta) / (1j * w * tau + 1)
        off = (_gain(G, shape, sd) * shape - G) / sd
        return np.concatenate((off.real, off.imag))

    found = min(
        (
            least_squares(
                misfit, [np.log(tau), theta], bounds=([-9.0, 0.0], [9.0, 100.0]), x_scale="jac"
            )
            for tau in STARTS
            for theta in (0.1, 1.0)
        ),
        key=lambda result: float(result.cost),
    )
    tau, theta = float(np.exp(found.x[0])) / middle, float(found.x[1]) / middle
    shape = np.exp(-1j * w * theta) / (1j * w * tau + 1)
    K = _gain(G, shape, sd)
    # Complex slopes with respect to K, tau, theta.
    slopes = np.stack((shape, -K * shape * 1j * w / (1j * w * tau + 1), -1j * w * K * shape)) / sd
    # The error of a point is shared between its real and imaginary part.
    information = 2 * np.real(slopes @ slopes.conj().T)
    off = misfit(found.x)
    excess = float(off @ off) / (w.size - 1.5)
    covariance = np.linalg.inv(information) * max(excess, 1.0)
    try:
        process = FOPDT(K=K, tau=tau, theta=theta)
    except ValueError as fact:
        raise FitNotTrusted(str(fact)) from fact
    return FrequencyFit(
        process=process,
        standard_errors=np.sqrt(np.diag(covariance)),
        misfit=excess,
        points=int(w.size),
    )


def _gain(G: Complex, shape: Complex, sd: Real) -> float:
    """Real gain that fits best."""
    weighted = shape.conj() / sd**2
    return float(np.real(weighted @ G) / np.real(weighted @ shape))
