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
    t, y, weight = _merged(problem)
    root = np.sqrt(weight)
    q = _fixed_columns(problem, t, taus, root)
    y *= root
    fixed = np.swapaxes(q, 1, 2) @ y[:, None]
    rest = y[:, None] - q @ fixed
    x = _responses(held, t, taus, thetas)
    onto = np.concatenate((q, rest), axis=2) * root[:, None]
    inner = _each(x, onto)
    x *= x
    size = _each(x, weight[None, :, None])[..., 0]
    # What a response adds to the fixed columns, and what of the data both explain. A response that
    # they nearly contain tells nothing, its own part is rounding.
    own = size - np.sum(inner[..., :-1] ** 2, axis=2)
    score = np.where(own > 1e-9 * size, inner[..., -1] ** 2 / np.maximum(own, 1e-300), -1.0)
    score += np.sum(fixed**2, axis=(1, 2))[:, None]  # a start differs from tau to tau
    if held.moves == 1:
        peaks = [int(np.argmax(score))]
    else:
        found = np.flatnonzero(score == maximum_filter(score, 3))
        peaks = found[np.argsort(-score.flat[found])][:MOST_STARTS].tolist()
    return [(float(taus[i // thetas.size]), float(thetas[i % thetas.size])) for i in peaks]


def _each(x: Real, columns: Real) -> Real:
    """Inner products of all responses with columns that all taus share or that differ by tau."""
    if len(columns) > 1:
        return np.asarray(x @ columns)
    flat = x.reshape(-1, x.shape[2]) @ columns[0]
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
    return np.sort(np.concatenate(grid))


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
        age = np.maximum(t - held.instants[0] - thetas[:, None], 0.0)
        x = age * (-1 / taus)[:, None, None]
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
    """Orthonormal basis of everything but the response, shape (taus or 1, samples, columns)."""
    since = t - problem.t0
    if not problem.start:  # two columns that are orthogonal once the second has no mean
        q = np.empty((1, t.size, 1 + problem.drift))
        q[0, :, 0] = root / math.sqrt(root @ root)
        if problem.drift:
            q[0, :, 1] = root * since
            q[0, :, 1] -= (q[0, :, 0] @ q[0, :, 1]) * q[0, :, 0]
            q[0, :, 1] /= math.sqrt(q[0, :, 1] @ q[0, :, 1])
        return q
    columns: list[Real] = [np.ones((1, t.size))]
    if problem.drift:
        columns.append(since[None, :])
    columns.append(np.exp(-np.minimum(since / taus[:, None], LONGEST)))
    stacked = np.stack(np.broadcast_arrays(*columns), axis=2) * root[:, None]
    return np.asarray(np.linalg.qr(stacked)[0])
