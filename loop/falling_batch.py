"""Margins of many ordinary loops at once: those whose gain falls all the way.

Then there is one gain crossover, and the loop is stable exactly if the phase there is above -180°.
The first phase crossover above it bounds the gain. That no other lies below is proven between
neighbouring points, and what cannot be proven is handed back to the full scan. A loop without
integrator whose gain starts below 1 has no gain crossover and is stable; its first phase crossover
bounds the gain just so.
"""

import math

import numpy as np

from loop.batch import MarginBatch
from loop.lag_loops import LagLoops
from loop.signals import Flags, Real
from loop.stability import ON_THE_AXIS, ROUNDING
from loop.unit_dead_time import Rows, UnitDeadTime

# Powers of time constants, in units of the dead time, stay far from overflow within these.
LARGEST_RATIO = 1e8
LARGEST_LOG_SQUARE = 55.0
STEPS = 14
CLOSE = 1e-7
PEAK_ACCURACY, NEAR_PEAK, EXACT = 1e-7, 1e-2, 1e-13
# Below this part of the lowest corner |T| differs from its start by the fourth power at most.
ASYMPTOTE = 3e-3
BELOW = (np.arange(28, 0, -1)[:, None] / 28) ** 2
ABOVE = np.arange(17)[:, None] / 15
FIRST_LOOK = np.arange(11)[:, None] / 10
# Summits this close to the highest, point by point, might be the higher ones between them.
RIVAL = 0.64
# Loops at a time on all points: a dozen arrays of this many by 45 fit the processor's cache.
AT_A_TIME = 256


def falling_margins(loops: LagLoops) -> tuple[MarginBatch, Flags]:
    """Find the margins of the loops whose gain provably falls all the way.

    Parameters
    ----------
    loops : LagLoops
        Open loops, shape (n,).

    Returns
    -------
    margins : MarginBatch
        Margins of shape (n,), meaningless where not proven.
    proven : ndarray of bool, shape (n,)
        Loops whose margins are final.
    """
    n = loops.size
    proven, stable = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    gain, phase, delay = np.zeros(n), np.zeros(n), np.zeros(n)
    Ms, Mt = np.full(n, math.inf), np.full(n, math.inf)
    rows = np.flatnonzero(_falls(loops))
    if rows.size:
        shape = UnitDeadTime.of(loops if rows.size == n else loops.take(rows))
        w, crossed = _anchor(shape)
        above = shape.above(w, w * w)
        proven[rows[crossed & (above < ON_THE_AXIS)]] = True
        kept = np.flatnonzero(crossed & (above >= ON_THE_AXIS))
        if kept.size:
            if kept.size < rows.size:
                shape, w, above = shape.take(kept), w[kept], above[kept]
            rows = rows[kept]
            found = _stable_margins(shape, w, above)
            gain[rows], phase[rows], delay[rows], Ms[rows], Mt[rows], proven[rows] = found
            delay[rows] *= loops.theta[rows]
            weak = rows[shape.weak]
            phase[weak], delay[weak] = math.inf, math.inf
            stable[rows] = True
    margins = MarginBatch(
        stable=stable,
        gain=gain,
        gain_reduction=np.zeros(n),
        phase=phase,
        delay=delay,
        Ms=Ms,
        Mt=Mt,
    )
    return margins, proven


def _falls(loops: LagLoops) -> Flags:
    """Whether |L| falls at every frequency, from above 1 to 0, by a sufficient condition.

    d ln|L|^2/d ln x = (beta x + 2 c^2 x^2)/(1 + beta x + c^2 x^2) - order - sum T^2 x/(1 + T^2 x).
    """
    theta = loops.theta
    slowest = np.zeros_like(theta)
    for T in loops.lags:
        slowest = np.maximum(slowest, T)
    beta = loops.b * loops.b - 2 * loops.c
    lag_wins = loops.c * loops.c <= beta * slowest * slowest
    no_second_zero = (loops.c == 0) & ((loops.order >= 1) | (loops.b <= slowest))
    falls = no_second_zero | ((beta >= 0) & ((loops.order >= 2) | ((loops.order == 1) & lag_wins)))
    longest = np.maximum(np.maximum(slowest, loops.b), np.sqrt(loops.c))
    sane = (theta > 0) & (longest <= LARGEST_RATIO * theta)
    return np.asarray(
        falls
        & sane
        & (loops.sign > 0)
        & (loops.excess >= 1)
        & (loops.order <= 2)
        & ((loops.order >= 1) | (np.abs(loops.log_k) > ON_THE_AXIS))
    )


