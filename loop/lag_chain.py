"""A process as the factors of a chain: gain, lags, numerator time constants, integrators."""

from dataclasses import dataclass

import numpy as np

from loop.errors import RuleNotApplicable
from loop.factors import polynomial_roots
from loop.process import FOPDT, SOPDT, Polynomial, Process
from loop.signals import Complex

TITLE = "The half rule"
# Damping ratio from which a pair of poles is close enough to two equal lags, and from which the
# difference is no more than what rounding makes of a multiple pole.
LEAST_DAMPING, REAL_DAMPING = 0.5, 0.99
# A real part this small beside the size of a root is rounding.
ROUNDING = 1e-9
# Roots this close together, relative to their size, may be one.
SCATTER = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class LagChain:
    """K prod(T s + 1) e^(-theta s) / (s^integrators prod(tau s + 1)).

    Attributes
    ----------
    K : float
        Gain of the chain. [PV/OP per s^integrators]
    lags : tuple of float
        Denominator time constants, positive. [s]
    leads : tuple of float
        Positive numerator time constants. [s]
    inverse : tuple of float
        Negative numerator time constants, of zeros in the right half-plane. [s]
    integrators : int
        Number of poles at s = 0. [-]
    theta : float
        Dead time. [s]
    remarks : tuple of str
        What was approximated already, one sentence each.
    """

    K: float
    lags: tuple[float, ...]
    leads: tuple[float, ...] = ()
    inverse: tuple[float, ...] = ()
    integrators: int = 0
    theta: float = 0.0
    remarks: tuple[str, ...] = ()


def lag_chain(process: Process) -> LagChain:
    """Factor a process into real lags and real numerator time constants.

    A pair of poles with a damping ratio of 0.5 or more counts as two equal lags with the same sum,
    which leaves the first power of s as it is.

    Parameters
    ----------
    process : Process
        Process model. [s]

    Raises
    ------
    RuleNotApplicable
        The process is unstable, oscillates by itself, integrates more than twice, blocks constants
        or has complex zeros.

    Examples
    --------
    >>> from loop.process import TransferFunction
    >>> chain = lag_chain(TransferFunction((-2.0, 1.0), (8.0, 6.0, 1.0, 0.0), 0.5))
    >>> chain.K, chain.lags, chain.inverse, chain.integrators
    (1.0, (4.0, 2.0), (-2.0,), 1)
    """
    match process:
        case FOPDT(tau=tau):
            return LagChain(K=process.K, lags=(tau,), theta=process.theta)
        case SOPDT(tau1=tau1, tau2=tau2):
            return LagChain(K=process.K, lags=(tau1, tau2), theta=process.theta)
        case _:
            return _factored(process)


def _factored(process: Process) -> LagChain:
    zeros = _merged(polynomial_roots(process.numerator), process.numerator)
    poles = _merged(polynomial_roots(process.denominator), process.denominator)
    integrators = int((poles == 0).sum())
    if (zeros == 0).any():
        raise RuleNotApplicable(TITLE, "the process passes no constants (a zero at s = 0)")
    if integrators > 2:
        raise RuleNotApplicable(TITLE, f"the process integrates {integrators} times")
    unstable = int((poles.real > ROUNDING * abs(poles)).sum())
    if unstable:
        plural = "pole" if unstable == 1 else "poles"
        raise RuleNotApplicable(
            "Tuning by a published rule",
            f"the process is unstable ({unstable} {plural} in the right half-plane)",
        )
    remarks: list[str] = []
    lags = _time_constants(poles[poles != 0], remarks)
    n = next(c for c in reversed(process.numerator) if c)
    d = next(c for c in reversed(process.denominator) if c)
    times = _numerator_times(zeros)
    return LagChain(
        K=n / d,
        lags=tuple(sorted(lags, reverse=True)),
        leads=tuple(sorted((T for T in times if T > 0), reverse=True)),
        inverse=tuple(sorted(T for T in times if T < 0)),
        integrators=integrators,
        theta=process.theta,
        remarks=tuple(remarks),
    )


def _merged(roots: Complex, polynomial: Polynomial) -> Complex:
    """Multiple roots as one number, where the polynomial is still the same with them.

    Rounding scatters the m copies of a root by the m-th root of it, but not their mean.
    """
    if roots.size < 2:
        return roots
    left, groups = sorted(roots, key=abs), []
    while left:
        near = [r for r in left if abs(r - left[0]) <= SCATTER * abs(left[0])]
        left = [r for r in left if abs(r - left[0]) > SCATTER * abs(left[0])]
        groups.append(near)
    merged = np.concatenate([np.full(len(g), np.mean(g)) for g in groups])
    real = np.abs(merged.imag) <= ROUNDING * np.abs(merged)
    merged = np.where(real, merged.real, merged)
    rebuilt = polynomial[0] * np.real(np.poly(merged))
    return merged if np.allclose(rebuilt, polynomial, rtol=1e-9, atol=0) else roots


def _time(value: float) -> float:
    """Round to the digits that roots of a polynomial have at best, so that 2 s is 2 s."""
    return float(f"{value:.12g}")


def _time_constants(poles: Complex, remarks: list[str]) -> list[float]:
    lags = [_time(-1 / float(p.real)) for p in poles if p.imag == 0]
    for p in poles[poles.imag > 0]:
        size = float(abs(p))
        damping = -float(p.real) / size
        if damping < LEAST_DAMPING:
            raise RuleNotApplicable(
                TITLE,
                f"the process oscillates by itself: poles with a damping ratio of {damping:.2g} at "
                f"{size:.3g} rad/s",
            )
        lags += [_time(damping / size)] * 2
        if damping < REAL_DAMPING:
            remarks.append(
                f"the poles with a damping ratio of {damping:.2g}: taken as two lags of "
                f"{damping / size:.4g} s, which have the same sum"
            )
    return lags


def _numerator_times(zeros: Complex) -> list[float]:
    times = [_time(-1 / float(z.real)) for z in zeros if z.imag == 0]
    for z in zeros[zeros.imag > 0]:
        size = float(abs(z))
        damping = -float(z.real) / size
        if abs(damping) < REAL_DAMPING:
            raise RuleNotApplicable(TITLE, "the process has complex zeros")
        times += [_time(damping / size)] * 2
    return times
