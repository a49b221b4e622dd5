"""The largest controller gain that keeps limits on a set of plants, for many controller shapes.

At one frequency a limit forbids an interval of loop gains. For the angle delta between L and -180°
and r = |L|:

    Ms:  1 + r^2 - 2 r cos(delta) < 1/Ms^2
    Mt:  r^2 > Mt^2 (1 + r^2 - 2 r cos(delta))
    gain margin A:  1/A < r <= 1 at delta = 0;  phase margin:  r = 1 at delta < phase
    effort M:  |C| > M |1 + L|

The gain wanted is the largest one that no plant forbids at any frequency, below the first that is
unstable: it is reached from the ultimate gain downwards, through intervals that overlap.
"""

import math

import numpy as np

from loop.signals import Flags, Real
from tuning.box_bounds import TURN, least_angle
from tuning.error_area import Shapes
from tuning.loop_limits import LoopLimits
from tuning.plant_set import PlantSet

# A gap between intervals counts where the gain may fall by this within it, in ln Kc: narrower ones
# are the frequency grid's, or settings that no 8 % of error survive.
SLACK = 0.08
STEPS = 40


def largest_gains(plants: PlantSet, shapes: Shapes, limits: LoopLimits) -> Real:
    """Find the largest gain of each controller shape that keeps all limits on all plants.

    Parameters
    ----------
    plants : PlantSet
        Plants; the first is the model, on which the effort is limited.
    shapes : Shapes
        m controllers of gain 1.
    limits : LoopLimits
        What to keep.

    Returns
    -------
    ndarray, shape (m,)
        Gains [OP/PV], to the accuracy of the grid; 0 where there is none.
    """
    C = shapes.response(1j * plants.w[None])
    log_C, arg_C = np.log(np.abs(C)), np.unwrap(np.angle(C), axis=1)
    log_r = log_C[:, None] + plants.log_gain
    phase = arg_C[:, None] + plants.phase
    low = phase - plants.theta_high[:, None] * plants.w
    high = phase - plants.theta_low[:, None] * plants.w
    delta = least_angle(low, high)
    least, most = np.log(plants.gain_low)[:, None], np.log(plants.gain_high)[:, None]
    # Bounds are kept as logarithms of the controller gain.
    intervals: list[tuple[Real, Real]] = [
        (a - most - log_r, b - least - log_r) for a, b in _circles(np.cos(delta), limits)
    ]
    start, ultimate = _ultimate(log_r + most, low)
    intervals += _crossings(log_r, low, delta, limits, least, most)
    intervals += _unit_circle(log_r, delta, plants, limits, least, most)
    if math.isfinite(limits.effort):
        intervals.append(_effort(log_C, log_r[:, 0], np.cos(delta[:, 0]), limits.effort))
    m = log_C.shape[0]
    smooth = intervals[0][0]
    lows = np.concatenate([a.reshape(m, -1) for a, _ in intervals], axis=1)
    highs = np.concatenate([b.reshape(m, -1) for _, b in intervals], axis=1)
    gain = ultimate
    for _ in range(STEPS):
        reached = (lows < gain[:, None]) & (highs > gain[:, None] - SLACK)
        lower = np.min(lows, axis=1, where=reached, initial=np.inf)
        moved = lower < gain
        gain = np.where(moved, lower, gain)
        if not moved.any():
            break
    gain = _between(smooth, gain)
    return np.asarray(np.where(start & np.isfinite(gain), np.exp(gain), 0.0))


def _circles(cos: Real, limits: LoopLimits) -> list[tuple[Real, Real]]:
    """Logarithms of the loop gains that Ms and Mt forbid; an empty interval is (inf, -inf)."""
    found = []
    q = 1 - 1 / limits.Ms**2
    root = np.sqrt(np.maximum(cos * cos - q, 0.0))
    found.append(_where((cos > 0) & (cos * cos > q), q / (cos + root), cos + root))
    if math.isfinite(limits.Mt):
        part = 1 - 1 / limits.Mt**2
        root = np.sqrt(np.maximum(cos * cos - part, 0.0))
        found.append(_where((cos > 0) & (cos * cos > part), 1 / (cos + root), (cos + root) / part))
    return found


def _where(inside: Flags, low: Real, high: Real) -> tuple[Real, Real]:
    a = np.log(np.where(inside, low, 1.0))
    b = np.log(np.where(inside, high, 1.0))
    return np.where(inside, a, np.inf), np.where(inside, b, -np.inf)


