"""The same process with other parameters: what it is when its model is off."""

import numpy as np

from loop.process import FOPDT, SOPDT, Process, TransferFunction


def varied(process: Process, *, K: float = 1.0, lag: float = 1.0, theta: float = 1.0) -> Process:
    """Multiply gain, lags and dead time of a process by factors.

    G(s) = K G0(s) e^(-theta s), where every pole and zero of G0 moves as its lag does; the gain, or
    the slope of an integrating process, stays that of K.

    Parameters
    ----------
    process : Process
        Process model.
    K, lag, theta : float
        Factors on the gain, on all time constants and on the dead time. [-]

    Examples
    --------
    >>> varied(FOPDT(K=2.0, tau=120.0, theta=30.0), K=1.5, lag=0.5, theta=2.0)
    FOPDT(K=3.0, tau=60.0, theta=60.0)
    """
    match process:
        case FOPDT():
            return FOPDT(K=process.K * K, tau=process.tau * lag, theta=process.theta * theta)
        case SOPDT():
            return SOPDT(
                K=process.K * K,
                tau1=process.tau1 * lag,
                tau2=process.tau2 * lag,
                theta=process.theta * theta,
            )
        case TransferFunction():
            n, d = np.array(process.numerator), np.array(process.denominator)
            # s becomes lag s; 1/s^m of the integrators keeps its size.
            integrators = int(d.size - 1 - np.flatnonzero(d)[-1])
            n = n * lag ** np.arange(n.size - 1.0, -1.0, -1.0) * K * lag**integrators
            d = d * lag ** np.arange(d.size - 1.0, -1.0, -1.0)
            return TransferFunction(tuple(n.tolist()), tuple(d.tolist()), process.theta * theta)
        case _:
            return type(process)(K=process.K * K, theta=process.theta * theta)
