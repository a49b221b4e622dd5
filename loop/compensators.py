"""Compensators in series with the PID: lead, lag, lead-lag and notch."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from loop.process import LARGEST, SMALLEST, Polynomial, Process, TransferFunction
from loop.signals import Complex


def _check_time(name: str, value: float) -> None:
    if not SMALLEST <= value <= LARGEST:
        raise ValueError(f"{name} must lie within {SMALLEST:g} and {LARGEST:g} s, got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Lead:
    """Phase lead with a static gain of 1, F(s) = (T s + 1)/(alpha T s + 1), alpha < 1.

    The largest lead, asin((1 - alpha)/(1 + alpha)), stands at w = 1/(T sqrt(alpha)), where the
    gain is 1/sqrt(alpha).

    Attributes
    ----------
    T : float
        Time constant of the zero. [s]
    alpha : float
        Time constant of the pole over that of the zero, below 1. [-]
    """

    T: float
    alpha: float

    def __post_init__(self) -> None:
        _check_time("T", self.T)
        if not 1e-6 <= self.alpha < 1:
            raise ValueError(f"alpha of a lead must lie within 1e-6 and 1, got {self.alpha}")

    @property
    def numerator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (self.T, 1.0)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (self.alpha * self.T, 1.0)

    @property
    def largest_lead(self) -> float:
        """Largest phase lead. [°]"""
        return math.degrees(math.asin((1 - self.alpha) / (1 + self.alpha)))

    @property
    def w_lead(self) -> float:
        """Frequency of the largest lead. [rad/s]"""
        return 1 / (self.T * math.sqrt(self.alpha))


@dataclass(frozen=True, slots=True, kw_only=True)
class Lag:
    """Low-frequency gain beta with a gain of 1 far above it, F(s) = beta (T s + 1)/(beta T s + 1).

    Attributes
    ----------
    T : float
        Time constant of the zero. [s]
    beta : float
        Static gain, above 1. [-]
    """

    T: float
    beta: float

    def __post_init__(self) -> None:
        _check_time("T", self.T)
        if not 1 < self.beta <= 1e6:
            raise ValueError(f"beta of a lag must lie within 1 and 1e6, got {self.beta}")

    @property
    def numerator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (self.beta * self.T, self.beta)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (self.beta * self.T, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeadLag:
    """Lead or lag with a static gain of 1, F(s) = (T_lead s + 1)/(T_lag s + 1).

    Attributes
    ----------
    T_lead, T_lag : float
        Time constants of zero and pole. [s]
    """

    T_lead: float
    T_lag: float

    def __post_init__(self) -> None:
        _check_time("T_lead", self.T_lead)
        _check_time("T_lag", self.T_lag)

    @property
    def numerator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (self.T_lead, 1.0)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (self.T_lag, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Notch:
    """Notch, F(s) = (s^2 + 2 zeta_zero w0 s + w0^2)/(s^2 + 2 zeta_pole w0 s + w0^2).

    Attributes
    ----------
    w0 : float
        Frequency of the notch. [rad/s]
    zeta_zero, zeta_pole : float
        Damping ratios of zeros and poles, zeta_zero below zeta_pole. [-]
    """

    w0: float
    zeta_zero: float
    zeta_pole: float

    def __post_init__(self) -> None:
        if not SMALLEST <= self.w0 <= LARGEST:
            raise ValueError(
                f"w0 must lie within {SMALLEST:g} and {LARGEST:g} rad/s, got {self.w0}"
            )
        if not 0 < self.zeta_zero < self.zeta_pole <= 10:
            raise ValueError(
                "a notch needs 0 < zeta_zero < zeta_pole <= 10, "
                f"got {self.zeta_zero} and {self.zeta_pole}"
            )

    @property
    def numerator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (1.0, 2 * self.zeta_zero * self.w0, self.w0**2)

    @property
    def denominator(self) -> Polynomial:
        """Coefficients, highest power first."""
        return (1.0, 2 * self.zeta_pole * self.w0, self.w0**2)

    @property
    def depth(self) -> float:
        """Gain at w0, zeta_zero/zeta_pole. [-]"""
        return self.zeta_zero / self.zeta_pole

    @property
    def width(self) -> float:
        """Band in which the gain is below 1/sqrt(2), over w0; 0 where it never is. [-]

        2 sqrt(zeta_pole^2 - 2 zeta_zero^2), from |F|^2 = 1/2 with x = (w0^2 - w^2)/(w0 w):
        x^2 = 4 zeta_pole^2 - 8 zeta_zero^2, and the two roots lie |x| w0 apart.
        """
        return 2 * math.sqrt(max(self.zeta_pole**2 - 2 * self.zeta_zero**2, 0.0))


Compensator: TypeAlias = Lead | Lag | LeadLag | Notch


def compensator_response(compensators: Sequence[Compensator], s: Complex) -> Complex:
    """Evaluate compensators in a row at s.

    Parameters
    ----------
    compensators : sequence of Compensator
        Compensators in series; none is a gain of 1.
    s : ndarray of complex
        Points of the complex plane. [rad/s]
    """
    product = np.ones(np.shape(s), dtype=complex)
    for item in compensators:
        product = product * np.polyval(item.numerator, s) / np.polyval(item.denominator, s)
    return product


def in_series(process: Process, compensators: Sequence[Compensator]) -> Process:
    """Put compensators in front of a process, so that margins and responses count them.

    Where a compensator stands between PID and process it is all the same to the loop whether it
    belongs to the one or to the other.

    Parameters
    ----------
    process : Process
        Process model.
    compensators : sequence of Compensator
        Compensators in series with the PID.

    Returns
    -------
    Process
        The process itself without compensators, otherwise a transfer function.
    """
    if not compensators:
        return process
    numerator, denominator = np.array(process.numerator), np.array(process.denominator)
    for item in compensators:
        numerator = np.polymul(numerator, item.numerator)
        denominator = np.polymul(denominator, item.denominator)
    return TransferFunction(
        tuple(map(float, numerator)), tuple(map(float, denominator)), process.theta
    )