def _anchor(shape: UnitDeadTime) -> tuple[Real, Flags]:
    """A frequency below the first phase crossover, and whether it was found.

    That is the gain crossover or, where the gain is below 1 everywhere, one at which lags and dead
    time take 1 rad at most.
    """
    weak = shape.weak
    if not weak.any():
        return _gain_crossover(shape)
    w = 1 / (1 + sum(shape.lags, np.zeros(weak.size)))
    crossed = weak.copy()
    strong = np.flatnonzero(~weak)
    if strong.size:
        w[strong], crossed[strong] = _gain_crossover(shape.take(strong))
    return w, crossed


def _gain_crossover(shape: UnitDeadTime) -> tuple[Real, Flags]:
    """Solve |L| = 1 by Newton's method on the Bode plot; also whether that converged."""
    u = np.clip(2 * shape.log_k / np.maximum(shape.order, 1.0), -20.0, 20.0)
    for _ in range(STEPS):
        x = np.exp(u)
        zeros = shape.zeros(x)
        slope = x * (shape.beta + 2 * shape.c2 * x) / zeros - shape.order
        product: Real = np.ones(1)
        for T2 in shape.squares:
            bend = T2 * x
            product = product * (1 + bend)
            slope = slope - bend / (1 + bend)
        level = 2 * shape.log_k - shape.order * u + np.log(zeros / product)
        step = np.maximum(np.minimum(level / np.minimum(slope, -1e-6), 8.0), -8.0)
        u = np.maximum(np.minimum(u - step, LARGEST_LOG_SQUARE), -LARGEST_LOG_SQUARE)
        converged = np.abs(step) < CLOSE
        if converged.all():
            break
    return np.exp(0.5 * u), converged & (np.abs(u) < LARGEST_LOG_SQUARE)


def _phase_crossover(shape: UnitDeadTime, w: Real) -> tuple[Real, Flags]:
    """Solve for phase -180° upwards from the gain crossover; also whether that converged.

    Zeros lead by 180° at most, so the dead time alone has passed -180° at `base` + pi.
    """
    looks = np.exp(np.log(w) + np.log(1.01 * (shape.base + math.pi) / w) * FIRST_LOOK)
    above = shape.above(looks, looks * looks)
    at = np.argmax(above < 0, axis=0), np.arange(w.size)
    before = at[0] - 1, at[1]
    part = above[before] / (above[before] - above[at])
    w = looks[before] + part * (looks[at] - looks[before])
    for _ in range(STEPS):
        x = w * w
        lag_rate = shape.lag_rate(x)
        rate = lag_rate - shape.lead_rate(x, shape.zeros(x))
        # Without the lead a step upwards never goes too far.
        change = shape.above(w, x) / np.where(rate > 0.05 * lag_rate, rate, lag_rate)
        w = np.maximum(w + change, 0.5 * w)
        converged = np.abs(change) < CLOSE * w
        if converged.all():
            break
    return w, converged


def _stable_margins(
    shape: UnitDeadTime, w: Real, above: Real
) -> tuple[Real, Real, Real, Real, Real, Flags]:
    """Gain, phase and delay margin (in dead times), Ms, Mt, and whether they are proven."""
    w180, converged = _phase_crossover(shape, w)
    u, u180 = 2 * np.log(w), 2 * np.log(w180)
    start = np.minimum(u, -2 * np.log(_longest(shape))) + 2 * math.log(ASYMPTOTE)
    points = np.concatenate([u - (u - start) * BELOW, u + (u180 - u) * ABOVE])
    values, size, clear = _on_points(shape, points)
    Ms2, Mt2, found = _lowest(shape, points, values)
    k = np.exp(np.minimum(shape.log_k, 300.0))
    T0 = np.where(shape.order > 0, 1.0, k / (1 + k))
    return (
        1 / size,
        np.degrees(np.minimum(above, 2 * math.pi - above)),
        above / w,
        np.maximum(1.0, 1 / np.sqrt(Ms2)),
        np.maximum(T0, 1 / np.sqrt(Mt2)),
        converged & clear & found,
    )


