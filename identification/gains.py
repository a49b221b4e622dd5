"""Gain of every step on its own: whether they agree in sign and size."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

from identification.condense import Samples, condense
from identification.held_input import HeldInput, lag_response
from identification.least_squares import LeastSquaresFit
from identification.quality import residual_colour
from identification.steps import Step
from loop.errors import FitNotTrusted
from loop.signals import Real

# Four standard errors from nothing: one false alarm in 16,000.
CERTAIN = 4.0
# A wrong sign counts when it is no small effect beside the others.
NOT_SMALL = 0.1
# Beyond this a test signal is on, and single steps say little.
MOST_STEPS = 12
MOST_SAMPLES = 600


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepGains:
    """Gain of each step with tau and theta in common.

    Attributes
    ----------
    gains, errors : ndarray, shape (m,)
        Gains and their standard errors. [PV/OP]
    """

    gains: Real
    errors: Real


def step_gains(fit: LeastSquaresFit, samples: Samples, steps: tuple[Step, ...]) -> StepGains | None:
    """Fit a gain to every step, tau and theta in common.

    A common gain of steps that differ spoils tau and theta, so that both are searched anew: from
    the common model and a grid, then by Nelder and Mead's method.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit with one gain for all.
    samples : Samples
        What was fitted.
    steps : tuple of Step
        Moves of the output.

    Returns
    -------
    gains : StepGains or None
        None for a single step, and for very many.
    """
    if not 2 <= len(steps) <= MOST_STEPS:
        return None
    few = condense(
        samples.t,
        samples.pv,
        fit.held.instants,
        weight=samples.weight,
        at_most=MOST_SAMPLES * len(steps),
    )
    hold = min(b.start - a.end for a, b in pairwise(steps))
    shortest, longest = hold / 100, float(few.t[-1] - few.t[0])

    def squares(point: Real) -> float:
        tau = float(np.exp(np.clip(point[0], np.log(shortest / 10), np.log(10 * longest))))
        return _separate(fit, few, steps, tau, max(float(point[1]), 0.0)).squares

    grid = [np.array([np.log(fit.tau), fit.theta])] + [
        np.array([np.log(tau), theta])
        for tau in np.geomspace(shortest, longest, 8).tolist()
        for theta in np.linspace(0, hold, 9).tolist()
    ]
    best = min(grid, key=squares)
    around = best + np.array([[0.0, 0.0], [0.2, 0.0], [0.0, 0.05 * np.exp(best[0])]])
    found = minimize(
        squares, best, method="Nelder-Mead", options={"initial_simplex": around, "maxfev": 60}
    )
    tau, theta = float(np.exp(found.x[0])), max(float(found.x[1]), 0.0)
    separate = _separate(fit, few, steps, tau, theta)
    variance = separate.variances[: len(steps)] * residual_colour(separate.residual).inflation
    return StepGains(gains=separate.parameters[: len(steps)], errors=np.sqrt(variance))


def require_one_sign(gains: StepGains, steps: tuple[Step, ...]) -> None:
    """Refuse steps that PV answers in opposite senses.

    Parameters
    ----------
    gains : StepGains
        Gain of every step.
    steps : tuple of Step
        Moves of the output.

    Raises
    ------
    FitNotTrusted
        Two steps have gains that differ in sign.
    """
    size = np.abs(gains.gains)
    certain = (size > CERTAIN * gains.errors) & (size > NOT_SMALL * np.max(size))
    up, down = certain & (gains.gains > 0), certain & (gains.gains < 0)
    if np.any(up) and np.any(down):
        i, j = int(np.argmax(up)), int(np.argmax(down))
        raise FitNotTrusted(
            f"The steps have gains that differ in sign: {gains.gains[i]:+.3g} at "
            f"{steps[i].start:.4g} s and {gains.gains[j]:+.3g} at {steps[j].start:.4g} s. "
            "Something else moved PV, or the process changes its sense; no linear model does."
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Separate:
    """Linear fit of one gain a step at given tau and theta."""

    parameters: Real
    variances: Real
    squares: float
    residual: Real


def _separate(
    fit: LeastSquaresFit, samples: Samples, steps: tuple[Step, ...], tau: float, theta: float
) -> _Separate:
    t = samples.t
    *parts, rest = _parts(fit.held, steps)
    columns = [_answer(part, t, tau, theta) for part in parts]
    if rest.moves:
        columns.append(_answer(rest, t, tau, theta))
    columns.append(np.ones_like(t))
    if fit.drift_fitted:
        columns.append(t - t[0])
    if fit.start_fitted:
        columns.append(np.exp(-(t - t[0]) / tau))
    root = np.ones_like(t) if samples.weight is None else np.sqrt(samples.weight)
    design = np.stack(columns, axis=1) * root[:, None]
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    u, s, vt = np.linalg.svd(design / scale, full_matrices=False)
    # A column that others contain has no gain of its own: nothing, with a large error.
    usable = s > 1e-8 * s[0]
    inverse = np.where(usable, 1 / np.maximum(s, 1e-300), 0.0)
    y = samples.pv * root
    best = (vt.T * inverse) @ (u.T @ y)
    left = y - (design / scale) @ best
    squares = float(left @ left)
    own = np.where(usable, inverse**2, 1e16) @ vt**2
    return _Separate(
        parameters=best / scale,
        variances=own / scale**2 * squares / max(t.size - best.size, 1),
        squares=squares,
        residual=left,
    )


def _answer(part: HeldInput, t: Real, tau: float, theta: float) -> Real:
    return lag_response(part, t, tau, theta)[0] if part.moves else np.zeros_like(t)


def _parts(held: HeldInput, steps: tuple[Step, ...]) -> list[HeldInput]:
    """The output split into the moves of every step, and the rest."""
    jumps = np.diff(held.levels)
    owner = np.full(held.moves, len(steps))
    for k, step in enumerate(steps):
        owner[(held.instants >= step.start) & (held.instants <= step.end)] = k
    return [
        HeldInput(
            instants=held.instants[owner == k],
            levels=np.concatenate(([0.0], np.cumsum(jumps[owner == k]))),
        )
        for k in range(len(steps) + 1)
    ]
