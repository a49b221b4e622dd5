"""Gauss-Newton steps in tau and theta, everything linear eliminated at each point.

All a step needs are inner products of a few columns: the response, its derivatives, the drift, the
unsteady start and the data. They are summed over blocks of samples, so that a record of any length
takes the memory of one block.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg.lapack import dposv

from identification.held_input import LONGEST, HeldInput, lag_response, lag_states
from loop.signals import Real

# A Gauss-Newton step s leaves an error of about s (s + 3 e), s and the standard error e relative to
# tau; a hundredth of a standard error is nothing that data can tell. A step in theta also moves the
# corner of the answer past a few noisy samples, which only a step of a few tenths leaves small.
SMALL_ERROR, SMALL_STEP = 0.01, 0.3
# A step that would lower the sum of squares by under a tenth of the noise variance, or raises it by
# as little, is under a third of a standard error and both ends are as good: the corner's samples
# make the valley rough, and to follow them to its very bottom makes no estimate better.
# Only so small a step, relative to tau, leaves the errors stated before it true after it.
FLAT, STRAIGHT = 0.1, 0.02
# Without noise the standard errors vanish; rounding then ends the iteration.
ROUNDING = 1e-12
MOST_STEPS = 60
# Samples worked on at a time: small enough to stay in the processor's cache.
BLOCK = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Where tau and theta may lie. [s]"""

    fastest: float
    slowest: float
    earliest: float
    latest: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """Data of one fit, and where time and PV are counted from.

    Attributes
    ----------
    t, pv : ndarray, shape (n,)
        Times [s] and process values [PV].
    weight : ndarray, shape (n,), or None
        Readings behind each value. [-]
    spread : ndarray, shape (n,), or None
        Variance of the times of the readings behind each value. [s^2]
    held : HeldInput
        The output.
    drift, start : bool
        Whether these are fitted.
    bounds : Bounds
        Of tau and theta.
    t0, pv_first : float
        Origins of time [s] and PV [PV].
    """

    t: Real
    pv: Real
    weight: Real | None
    spread: Real | None
    held: HeldInput
    drift: bool
    start: bool
    bounds: Bounds
    t0: float
    pv_first: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Point:
    """Everything a step needs at one (tau, theta).

    `normal` and `gradient` order the parameters as the linear ones (K, pv0, drift, start), then
    ln(tau) and theta. `slopes` is, of averages, what theta does to the response, block by block.
    """

    tau: float
    theta: float
    linear: Real
    sse: float
    normal: Real
    gradient: Real
    slopes: list[Real]


def evaluate(problem: Problem, tau: float, theta: float) -> Point:
    """Solve for the linear parameters and build the normal equations of all.

    Parameters
    ----------
    problem : Problem
        What to fit.
    tau, theta : float
        Where. [s]
    """
    products, slopes = _inner_products(problem, tau, theta)
    linear = 2 + problem.drift + problem.start
    gram, product = products[:-1, :-1], products[:-1, -1]
    a = _solve(gram[:linear, :linear], product[:linear])
    misfit = product - a @ gram[:linear]
    sse = float(products[-1, -1] - a @ (product[:linear] + misfit[:linear]))
    # From columns to the Jacobian in K, pv0, drift, start, ln(tau), theta.
    K = float(a[0])
    scale = np.array([1.0] * linear + [K * tau, K] + [float(a[-1]) * tau] * problem.start)
    normal, gradient = gram * scale, misfit * scale
    normal *= scale[:, None]
    if problem.start:  # both parts of what tau does
        normal[linear] += normal[-1]
        normal[:, linear] += normal[:, -1]
        gradient[linear] += gradient[-1]
        normal, gradient = normal[:-1, :-1], gradient[:-1]
    return Point(
        tau=tau,
        theta=theta,
        linear=a,
        sse=max(sse, 0.0),
        normal=normal,
        gradient=gradient,
        slopes=slopes,
    )


def _inner_products(problem: Problem, tau: float, theta: float) -> tuple[Real, list[Real]]:
    """Inner products of all columns with each other; of averages also what theta does, in blocks.

    Columns: the response, 1, t where a drift is fitted, e^(-t/tau) where a start is; then what tau
    and theta do to the response, and what tau does to the start; last the data.
    """
    linear = 2 + problem.drift + problem.start
    size = linear + 3 + problem.start
    n, products, slopes = problem.t.size, np.empty((size, size)), []
    states = lag_states(problem.held, tau) if problem.held.moves > 1 else None
    columns = np.empty((size, min(BLOCK, n)))
    columns[1] = 1.0
    for first in range(0, n, BLOCK):
        t, pv, weight, spread = problem.t, problem.pv, problem.weight, problem.spread
        if n > BLOCK:
            block = slice(first, first + BLOCK)
            t, pv = t[block], pv[block]
            weight = None if weight is None else weight[block]
            spread = None if spread is None else spread[block]
            columns = columns[:, : t.size]
        response = (columns[0], columns[linear], columns[linear + 1])
        lag_response(problem.held, t, tau, theta, states=states, spread=spread, out=response)
        if problem.drift:
            np.subtract(t, problem.t0, out=columns[2])
        if problem.start:
            age = (t - problem.t0) / tau
            np.exp(-np.minimum(age, LONGEST), out=columns[linear - 1])
            if spread is not None:
                columns[linear - 1] *= 1 + spread / (2 * tau**2)
            np.multiply(columns[linear - 1], age / tau, out=columns[-2])
        if spread is not None:
            slopes.append(response[2].copy())
        np.subtract(pv, problem.pv_first, out=columns[-1])
        weighted = columns if weight is None else columns * weight
        # Numpy takes a symmetric routine for A @ A.T that is four times slower on thin arrays.
        if first == 0:
            np.matmul(weighted[:-1], columns.T, out=products[:-1])
            square = weighted[-1] @ columns[-1]
        else:
            products[:-1] += weighted[:-1] @ columns.T
            square += weighted[-1] @ columns[-1]
    products[-1, :-1], products[-1, -1] = products[:-1, -1], square
    return products, slopes