def _longest(shape: UnitDeadTime) -> Real:
    """Longest time that bends the Bode plot. [dead times]"""
    longest = np.maximum(np.maximum(1.0, shape.b), np.sqrt(shape.c))
    for T in shape.lags:
        longest = np.maximum(longest, T)
    return longest


def _on_points(shape: UnitDeadTime, u: Real) -> tuple[Real, Real, Flags]:
    """1/|S|^2 of all loops then 1/|T|^2, |L| on the last point but one, and a proof.

    Some loops at a time: what is computed of them on the way then stays in the cache.
    """
    n = u.shape[1]
    values, size, clear = np.empty((len(u), 2 * n)), np.empty(n), np.empty(n, dtype=bool)
    for first in range(0, n, AT_A_TIME):
        some = slice(first, min(first + AT_A_TIME, n))
        part = shape if n <= AT_A_TIME else shape.take(some)
        S, T = values[:, some], values[:, n + first : n + some.stop]
        size[some], clear[some] = _some_on_points(part, u[:, some], S, T)
    return values, size, clear


def _some_on_points(shape: UnitDeadTime, u: Real, Ms2: Real, Mt2: Real) -> tuple[Real, Flags]:
    """Write 1/|S|^2 and 1/|T|^2; |L| on the last point but one, and whether no crossover is below.

    Between neighbours i and j the phase is above lead(i) - lag(j), both being rising functions, and
    has no dip where its slope keeps its sign.
    """
    x = np.exp(u)
    w, zeros = np.sqrt(x), shape.zeros(x)
    lead, lag = shape.lead(w, x), shape.lag(w)
    product: Real = np.ones(1)
    drop: Real = np.ones(x.shape)  # also where there is no lag to widen it
    for T, T2 in zip(shape.lags, shape.squares, strict=True):
        bend = 1 + T2 * x
        product = product * bend
        drop = drop + T / bend
    r2 = np.exp(2 * shape.log_k - shape.order * u) * zeros / product
    r = np.sqrt(r2)
    base = shape.base
    # |1 + L|^2 = (1 - r)^2 + 4 r sin^2(above/2), above the phase above -180°; numpy's tangent takes
    # a sixth of the time of its sine.
    half = np.tan(0.5 * (lead - lag + base))
    half *= half
    np.add((1 - r) ** 2, 4 * r * (half / (1 + half)), out=Ms2)
    np.divide(Ms2, r2, out=Mt2)
    # The last point lies beyond the crossover.
    here, there = slice(0, -2), slice(1, -1)
    rise = shape.b * (1 + shape.c * x)
    falls = rise[there] < drop[there] * zeros[here]
    climbs = rise[here] > drop[here] * zeros[there]
    clear = falls | climbs | (lead[here] + base > lag[there])
    # Before the first point only lags act: the loop starts above -180° or rises from it.
    first = np.where(shape.order < 2, base > lag[0], shape.b > drop[0] * zeros[0])
    return r[-2], first & clear.all(axis=0)


def _lowest(shape: UnitDeadTime, points: Real, values: Real) -> tuple[Real, Real, Flags]:
    """Least 1/|S|^2 and 1/|T|^2: a parabola through every deep dip, then Newton's method."""
    n = points.shape[1]
    least = values.min(axis=0)
    inner = values[1:-1]
    dips = (inner < values[:-2]) & (inner <= values[2:]) & (RIVAL * inner <= least)
    at, column = np.divmod(np.flatnonzero(dips), 2 * n)
    loop = np.where(column < n, column, column - n)
    three = at + np.arange(3)[:, None]
    v, around = _vertices(points[three, loop], values[three, column])
    way = np.where(column < n, 1.0, -1.0)
    lowest, settled = _newton(shape.take(loop), v, around, way)
    # Without a dip |T| only falls from its start. The points round their phase near -1.
    settled &= lowest <= values[at + 1, column] + ROUNDING
    refined = np.full(2 * n, math.inf)
    np.minimum.at(refined, column, lowest)
    found = (refined < math.inf) | ((values[0] == least) & (np.arange(2 * n) >= n))
    found[column[~settled]] = False
    least = np.where(refined < math.inf, refined, least)
    return least[:n], least[n:], found[:n] & found[n:]


