"""Where to start a fit: the best tau and theta of a grid, everything linear at its own best.

A fit whose theta is moved by gradient alone stays where it starts, or slides into the nearest
valley; a grid knows neither trouble.
"""

import math

import numpy as np
from scipy.ndimage import maximum_filter

from identification.gauss_newton import Problem
from identification.held_input import LONGEST, HeldInput
from loop.signals import Real

# Ratios of neighbours in the grid, and how many of its peaks are followed.
TAU_RATIO, THETA_RATIO, MOST_STARTS = 3.0, 2.0, 8
# Values for each move that the grid looks at.
VALUES = 25
# A grid wider than this many tau is searched once more, every half tau and at these parts of tau.
WIDE, MOST_BETWEEN = 1.0, 60
CLOSER = np.array([0.4, 0.6, 1.0, 1.6])


def search(problem: Problem, spacing: float) -> list[tuple[float, float]]:
    """Best (tau, theta) of a grid. [s]

    After a single move the sum of squares has one valley. After several it can have many, such as
    when a staircase passes for a drift: each peak of the explained part is then a start.

    Parameters
    ----------
    problem : Problem
        What to fit, averaged to a few hundred values.
    spacing : float
        Time between samples before that. [s]
    """
    bounds, held = problem.bounds, problem.held
    taus = _geometric(spacing, bounds.slowest / 10, TAU_RATIO)
    thetas = _dead_times(problem, spacing)
    merged = _merged(problem)
    score = _scores(problem, merged, taus, thetas)
    if held.moves > 1:
        found = np.flatnonzero(score == maximum_filter(score, 3))
        peaks = found[np.argsort(-score.flat[found])][:MOST_STARTS].tolist()
        return [(float(taus[i // thetas.size]), float(thetas[i % thetas.size])) for i in peaks]
    i, j = divmod(int(score.argmax()), thetas.size)
    tau, around = float(taus[i]), thetas[max(j - 1, 0) : j + 2]
    meshes = float(around[-1] - around[0]) / tau
    if meshes > WIDE:
        # A long dead time: between its neighbours in the grid there is room for other valleys.
        taus = tau * CLOSER
        thetas = np.linspace(around[0], around[-1], min(math.ceil(2 * meshes), MOST_BETWEEN))
        i, j = divmod(int(_scores(problem, merged, taus, thetas).argmax()), thetas.size)
        return [(float(taus[i]), float(thetas[j]))]
    return [(tau, _summit(thetas, score[i], j))]


def _summit(x: Real, y: Real, at: int) -> float:
    """Where the parabola through the highest point and its neighbours is highest."""
    if not 0 < at < x.size - 1:
        return float(x[at])
    left, middle, right = x[at - 1 : at + 2].tolist()
    low, high, end = y[at - 1 : at + 2].tolist()
    before, after = (high - low) / (middle - left), (end - high) / (right - middle)
    if min(low, end) < 0 or not before > after:
        return float(middle)
    return float(0.5 * (left + middle) + 0.5 * before * (right - left) / (before - after))


def _scores(problem: Problem, merged: tuple[Real, Real, Real], taus: Real, thetas: Real) -> Real:
    """Sum of squares that each response explains beside the rest, shape (taus, thetas)."""
    t, y, weight = merged
    root = np.sqrt(weight)
    q = _fixed_columns(problem, t, taus, root)
    weighted = y * root
    fixed = q @ weighted
    columns = np.empty((len(q), q.shape[1] + 1, t.size))
    columns[:, :-1] = q
    columns[:, -1] = weighted - (fixed[:, None] @ q)[:, 0]
    columns *= root
    x = _responses(problem.held, t, taus, thetas)
    inner = _onto(x, columns)
    x *= x
    size = x @ weight
    # What a response adds to the fixed columns, and what of the data both explain. A response that
    # they nearly contain tells nothing, its own part is rounding.
    inner *= inner
    own = size - inner[..., :-1].sum(axis=2)
    size *= 1e-9
    size += 1e-300
    score = np.where(own > size, inner[..., -1] / np.maximum(own, size), -1.0)
    if problem.start:  # which differs from tau to tau
        score += (fixed * fixed).sum(axis=1)[:, None]
    return score


def _onto(x: Real, columns: Real) -> Real:
    """Inner products of all responses with columns that all taus share or that differ by tau."""
    if len(columns) > 1:
        return np.asarray(x @ np.swapaxes(columns, 1, 2))
    flat = x.reshape(-1, x.shape[2]) @ columns[0].T
    return np.asarray(flat.reshape(*x.shape[:2], -1))


def _dead_times(problem: Problem, spacing: float) -> Real:
    bounds = problem.bounds
    grid: list[Real] = [np.zeros(1)]
    if bounds.latest > spacing:
        grid.append(_geometric(spacing, bounds.latest, THETA_RATIO))
    if bounds.earliest < -spacing:
        grid.append(-_geometric(spacing, -bounds.earliest, THETA_RATIO))
    if problem.held.moves > 3:  # periodic moves leave local minima between wide points
        grid.append(np.linspace(0, bounds.latest, 60)[1:])
    thetas = np.concatenate(grid)
    thetas.sort()
    return thetas


def _merged(problem: Problem) -> tuple[Real, Real, Real]:
    """Times, values and weights of a few neighbours at a time."""
    t, y = problem.t, problem.pv - problem.pv_first
    weight = np.ones_like(t) if problem.weight is None else problem.weight
    merge = round(t.size / (VALUES * (problem.held.moves + 1)))
    if merge < 2:
        return t, y, weight
    starts = np.arange(0, t.size, merge)
    total = np.add.reduceat(weight, starts)
    return (
        np.add.reduceat(t * weight, starts) / total,
        np.add.reduceat(y * weight, starts) / total,
        total,
    )


def _geometric(first: float, last: float, ratio: float) -> Real:
    count = 2 + int(math.log(last / first) / math.log(ratio))
    return first * (last / first) ** (np.arange(count) / (count - 1))


def _responses(held: HeldInput, t: Real, taus: Real, thetas: Real) -> Real:
    """Responses for every tau and theta, shape (taus, thetas, samples). [OP]"""
    if held.moves == 1:
        ages = np.subtract.outer(-held.instants[0] - thetas, -t)
        np.maximum(ages, 0.0, out=ages)
        x = np.multiply.outer(-1 / taus, ages)
        np.maximum(x, -LONGEST, out=x)
        np.exp(x, out=x)
        x -= 1.0
        return np.asarray(x)  # the sign is of no account: the gain takes it
    shifted = t - thetas[:, None]
    index = np.searchsorted(held.instants, shifted, side="right")
    age = shifted - held.instants[np.maximum(index - 1, 0)]
    np.maximum(age, 0.0, out=age)
    z = _states(held, taus)
    x = age / -taus[:, None, None]
    np.maximum(x, -LONGEST, out=x)
    np.exp(x, out=x)
    x *= z[:, index]
    x += (held.levels - held.levels[0])[index]
    return x


def _states(held: HeldInput, taus: Real) -> Real:
    """Distance of the lag from the level it heads for, shape (taus, moves + 1). [OP]"""
    z = np.zeros((held.moves + 1, taus.size))
    gaps, jumps = np.diff(held.instants).tolist(), np.diff(held.levels).tolist()
    for j, (gap, jump) in enumerate(zip([0.0, *gaps], jumps, strict=True)):
        z[j + 1] = z[j] * np.exp(-gap / taus) - jump
    return z.T


def _fixed_columns(problem: Problem, t: Real, taus: Real, root: Real) -> Real:
    """Orthonormal basis of everything but the response, shape (taus or 1, columns, samples)."""
    since = t - problem.t0
    if not problem.start:  # two columns that are orthogonal once the second has no mean
        q = np.empty((1, 1 + problem.drift, t.size))
        level = np.multiply(root, 1 / math.sqrt(root @ root), out=q[0, 0])
        if problem.drift:
            since *= root
            since -= (level @ since) * level
            np.multiply(since, 1 / math.sqrt(since @ since), out=q[0, 1])
        return q
    columns: list[Real] = [np.ones((1, t.size))]
    if problem.drift:
        columns.append(since[None, :])
    columns.append(np.exp(-np.minimum(since / taus[:, None], LONGEST)))
    stacked = np.stack(np.broadcast_arrays(*columns), axis=2) * root[:, None]
    return np.asarray(np.swapaxes(np.linalg.qr(stacked)[0], 1, 2))
