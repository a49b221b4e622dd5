"""Exact count of the unstable poles of a loop with dead time."""

import math

import numpy as np

from loop.controller import PID
from loop.crossovers import GainCuts, gain_cuts
from loop.errors import INFINITELY_MANY
from loop.factors import FactoredLoop, polynomial_roots
from loop.process import Process
from loop.signals import Complex, Real

# A pole this close to the imaginary axis lies on it to within rounding.
ON_THE_AXIS = 1e-9
ROUNDING = 1e-14
LARGEST_LOG = 300.0


def unstable_poles(process: Process, controller: PID, *, delay: float = 0.0) -> int:
    """Count the closed-loop poles that are not in the open left half-plane [1]_.

    The characteristic equation is d(s) + n(s) e^(-theta s) = 0. Without dead time the poles are
    the roots of a polynomial. As theta grows, poles cross the imaginary axis only where
    |d(jw)| = |n(jw)|, that is at gain crossovers, whenever w theta passes arg L + pi (mod 2 pi):
    to the right where |L| falls with w, back to the left where it rises.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    delay : float
        Dead time on top of the process's own. [s]

    Returns
    -------
    int
        Number of poles with a real part of 0 or more; 0 means stable. `INFINITELY_MANY` where the
        loop gain does not fall below 1 at high frequency around a dead time, as with an unfiltered
        derivative on a first-order process.

    Raises
    ------
    ValueError
        The delay lies outside 0 to 1e30 s, or the loop has no sensible scale.

    References
    ----------
    .. [1] K. Walton, J. E. Marshall, "Direct method for TDS stability analysis", IEE Proceedings D
       134 (1987) 101-107.
    """
    loop = FactoredLoop.of(process, controller, delay=delay)
    return count_unstable_poles(loop, gain_cuts(loop))


def count_unstable_poles(loop: FactoredLoop, cuts: GainCuts) -> int:
    """Count the unstable closed-loop poles of a factored loop.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop.
    cuts : GainCuts
        Its gain crossovers.
    """
    if loop.theta > 0 and (loop.excess < 0 or (loop.excess == 0 and loop.log_k > -ROUNDING)):
        return INFINITELY_MANY
    wc, w = cuts.wc, cuts.w
    if loop.theta == 0:
        roots, lost = _poles_without_dead_time(loop, float(wc[-1] if wc.size else w[w.size // 2]))
        return int(np.sum(roots.real >= -ON_THE_AXIS * np.abs(roots))) + lost
    if not wc.size:
        # Rouche: the smaller of d and n does not move a zero of the larger across the axis.
        larger = loop.poles if loop.log_gain(w[:1])[0] < 0 else loop.zeros
        return int(np.sum(larger.real >= 0)) + _stands_at_origin(loop)
    leaves_right = loop.gain_slope(wc) < 0
    # Phase to lose until a pole pair reaches the axis.
    lag = np.mod(loop.phase(wc) + wc * loop.theta + math.pi, 2 * math.pi)
    on_axis = np.minimum(lag, 2 * math.pi - lag) < ON_THE_AXIS
    roots, lost = _poles_without_dead_time(loop, float(wc[-1]))
    for w_axis in np.concatenate([wc[on_axis], -wc[on_axis]]):
        roots = np.delete(roots, np.argmin(np.abs(roots - 1j * w_axis)))
    # A pair that starts on the axis leaves it at once: to the right, or to the left until it comes
    # back after a whole turn.
    lag = np.where(on_axis, np.where(leaves_right, 0.0, 2 * math.pi), lag)
    slack = ON_THE_AXIS * np.where(leaves_right, 1.0, -1.0)
    visits = np.maximum(np.floor((wc * loop.theta - lag + slack) / (2 * math.pi)) + 1, 0.0)
    crossed = 2 * int(np.sum(np.where(leaves_right, visits, -visits)))
    return int(np.sum(roots.real >= 0)) + lost + crossed


def _stands_at_origin(loop: FactoredLoop) -> int:
    """1 where L(0) = -1, which puts a pole at the origin whatever the dead time."""
    sign, log_size = loop.origin
    return int(loop.integrators == 0 and sign < 0 and abs(log_size) < ROUNDING)


def _poles_without_dead_time(loop: FactoredLoop, unit: float) -> tuple[Complex, int]:
    """Roots of d + n, those at the origin exactly, and how many L(infinity) = -1 sends to infinity.

    The unit of frequency is one where d and n are of one size. [rad/s]
    """
    d, n = _polynomial(loop.poles / unit), _polynomial(loop.zeros / unit)
    size = math.exp(min(max(float(loop.log_gain(np.array([unit]))[0]), -LARGEST_LOG), LARGEST_LOG))
    size *= float(abs(np.polyval(d, 1j)) / abs(np.polyval(n, 1j)))
    degree = max(d.size, n.size)
    d, n = (np.pad(p, (degree - p.size, 0)) for p in (d, loop.sign * size * n))
    total = np.where(np.abs(d + n) <= ROUNDING * (np.abs(d) + np.abs(n)), 0.0, d + n)
    inner = np.trim_zeros(total, "f")
    return polynomial_roots(tuple(inner)) * unit, total.size - inner.size


def _polynomial(roots: Complex) -> Real:
    """Multiply out prod(s - root), each factor scaled to coefficients of at most 1."""
    product = np.ones(1, dtype=complex)
    for root in roots:
        product = np.convolve(product, np.array([1.0, -root]) / max(1.0, abs(root)))
    return np.asarray(product.real)