def _newton(part: UnitDeadTime, v: Real, around: Real, way: Real) -> tuple[Real, Flags]:
    """Least distances near ln w = v by Newton's method, and whether that settled.

    Few dips take many steps: once three quarters are exact the others go on alone.
    """
    lowest, settled = np.empty(v.size), np.zeros(v.size, dtype=bool)
    left: Rows | slice = slice(None)
    for _ in range(STEPS):
        f, slope, bend = _distance(part, v, way)
        step = -slope / np.where(bend > 0, bend, math.inf)
        # Along the step the slope falls to zero in a straight line.
        change = 0.5 * slope * step
        done = (bend > 0) & (np.abs(change) < PEAK_ACCURACY * f) & (np.abs(step) < NEAR_PEAK)
        lowest[left], settled[left] = f + change, done
        v = v + np.maximum(np.minimum(step, around), -around)
        if done.all():
            break
        exact = done & (np.abs(change) < EXACT * f)
        if 4 * np.count_nonzero(exact) > 3 * v.size:
            rows = np.flatnonzero(~exact)
            part, v = part.take(rows), v[rows]
            around, way = around[rows], way[rows]
            left = np.arange(lowest.size)[left][rows]
    return lowest, settled


def _vertices(points: Real, values: Real) -> tuple[Real, Real]:
    """Lowest points of parabolas through three points each, in ln w, and half their width."""
    left, v, right = 0.5 * points
    before = (values[1] - values[0]) / (v - left)
    after = (values[2] - values[1]) / (right - v)
    width = 0.5 * (right - left)
    return 0.5 * (left + v) - width * before / (after - before), width


def _distance(shape: UnitDeadTime, v: Real, way: Real) -> tuple[Real, Real, Real]:
    """1/|S|^2 (way 1) or 1/|T|^2 (way -1) at ln w = v, with its first and second derivative.

    |T| is |S| with 1/L for L.
    """
    w = np.exp(v)
    x = w * w
    bw, cx, rise, peak = shape.b * w, shape.c * x, shape.beta * x, shape.c2 * x * x
    zeros = 1 + rise + peak
    bump = (rise + 2 * peak) / zeros
    rho, rho_rate = bump - shape.order, (rise + 4 * peak) / zeros - bump * bump
    pull = bw / zeros
    lead = pull * (1 + cx)
    turn, turn_rate = lead - w, lead * (1 - 2 * bump) + 2 * pull * cx - w
    above = np.arctan2(bw, 1 - cx) - w + shape.base
    for T, T2 in zip(shape.lags, shape.squares, strict=True):
        bend, angle = T2 * x, T * w
        above = above - np.arctan(angle)
        whole = 1 + bend
        zeros = zeros / whole
        bend, angle = bend / whole, angle / whole
        rho, rho_rate = rho - bend, rho_rate - bend / whole
        turn, turn_rate = turn - angle, turn_rate - angle * (1 - 2 * bend)
    r = np.exp(way * (shape.log_k - shape.order * v + 0.5 * np.log(zeros)))
    cos, sin = -np.cos(above), -np.sin(above)
    rho, rho_rate = way * rho, 2 * way * rho_rate
    toward, across = cos + r, turn * sin
    slope = rho * toward - across
    bend = rho_rate * toward + rho * (rho * r - across) - turn_rate * sin - turn * turn * cos
    f = (1 + r * cos) ** 2 + (r * sin) ** 2
    return f, 2 * r * slope, 2 * r * (bend + rho * slope)
