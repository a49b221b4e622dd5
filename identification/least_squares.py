"""Least squares of the simulation error for first order plus dead time.

    pv(t) = pv0 + drift (t - t[0]) + start e^(-(t - t[0])/tau) + K x(t; tau, theta)

K, pv0, drift and start enter linearly and are eliminated (variable projection [1]_); tau and theta
are searched over a grid on averaged data, which no start value and no local minimum can spoil, then
refined by Gauss-Newton steps. The last steps use every sample and the exact response, so that the
estimate is the least-squares one of the whole record and its standard errors come from the exact
Jacobian, dead time included.

References
----------
.. [1] G. Golub and V. Pereyra, "Separable nonlinear least squares: the variable projection method
   and its applications," Inverse Problems, vol. 19, no. 2, pp. R1-R26, 2003.
   doi:10.1088/0266-5611/19/2/201
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.ndimage import maximum_filter

from identification.condense import condense
from identification.held_input import LONGEST, HeldInput, lag_response, lag_states
from loop.errors import PoorExcitation
from loop.signals import Real

# Buckets for each move in the search and the first steps: neighbours differ by a tenth of the time
# since the move over four decades of it. With very many moves the total is held down.
BUCKETS, MOST_BUCKETS = 100, 4000
# Buckets for each move that the grid looks at.
MERGED = 25
# Grid of the search, and how many of its peaks are followed.
TAU_RATIO, THETA_RATIO, MOST_STARTS = 3.0, 2.0, 8
# A Gauss-Newton step s leaves an error of about s (s + 3 e), s and the standard error e relative to
# tau; a hundredth of a standard error is nothing that data can tell.
SMALL_ERROR = 0.01
# Averaged data need no more than to start the last steps well.
CLOSE = 1e-3
# Samples worked on at a time: small enough to stay in the processor's cache.
BLOCK = 4096
# Without noise the standard errors vanish; rounding then ends the iteration.
ROUNDING = 1e-12
MOST_STEPS = 60
# A time constant of 30 records cannot be told from an integrator, one of a fiftieth of a sample not
# from none.
SLOWEST, FASTEST = 30.0, 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeastSquaresFit:
    """First-order-plus-dead-time model with the errors that white noise would leave in it.

    Attributes
    ----------
    K, tau, theta : float
        Model. [PV/OP], [s], [s]
    pv0 : float
        PV at the first sample's time for the output before the first move. [PV]
    drift : float
        Slope of PV that is no answer to the output; 0 unless fitted. [PV/s]
    start : float
        How far PV was from rest at the first sample, dying out with tau; 0 unless fitted. [PV]
    covariance : ndarray, shape (p, p)
        Of K, tau, theta, pv0 and whatever else was fitted, in that order: drift, start.
    sse : float
        Sum of the squared residuals, each as often as there are readings behind it. [PV^2]
    freedom : int
        Values fitted less parameters. [-]
    t0 : float
        Time of the first sample. [s]
    held : HeldInput
        Input that the model was fitted to.
    drift_fitted, start_fitted : bool
        Which of the two were free.
    """

    K: float
    tau: float
    theta: float
    pv0: float
    drift: float
    start: float
    covariance: Real
    sse: float
    freedom: int
    t0: float
    held: HeldInput
    drift_fitted: bool
    start_fitted: bool

    @property
    def noise_sd(self) -> float:
        """Standard deviation of a reading about the model. [PV]"""
        return math.sqrt(self.sse / self.freedom)

    @property
    def standard_errors(self) -> Real:
        """Of every fitted parameter, in the order of `covariance`."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def drift_error(self) -> float:
        """Standard error of the drift, 0 where it was not fitted. [PV/s]"""
        return float(self.standard_errors[4]) if self.drift_fitted else 0.0

    @property
    def start_error(self) -> float:
        """Standard error of the unsteady start, 0 where it was not fitted. [PV]"""
        return float(self.standard_errors[-1]) if self.start_fitted else 0.0

    def predict(self, t: Real) -> Real:
        """Model's PV.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times, increasing. [s]
        """
        since = t - self.t0
        response = lag_response(self.held, t, self.tau, self.theta)[0]
        transient = self.start * np.exp(-since / self.tau)
        return np.asarray(self.pv0 + self.drift * since + transient + self.K * response)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """Data of one fit, and where time and PV are counted from."""

    t: Real
    pv: Real
    weight: Real | None
    held: HeldInput
    drift: bool
    start: bool
    bounds: tuple[float, float, float, float]
    t0: float
    pv_first: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """Everything a Gauss-Newton step needs at one (tau, theta); the step is in ln(tau), theta.

    `normal` and `gradient` order the parameters as the linear ones (K, pv0, drift, start), then
    ln(tau) and theta.
    """

    tau: float
    theta: float
    linear: Real
    sse: float
    normal: Real
    gradient: Real


