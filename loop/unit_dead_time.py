"""Loops in units of their dead time: the parts of magnitude and phase that searches ask for."""

import math
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np
import numpy.typing as npt

from loop.lag_loops import LagLoops
from loop.signals import Flags, Real

Rows: TypeAlias = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class UnitDeadTime:
    """Loops in units of their dead time, with |1 + b s + c s^2|^2 = 1 + beta x + c2 x^2.

    `base` is the phase above -180° that the integrators leave. Frequencies run along the first
    axis, loops along the last.
    """

    log_k: Real
    order: Real
    base: Real
    b: Real
    c: Real
    beta: Real
    c2: Real
    lags: tuple[Real, ...]
    squares: tuple[Real, ...]

    @classmethod
    def of(cls, loops: LagLoops) -> Self:
        """Take loops with dead time to its units.

        Parameters
        ----------
        loops : LagLoops
            Open loops, shape (n,).
        """
        lags = tuple(T / loops.theta for T in loops.lags)
        b, c = loops.b / loops.theta, loops.c / (loops.theta * loops.theta)
        return cls(
            log_k=loops.log_k + loops.order * np.log(loops.theta),
            order=loops.order,
            base=(1 - 0.5 * loops.order) * math.pi,
            b=b,
            c=c,
            beta=b * b - 2 * c,
            c2=c * c,
            lags=lags,
            squares=tuple(T * T for T in lags),
        )

    def take(self, rows: Rows | slice) -> Self:
        """Pick loops by index, which may repeat, or a range of them.

        Parameters
        ----------
        rows : ndarray of int, or slice
            Indices or a range.
        """
        return type(self)(
            self.log_k[rows],
            self.order[rows],
            self.base[rows],
            self.b[rows],
            self.c[rows],
            self.beta[rows],
            self.c2[rows],
            tuple(T[rows] for T in self.lags),
            tuple(T2[rows] for T2 in self.squares),
        )

    @property
    def weak(self) -> Flags:
        """Loops whose falling gain is below 1 from the start."""
        return np.asarray((self.order == 0) & (self.log_k < 0))

    def lead(self, w: Real, x: Real) -> Real:
        """Phase that the zeros add. [rad]"""
        return np.arctan2(self.b * w, 1 - self.c * x)

    def lag(self, w: Real) -> Real:
        """Phase that lags and dead time take. [rad]"""
        total = w
        for T in self.lags:
            total = total + np.arctan(T * w)
        return total

    def above(self, w: Real, x: Real) -> Real:
        """Phase above -180° at w, x being its square. [rad]"""
        return self.lead(w, x) - self.lag(w) + self.base

    def lead_rate(self, x: Real, zeros: Real) -> Real:
        """Return d lead / dw, `zeros` being |1 + b s + c s^2|^2."""
        return self.b * (1 + self.c * x) / zeros

    def lag_rate(self, x: Real) -> Real:
        """Return d lag / dw; it falls with w, so that steps over it never go too far."""
        rate: Real = np.ones(1)
        for T, T2 in zip(self.lags, self.squares, strict=True):
            rate = rate + T / (1 + T2 * x)
        return rate

    def zeros(self, x: Real) -> Real:
        """|1 + b s + c s^2|^2 on the imaginary axis."""
        return 1 + x * (self.beta + self.c2 * x)
