"""Open loops of PID controllers around lags, integrators and swings, many at once.

L(jw) = sign k (1 + b s + c s^2) prod(T0 s + 1) e^(-theta s)
/ (s^order prod(T s + 1) prod(1 + b1 s + c1 s^2)): magnitude, unwrapped phase and their slopes in
closed form, free of overflow over the whole range of legal parameters.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from loop.batch import PIDBatch, ProcessBatch
from loop.factors import NEGLIGIBLE_TIME
from loop.signals import Flags, Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LagLoops:
    """Loops as arrays that broadcast against the frequencies they are evaluated at.

    Attributes
    ----------
    sign : ndarray of float
        +1 for negative feedback, -1 for the wrong action. [-]
    log_k : ndarray of float
        Logarithm of |L| w^order for w -> 0. [-]
    order : ndarray of float
        Poles at the origin. [-]
    b, c : ndarray of float
        Zeros of the controller, 1 + b s + c s^2. [s, s^2]
    lags : tuple of ndarray of float
        Time constants of process, derivative filter and controller lag; 0 for none. [s]
    theta : ndarray of float
        Dead time. [s]
    leads : tuple of ndarray of float
        Numerator time constants T0 of the process, negative for zeros in the right half-plane. [s]
    swings : tuple of two ndarray of float each
        Pairs of complex poles of the process, b1 and c1 of 1 + b1 s + c1 s^2, positive. [s, s^2]
    """

    sign: Real
    log_k: Real
    order: Real
    b: Real
    c: Real
    lags: tuple[Real, ...]
    theta: Real
    leads: tuple[Real, ...] = ()
    swings: tuple[tuple[Real, Real], ...] = ()

    @classmethod
    def of(
        cls, processes: ProcessBatch, controllers: PIDBatch, delay: Real, shape: tuple[int, ...]
    ) -> Self:
        """Close the loops of a batch, flattened to shape (n,).

        Parameters
        ----------
        processes : ProcessBatch
            Process models.
        controllers : PIDBatch
            Controllers.
        delay : ndarray
            Dead time on top of the processes' own. [s]
        shape : tuple of int
            Shape that all of them broadcast to.
        """
        Kc, Ti, Td = controllers.Kc, controllers.Ti, controllers.Td
        Td = np.where(Td > NEGLIGIBLE_TIME, Td, 0.0)
        Tf = Td / controllers.N
        Tf = np.where(Tf > NEGLIGIBLE_TIME, Tf, 0.0)
        integral = np.isfinite(Ti)
        Ti = np.where(integral, Ti, 1.0)
        log_k = np.log(np.abs(processes.K)) + np.log(Kc) - np.log(Ti)

        whole = np.zeros(shape)

        def flat(values: Real) -> Real:
            return (values + whole).ravel()

        tauF = np.where(controllers.tauF > NEGLIGIBLE_TIME, controllers.tauF, 0.0)
        lags = (processes.tau1, processes.tau2, Tf, tauF)
        return cls(
            sign=flat(np.sign(processes.K) * controllers.sign),
            log_k=flat(log_k),
            order=flat(processes.integrators + integral * 1.0),
            b=flat(np.where(integral, Ti + Tf, Td + Tf)),
            c=flat(np.where(integral, Ti * (Td + Tf), 0.0)),
            lags=tuple(flat(T) for T in lags if np.any(T)),
            theta=flat(processes.theta + delay),
        )

    @property
    def size(self) -> int:
        """Number of loops."""
        return int(self.sign.size)

    def take(self, rows: npt.NDArray[np.intp] | Flags | slice) -> Self:
        """Pick loops by index, flag or range; an index may repeat.

        Parameters
        ----------
        rows : ndarray or slice
            Indices, flags or a range along the batch.
        """
        return type(self)(
            sign=self.sign[rows],
            log_k=self.log_k[rows],
            order=self.order[rows],
            b=self.b[rows],
            c=self.c[rows],
            lags=tuple(T[rows] for T in self.lags),
            theta=self.theta[rows],
            leads=tuple(T[rows] for T in self.leads),
            swings=tuple((b[rows], c[rows]) for b, c in self.swings),
        )

    def columns(self) -> Self:
        """Turn to shape (n, 1), to be evaluated at frequencies of shape (n, m)."""
        return self.take((slice(None), None))  # type: ignore[arg-type]

    @property
    def zeros(self) -> Real:
        """Number of zeros. [-]"""
        own = np.where(self.c > 0, 2.0, np.where(self.b > 0, 1.0, 0.0))
        return np.asarray(own + len(self.leads))

    @property
    def excess(self) -> Real:
        """Number of poles above the number of zeros. [-]"""
        lags = sum(1.0 * (T > 0) for T in self.lags)
        return np.asarray(self.order + lags + 2 * len(self.swings) - self.zeros)

    @property
    def log_k_high(self) -> Real:
        """Logarithm of |L| w^excess for w -> infinity. [-]"""
        lead = np.where(self.c > 0, self.c, np.where(self.b > 0, self.b, 1.0))
        lags = sum((np.log(np.where(T > 0, T, 1.0)) for T in self.lags), np.zeros_like(lead))
        leads = sum((np.log(np.abs(T)) for T in self.leads), np.zeros_like(lead))
        swings = sum((np.log(c) for _, c in self.swings), np.zeros_like(lead))
        return np.asarray(self.log_k + np.log(lead) + leads - lags - swings)

    def log_gain(self, w: Real) -> Real:
        """Logarithm of |L(jw)|. [-]"""
        x = w * w
        total = 2 * (self.log_k - self.order * np.log(w)) + np.log(_square(self.b, self.c, x))
        for T in self.lags:
            total = total - np.log1p(T * T * x)
        for T in self.leads:
            total = total + np.log1p(T * T * x)
        for b, c in self.swings:
            total = total - np.log(_square(b, c, x))
        return np.asarray(0.5 * total)

    def phase(self, w: Real) -> Real:
        """Phase of L(jw) without jumps. [rad]"""
        turn = np.arctan2(self.b * w, 1 - self.c * w * w) - self.theta * w
        for T in self.lags:
            turn = turn - np.arctan(T * w)
        for T in self.leads:
            turn = turn + np.arctan(T * w)
        for b, c in self.swings:
            turn = turn - np.arctan2(b * w, 1 - c * w * w)
        return np.asarray(turn + (0.5 * math.pi) * (self.sign - 1 - self.order))

    def gain_slope(self, w: Real) -> Real:
        """Return d ln|L| / d ln w. [-]"""
        x = w * w
        slope = _square_slope(self.b, self.c, x) - self.order
        for T in self.lags:
            bend = T * T * x
            slope = slope - bend / (1 + bend)
        for T in self.leads:
            bend = T * T * x
            slope = slope + bend / (1 + bend)
        for b, c in self.swings:
            slope = slope - _square_slope(b, c, x)
        return np.asarray(slope)

    def phase_slope(self, w: Real) -> Real:
        """Return d arg L / d ln w. [rad]"""
        x = w * w
        slope = self.b * (1 + self.c * x) / _square(self.b, self.c, x) - self.theta
        for T in self.lags:
            slope = slope - T / (1 + T * T * x)
        for T in self.leads:
            slope = slope + T / (1 + T * T * x)
        for b, c in self.swings:
            slope = slope - b * (1 + c * x) / _square(b, c, x)
        return np.asarray(slope * w)


def _square(b: Real, c: Real, x: Real) -> Real:
    """|1 + b s + c s^2|^2 on the imaginary axis, x = w^2."""
    level = 1 - c * x
    return np.maximum(level * level + b * b * x, 1e-300)


def _square_slope(b: Real, c: Real, x: Real) -> Real:
    """D ln|1 + b s + c s^2| / d ln w."""
    cx = c * x
    return np.asarray(((b * b - 2 * c) * x + 2 * cx * cx) / _square(b, c, x))