def fopdt_least_squares(
    t: Real,
    pv: Real,
    held: HeldInput,
    *,
    weight: Real | None = None,
    drift: bool = False,
    start: bool = False,
    earliest: float = 0.0,
) -> LeastSquaresFit:
    """Fit first order plus dead time to a record by least squares of the simulation error.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times, increasing, evenly spaced or not. [s]
    pv : ndarray, shape (n,)
        Process values, without gaps. [PV]
    held : HeldInput
        Output, at rest at its first level before its first move.
    weight : ndarray, shape (n,), optional
        Readings averaged into each value. Default: one each. [-]
    drift : bool
        Fit a constant slope of PV.
    start : bool
        Fit a start off rest, which dies out with tau.
    earliest : float
        Smallest dead time allowed; a negative one asks whether PV moved before OP. [s]

    Raises
    ------
    PoorExcitation
        There are too few samples, no move, or PV does not change.
    """
    parameters = 4 + drift + start
    change = float(np.ptp(pv)) if t.size else 0.0
    if t.size <= parameters or not held.moves or change == 0:
        raise PoorExcitation(
            f"{t.size} samples with {held.moves} moves and a PV range of {change:.3g} cannot "
            f"carry {parameters} parameters."
        )
    t0, pv_first = float(t[0]), float(pv[0])
    held_since = HeldInput(instants=held.instants - t0, levels=held.levels)
    span, spacing = float(t[-1]) - t0, (float(t[-1]) - t0) / (t.size - 1)
    latest = max(span - float(held_since.instants[0]) - 2 * spacing, 0.0)

    def problem(at_most: int) -> _Problem:
        used = condense(t, pv, held.instants, weight=weight, at_most=at_most)
        return _Problem(
            t=used.t,
            pv=used.pv,
            weight=used.weight,
            held=held_since,
            drift=drift,
            start=start,
            bounds=(FASTEST * spacing, SLOWEST * span, earliest, latest),
            t0=t0,
            pv_first=pv_first,
        )

    averaged, whole = problem(min(BUCKETS * (held.moves + 1), MOST_BUCKETS)), problem(t.size)
    starts = [_descend(averaged, *found, CLOSE)[0] for found in _search(averaged)]
    point = min(starts, key=lambda reached: reached.sse)
    point, step = _descend(whole, point.tau, point.theta, 0.0)
    return _result(whole, point, step, held)


