"""The open loop L = G C as poles, zeros and dead time: exact magnitude and unwrapped phase.

Sums of logarithms and of arctangents neither overflow nor wrap, however far apart the time
constants lie, and every slope is known in closed form.
"""

import math
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from loop.controller import PID
from loop.process import FOPDT, SOPDT, Polynomial, Process
from loop.signals import Complex, Real

# A lag or derivative shorter than this acts beyond every frequency a legal loop can cross over at.
NEGLIGIBLE_TIME = 1e-30
LARGEST_LOG = 700.0
LONGEST_DELAY = 1e30
LARGEST_LOG_FREQUENCY = 60 * math.log(10)


def polynomial_roots(coefficients: Polynomial) -> Complex:
    """Find the roots of a polynomial, scaled so that coefficients of any unit of time work.

    Parameters
    ----------
    coefficients : tuple of float
        Coefficients, highest power first, the first not zero.

    Returns
    -------
    ndarray of complex, shape (degree,)
        Roots; those at the origin are exactly zero.

    Raises
    ------
    ValueError
        A root lies outside 1e-60 to 1e60 rad/s.
    """
    a = np.asarray(coefficients, dtype=float)
    inner = np.trim_zeros(a, "b")
    degree = inner.size - 1
    roots = np.zeros(a.size - 1, dtype=complex)
    if degree:
        present = np.where(inner == 0, 1.0, np.abs(inner))
        unit = (math.log(present[-1]) - math.log(present[0])) / degree
        size = np.log(present) + unit * np.arange(degree, -1, -1)
        scaled = np.sign(inner) * np.exp(np.maximum(size - size.max(), -LARGEST_LOG))
        found = _quadratic_roots(*scaled) if degree == 2 else np.roots(scaled)
        logs = np.log(np.abs(found)) + unit
        if np.any(np.abs(logs) > LARGEST_LOG_FREQUENCY):
            raise ValueError("poles and zeros must lie within 1e-60 and 1e60 rad/s in size")
        roots[:degree] = found * math.exp(unit)
    return roots


