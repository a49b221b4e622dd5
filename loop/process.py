"""Process models used for tuning: low-order models and the general rational one.

Every model carries its dead time apart from its rational part, so that a frequency response is
exact and no Padé approximation is needed anywhere.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from loop.signals import Complex

# Wide enough for every real plant in any unit; beyond these, products of the parameters overflow.
SMALLEST, LARGEST = 1e-9, 1e9
Polynomial: TypeAlias = tuple[float, ...]


def _check_gain(K: float) -> None:
    if not SMALLEST <= abs(K) <= LARGEST:
        raise ValueError(f"K must lie within {SMALLEST:g} and {LARGEST:g} in size, got {K}")


def _check_lag(name: str, lag: float) -> None:
    if not SMALLEST <= lag <= LARGEST:
        raise ValueError(f"{name} must lie within {SMALLEST:g} and {LARGEST:g} s, got {lag}")


def _check_dead_time(theta: float) -> None:
    if not (theta == 0 or SMALLEST <= theta <= LARGEST):
        raise ValueError(f"theta must be 0 or within {SMALLEST:g} and {LARGEST:g} s, got {theta}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FOPDT:
    """First order plus dead time, G(s) = K e^(-theta s) / (tau s + 1).

    Attributes
    ----------
    K : float
        Steady-state gain. [PV/OP]
    tau : float
        Time constant. [s]
    theta : float
        Dead time. [s]
    """

    K: float
    tau: float
    theta: float

    def __post_init__(self) -> None:
        _check_gain(self.K)
        _check_lag("tau", self.tau)
        _check_dead_time(self.theta)

    @property
    def numerator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (self.K,)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (self.tau, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SOPDT:
    """Second order plus dead time, G(s) = K e^(-theta s) / ((tau1 s + 1)(tau2 s + 1)).

    Attributes
    ----------
    K : float
        Steady-state gain. [PV/OP]
    tau1, tau2 : float
        Time constants, tau1 >= tau2. [s]
    theta : float
        Dead time. [s]
    """

    K: float
    tau1: float
    tau2: float
    theta: float

    def __post_init__(self) -> None:
        _check_gain(self.K)
        _check_lag("tau1", self.tau1)
        _check_lag("tau2", self.tau2)
        if self.tau1 < self.tau2:
            raise ValueError(f"tau1 must not be below tau2, got {self.tau1} and {self.tau2}")
        _check_dead_time(self.theta)

    @property
    def numerator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (self.K,)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (self.tau1 * self.tau2, self.tau1 + self.tau2, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class IPDT:
    """Integrator plus dead time, G(s) = K e^(-theta s) / s.

    Attributes
    ----------
    K : float
        Slope of PV for a unit step of OP. [PV/OP/s]
    theta : float
        Dead time. [s]
    """

    K: float
    theta: float

    def __post_init__(self) -> None:
        _check_gain(self.K)
        _check_dead_time(self.theta)

    @property
    def numerator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (self.K,)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (1.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DoubleIntegrator:
    """Two integrators plus dead time, G(s) = K e^(-theta s) / s^2.

    Attributes
    ----------
    K : float
        Acceleration of PV for a unit step of OP. [PV/OP/s^2]
    theta : float
        Dead time. [s]
    """

    K: float
    theta: float

    def __post_init__(self) -> None:
        _check_gain(self.K)
        _check_dead_time(self.theta)

    @property
    def numerator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (self.K,)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (1.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PureDelay:
    """Gain plus dead time and nothing else, G(s) = K e^(-theta s).

    Attributes
    ----------
    K : float
        Steady-state gain. [PV/OP]
    theta : float
        Dead time, not 0. [s]
    """

    K: float
    theta: float

    def __post_init__(self) -> None:
        _check_gain(self.K)
        _check_lag("theta", self.theta)

    @property
    def numerator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (self.K,)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients of the rational part, highest power first."""
        return (1.0,)


@dataclass(frozen=True, slots=True)
class TransferFunction:
    """Any proper rational transfer function with dead time, n(s)/d(s) e^(-theta s).

    Attributes
    ----------
    numerator, denominator : tuple of float
        Coefficients, highest power first; leading zeros are removed. [time in s]
    theta : float
        Dead time. [s]
    """

    numerator: Polynomial
    denominator: Polynomial
    theta: float = 0.0

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            coefficients = tuple(float(c) for c in getattr(self, name))
            if not all(map(math.isfinite, coefficients)) or not any(coefficients):
                raise ValueError(f"{name} must hold finite coefficients that are not all zero")
            leading = next(i for i, c in enumerate(coefficients) if c)
            object.__setattr__(self, name, coefficients[leading:])
        if len(self.numerator) > len(self.denominator):
            raise ValueError(
                "the transfer function must be proper: numerator of degree "
                f"{len(self.numerator) - 1} over denominator of degree {len(self.denominator) - 1}"
            )
        _check_dead_time(self.theta)


Process: TypeAlias = FOPDT | SOPDT | IPDT | DoubleIntegrator | PureDelay | TransferFunction


def rational_response(process: Process, s: Complex) -> Complex:
    """Evaluate the process at s without its dead time.

    Parameters
    ----------
    process : Process
        Process model.
    s : ndarray of complex
        Points of the complex plane. [rad/s]
    """
    return np.polyval(process.numerator, s) / np.polyval(process.denominator, s)


def static_gain(process: Process) -> float:
    """Steady-state gain, infinite (with its sign) for a process that integrates. [PV/OP]"""
    last = process.denominator[-1]
    sign = math.copysign(1.0, gain_sign(process))
    return process.numerator[-1] / last if last else math.copysign(math.inf, sign)


def gain_sign(process: Process) -> float:
    """Direction in which PV finally goes when OP rises, +1 or -1."""
    n = next(c for c in reversed(process.numerator) if c)
    d = next(c for c in reversed(process.denominator) if c)
    return math.copysign(1.0, n) * math.copysign(1.0, d)
