"""Least squares of the simulation error for any process structure, its gains eliminated.

The gains, rest, drift and start are linear and solved for at every shape [1]_; the shape (lags,
damping, dead time) is searched from the best points of a grid about the first-order fit by damped
Gauss-Newton steps within bounds.

References
----------
.. [1] G. Golub and V. Pereyra, "Separable nonlinear least squares: the variable projection method
   and its applications," Inverse Problems, vol. 19, no. 2, pp. R1-R26, 2003.
   doi:10.1088/0266-5611/19/2/201
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from identification.condense import Samples, condense
from identification.held_input import HeldInput
from identification.least_squares import LeastSquaresFit
from identification.structures import (
    EQUAL_LAGS,
    LEAD,
    LEAST_DAMPED,
    ONE_LAG,
    Shape,
    Structure,
    design,
)
from loop.signals import Real

# Values for each move that the search works on, and in all; and for a structure that nothing calls
# for, whose figures are only shown beside the others'.
VALUES, MOST_VALUES = 150, 1200
FEW_VALUES = 50
# Factors on the first-order fit's lag and dead time, and values of q, that the grid takes.
LAGS, MANY_LAGS, DEAD_TIMES = (0.7, 1.1), (0.3, 0.6, 1.0, 1.6, 3.0), (0.0, 0.5, 1.0)
# A lead hides a lag: that of the first-order fit may be ten times too short.
HIDDEN_LAGS = (0.7, 1.1, 3.0, 10.0)
REAL_LAGS, SWINGING = (0.08, 0.22), (0.3, 0.7, 2.0, 8.0, 30.0)
# The best points of the grid that are followed.
STARTS = 2
MOST_STEPS = 40
# A step that lowers the sum of squares by so little changes nothing that the data could tell.
CLOSE = 1e-6
# Lags that differ by less than a fifth are known by their sum alone.
NEARLY_EQUAL = 0.99 * EQUAL_LAGS
# For derivatives by differences: half the digits.
DELTA = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StructureFit:
    """One structure fitted to a record.

    Attributes
    ----------
    structure : Structure
        Kind of process.
    values : tuple of float
        Parameters, in the order of `structure.names`.
    covariance : ndarray, shape (p, p)
        Of the parameters, as white noise would leave it.
    linear : ndarray
        Gains, rest [PV], slope [PV/s] and start [PV], whichever were fitted.
    shape : tuple of float
        What is not linear.
    sse : float
        Sum of the squared residuals of all readings. [PV^2]
    free : int
        Parameters fitted, those of rest, drift and start included.
    freedom : int
        Readings less parameters.
    held : HeldInput
        Output.
    t0 : float
        Time of the first sample. [s]
    drift, start : bool
        Whether these were fitted.
    """

    structure: Structure
    values: tuple[float, ...]
    covariance: Real
    linear: Real
    shape: Shape
    sse: float
    free: int
    freedom: int
    held: HeldInput
    t0: float
    drift: bool
    start: bool

    @property
    def noise_sd(self) -> float:
        """Standard deviation of a reading about the model. [PV]"""
        return float((self.sse / self.freedom) ** 0.5)

    def swing(self, t: Real) -> float:
        """Highest less lowest of the answer to OP alone, at the record's times. [PV]

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times, increasing. [s]
        """
        answers = self.structure.answer(self.held, t, self.shape)
        return float(np.ptp(np.stack(answers, axis=1) @ self.linear[: len(answers)]))

    def predict(self, t: Real) -> Real:
        """Model's PV; times begin at the record's first sample. [PV]

        Parameters
        ----------
        t : ndarray, shape (n,)
            Times, increasing, the first one of the record first. [s]
        """
        columns = design(
            self.structure, self.held, t, self.shape, drift=self.drift, start=self.start
        )
        return np.asarray(columns @ self.linear)


def fit_structure(
    structure: Structure, samples: Samples, first_order: LeastSquaresFit, *, thorough: bool = True
) -> StructureFit:
    """Fit one structure to a record.

    Parameters
    ----------
    structure : Structure
        Kind of process.
    samples : Samples
        What the first-order model was fitted to.
    first_order : LeastSquaresFit
        That fit: where to look for lags, and whether drift and start are free.
    thorough : bool
        Whether to search from several starts on a fine average of the record; a rough answer is
        enough to show that nothing calls for a structure.
    """
    held = first_order.held
    values = VALUES if thorough else FEW_VALUES
    few = condense(
        samples.t,
        samples.pv,
        held.instants,
        weight=samples.weight,
        at_most=min(values * (held.moves + 1), MOST_VALUES),
    )
    search = _Search(structure, few, first_order)
    starts = sorted(search.grid(), key=search.squares)[: STARTS if thorough else 1]
    found = min((search.descend(start) for start in starts), key=search.squares)
    return _result(search.structure, samples, first_order, search.shape(found))


class _Search:
    """Shape of a structure as a point within a box: logarithms of lag and q, and the dead time."""

    def __init__(self, structure: Structure, few: Samples, fit: LeastSquaresFit) -> None:
        self.structure, self.fit, self.t = structure, fit, few.t
        self.root = np.ones_like(few.t) if few.weight is None else np.sqrt(few.weight)
        self.y = few.pv * self.root
        span = float(few.t[-1] - few.t[0])
        spacing = span / (few.t.size - 1)
        self.latest = max(span - float(fit.held.instants[0] - few.t[0]) - 2 * spacing, 0.0)
        # Behind an integrator the lag is part of what the first-order fit calls a dead time.
        slow = max(fit.theta, 3 * spacing) if structure.integrates else fit.tau
        self.lag = min(max(slow, spacing), span)
        q = (EQUAL_LAGS, LEAST_DAMPED) if structure.swings else (ONE_LAG, EQUAL_LAGS)
        boxes = {
            "lag": (np.log(spacing / 20), np.log(3 * span)),
            "q": (np.log(q[0]), np.log(q[1])),
            "theta": (0.0, self.latest),
        }
        self.low, self.high = np.array([boxes[name] for name in structure.shape]).T
        units = {"lag": 1.0, "q": 1.0, "theta": max(self.lag / 10, spacing)}
        self.unit = np.array([units[name] for name in structure.shape])

    def shape(self, point: Real) -> Shape:
        return tuple(
            float(value) if name == "theta" else float(np.exp(value))
            for name, value in zip(self.structure.shape, point, strict=True)
        )

    def grid(self) -> list[Real]:
        fit = self.fit
        lags: tuple[float, ...] = LAGS
        if self.structure.swings or self.structure.integrates:
            lags = MANY_LAGS
        elif self.structure is LEAD:
            lags = HIDDEN_LAGS
        choices = {
            "lag": [np.log(self.lag * factor) for factor in lags],
            "q": [np.log(q) for q in (SWINGING if self.structure.swings else REAL_LAGS)],
            "theta": [fit.theta * factor for factor in DEAD_TIMES],
        }
        points = product(*(choices[name] for name in self.structure.shape))
        return [np.clip(np.array(point), self.low, self.high) for point in points]

    def residual(self, point: Real) -> Real:
        columns = design(
            self.structure, self.fit.held, self.t, self.shape(point),
            drift=self.fit.drift_fitted, start=self.fit.start_fitted,
        ) * self.root[:, None]  # fmt: skip
        q = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
        return np.asarray(self.y - q @ (q.T @ self.y))

    def squares(self, point: Real) -> float:
        left = self.residual(point)
        return float(left @ left)

    def descend(self, point: Real) -> Real:
        """Damped Gauss-Newton steps on the residual with the linear part eliminated."""
        left, damping = self.residual(point), 1e-3
        for _ in range(MOST_STEPS):
            jacobian = np.stack(
                [
                    (self.residual(point + off) - left) / DELTA
                    for off in np.diag(self.unit * DELTA * np.where(point < self.high, 1, -1))
                ],
                axis=1,
            ) * np.where(point < self.high, 1, -1)
            normal, gradient = jacobian.T @ jacobian, jacobian.T @ left
            # What pushes out of the box does not move.
            free = ~(
                ((point <= self.low) & (gradient > 0)) | ((point >= self.high) & (gradient < 0))
            )
            if not np.any(free):
                return point
            normal = normal[np.ix_(free, free)]
            weighted = normal + damping * np.diag(np.diag(normal)) + 1e-300 * np.eye(len(normal))
            step = np.zeros(point.size)
            step[free] = -np.linalg.lstsq(weighted, gradient[free], rcond=1e-15)[0]
            trial = np.clip(point + step * self.unit, self.low, self.high)
            trial_left = self.residual(trial)
            gained = float(left @ left - trial_left @ trial_left)
            if gained >= 0:
                point, left, damping = trial, trial_left, damping / 10
                if gained <= CLOSE * float(left @ left) or np.max(np.abs(step)) < CLOSE:
                    return point
            elif damping > 1e6:
                return point
            else:
                damping *= 10
        return point


def _result(
    structure: Structure, samples: Samples, fit: LeastSquaresFit, shape: Shape
) -> StructureFit:
    """Solve for the gains on all samples and state the errors of the parameters."""
    t, held = samples.t, fit.held
    root = np.ones_like(t) if samples.weight is None else np.sqrt(samples.weight)

    def columns(at: Shape) -> Real:
        return root[:, None] * design(
            structure, held, t, at, drift=fit.drift_fitted, start=fit.start_fitted
        )

    about = columns(shape)
    scale = np.maximum(np.linalg.norm(about, axis=0), 1e-300)
    linear = np.linalg.lstsq(about / scale, samples.pv * root, rcond=1e-12)[0] / scale
    left = samples.pv * root - about @ linear
    sse = float(left @ left)
    deltas = [DELTA * max(abs(value), 1e-3 * (t[-1] - t[0])) for value in shape]
    loose = [i for i in range(len(shape)) if not _held_equal(structure, shape, i)]
    moved = [(columns(_replaced(shape, i, deltas[i])) - about) @ linear / deltas[i] for i in loose]
    jacobian = np.column_stack((about, *moved))
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    freedom = max(int(np.sum(root**2)) - jacobian.shape[1], 1)
    inner = (jacobian / size).T @ (jacobian / size)
    spread = np.linalg.pinv(inner, rcond=1e-13, hermitian=True) / np.outer(size, size)
    spread *= sse / freedom
    gains = about.shape[1] - 1 - (fit.drift_fitted or structure.integrates)
    gains -= fit.start_fitted and not structure.integrates
    chosen = np.r_[0:gains, about.shape[1] : jacobian.shape[1]]
    turn = _parameter_jacobian(structure, linear[:gains], shape)
    turn = turn[:, [*range(gains), *(gains + i for i in loose)]]
    return StructureFit(
        structure=structure,
        values=structure.parameters(linear[:gains], shape),
        covariance=turn @ spread[np.ix_(chosen, chosen)] @ turn.T,
        linear=linear,
        shape=shape,
        sse=sse,
        free=about.shape[1] + len(shape),
        freedom=freedom,
        held=held,
        t0=float(t[0]),
        drift=fit.drift_fitted,
        start=fit.start_fitted,
    )


def _held_equal(structure: Structure, shape: Shape, i: int) -> bool:
    """Whether a q is taken as that of equal lags, beyond which the answer would swing."""
    return structure.shape[i] == "q" and not structure.swings and shape[i] > NEARLY_EQUAL


def _replaced(shape: Shape, i: int, delta: float) -> Shape:
    return (*shape[:i], shape[i] + delta, *shape[i + 1 :])


def _parameter_jacobian(structure: Structure, gains: Real, shape: Shape) -> Real:
    """Derivatives of the parameters with respect to gains and shape, by central differences."""
    point = np.array([*gains, *shape])

    def at(values: Real) -> Real:
        return np.array(structure.parameters(values[: gains.size], tuple(values[gains.size :])))

    columns = []
    for i, value in enumerate(point):
        delta = np.zeros(point.size)
        delta[i] = DELTA * max(abs(value), 1e-12)
        columns.append((at(point + delta) - at(point - delta)) / (2 * delta[i]))
    return np.stack(columns, axis=1)