def _quadratic_roots(a: float, b: float, c: float) -> Complex:
    """Roots without cancellation, so that two far apart are both exact."""
    square = b * b - 4 * a * c
    if square < 0:
        half = 0.5 * math.sqrt(-square) / a
        return np.array([complex(-0.5 * b / a, half), complex(-0.5 * b / a, -half)])
    larger = -0.5 * (b + math.copysign(math.sqrt(square), b))
    return np.array([larger / a, c / larger], dtype=complex)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FactoredLoop:
    """L(s) = sign e^log_k prod(s - zeros) / prod(s - poles) e^(-theta s).

    Attributes
    ----------
    sign : float
        Sign of the leading coefficient, +1 or -1. [-]
    log_k : float
        Logarithm of its size. [-]
    zeros, poles : ndarray of complex
        Zeros and poles. [rad/s]
    theta : float
        Dead time. [s]
    """

    sign: float
    log_k: float
    zeros: Complex
    poles: Complex
    theta: float
    _roots: Complex = field(init=False, repr=False)
    _weights: Real = field(init=False, repr=False)
    _turns: Real = field(init=False, repr=False)
    _start: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        roots = np.concatenate([self.zeros, self.poles])
        weights = np.concatenate([np.ones(self.zeros.size), -np.ones(self.poles.size)])
        right = roots.real > 0
        start = 0.0 if self.sign > 0 else -math.pi
        object.__setattr__(self, "_roots", roots)
        object.__setattr__(self, "_weights", weights)
        object.__setattr__(self, "_turns", np.where(right, -weights, weights))
        object.__setattr__(self, "_start", start + math.pi * float(np.sum(weights[right])))

    @classmethod
    def of(cls, process: Process, controller: PID, *, delay: float = 0.0) -> Self:
        """Factor the loop of a process and a controller.

        Parameters
        ----------
        process : Process
            Process model.
        controller : PID
            Controller settings.
        delay : float
            Dead time on top of the process's own. [s]

        Raises
        ------
        ValueError
            The delay lies outside 0 to 1e30 s, N is too small for a derivative filter, or a pole
            or zero of the process is out of every physical range.
        """
        if not 0 <= delay <= LONGEST_DELAY:
            raise ValueError(
                f"the extra delay must lie within 0 and {LONGEST_DELAY:g} s, got {delay}"
            )
        if not math.isfinite(controller.filter_time):
            raise ValueError(f"N is too small for a derivative filter, got {controller.N}")
        log_C, C_zeros, C_poles = _controller_factors(controller)
        lead = process.numerator[0] * math.copysign(1.0, process.denominator[0])
        return cls(
            sign=controller.action.sign * math.copysign(1.0, lead),
            log_k=log_C
            + math.log(abs(process.numerator[0]))
            - math.log(abs(process.denominator[0])),
            zeros=np.concatenate([polynomial_roots(process.numerator), C_zeros]),
            poles=np.concatenate([_process_poles(process), C_poles]),
            theta=process.theta + delay,
        )

    @property
    def excess(self) -> int:
        """Number of poles above the number of zeros."""
        return int(self.poles.size - self.zeros.size)

    @property
    def integrators(self) -> int:
        """Poles at the origin above the zeros there; negative for a loop that blocks constants."""
        return int(np.sum(self.poles == 0) - np.sum(self.zeros == 0))

    @property
    def origin(self) -> tuple[float, float]:
        """Sign and logarithm of L(s) s^integrators at s = 0. [-]"""
        zeros, poles = self.zeros[self.zeros != 0], self.poles[self.poles != 0]
        log_size = self.log_k + float(np.sum(np.log(np.abs(zeros))) - np.sum(np.log(np.abs(poles))))
        right = np.sum((zeros.imag == 0) & (zeros.real > 0))
        right += np.sum((poles.imag == 0) & (poles.real > 0))
        return self.sign * (-1.0) ** int(right), log_size

    def log_gain(self, w: Real) -> Real:
        """Logarithm of |L(jw)| at frequencies of shape (n,). [-]"""
        return np.asarray(self.log_k + 0.5 * (np.log(self._offsets(w)[1]) @ self._weights))

    def phase(self, w: Real) -> Real:
        """Phase of L(jw) without jumps of 360°, at frequencies of shape (n,). [rad]

        Roots on the imaginary axis count as lying left of it.
        """
        angles = np.arctan2(w[:, None] - self._roots.imag, np.abs(self._roots.real))
        return np.asarray(self._start + angles @ self._turns - w * self.theta)

    def gain_slope(self, w: Real) -> Real:
        """Return d ln|L| / d ln w at frequencies of shape (n,). [-]"""
        height, square = self._offsets(w)
        return np.asarray(w * ((height / square) @ self._weights))

    def phase_slope(self, w: Real) -> Real:
        """Return d arg L / d ln w at frequencies of shape (n,). [rad]"""
        pull = (1 / self._offsets(w)[1]) @ (self._weights * self._roots.real)
        return np.asarray(-w * (pull + self.theta))

    def _offsets(self, w: Real) -> tuple[Real, Real]:
        """Height of jw above each root, and their distance squared."""
        height = w[:, None] - self._roots.imag
        return height, np.maximum(height * height + self._roots.real**2, 1e-300)

    def response(self, w: Real) -> Complex:
        """L(jw) at frequencies of shape (n,); beyond 1e304 in size it is cut off. [-]"""
        size = np.exp(np.clip(self.log_gain(w), -LARGEST_LOG, LARGEST_LOG))
        phase = self.phase(w)
        return np.asarray(size * np.cos(phase) + 1j * (size * np.sin(phase)))


def _process_poles(process: Process) -> Complex:
    match process:
        case FOPDT():
            return np.array([-1 / process.tau], dtype=complex)
        case SOPDT():
            return np.array([-1 / process.tau1, -1 / process.tau2], dtype=complex)
        case _:
            return polynomial_roots(process.denominator)


def _controller_factors(pid: PID) -> tuple[float, Complex, Complex]:
    """Logarithm of the leading coefficient, zeros and poles of the controller."""
    Tf = pid.filter_time if pid.Td > NEGLIGIBLE_TIME else 0.0
    lead = pid.Td + Tf if pid.Td > NEGLIGIBLE_TIME else 0.0
    lags = [T for T in (Tf, pid.tauF) if T > NEGLIGIBLE_TIME]
    log_k = math.log(pid.Kc) - sum(math.log(T) for T in lags)
    poles = [-1 / T for T in lags]
    if pid.Ti < math.inf:
        poles.append(0.0)
        log_k += math.log(lead) if lead else 0.0
        square = (pid.Ti * lead,) if lead else ()
        zeros = polynomial_roots((*square, pid.Ti + Tf, 1.0))
    else:
        log_k += math.log(lead) if lead else 0.0
        zeros = polynomial_roots((lead, 1.0) if lead else (1.0,))
    return log_k, zeros, np.array(poles, dtype=complex)
