"""Bode's sensitivity integral: what feedback gains at one frequency it loses at another."""

import math
from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.crossovers import gain_cuts
from loop.errors import UnstableLoop
from loop.factors import FactoredLoop
from loop.process import Process
from loop.signals import Real
from loop.stability import count_unstable_poles

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
# Where L is this small, ln S = -L to within its square.
SMALL = 1e-4
PERIODS_TO_TAIL = 50
MOST_PANELS = 400_000
DECADES_BEYOND = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class BodeIntegral:
    """The integral of ln|S| over all frequencies, and what it has to be.

    Attributes
    ----------
    integral : float
        Computed int_0^inf ln|S(jw)| dw. [rad/s]
    expected : float
        pi sum Re p over the unstable open-loop poles; less pi/2 lim s L(s) where L falls with
        1/s only and there is no dead time. [rad/s]
    """

    integral: float
    expected: float


def bode_integral(process: Process, controller: PID) -> BodeIntegral:
    """Integrate ln|S| over all frequencies and compare with Bode's law [1]_.

    int_0^inf ln|S(jw)| dw = pi sum Re p, for a stable closed loop whose L falls at least with
    1/s^2, or with 1/s and a dead time.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.

    Raises
    ------
    UnstableLoop
        The closed loop is unstable.
    ValueError
        L does not fall to 0 at high frequency, so that the integral does not exist, or the dead
        time is too long against the crossover to follow it.

    References
    ----------
    .. [1] J. S. Freudenberg, D. P. Looze, "Right half plane poles and zeros and design tradeoffs
       in feedback systems", IEEE Trans. Automatic Control 30 (1985) 555-565 (from memory).
    """
    loop = FactoredLoop.of(process, controller)
    cuts = gain_cuts(loop)
    unstable = count_unstable_poles(loop, cuts)
    if unstable:
        raise UnstableLoop(unstable)
    if loop.excess < 1:
        raise ValueError("L does not fall to 0 at high frequency: the integral does not exist")
    expected = math.pi * float(np.sum(loop.poles.real[loop.poles.real > 0]))
    if loop.excess == 1 and not loop.theta:
        expected -= 0.5 * math.pi * loop.sign * math.exp(loop.log_k)
    edges, tail = _panels(loop, cuts.w)
    middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    total = 0.0
    for at in range(0, middle.size, 4096):
        part = slice(at, at + 4096)
        w = middle[part, None] + half[part, None] * NODES
        heights = _log_sensitivity(loop, w.ravel()).reshape(w.shape)
        total += float(np.sum((heights @ WEIGHTS) * half[part]))
    # Below the first edge |S| follows a power of w.
    first = edges[:1]
    total += float(first[0] * (_log_sensitivity(loop, first)[0] - max(loop.integrators, 0)))
    return BodeIntegral(integral=total + tail, expected=expected)


def _log_sensitivity(loop: FactoredLoop, w: Real) -> Real:
    """ln|S| = -ln|1 + L|, from the logarithm of L where that is large."""
    size, phase = loop.log_gain(w), loop.phase(w)
    large = size > 30
    r = np.where(large, 0.0, np.exp(np.minimum(size, 30.0)))
    near = -0.5 * np.log1p(r * (r + 2 * np.cos(phase)))
    return np.asarray(np.where(large, -size, near))


def _panels(loop: FactoredLoop, w: Real) -> tuple[Real, float]:
    """Edges of the panels, and the integral beyond the last."""
    if not loop.theta:
        # |L| falls by its excess a decade: after this many more it is rounding.
        top = float(w[-1])
        more = top * 10.0 ** np.linspace(0, DECADES_BEYOND, 8 * DECADES_BEYOND + 1)
        return _refined_edges(np.union1d(w, more)), 0.0
    loud = w[loop.log_gain(w) > math.log(SMALL)]
    top = max(float(loud[-1]) if loud.size else 0.0, PERIODS_TO_TAIL * 2 * math.pi / loop.theta)
    step = math.pi / (2 * loop.theta)
    count = math.ceil(top / step)
    if count > MOST_PANELS:
        raise ValueError(
            f"the loop turns {count / 4:.3g} times before it is small: too often to integrate"
        )
    edges = np.union1d(w[w < top], step * np.arange(1, count + 1))
    last = edges[-1:]
    # One integration by parts: int_W^inf L dw = -L/(d ln L/dw) to within its square over L.
    L = complex(loop.response(last)[0])
    slope = complex(loop.gain_slope(last)[0], loop.phase_slope(last)[0]) / float(last[0])
    return _refined_edges(edges), (L / slope).real


def _refined_edges(edges: Real) -> Real:
    """Halve every panel, which the narrow ones at a resonance need."""
    return np.union1d(edges, 0.5 * (edges[1:] + edges[:-1]))
