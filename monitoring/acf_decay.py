"""How fast the autocorrelation of the error swings out: the decay ratio of the loop."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from monitoring.basis import Basis, graded, refusal
from monitoring.cross_correlation import correlations

THRESHOLD = 0.5
MOST_LAGS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class AcfDecay:
    """Decay ratio of the autocorrelation.

    Attributes
    ----------
    ratio : float
        R = a/b, height of the first maximum above the line through its two neighbouring minima,
        over depth of the first minimum below the line from lag 0 to that maximum [1]_. It is
        exp(-pi zeta/sqrt(1 - zeta^2)) for a second-order loop. [-]
    period : float or None
        Lag of the first maximum. [s]
    lively : bool
        R beyond 0.5: zeta below 0.216, quarter decay a period.
    basis : Basis
        What this rests on.

    References
    ----------
    .. [1] T. Miao and D. E. Seborg, "Automatic detection of excessively oscillatory feedback
       control loops", IEEE Conference on Control Applications (1999); the threshold from memory.
    """

    ratio: float
    period: float | None
    lively: bool
    basis: Basis


def acf_decay(error: Real, dt: float, *, share: float = 1.0) -> AcfDecay:
    """Measure the decay ratio of the autocorrelation of the error.

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error without gaps. [PV]
    dt : float
        Sample time. [s]
    share : float
        Part of the record that the error covers. [-]
    """
    settings = (("threshold", THRESHOLD),)
    lags = min(MOST_LAGS, error.size // 4)
    found = correlations(error, error, lags) if lags >= 8 else None
    if found is None:
        return AcfDecay(
            ratio=0.0, period=None, lively=False,
            basis=refusal("the error is too short or does not move", settings=settings),
        )  # fmt: skip
    rho = found[lags:]
    # Ripples below two standard errors of an autocorrelation are not extremes of the loop.
    places = _extremes(rho, 2 / np.sqrt(error.size))
    if len(places) < 3:
        return AcfDecay(
            ratio=0.0, period=None, lively=False, basis=graded(share, settings=settings)
        )
    first, top, second = places[:3]
    a = rho[top] - np.interp(top, [first, second], [rho[first], rho[second]])
    b = np.interp(first, [0, top], [1.0, rho[top]]) - rho[first]
    ratio = float(np.clip(a / b, 0.0, 1.0)) if b > 0 else 0.0
    return AcfDecay(
        ratio=ratio,
        period=float(top * dt),
        lively=ratio > THRESHOLD,
        basis=graded(share, settings=settings),
    )


def _extremes(rho: Real, ripple: float) -> list[int]:
    """Places of minimum, maximum, minimum after lag 0, each clear of the ripple."""
    places: list[int] = []
    best, sign = 0, -1.0
    for k, value in enumerate(rho.tolist()):
        if sign * (value - rho[best]) > 0:
            best = k
        elif sign * (rho[best] - value) > ripple and best > 0:
            places.append(best)
            best, sign = k, -sign
            if len(places) == 3:
                break
    return places
