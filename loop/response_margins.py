"""Margins of a loop that is known only by its response, as that of a predictor or a cascade is.

`loop.margins` is exact and needs poles, zeros and one dead time; here the response is followed on
a grid, and every crossing and peak is refined on the response itself.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from loop.bracket_solver import solve_brackets
from loop.errors import UnstableLoop
from loop.margins import Margins
from loop.nyquist import encirclements
from loop.signals import Complex, Real

Loop: TypeAlias = Callable[[Complex], Complex]
Places: TypeAlias = npt.NDArray[np.intp]
# Crossings refined on either side: grid and curve may disagree on which one is nearest.
CANDIDATES = 3
# Each look divides a peak's stretch by 16: four of them, and the value stands to 1e-9.
CLOSER, INSIDE = 4, 33


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResponseLoop:
    """An open loop by its response, with what the response alone does not tell.

    Attributes
    ----------
    L : callable
        Loop of real coefficients, of complex s of shape (n,). [-]
    w : ndarray, shape (n,)
        Ascending frequencies, dense enough to follow L; |L| < 1 from the last on. [rad/s]
    axis_poles : tuple of float
        Frequencies on the axis, 0 for the origin, at which L is infinite. [rad/s]
    unstable_poles : int
        Poles of L in the open right half-plane.
    """

    L: Loop
    w: Real
    axis_poles: tuple[float, ...] = (0.0,)
    unstable_poles: int = 0


def response_margins(loop: ResponseLoop) -> Margins:
    """Find the margins of a loop from its response, after deciding that it is stable.

    Parameters
    ----------
    loop : ResponseLoop
        Open loop.

    Raises
    ------
    UnstableLoop
        The closed loop is unstable.
    ValueError
        The loop stands on the stability limit.
    """
    unstable = encirclements(loop.L, loop.w, loop.axis_poles) + loop.unstable_poles
    if unstable:
        raise UnstableLoop(unstable)
    w = loop.w
    L = loop.L(1j * w)
    wc = _roots(lambda v: np.log(np.abs(loop.L(1j * v))), w, _changes(np.log(np.abs(L))))
    w180 = _roots(lambda v: loop.L(1j * v).imag, w, _nearest_crossings(L))
    inverse = 1 / np.abs(loop.L(1j * w180))
    turns = np.mod(math.pi + np.angle(loop.L(1j * wc)), 2 * math.pi)
    return Margins(
        gain=float(np.min(inverse[inverse > 1], initial=math.inf)),
        gain_reduction=float(np.max(inverse[inverse < 1], initial=0.0)),
        phase=math.degrees(np.min(np.minimum(turns, 2 * math.pi - turns), initial=math.inf)),
        delay=float(np.min(turns / wc, initial=math.inf)),
        # S is 1 at high frequency, and T is 1 at rest where the loop integrates.
        Ms=max(1.0, _peak(lambda v: np.abs(1 / (1 + loop.L(1j * v))), w)),
        Mt=max(
            float(0.0 in loop.axis_poles),
            _peak(lambda v: np.abs(1 - 1 / (1 + loop.L(1j * v))), w),
        ),
    )


def _changes(values: Real) -> Places:
    return np.flatnonzero(np.sign(values[1:]) != np.sign(values[:-1]))


def _nearest_crossings(L: Complex) -> Places:
    """Where L crosses the real axis on the left, the few on either side of -1 nearest to it."""
    at = _changes(L.imag)
    at = at[L.real[at] < 0]
    size = np.abs(L[at])
    outside, inside = at[size >= 1], at[size < 1]
    return np.concatenate(
        [
            outside[np.argsort(np.abs(L[outside]))][:CANDIDATES],
            inside[np.argsort(-np.abs(L[inside]))][:CANDIDATES],
        ]
    )


def _roots(f: Callable[[Real], Real], w: Real, at: Places) -> Real:
    return solve_brackets(f, w[at], w[at + 1]) if at.size else np.array([])


def _peak(f: Callable[[Real], Real], w: Real) -> float:
    """Largest value, looked for ever closer around the largest on the grid."""
    values = f(w)
    for _ in range(CLOSER):
        i = int(np.argmax(values))
        if i in (0, w.size - 1):
            break
        w = np.linspace(w[i - 1], w[i + 1], INSIDE)
        values = f(w)
    return float(np.max(values))


def following_grid(corners: Sequence[float], top: float, dead_time: float) -> Real:
    """Frequencies that follow a response with dead time up to where it has become small. [rad/s]

    Parameters
    ----------
    corners : sequence of float
        Corner frequencies of its rational parts, all positive. [rad/s]
    top : float
        Where |L| stays below 1. [rad/s]
    dead_time : float
        Longest sum of dead times around the loop, 0 for none. [s]
    """
    low = min(*corners, top) / 1e3
    w = np.geomspace(low, top, 400)
    if dead_time:
        step = math.pi / (16 * dead_time)
        count = math.ceil(top / step)
        if count > 50_000:
            raise ValueError(
                f"the loop turns {count / 32:.3g} times before it is small: too often to follow"
            )
        w = np.union1d(w, step * np.arange(1, count + 1))
    return w