def _ultimate(log_r: Real, low: Real) -> tuple[Flags, Real]:
    """Whether the phase falls through -180° for every plant, and where the first is unstable."""
    above = low > -math.pi
    last = above.shape[2] - 1 - np.argmax(above[:, :, ::-1], axis=2)
    crosses = above.any(axis=2) & (last < above.shape[2] - 1)
    last = np.minimum(last, above.shape[2] - 2)[..., None]
    phases = np.concatenate(
        [np.take_along_axis(low, last, 2), np.take_along_axis(low, last + 1, 2)], axis=2
    )
    sizes = np.concatenate(
        [np.take_along_axis(log_r, last, 2), np.take_along_axis(log_r, last + 1, 2)], axis=2
    )
    drop = phases[..., 0] - phases[..., 1]
    part = np.clip((phases[..., 0] + math.pi) / np.where(drop > 0, drop, 1.0), 0.0, 1.0)
    size = sizes[..., 0] + part * (sizes[..., 1] - sizes[..., 0])
    return crosses.all(axis=1), np.asarray(np.min(-size, axis=1))


def _crossings(
    log_r: Real, low: Real, delta: Real, limits: LoopLimits, least: Real, most: Real
) -> list[tuple[Real, Real]]:
    """Gains whose margin is too small where the phase passes an odd multiple of -180°."""
    if limits.gain == 1:
        return []
    width = math.log(limits.gain)
    inside = delta == 0
    found = [
        (
            np.where(inside, -width - most - log_r, np.inf),
            np.where(inside, -least - log_r, -np.inf),
        )
    ]
    turn = np.floor((low + math.pi) / TURN)
    falls = turn[..., 1:] < turn[..., :-1]
    level = TURN * turn[..., :-1] - math.pi
    drop = low[..., :-1] - low[..., 1:]
    part = (low[..., :-1] - level) / np.where(drop > 0, drop, 1.0)
    size = log_r[..., :-1] + part * np.diff(log_r, axis=2)
    found.append(
        (np.where(falls, -width - most - size, np.inf), np.where(falls, -least - size, -np.inf))
    )
    return found


def _unit_circle(
    log_r: Real, delta: Real, plants: PlantSet, limits: LoopLimits, least: Real, most: Real
) -> list[tuple[Real, Real]]:
    """Gains that put |L| = 1 where the angle to -180° is below the phase or the delay margin."""
    if limits.phase == 0 and limits.delay_over_theta == 0:
        return []
    own = limits.delay_over_theta * np.maximum(plants.theta_high - plants.hold, 0.0)
    wanted = np.maximum(math.radians(limits.phase), own[:, None] * plants.w)
    spare = delta - wanted
    here, there = spare[..., :-1], spare[..., 1:]
    bad = np.minimum(here, there) < 0
    slope = np.where(here != there, here - there, 1.0)
    root = np.clip(here / slope, 0.0, 1.0)
    first, last = np.where(here < 0, 0.0, root), np.where(there < 0, 1.0, root)
    step = np.diff(log_r, axis=2)
    a, b = -log_r[..., :-1] - first * step, -log_r[..., :-1] - last * step
    return [
        (
            np.where(bad, np.minimum(a, b) - most, np.inf),
            np.where(bad, np.maximum(a, b) - least, -np.inf),
        )
    ]


def _effort(log_C: Real, log_r: Real, cos: Real, effort: float) -> tuple[Real, Real]:
    """Gains k with k|C| > M |1 + k L|, that is (|C|/M)^2 k^2 > 1 + k^2 r^2 - 2 k r cos."""
    r = np.exp(log_r)
    side = r * cos
    square = np.exp(2 * log_C) / effort**2 - r * r
    root = np.sqrt(np.maximum(side * side + square, 0.0))
    over = square > 0
    turns = (square < 0) & (side > 0) & (side * side + square > 0)
    low = np.where(over | turns, 1 / np.where(over | turns, side + root, 1.0), 1.0)
    high = np.where(turns, 1 / np.where(turns, side - root, 1.0), 1.0)
    return (
        np.where(over | turns, np.log(np.where(low > 0, low, 1.0)), np.inf),
        np.where(over, np.inf, np.where(turns, np.log(np.where(high > 0, high, 1.0)), -np.inf)),
    )


def _between(lows: Real, gain: Real) -> Real:
    """Lower a gain to the dip between grid points, by a parabola through three bounds of Ms."""
    m, plants, k = lows.shape
    flat = lows.reshape(m, -1)
    at = np.argmin(np.abs(flat - gain[:, None]), axis=1)
    row = np.arange(m)
    inner = (at % k > 0) & (at % k < k - 1) & (flat[row, at] == gain)
    three = np.clip(at[:, None] + np.array([-1, 0, 1]), 0, plants * k - 1)
    left, middle, right = flat[row[:, None], three].T
    inner &= np.isfinite(left) & np.isfinite(right)
    left, right = np.where(inner, left, 0.0), np.where(inner, right, 0.0)
    good = inner & (left >= middle) & (right >= middle)
    bend = np.where(good, left - 2 * middle + right, 1.0)
    tilt = np.where(good, right - left, 0.0)
    return np.asarray(gain - np.where(good & (bend > 0), tilt * tilt / (8 * bend), 0.0))