def _search(problem: _Problem) -> list[tuple[float, float]]:
    """Best (tau, theta) of a grid, every linear parameter at its own best.

    After a single move the sum of squares has one valley. After several it can have many, such as
    when a staircase passes for a drift: each peak of the explained part is then a start.
    """
    fastest, slowest, earliest, latest = problem.bounds
    spacing = fastest / FASTEST
    taus = _geometric(spacing, slowest / 10, TAU_RATIO)
    grid: list[Real] = [np.zeros(1)]
    if latest > spacing:
        grid.append(_geometric(spacing, latest, THETA_RATIO))
    if earliest < 0:
        grid.append(-_geometric(spacing, -earliest, THETA_RATIO))
    if problem.held.moves > 3:  # periodic moves leave local minima between wide points
        grid.append(np.linspace(0, latest, 60)[1:])
    thetas = np.sort(np.concatenate(grid))

    t, y, weight = _merged(problem)
    root = np.sqrt(weight)
    q = _fixed_columns(problem, t, taus, root)
    y *= root
    rest = y[:, None] - q @ (np.swapaxes(q, 1, 2) @ y[:, None])
    x = _responses(problem.held, t, taus, thetas)
    inner = x @ (np.concatenate((q, rest), axis=2) * root[:, None])
    x *= x
    size = x @ weight
    # What a response adds to the fixed columns, and what of the data it explains. A response that
    # they nearly contain tells nothing, its own part is rounding.
    own = size - np.sum(inner[..., :-1] ** 2, axis=2)
    score = np.where(own > 1e-9 * size, inner[..., -1] ** 2 / np.maximum(own, 1e-300), -1.0)
    if problem.held.moves == 1:
        peaks = np.array([np.argmax(score)])
    else:
        peaks = np.flatnonzero(score == maximum_filter(score, 3))
        peaks = peaks[np.argsort(-score.flat[peaks])][:MOST_STARTS]
    return [(float(taus[i // thetas.size]), float(thetas[i % thetas.size])) for i in peaks]


def _merged(problem: _Problem) -> tuple[Real, Real, Real]:
    """Times, values and weights of a few neighbouring buckets at a time: a grid needs no more."""
    t, y = problem.t - problem.t0, problem.pv - problem.pv_first
    weight = np.ones_like(t) if problem.weight is None else problem.weight
    merge = t.size // (MERGED * (problem.held.moves + 1))
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
    return np.exp(np.linspace(math.log(first), math.log(last), count))


def _responses(held: HeldInput, t: Real, taus: Real, thetas: Real) -> Real:
    """Responses for every tau and theta, shape (taus, thetas, samples). [OP]"""
    shifted = t - thetas[:, None]
    index = np.searchsorted(held.instants, shifted, side="right")
    origins = np.append(held.instants[:1], held.instants)
    age = np.maximum(shifted - origins[index], 0.0)
    z = np.array([lag_states(held, tau)[0] for tau in taus.tolist()])
    x = age / -taus[:, None, None]
    np.maximum(x, -LONGEST, out=x)
    np.exp(x, out=x)
    x *= z[:, index]
    x += (held.levels - held.levels[0])[index]
    return x


def _fixed_columns(problem: _Problem, t: Real, taus: Real, root: Real) -> Real:
    """Orthonormal basis of everything but the response, shape (taus or 1, samples, columns)."""
    columns: list[Real] = [np.ones((1, t.size))]
    if problem.drift:
        columns.append(t[None, :])
    if problem.start:
        columns.append(np.exp(-np.minimum(t / taus[:, None], LONGEST)))
    stacked = np.stack(np.broadcast_arrays(*columns), axis=2) * root[:, None]
    return np.asarray(np.linalg.qr(stacked)[0])


def _evaluate(problem: _Problem, tau: float, theta: float) -> _Point:
    """Solve for the linear parameters and build the normal equations of all."""
    products = _inner_products(problem, tau, theta)
    gram, product, square = products[:-1, :-1], products[:-1, -1], products[-1, -1]
    linear = 2 + problem.drift + problem.start
    a = _inverse(gram[:linear, :linear]) @ product[:linear]
    # From columns to the Jacobian in K, pv0, drift, start, ln(tau), theta.
    jacobian = np.eye(linear + 2, len(gram))
    jacobian[linear, linear] = a[0] * tau
    jacobian[linear + 1, linear + 1] = a[0]
    if problem.start:
        jacobian[linear, linear + 2] = a[-1] * tau
    misfit = product - gram[:, :linear] @ a
    sse = square - a @ (product[:linear] + misfit[:linear])
    return _Point(
        tau=tau,
        theta=theta,
        linear=a,
        sse=max(float(sse), 0.0),
        normal=jacobian @ gram @ jacobian.T,
        gradient=jacobian @ misfit,
    )


def _inner_products(problem: _Problem, tau: float, theta: float) -> Real:
    """Inner products of all columns with each other.

    Columns: response, 1, t where a drift is fitted, e^(-t/tau) where a start is; then the
    derivatives of the response for tau and theta, and that of the start; last the data.
    """
    linear = 2 + problem.drift + problem.start
    size = linear + 3 + problem.start
    products = np.zeros((size, size))
    states = lag_states(problem.held, tau)
    buffer = np.empty((size + 3, min(BLOCK, problem.t.size)))
    for first in range(0, problem.t.size, BLOCK):
        block = slice(first, first + BLOCK)
        t = problem.t[block] - problem.t0
        columns, response = buffer[:size, : t.size], buffer[size:, : t.size]
        lag_response(problem.held, t, tau, theta, states=states, out=response)
        columns[0] = response[0]
        columns[1] = 1.0
        if problem.drift:
            columns[2] = t
        columns[linear : linear + 2] = response[1:]
        if problem.start:
            transient = np.exp(-np.minimum(t / tau, LONGEST))
            columns[linear - 1] = transient
            columns[-2] = transient * t / tau**2
        np.subtract(problem.pv[block], problem.pv_first, out=columns[-1])
        weighted = columns if problem.weight is None else columns * problem.weight[block]
        # Numpy takes a symmetric routine for A @ A.T that is four times slower on thin arrays.
        products[:-1] += weighted[:-1] @ columns.T
        products[-1, -1] += weighted[-1] @ columns[-1]
    products[-1, :-1] = products[:-1, -1]
    return products


def _inverse(matrix: Real) -> Real:
    """Inverse of normal equations, columns scaled to one; a direction without data gives 0."""
    diagonal = matrix.diagonal()
    empty = diagonal <= 0
    scale = np.where(empty, 0.0, 1 / np.sqrt(np.where(empty, 1.0, diagonal)))
    scales = scale[:, None] * scale
    identity = np.eye(scale.size)
    scaled = matrix * scales + np.diag(empty.astype(float))
    _, inverse, failed = dposv(scaled, identity)
    if failed:  # two columns alike to rounding
        inverse = np.linalg.inv(scaled + 1e-13 * identity)
    return np.asarray(inverse * scales)


def _descend(problem: _Problem, tau: float, theta: float, close: float) -> tuple[_Point, Real]:
    """Damped Gauss-Newton from a start to where the next step is small.

    Parameters
    ----------
    problem : _Problem
        What to fit.
    tau, theta : float
        Start. [s]
    close : float
        Size of step, relative to tau, that is small even where the data could tell. [-]

    Returns
    -------
    point : _Point
        Last point evaluated.
    step : ndarray
        The small step that is left, in the order of `_Point.normal`.
    """
    point = _evaluate(problem, tau, theta)
    freedom = max(problem.t.size - point.gradient.size, 1)
    damping = 0.0
    for _ in range(MOST_STEPS):
        step, errors = _step(problem, point, damping, freedom)
        # Relative to tau, so that the two are alike.
        size = max(abs(float(step[-2])), abs(float(step[-1])) / point.tau)
        error = max(float(errors[0]), float(errors[1]) / point.tau)
        least = min(float(errors[0]), float(errors[1]) / point.tau)
        if size <= max(close, ROUNDING) or size * (size + 3 * error) <= SMALL_ERROR * least:
            break
        trial = _evaluate(problem, *_moved(problem, point, step))
        if trial.sse <= point.sse:
            point, damping = trial, damping / 10 if damping > 1e-6 else 0.0
        elif damping < 1e8:
            damping = max(10 * damping, 1e-3)
        else:
            break
    return point, step


def _step(problem: _Problem, point: _Point, damping: float, freedom: int) -> tuple[Real, Real]:
    """Gauss-Newton step, and standard errors of ln(tau) and theta.

    A dead time at a bound stays there while the data push it outwards.
    """
    _, _, earliest, latest = problem.bounds
    normal = point.normal
    if damping:
        normal = normal + damping * np.diag(normal.diagonal())
    inverse = _inverse(normal)
    errors = np.sqrt(inverse.diagonal()[-2:] * (point.sse / freedom))
    step = inverse @ point.gradient
    outwards = (point.theta <= earliest and step[-1] < 0) or (
        point.theta >= latest and step[-1] > 0
    )
    if outwards:
        step = np.append(_inverse(normal[:-1, :-1]) @ point.gradient[:-1], 0.0)
    return step, errors


def _moved(problem: _Problem, point: _Point, step: Real) -> tuple[float, float]:
    """New (tau, theta) within their bounds; tau changes by a factor of 4 at most."""
    fastest, slowest, earliest, latest = problem.bounds
    factor = math.exp(min(max(float(step[-2]), -1.4), 1.4))
    return (
        min(max(point.tau * factor, fastest), slowest),
        min(max(point.theta + float(step[-1]), earliest), latest),
    )


def _result(problem: _Problem, point: _Point, step: Real, held: HeldInput) -> LeastSquaresFit:
    """Take the small last step in all parameters and state the errors."""
    tau, theta = _moved(problem, point, step)
    linear = point.linear + step[:-2]
    sse = max(point.sse - float(point.gradient @ step), 0.0)
    freedom = problem.t.size - step.size
    # K, ln(tau), theta, pv0, drift, start
    order = [0, step.size - 2, step.size - 1, *range(1, step.size - 2)]
    units = np.ones(step.size)
    units[1] = tau
    covariance = _inverse(point.normal)[np.ix_(order, order)] * np.outer(units, units)
    return LeastSquaresFit(
        K=float(linear[0]),
        tau=tau,
        theta=theta,
        pv0=float(linear[1]) + problem.pv_first,
        drift=float(linear[2]) if problem.drift else 0.0,
        start=float(linear[-1]) if problem.start else 0.0,
        covariance=covariance * sse / freedom,
        sse=sse,
        freedom=freedom,
        t0=problem.t0,
        held=held,
        drift_fitted=problem.drift,
        start_fitted=problem.start,
    )
