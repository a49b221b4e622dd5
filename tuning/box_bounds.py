"""How bad a margin can be where L is known to lie in a piece of a ring.

For |L| in [r1, r2] and a phase that comes as close to -180° as delta, the least distance is
|1 + L|^2 = (1 - r)^2 + 4 r sin^2(delta/2) at r = cos(delta), or at the nearer end. |T| is |S| of
1/L. Badness is Ms, Mt, 1/gain margin, 1/phase margin [1/rad] and 1/delay margin [1/s]: large is
bad, 0 is where a margin does not exist.
"""

import math

import numpy as np

from loop.signals import Real
from tuning.uncertain_loop import LARGEST_LOG, Enclosure, UncertainLoop

TURN = 2 * math.pi
MARGINS = ("Ms", "Mt", "gain", "phase", "delay")


def least_angle(low: Real, high: Real) -> Real:
    """Least angle between -180° and phases from low to high, shape (n,). [rad]"""
    a, b = low + math.pi, high + math.pi
    below = np.mod(a, TURN)
    inside = np.floor(a / TURN) != np.floor(b / TURN)
    return np.where(inside, 0.0, np.minimum(below, TURN - np.mod(b, TURN)))


def least_distance(low: Real, high: Real, delta: Real) -> tuple[Real, Real]:
    """Least |1 + r e^(j(pi - delta))| for r from low to high, and the r where it is."""
    r = np.clip(np.cos(delta), low, high)
    half = np.sin(0.5 * delta)
    return np.hypot(1 - r, 2 * np.sqrt(r) * half), r


def badness(loop: UncertainLoop, where: Enclosure) -> Real:
    """Bound the badness of the five margins over cells, or give it at points.

    A larger gain always has the smaller gain margin and a longer dead time the smaller delay
    margin, as long as no plant of the box is unstable: those two are taken at the ends of K and of
    theta. The other three take the worst of K and theta in closed form.

    Parameters
    ----------
    loop : UncertainLoop
        The loop.
    where : Enclosure
        Cells or points, shape (n,).

    Returns
    -------
    ndarray, shape (5, n)
    """
    size_low = np.exp(np.clip(where.log_low, -LARGEST_LOG, LARGEST_LOG))
    size_high = np.exp(np.clip(where.log_high, -LARGEST_LOG, LARGEST_LOG))
    low, high = loop.gain_low * size_low, loop.gain_high * size_high
    delta = least_angle(where.phase_low, where.phase_high)
    found = np.zeros((5, delta.size))
    with np.errstate(divide="ignore"):
        found[0] = 1 / least_distance(low, high, delta)[0]
        found[1] = 1 / least_distance(1 / high, 1 / low, delta)[0]
        crosses = (delta == 0) & (loop.gain_high * size_low < 1)
        found[2] = np.where(crosses, np.minimum(high, 1.0), 0.0)
        unit = (low <= 1) & (high >= 1)
        found[3] = np.where(unit, 1 / delta, 0.0)
        a, b = where.phase_low + math.pi, where.late_high + math.pi
        lag = np.where(np.floor(a / TURN) == np.floor(b / TURN), np.mod(a, TURN), 0.0)
        found[4] = np.where(unit, where.w_high / lag, 0.0)
    return found
