"""First order plus dead time from samples in closed loop, by the prediction error.

In a closed loop the output answers every disturbance, so a plain fit of PV to OP takes the
controller for the process. The error that counts is therefore the part of PV that neither the
output nor PV's own past foretells: the difference between PV and the model is whitened by an
autoregression, fitted along with the model.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from identification.even_stretches import Stretch, thinned
from identification.whitened_search import (
    Start,
    autoregression,
    columns,
    lag_samples,
    search,
    whiten,
)
from loop.signals import Real

# Samples that the grid is searched with.
FEW = 700
# Samples for each (tau + theta): enough to place the dead time, few enough for an autoregression
# to reach back over the disturbance's memory.
DENSITY = 30.0
MOST_STEPS = 25
# Pole of the noise that the second search starts from: nearly a random walk.
WANDERS = 0.97
# Two valleys are two when they lie this far apart, in ln(tau) or in (tau + theta); the deeper one
# is chance when it is lower by under so many variances (chi-squared of 3: 1 in 400 is 14).
APART, NOT_TOLD = 0.5, 14.0
# Relative step of the derivatives.
SMALL = 1e-4
# A step that lowers the sum of squares by less than this part of one sample's share ends the fit.
DONE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Rival:
    """Another process that explains the record almost as well.

    Attributes
    ----------
    K, tau, theta : float
        Process. [PV/OP], [s], [s]
    worse : float
        By how much its sum of squares is larger, in variances of the innovation. [-]
    """

    K: float
    tau: float
    theta: float
    worse: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PredictionErrorFit:
    """A model with the colour of its disturbance.

    Attributes
    ----------
    K, tau, theta : float
        Process. [PV/OP], [s], [s]
    noise : ndarray, shape (p,)
        Autoregression of the disturbance v, v[k] = sum noise[j] v[k-1-j] + e[k]. [-]
    covariance : ndarray, shape (3, 3)
        Of K, tau, theta, what the disturbance leaves uncertain included.
    innovation_sd : float
        Standard deviation of e. [PV]
    sse : float
        Sum of squares of e. [PV^2]
    freedom : int
        Samples less parameters.
    dt : float
        Spacing of the averages fitted. [s]
    by : int
        Samples in each average.
    stretches : tuple of Stretch
        The averages.
    predicted : tuple of ndarray
        Model without its disturbance, of every stretch. [PV]
    innovations : tuple of ndarray
        e of every stretch, from its p-th sample on. [PV]
    rivals : tuple of Rival
        Quite different processes that explain the record almost as well.
    """

    K: float
    tau: float
    theta: float
    noise: Real
    covariance: Real
    innovation_sd: float
    sse: float
    freedom: int
    dt: float
    by: int
    stretches: tuple[Stretch, ...]
    predicted: tuple[Real, ...]
    innovations: tuple[Real, ...]
    rivals: tuple[Rival, ...]

    @property
    def standard_errors(self) -> Real:
        """Of K, tau, theta, shape (3,). [PV/OP], [s], [s]"""
        return np.sqrt(np.diag(self.covariance))


def prediction_error_fit(
    stretches: tuple[Stretch, ...], dt: float, *, slowest: float, latest: float
) -> PredictionErrorFit:
    """Fit all stretches at once: common process and noise, own level and start for each.

    v = pv - K x(tau, theta) - level - start e^(-t/tau)
    e[k] = v[k] - sum noise[j] v[k-1-j], the sum of e^2 smallest over all parameters

    The search starts on a grid with a white and with a wandering disturbance, whichever ends
    lower; samples much denser than the process are averaged.

    Parameters
    ----------
    stretches : tuple of Stretch
        Samples.
    dt : float
        Their spacing. [s]
    slowest, latest : float
        Largest time constant and dead time to consider. [s]
    """
    total = sum(s.pv.size for s in stretches)
    by = max(round(total / FEW), 1)
    rough = _Problem(stretches, dt, by, slowest, latest)
    starts = [
        search(rough.stretches, rough.dt, slowest=slowest, latest=rough.latest, noise=noise)
        for noise in (np.zeros(0), np.array([WANDERS]))
    ]
    points = [rough.refine(start) for start, *_ in starts]
    lower = 0 if points[0].sse <= points[1].sse else 1
    points += [rough.refine(start) for start in starts[lower][1:]]
    best = min(points, key=lambda point: point.sse)
    rivals = tuple(rough.rivals(best, points))
    theta = best.theta + rough.shift
    dense = min((best.tau + theta) / DENSITY, max(theta, best.tau / DENSITY))
    finer = max(min(round(dense / dt), by), 1)
    if finer == by:
        return rough.result(best, rivals)
    fine = _Problem(stretches, dt, finer, slowest, latest)
    start = max(theta - fine.shift, 0.0)
    noise = fine.noise_at(best.tau, start)
    return fine.result(fine.refine(Start(tau=best.tau, theta=start, noise=noise)), rivals)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Point:
    """Normal equations of all parameters, scaled: K, levels and starts, ln tau, theta, noise."""

    tau: float
    theta: float
    noise: Real
    linear: Real
    sse: float
    scale: Real
    normal: Real
    gradient: Real
    innovation: Real
    count: int


class _Problem:
    """One fit of averages: the data, and what the search evaluates."""

    def __init__(
        self, stretches: tuple[Stretch, ...], dt: float, by: int, slowest: float, latest: float
    ) -> None:
        self.by = by
        self.dt = by * dt
        self.shift = (by - 1) / 2 * dt
        self.stretches = thinned(stretches, by)
        self.slowest, self.latest = slowest, max(latest - self.shift, self.dt)
        self.pv = [s.pv - s.pv.mean() for s in self.stretches]
        self.linear = 1 + 2 * len(self.stretches)

    def noise_at(self, tau: float, theta: float) -> Real:
        """Autoregression about the model at one point."""
        blocks = columns(self.stretches, self.dt, tau, theta)
        white, y = np.concatenate(blocks), np.concatenate(self.pv)
        a, *_ = np.linalg.lstsq(white, y, rcond=None)
        return autoregression([v - b @ a for v, b in zip(self.pv, blocks, strict=True)])

    def refine(self, start: Start) -> _Point:
        """Damped Gauss-Newton in all parameters at once."""
        point = self._evaluate(start.tau, start.theta, start.noise)
        damping = 0.0
        for _ in range(MOST_STEPS):
            trial = self._evaluate(*self._moved(point, self._step(point, damping)))
            gained = point.sse - trial.sse
            if gained >= 0:
                point, damping = trial, damping / 10 if damping > 1e-5 else 0.0
                if gained < DONE * point.sse / point.count:
                    break
            elif damping < 1e3:
                damping = max(10 * damping, 1e-3)
            else:
                break
        return point

    def _step(self, point: _Point, damping: float) -> Real:
        normal = point.normal + (damping + 1e-12) * np.eye(point.scale.size)
        return np.asarray(np.linalg.solve(normal, point.gradient) / point.scale)

    def _moved(self, point: _Point, step: Real) -> tuple[float, float, Real]:
        d_tau, d_theta = float(step[self.linear]), float(step[self.linear + 1])
        tau = point.tau * math.exp(min(max(d_tau, -0.7), 0.7))
        reach = max(0.5 * point.tau, 3 * self.dt)
        theta = point.theta + min(max(d_theta, -reach), reach)
        return (
            min(max(tau, self.dt / 4), self.slowest),
            min(max(theta, 0.0), self.latest),
            point.noise + step[self.linear + 2 :],
        )

    def _evaluate(self, tau: float, theta: float, noise: Real) -> _Point:
        p, linear = noise.size, self.linear
        blocks = self._with_derivatives(tau, theta)
        white = np.concatenate([whiten(block, noise) for block in blocks])
        y = np.concatenate([whiten(pv, noise) for pv in self.pv])
        gram = white.T @ white
        size = np.sqrt(np.maximum(gram.diagonal(), np.finfo(np.float64).tiny))
        inner = (white.T @ y) / size
        gram = gram / np.outer(size, size)
        inside = gram[:linear, :linear] + 1e-12 * np.eye(linear)
        a = np.linalg.solve(inside, inner[:linear]) / size[:linear]
        e = y - white[:, :linear] @ a
        past = np.concatenate(
            [
                _lags(pv - block[:, :linear] @ a, p)
                for pv, block in zip(self.pv, blocks, strict=True)
            ]
        )
        white[:, linear:] *= a[0]
        J = np.concatenate((white, past), axis=1)
        normal = J.T @ J
        scale = np.sqrt(np.maximum(normal.diagonal(), np.finfo(np.float64).tiny))
        return _Point(
            tau=tau,
            theta=theta,
            noise=noise,
            linear=a,
            sse=float(e @ e),
            scale=scale,
            normal=normal / np.outer(scale, scale),
            gradient=(J.T @ e) / scale,
            innovation=e,
            count=e.size,
        )

    def _with_derivatives(self, tau: float, theta: float) -> list[Real]:
        """Columns of every stretch, and what ln(tau) and theta do to the answer."""
        blocks = []
        later = SMALL * self.dt
        for s, block in zip(
            self.stretches, columns(self.stretches, self.dt, tau, theta), strict=True
        ):
            x = block[:, 0]
            slow = lag_samples(s.op, self.dt, tau * (1 + SMALL), theta)[s.lead :]
            late = lag_samples(s.op, self.dt, tau, theta + later)[s.lead :]
            blocks.append(np.column_stack((block, (slow - x) / SMALL, (late - x) / later)))
        return blocks

    def rivals(self, best: _Point, points: list[_Point]) -> Iterator[Rival]:
        """Other valleys whose floor the data hardly tell from that of the best."""
        variance = best.sse / best.count
        for point in points:
            apart = max(
                abs(math.log(point.tau / best.tau)),
                abs(point.theta - best.theta) / (best.tau + best.theta),
            )
            worse = point.sse - best.sse
            if apart > APART and worse < NOT_TOLD * variance:
                yield Rival(
                    K=float(point.linear[0]),
                    tau=point.tau,
                    theta=point.theta + self.shift,
                    worse=worse / variance,
                )

    def result(self, point: _Point, rivals: tuple[Rival, ...]) -> PredictionErrorFit:
        """State the fit in the samples' own time, with its errors."""
        freedom = max(point.count - point.scale.size, 1)
        variance = point.sse / freedom
        spread = np.linalg.pinv(point.normal, hermitian=True) * variance
        spread = spread / np.outer(point.scale, point.scale)
        order = np.array([0, self.linear, self.linear + 1])
        covariance = spread[order[:, None], order]
        covariance[1] *= point.tau
        covariance[:, 1] *= point.tau
        blocks = columns(self.stretches, self.dt, point.tau, point.theta)
        ends = np.cumsum([s.pv.size - point.noise.size for s in self.stretches])[:-1]
        return PredictionErrorFit(
            K=float(point.linear[0]),
            tau=point.tau,
            theta=point.theta + self.shift,
            noise=point.noise,
            covariance=covariance,
            innovation_sd=math.sqrt(variance),
            sse=point.sse,
            freedom=freedom,
            dt=self.dt,
            by=self.by,
            stretches=self.stretches,
            predicted=tuple(
                s.pv.mean() + block @ point.linear
                for s, block in zip(self.stretches, blocks, strict=True)
            ),
            innovations=tuple(np.split(point.innovation, ends)),
            rivals=rivals,
        )


def _lags(v: Real, p: int) -> Real:
    """Columns v[k-1] ... v[k-p] from row p on."""
    return np.column_stack([v[p - 1 - j : v.size - 1 - j] for j in range(p)])
