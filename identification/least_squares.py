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
from itertools import pairwise

import numpy as np

from identification.condense import Samples, condense
from identification.gauss_newton import Bounds, Problem, descend, descend_to_the_end, inverse
from identification.grid_search import search
from identification.held_input import HeldInput, lag_response
from loop.errors import PoorExcitation
from loop.signals import Real

# Averaged values for each move: neighbours differ by 4 % of the time since the move over four
# decades of it. With very many moves the total is held down.
VALUES, MOST_VALUES = 250, 5000
# Such averages move an estimate by under a fifth of a standard error, worth it from so many
# readings an average on. Noise must be above this part of the answer; and where an answer or an
# unsteady start begins, an average must be narrow against tau and the corner that lies within it
# off by less than this part of that average's error.
WORTHWHILE, NOISY, NARROW, SHARP = 20, 1e-3, 0.1, 0.5
# So few samples cost hardly more a step than their averages, which are then not worth a descent.
FEW = 4096
# The first steps need no more than to start the last ones well. Of several valleys those are not
# followed to their bottom that lie this many times as high as the lowest when nearly there.
CLOSE, ROUGH, HOPELESS = 1e-3, 0.05, 2.0
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


def fopdt_least_squares(
    t: Real,
    pv: Real,
    held: HeldInput,
    *,
    weight: Real | None = None,
    drift: bool = False,
    start: bool = False,
    earliest: float = 0.0,
    latest: float | None = None,
    begin: tuple[float, float] | None = None,
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
    latest : float, optional
        Largest dead time allowed, for an input that repeats itself. Default: what the record can
        show. [s]
    begin : tuple of float, optional
        tau and theta to start from, of another fit to the same answer. Default: they are searched.
        [s]

    Raises
    ------
    PoorExcitation
        There are too few samples, no move, or PV does not change.
    """
    parameters = 4 + drift + start
    moved = t.size > 0 and bool(pv[-1] != pv[0] or (pv != pv[0]).any())
    if t.size <= parameters or not held.moves or not moved:
        change = float(np.ptp(pv)) if t.size else 0.0
        raise PoorExcitation(
            f"{t.size} samples with {held.moves} moves and a PV range of {change:.3g} cannot "
            f"carry {parameters} parameters."
        )
    t0, pv_first = float(t[0]), float(pv[0])
    span = float(t[-1]) - t0
    spacing = span / (t.size - 1)
    bounds = Bounds(
        fastest=FASTEST * spacing,
        slowest=SLOWEST * span,
        earliest=earliest,
        latest=max(t0 + span - float(held.instants[0]) - 2 * spacing, 0.0)
        if latest is None
        else latest,
    )

    def problem(samples: Samples) -> Problem:
        return Problem(
            t=samples.t,
            pv=samples.pv,
            weight=samples.weight,
            spread=samples.spread,
            held=held,
            drift=drift,
            start=start,
            bounds=bounds,
            t0=t0,
            pv_first=pv_first,
        )

    few = condense(
        t, pv, held.instants, weight=weight, at_most=min(VALUES * (held.moves + 1), MOST_VALUES)
    )
    averaged = problem(few)
    if begin is None:
        found = search(averaged, spacing)
        if len(found) > 1:
            rough = [descend(averaged, *start, ROUGH)[0] for start in found]
            least = min(point.sse for point in rough)
            reached = [
                descend(averaged, point.tau, point.theta, CLOSE)[0]
                for point in rough
                if point.sse <= HOPELESS * least
            ]
            best = min(reached, key=lambda point: point.sse)
            found = [(best.tau, best.theta)]
        begin = found[0]
    if few.t.size == t.size or t.size > FEW:
        fit = _result(averaged, begin, t.size, few.scatter)
        if few.t.size == t.size or _averages_do(fit, few):
            return fit
        begin = (fit.tau, fit.theta)
    whole = problem(Samples(t=t, pv=pv, weight=weight))
    return _result(whole, begin, t.size, 0.0)


def _averages_do(fit: LeastSquaresFit, few: Samples) -> bool:
    """Whether a fit to averages is as good as one to all readings."""
    if few.spread is None or few.weight is None:
        return False
    readings, noise, levels = (
        fit.freedom + len(fit.covariance),
        fit.noise_sd,
        fit.held.levels.tolist(),
    )
    jumps = [abs(after - before) for before, after in pairwise(levels)]
    if readings < WORTHWHILE * few.t.size or noise < NOISY * abs(fit.K) * max(jumps):
        return False
    if fit.start_fitted and 12 * float(few.spread[0]) > (NARROW * fit.tau) ** 2:
        return False
    # A corner in the middle of an average of width w is off by its jump times w/(8 tau).
    off = abs(fit.K) / (8 * fit.tau)
    for jump, instant in zip(jumps, fit.held.instants.tolist(), strict=True):
        at = min(int(few.t.searchsorted(instant + fit.theta)), few.t.size - 1)
        width = math.sqrt(12 * float(few.spread[at]))
        sharp = jump * off * width * math.sqrt(float(few.weight[at])) < SHARP * noise
        if width > NARROW * fit.tau or not sharp:
            return False
    return True


def _result(
    problem: Problem, begin: tuple[float, float], readings: int, scatter: float
) -> LeastSquaresFit:
    """Descend from a start to the bottom and state the errors there.

    Of averages, `scatter` is the sum of squares of the readings about them, of which the model's
    own movement explains a part.
    """
    point = descend_to_the_end(problem, *begin)
    tau, linear = point.tau, point.linear
    K, drift = float(linear[0]), float(linear[2]) if problem.drift else 0.0
    sse = point.sse + scatter
    if problem.spread is not None and problem.weight is not None:
        slope = drift - K * np.concatenate(point.slopes)
        if problem.start:
            slope -= linear[-1] / tau * np.exp(-(problem.t - problem.t0) / tau)
        sse -= float((problem.weight * problem.spread) @ slope**2)
    sse = max(sse, 0.0)
    size = len(point.normal)
    freedom = readings - size
    # K, tau, theta, pv0, drift, start
    order = np.array([0, size - 2, size - 1, *range(1, size - 2)])
    covariance = inverse(point.normal)[order[:, None], order] * (sse / freedom)
    covariance[1] *= tau
    covariance[:, 1] *= tau
    return LeastSquaresFit(
        K=K,
        tau=tau,
        theta=point.theta,
        pv0=float(linear[1]) + problem.pv_first,
        drift=drift,
        start=float(linear[-1]) if problem.start else 0.0,
        covariance=covariance,
        sse=sse,
        freedom=freedom,
        t0=problem.t0,
        held=problem.held,
        drift_fitted=problem.drift,
        start_fitted=problem.start,
    )
