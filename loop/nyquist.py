"""Nyquist's count of encirclements, Z = N + P, taken from the curve itself."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.crossovers import gain_cuts
from loop.factors import FactoredLoop
from loop.process import Process
from loop.signals import Complex, Real
from loop.winding import turning

# Radius of the detour around a pole on the axis, over the distance to whatever is next.
DETOUR = 1e-3
POINTS_A_HALF_TURN = 33
POINTS_A_PERIOD = 16
MOST_PERIODS = 5_000
# Real parts smaller than this, over the size, are rounding.
ON_THE_AXIS = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class NyquistCount:
    """Encirclements of -1 by L along the axis, closed around the right half-plane.

    Attributes
    ----------
    encirclements : int
        N, clockwise turns of L about -1. [-]
    open_loop : int
        P, poles of L in the open right half-plane; those on the axis are passed on their right.
    closed_loop : int
        Z = N + P, poles of the closed loop in the open right half-plane.
    """

    encirclements: int
    open_loop: int
    closed_loop: int


def nyquist_count(process: Process, controller: PID) -> NyquistCount:
    """Count the encirclements of a loop with exact dead time.

    A route of its own beside the direct method of `loop.stability`: the curve is followed, poles
    on the axis are passed on a small half circle to their right, and its turns about -1 counted.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.

    Raises
    ------
    ValueError
        L passes through -1, or does not fall below 1 at high frequency, so that the curve never
        leaves -1 alone.
    """
    loop = FactoredLoop.of(process, controller)
    if loop.excess < 0 or (loop.excess == 0 and loop.log_k >= 0):
        raise ValueError("L stays above 1 at high frequency: its encirclements have no end")
    cuts = gain_cuts(loop)
    poles = loop.poles
    on_axis = np.abs(poles.real) <= ON_THE_AXIS * np.abs(poles)
    heights = np.unique(np.abs(poles[on_axis].imag))
    w = cuts.w if not cuts.wc.size else cuts.w[cuts.w <= 2 * cuts.wc[-1]]
    if not cuts.wc.size:  # |L| < 1 throughout: -1 is never encircled
        w = cuts.w[:1]
    if loop.theta > 0:
        period = 2 * math.pi / loop.theta
        periods = float(w[-1]) / period
        if periods > MOST_PERIODS:
            raise ValueError(
                f"the loop turns {periods:.3g} times before it is small: too often to follow"
            )
        w = np.union1d(w, np.arange(1, math.ceil(periods * POINTS_A_PERIOD)) * period / 16)
    right = int(np.sum((poles.real > 0) & ~on_axis))
    turns = encirclements(lambda s: _rational_point(loop, s), w, heights.tolist())
    return NyquistCount(encirclements=turns, open_loop=right, closed_loop=turns + right)


def encirclements(L: Callable[[Complex], Complex], w: Real, axis_poles: Sequence[float]) -> int:
    """Count the clockwise turns of L(s) about -1, for s once around the right half-plane.

    Parameters
    ----------
    L : callable
        Loop of real coefficients, of complex s of shape (n,). |L| < 1 from the last frequency on.
    w : ndarray, shape (n,)
        Ascending positive frequencies, dense enough to follow L. [rad/s]
    axis_poles : sequence of float
        Frequencies, 0 for the origin, at which L is infinite. [rad/s]

    Raises
    ------
    ValueError
        L passes through -1.
    """
    heights = sorted(set(axis_poles))
    path: list[Complex] = []
    last = 0.0
    if heights and heights[0] == 0.0:
        last = DETOUR * float(min(w[0], *heights[1:], math.inf))
        path.append(last * np.exp(1j * np.linspace(0, math.pi / 2, POINTS_A_HALF_TURN)))
        heights = heights[1:]
    else:
        path.append(np.array([0j]))
    for i, height in enumerate(heights):
        neighbours = [height - last, *(h - height for h in heights[i + 1 : i + 2])]
        radius = DETOUR * min(neighbours)
        between = w[(w > last) & (w < height - radius)]
        path.append(1j * between)
        around = np.linspace(-math.pi / 2, math.pi / 2, POINTS_A_HALF_TURN)
        path.append(1j * height + radius * np.exp(1j * around))
        last = height + radius
    path.append(1j * np.union1d(w[w > last], [max(float(w[-1]), last * 1.001)]))
    s = np.concatenate(path)
    upper = turning(lambda points: 1 + L(points), s)
    # From the last point L only shrinks to 0, and 1 + L back to 1 without a turn.
    upper -= float(np.angle(1 + L(s[-1:]))[0])
    # It starts on the real axis, so this is whole; the lower half of the axis mirrors the upper.
    return round(-upper / math.pi)


def _rational_point(loop: FactoredLoop, s: Complex) -> Complex:
    """L at points of the plane off its poles."""
    log = np.full(s.shape, loop.log_k, dtype=complex) - loop.theta * s
    zero = np.zeros(s.shape, dtype=bool)
    for root in loop.zeros:
        zero |= s == root
        log = log + np.log(np.where(s == root, 1.0, s - root))
    for root in loop.poles:
        log = log - np.log(s - root)
    return np.where(zero, 0.0, loop.sign * np.exp(log))