def _solve(matrix: Real, right: Real) -> Real:
    _, found, failed = dposv(matrix, right)
    return inverse(matrix) @ right if failed else np.asarray(found)


@cache
def _identity(size: int) -> Real:
    return np.eye(size)


def inverse(matrix: Real) -> Real:
    """Inverse of normal equations; a direction without data gives 0.

    Parameters
    ----------
    matrix : ndarray, shape (p, p)
        Symmetric, not negative.
    """
    identity = _identity(len(matrix))
    _, found, failed = dposv(matrix, identity)
    if not failed:
        return np.asarray(found)
    # A column of nothing, or two alike to rounding.
    diagonal = matrix.diagonal()
    empty = diagonal <= 0
    scale = np.where(empty, 0.0, 1 / np.sqrt(np.where(empty, 1.0, diagonal)))
    scales = scale[:, None] * scale
    scaled = matrix * scales + np.diag(empty.astype(float))
    return np.asarray(np.linalg.inv(scaled + 1e-13 * identity) * scales)


def descend(problem: Problem, tau: float, theta: float, close: float) -> tuple[Point, Real]:
    """Damped Gauss-Newton from a start to where the next step is small.

    Parameters
    ----------
    problem : Problem
        What to fit.
    tau, theta : float
        Start. [s]
    close : float
        Size of step, relative to tau, that is small even where the data could tell. [-]

    Returns
    -------
    point : Point
        Last point evaluated.
    step : ndarray
        The small step that is left, in the order of `Point.normal`.
    """
    point = evaluate(problem, tau, theta)
    freedom = max(problem.t.size - point.gradient.size, 1)
    damping = 0.0
    for _ in range(MOST_STEPS):
        step, errors = _step(problem, point, damping, freedom)
        # Relative to tau, so that the two are alike.
        size = max(abs(float(step[-2])), abs(float(step[-1])) / point.tau)
        error, least = max(errors), min(errors)
        enough = size * (size + 3 * error) <= SMALL_ERROR * least and size <= SMALL_STEP * least
        gain = float(point.gradient @ step)
        flat = FLAT * (point.sse - gain) / freedom
        rough = gain < flat and not damping and size < STRAIGHT
        if enough or rough or size <= max(close, ROUNDING):
            break
        trial = evaluate(problem, *moved(problem, point, step))
        if trial.sse <= point.sse:
            point, damping = trial, damping / 10 if damping > 1e-6 else 0.0
        elif trial.sse - point.sse < flat:
            step = np.zeros_like(step)
            break
        elif damping < 1e8:
            damping = max(10 * damping, 1e-3)
        else:
            break
    return point, step


def descend_to_the_end(problem: Problem, tau: float, theta: float) -> Point:
    """Descend to the bottom, the small last step included where it lowers the sum of squares.

    Where the normal equations are singular, as at a jump between two samples, a step can be
    anything; only a point that was evaluated is an answer.

    Parameters
    ----------
    problem : Problem
        What to fit.
    tau, theta : float
        Start. [s]
    """
    point, step = descend(problem, tau, theta, 0.0)
    if not step.any():
        return point
    last = evaluate(problem, *moved(problem, point, step))
    return last if last.sse <= point.sse else point


def _step(
    problem: Problem, point: Point, damping: float, freedom: int
) -> tuple[Real, tuple[float, float]]:
    """Gauss-Newton step, and standard errors of ln(tau) and theta/tau.

    A dead time at a bound stays there while the data push it outwards.
    """
    normal = point.normal
    if damping:
        normal = normal + damping * np.diag(normal.diagonal())
    spread = inverse(normal)
    step = spread @ point.gradient
    # What remains after the step is the noise; before it the misfit may be most of the sum.
    noise = math.sqrt(max(point.sse - float(point.gradient @ step), 0.0) / freedom)
    errors = (
        noise * math.sqrt(max(spread[-2, -2], 0.0)),
        noise * math.sqrt(max(spread[-1, -1], 0.0)) / point.tau,
    )
    outwards = (point.theta <= problem.bounds.earliest and step[-1] < 0) or (
        point.theta >= problem.bounds.latest and step[-1] > 0
    )
    if outwards:
        step = np.append(inverse(normal[:-1, :-1]) @ point.gradient[:-1], 0.0)
    return step, errors


def moved(problem: Problem, point: Point, step: Real) -> tuple[float, float]:
    """Take a step within the bounds; tau changes by a factor of 4 at most. [s]

    Parameters
    ----------
    problem : Problem
        What to fit.
    point : Point
        Where from.
    step : ndarray
        Step in the order of `Point.normal`.
    """
    bounds = problem.bounds
    factor = math.exp(min(max(float(step[-2]), -1.4), 1.4))
    return (
        min(max(point.tau * factor, bounds.fastest), bounds.slowest),
        min(max(point.theta + float(step[-1]), bounds.earliest), bounds.latest),
    )
