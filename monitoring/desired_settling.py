"""The error against the best that settles no faster than somebody wants it to."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from loop.autoregression import AR, ar_least_squares, yule_walker
from loop.errors import PoorExcitation
from loop.process import LARGEST, SMALLEST
from loop.signals import Real
from monitoring.basis import Basis, Setting, graded, refusal
from monitoring.minimum_variance import FAST_FROM, FEWEST_PER_ORDER, ORDER


@dataclass(frozen=True, slots=True, kw_only=True)
class DesiredSettling:
    """Minimum-variance index with a desired closed-loop time constant.

    Attributes
    ----------
    index : float or None
        Variance of the desired response over the actual variance: 1 for a loop as good as wished,
        above 1 for one that is calmer than wished. [-]
    variance : float or None
        Variance of the desired response. [PV^2]
    tau_c : float
        Desired closed-loop time constant. [s]
    delay : int
        Delay b, sample-and-hold included. [samples]
    order : int
        Coefficients of the autoregression.
    comparable : bool
        Fit for ranking: not averaging level, not saturated, not sticking.
    basis : Basis
        What this rests on.
    """

    index: float | None
    variance: float | None
    tau_c: float
    delay: int
    order: int
    comparable: bool
    basis: Basis


def desired_settling(
    error: Real,
    dt: float,
    *,
    delay: int,
    tau_c: float,
    order: int = ORDER,
    share: float = 1.0,
    marks: tuple[str, ...] = (),
) -> DesiredSettling:
    r"""Compare the error with one that decays as wished once the dead time is over [1]_.

    .. math:: \sigma_d^2 = \sigma_e^2\left(\sum_{i<b} f_i^2
              + f_{b-1}^2 \frac{\mu^2}{1-\mu^2}\right),\qquad \mu = e^{-dt/\tau_c}

    f is the impulse response of an autoregression of the error, whose first b values no feedback
    changes; from there on the desired response decays with mu.

    Parameters
    ----------
    error : ndarray, shape (n,)
        Control error, evenly sampled, without gaps. [PV]
    dt : float
        Sample time. [s]
    delay : int
        Delay from OP to PV, one sample at least for the hold. [samples]
    tau_c : float
        Desired closed-loop time constant. [s]
    order : int
        Coefficients of the autoregression.
    share : float
        Part of the record that the error covers. [-]
    marks : tuple of str
        Why the index must not be used for ranking, if so.

    References
    ----------
    .. [1] A. Horch and A. J. Isaksson, "A modified index for control performance assessment",
       Journal of Process Control 9 (1999); from memory, checked against closed forms.
    """
    if delay < 1:
        raise ValueError(f"delay must be at least one sample, got {delay}")
    if not SMALLEST <= tau_c <= LARGEST:
        raise ValueError(f"tau_c must lie within {SMALLEST:g} and {LARGEST:g} s, got {tau_c}")
    settings: tuple[Setting, ...] = (
        ("order", float(order)),
        ("delay, samples", float(delay)),
        ("desired time constant, s", tau_c),
    )
    try:
        fit = _autoregression(error, order, delay)
        variance = _variance(fit, delay, dt / tau_c)
    except PoorExcitation as reason:
        return DesiredSettling(
            index=None, variance=None, tau_c=tau_c, delay=delay, order=order, comparable=False,
            basis=refusal(str(reason), share=share, settings=settings),
        )  # fmt: skip
    return DesiredSettling(
        index=variance / float(np.var(error)),
        variance=variance,
        tau_c=tau_c,
        delay=delay,
        order=order,
        comparable=not marks,
        basis=graded(share, marks, settings=settings),
    )


def _autoregression(error: Real, order: int, delay: int) -> AR:
    if error.size < FEWEST_PER_ORDER * order + delay:
        raise PoorExcitation(
            f"{error.size} samples are too few for {order} coefficients and a delay of "
            f"{delay} samples"
        )
    if not np.ptp(error) > 0:
        raise PoorExcitation("the error does not move")
    return yule_walker(error, order) if error.size >= FAST_FROM else ar_least_squares(error, order)


def _variance(fit: AR, delay: int, rate: float) -> float:
    """Variance of f[0] ... f[b-1], f[b-1] mu, f[b-1] mu^2 ... driven by the innovations."""
    with np.errstate(over="ignore", invalid="ignore"):
        f = lfilter([1.0], np.r_[1.0, -fit.a], np.r_[1.0, np.zeros(delay - 1)])
        tail = np.exp(-2 * rate) / -np.expm1(-2 * rate)
        variance = fit.noise_variance * float(f @ f + f[-1] ** 2 * tail)
    if not np.isfinite(variance):
        raise PoorExcitation("the autoregression of the error grows without bound")
    return variance
