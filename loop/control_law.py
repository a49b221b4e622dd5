"""The law printed at `ScanLaw`, scan by scan: in floats for one controller, in arrays for many.

Floats are ten times faster for one loop, arrays ten times faster for a thousand.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from loop.digital_pid import AntiWindup, OutputLimits, ScanLaw
from loop.signals import Real


@dataclass(frozen=True, slots=True, kw_only=True)
class LawLimits:
    """Limits of the output as deviations from rest, and what the integral does at them.

    Attributes
    ----------
    low, high : float
        Limits of the output. [OP]
    move : float
        Largest change of the output in one scan. [OP]
    clamps : bool
        Whether the integral holds while the output is at a limit.
    rebases : bool
        Whether the law goes on from the limited output, its lag included.
    """

    low: float
    high: float
    move: float
    clamps: bool
    rebases: bool

    @classmethod
    def of(cls, limits: OutputLimits, anti_windup: AntiWindup, *, op0: float, dt: float) -> Self:
        """Refer limits to the output at rest, and the rate to one scan."""
        return cls(
            low=limits.low - op0,
            high=limits.high - op0,
            move=limits.rate * dt,
            clamps=anti_windup is AntiWindup.CLAMPING,
            rebases=anti_windup in (AntiWindup.TRACKING, AntiWindup.VELOCITY),
        )


# From set point, measurement and the output by hand (none in automatic) to the output.
OneLaw = Callable[[float, float, float | None], float]


def law_of_one(law: ScanLaw, limits: LawLimits) -> OneLaw:
    """Start the first controller of a law at rest.

    Parameters
    ----------
    law : ScanLaw
        Numbers of the law.
    limits : LawLimits
        Limits of the output.
    """
    kP, kI, kD, dD, b, c, dF, f0, f1, track = (float(a[0]) for a in law.arrays())
    low, high, move = limits.low, limits.high, limits.move
    clamps, rebases = limits.clamps, limits.rebases
    integral = derivative = lagged = u = r_old = m_old = w_old = v_old = 0.0

    def scan(r: float, m: float, by_hand: float | None) -> float:
        nonlocal integral, derivative, lagged, u, r_old, m_old, w_old, v_old
        w = c * r - m
        derivative = dD * derivative + kD * (w - w_old)
        added = kI * (r_old - 0.5 * (m + m_old))
        integral += added
        v = kP * (b * r - m) + integral + derivative
        lagged = dF * lagged + f1 * v_old + f0 * v if dF else v
        r_old, m_old, w_old = r, m, w
        if by_hand is not None:
            integral += by_hand - v
            u = lagged = v_old = by_hand
            return u
        floor, ceiling = u - move, u + move
        u = lagged
        if u < floor:
            u = floor
        elif u > ceiling:
            u = ceiling
        if u < low:
            u = low
        elif u > high:
            u = high
        v_old = v
        if u != lagged:
            shift = track * (u - lagged)
            if not clamps:
                integral += shift
            elif (lagged - u) * added > 0:
                integral -= added
            if rebases:
                lagged += shift
                v_old += shift
        return u

    return scan


class ManyLaws:
    """Controllers of a law on their way; arrays of shape (m,) keep what the next scan needs."""

    def __init__(self, law: ScanLaw, limits: LawLimits) -> None:
        self._law, self._limits = law, limits
        self._half, self._derives, self._lags = law.kI / 2, np.any(law.kD), np.any(law.dF)
        rest: Real = np.zeros(law.kP.size)
        # Numpy compares arrays twice as fast as an array with a number.
        self._low, self._high = np.full_like(rest, limits.low), np.full_like(rest, limits.high)
        self._moves = limits.move < np.inf
        self._integral = self._derivative = self._lagged = self._u = rest
        self._m = self._w = self._v = rest
        # Share of the set point in the next integral step and in this scan's P part.
        self._r: float | Real = 0.0
        self._r_integral = self._r_proportional = rest

    def scan(self, r: float | Real, m: Real, by_hand: float | None, out: Real) -> None:
        """Take set points and measurements of one scan; write the outputs to `out`.

        Parameters
        ----------
        r : float or ndarray, shape (m,)
            Set points. [PV]
        m : ndarray, shape (m,)
            Measurements; kept until the next scan. [PV]
        by_hand : float, optional
            Output of all controllers in manual; none in automatic. [OP]
        out : ndarray, shape (m,)
            Where the outputs go; kept until the next scan. [OP]
        """
        law = self._law
        added = self._m + m
        added *= self._half
        np.subtract(self._r_integral, added, out=added)
        self._integral = self._integral + added
        if not isinstance(r, float) or r != self._r:
            self._r, self._r_integral, self._r_proportional = r, law.kI * r, law.kP * law.b * r
        v = law.kP * m
        np.subtract(self._r_proportional, v, out=v)
        v += self._integral
        if self._derives:
            w = law.c * r - m
            self._derivative = law.dD * self._derivative + law.kD * (w - self._w)
            self._w = w
            v += self._derivative
        lagged = law.dF * self._lagged + law.f1 * self._v + law.f0 * v if self._lags else v
        self._m = m
        if by_hand is None:
            self._limit(lagged, v, added, out)
        else:
            out[:] = by_hand
            self._integral = self._integral + (by_hand - v)
            self._lagged = self._v = out
        self._u = out

    def _limit(self, lagged: Real, v: Real, added: Real, out: Real) -> None:
        limits, wanted = self._limits, lagged
        if self._moves:
            wanted = np.minimum(np.maximum(wanted, self._u - limits.move), self._u + limits.move)
        np.minimum(np.maximum(wanted, self._low, out=out), self._high, out=out)
        shift = out - lagged
        if limits.clamps:
            against = shift * added < 0
            self._integral = np.where(against, self._integral - added, self._integral)
        else:
            shift *= self._law.track
            if limits.rebases:
                self._go_on_from(lagged + shift, shift, v)
                return
            self._integral += shift
        self._lagged, self._v = lagged, v

    def _go_on_from(self, lagged: Real, shift: Real, v: Real) -> None:
        self._integral = self._integral + shift
        self._lagged, self._v = lagged, v + shift


class Smoothing:
    """First-order filter of a measurement, exact for a straight line between two scans.

    mF = d mF' + f1 m' + f0 m with d = e^(-dt/T), l = (1 - d) T/dt, f0 = 1 - l, f1 = l - d
    """

    def __init__(self, T: float, dt: float) -> None:
        self._d = float(np.exp(-dt / T))
        part = (1 - self._d) * T / dt
        self._f0, self._f1 = 1 - part, part - self._d
        self._held: float | Real = 0.0
        self._m: float | Real = 0.0

    def of_one(self, m: float) -> float:
        """Take the measurement of one scan; give the filtered one. [PV]"""
        held = float(self._d * self._held + self._f1 * self._m + self._f0 * m)
        self._held, self._m = held, m
        return held

    def of_many(self, m: Real) -> Real:
        """Take the measurements of one scan, shape (m,); give the filtered ones. [PV]"""
        held = np.asarray(self._d * self._held + self._f1 * self._m + self._f0 * m)
        self._held, self._m = held, m
        return held
