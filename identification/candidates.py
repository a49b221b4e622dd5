"""Which process structure a record speaks for, and by what figures.

A fit percentage always prefers the richer structure. Here a structure has to be called for by an
information criterion corrected for the residual's colour, has to leave a residual that is nearer to
noise, has to matter to whoever uses the model, and its own parameters have to be determined;
otherwise the simpler one stands.
"""

import math
from dataclasses import dataclass

import numpy as np

from identification.candidate import Candidate, Choice
from identification.condense import Samples
from identification.delay_fit import fit_delay, may_lack_lag
from identification.disturbances import Explanation, weighted_residual
from identification.least_squares import LeastSquaresFit
from identification.plausibility import answer_swing
from identification.quality import Colour, Misfit, residual_colour, worst_misfit
from identification.steps import Step
from identification.structure_fit import StructureFit, fit_structure
from identification.structures import (
    DOUBLE_INTEGRATOR,
    FIRST_ORDER,
    INTEGRATOR,
    INTEGRATOR_WITH_LAG,
    LEAD,
    PURE_DELAY,
    TWO_LAGS,
    UNDERDAMPED,
    Structure,
)
from loop.signals import Real

# Ten and more is very strong evidence on the usual scale of differences of this criterion [1]_:
# e^5 = 150 to one.
DECISIVE = 10.0
# An error of a first-order model below a fiftieth of the answer changes no tuning that is verified
# over ±50 %; TCLab's heaters, whose two lags the noise shows well, stay under it.
MATERIAL = 0.02
# A richer structure takes away at least half of the systematic error.
HALF = 0.5
# Part of the final change below which an integrator is as likely as a slow lag; and how much worse
# its criterion may be. A ramp must last five dead times to be one,
# about what a loop tuned for that dead time looks ahead.
SETTLING, AS_GOOD, RAMP = 0.5, 2.0, 5.0
# A residual that is this much more coloured than another is not the same.
COLOUR = 1.2
# A residual below this part of PV's range is arithmetic.
ROUNDING = 1e-7


def choose(
    samples: Samples, explanation: Explanation, steps: tuple[Step, ...], spacing: float
) -> Choice:
    """Fit the structures that the record can call for and take the simplest that does.

    Two lags are always fitted beside one. Swings and leads follow where one lag misses PV by more
    than a fiftieth of the answer, a gain with dead time where the lag is too short to be seen;
    integrators where the record ends before half of the final change
    or nothing else fits.

    Parameters
    ----------
    samples : Samples
        What was fitted.
    explanation : Explanation
        First-order fit with what was decided about drift and start.
    steps : tuple of Step
        Moves of the output.
    spacing : float
        Time between samples. [s]

    References
    ----------
    .. [1] R. E. Kass and A. E. Raftery, "Bayes factors," J. Am. Statist. Assoc., vol. 90, no. 430,
       pp. 773-795, 1995. doi:10.1080/01621459.1995.10476572 (scale quoted from memory)
    """
    first_order = explanation.fit
    rows = [_Row.of_first_order(explanation, samples)]
    misfit = _misfit(rows[0].residual, samples, first_order, spacing)
    part = misfit.size / max(_swing(first_order, samples.t), 1e-300)
    holds = _holds(steps, float(samples.t[-1]))
    seen = 1 - math.exp(-max(max(holds) - first_order.theta, 0.0) / first_order.tau)
    wanted = [TWO_LAGS]
    if part > MATERIAL:
        wanted += [UNDERDAMPED, LEAD]
    if seen < SETTLING or part > MATERIAL:
        wanted += [INTEGRATOR, INTEGRATOR_WITH_LAG, DOUBLE_INTEGRATOR]
    thorough = len(wanted) > 1
    rows += [
        _Row.of(fit_structure(s, samples, first_order, thorough=thorough), samples) for s in wanted
    ]
    rows += _delay_alone(rows[:2], samples, first_order, spacing)
    candidates = _candidates(rows, samples, first_order, spacing)
    return _chosen(candidates, seen=seen, longest=max(holds))


def _delay_alone(
    lagged: list["_Row"], samples: Samples, fit: LeastSquaresFit, spacing: float
) -> list["_Row"]:
    """A gain with dead time, where the better of the fits with one and two lags hardly has any."""
    best = min(lagged, key=lambda row: row.fit.sse)
    lags = slice(1, best.values.size - 1)
    lag, theta = float(best.values[lags].sum()), float(best.values[-1])
    error = float(best.covariance[lags, lags].sum()) ** 0.5
    if not may_lack_lag(lag, error, theta, spacing):
        return []
    alone = fit_delay(samples, fit, lag=lag, theta=theta)
    return [] if alone is None else [_Row.of(alone, samples)]


def _swing(fit: LeastSquaresFit | StructureFit, t: Real) -> float:
    """Size of a model's answer to OP. [PV]"""
    return fit.swing(t) if isinstance(fit, StructureFit) else answer_swing(fit, t)


def _holds(steps: tuple[Step, ...], end: float) -> list[float]:
    return [b - a.end for a, b in zip(steps, [*(s.start for s in steps[1:]), end], strict=True)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Row:
    """A fit with its residual, before it is compared."""

    structure: Structure
    fit: LeastSquaresFit | StructureFit
    values: Real
    covariance: Real
    free: int
    residual: Real
    colour: Colour

    @classmethod
    def of_first_order(cls, explanation: Explanation, samples: Samples) -> "_Row":
        fit = explanation.fit
        return cls(
            structure=FIRST_ORDER,
            fit=fit,
            values=np.array([fit.K, fit.tau, fit.theta]),
            covariance=fit.covariance[:3, :3],
            free=4 + fit.drift_fitted + fit.start_fitted,
            residual=weighted_residual(fit, samples),
            colour=explanation.colour,
        )

    @classmethod
    def of(cls, fit: StructureFit, samples: Samples) -> "_Row":
        residual = weighted_residual(fit, samples)
        return cls(
            structure=fit.structure,
            fit=fit,
            values=np.array(fit.values),
            covariance=fit.covariance,
            free=fit.free,
            residual=residual,
            colour=residual_colour(residual),
        )


def _misfit(residual: Real, samples: Samples, fit: LeastSquaresFit, spacing: float) -> Misfit:
    """Largest systematic error over a quarter of the first-order time constant."""
    weight = samples.weight
    span = float(samples.t[-1] - samples.t[0])
    return worst_misfit(
        samples.t,
        residual if weight is None else residual / np.sqrt(weight),
        noise_sd=math.sqrt(float(residual @ residual) / residual.size),
        width=max(min(fit.tau, span) / 4, 5 * spacing),
        weight=weight,
    )


def _candidates(
    rows: list[_Row], samples: Samples, fit: LeastSquaresFit, spacing: float
) -> list[Candidate]:
    """All fits with comparable figures, the first-order one first."""
    readings = fit.freedom + rows[0].free
    # The structure nearest to the truth shows how coloured the noise itself is.
    independent = max(readings / min(row.colour.inflation for row in rows), 10.0)
    floor = readings * (ROUNDING * float(np.ptp(samples.pv))) ** 2

    def criterion(row: _Row) -> float:
        sse = max(row.fit.sse, floor)
        return independent * math.log(sse / readings) + row.free * math.log(independent)

    reference = criterion(rows[0])
    found = []
    for row in rows:
        swing = _swing(row.fit, samples.t)
        misfit = _misfit(row.residual, samples, fit, spacing)
        covariance = row.covariance * row.colour.inflation
        found.append(
            Candidate(
                structure=row.structure,
                fit=row.fit,
                values=row.values,
                standard_errors=np.sqrt(np.maximum(np.diag(covariance), 0.0)),
                covariance=covariance,
                free=row.free,
                bic=criterion(row) - reference,
                misfit=misfit,
                part=misfit.size / max(swing, 1e-300),
                swing=swing,
                colour=row.colour,
            )
        )
    return found


def _chosen(candidates: list[Candidate], *, seen: float, longest: float) -> Choice:
    first = candidates[0]
    chosen, why = (
        _integrating(candidates, seen=seen, longest=longest)
        or _without_lag(candidates)
        or (first, "")
    )
    if chosen is first and first.part > MATERIAL:
        chosen = _second_order(candidates)
    ordered = tuple(sorted(candidates, key=lambda c: c.bic))
    if not why:
        why = _why(chosen, first, next(c for c in ordered if c is not chosen))
    return Choice(chosen=chosen, candidates=ordered, reason=why)


def _integrating(
    candidates: list[Candidate], *, seen: float, longest: float
) -> tuple[Candidate, str] | None:
    """An integrator where the record shows no settling; the simplest that serves."""
    first = candidates[0]
    found = [c for c in candidates if c.structure.integrates and c.determined]
    if not found:
        return None
    chosen = min(found, key=lambda c: (c.free, c.bic))
    for rival in sorted(found, key=lambda c: c.free):
        if rival.bic < chosen.bic - DECISIVE:
            chosen = rival
    theta = float(chosen.values[-1])
    others = [c for c in candidates if c.determined and not c.structure.integrates]
    best = min((c.bic for c in others), default=math.inf)
    settled = seen >= SETTLING and first.determined
    limit = best - DECISIVE if settled else min(best + AS_GOOD, first.bic + AS_GOOD)
    if chosen.bic > limit or longest < RAMP * theta:
        return None
    return chosen, (
        f"PV shows no settling, and the {chosen.structure.name} explains it "
        f"{_than(chosen.bic, 'one lag with dead time')}"
    )


def _without_lag(candidates: list[Candidate]) -> tuple[Candidate, str] | None:
    """A gain with dead time where a lag explains nothing more, by any of three figures."""
    alone = next((c for c in candidates if c.structure is PURE_DELAY), None)
    if alone is None or not alone.determined:
        return None
    best = min((c for c in candidates if c is not alone), key=lambda c: c.bic)
    limit = max(best.part, MATERIAL)
    white = alone.colour.inflation < COLOUR * best.colour.inflation
    if alone.bic > best.bic or alone.part > limit or not white:
        return None
    return alone, (
        f"gain and dead time are taken: {best.structure.name} with dead time would fit "
        f"{_than(best.bic - alone.bic, 'they do')}, and the residual is no whiter"
    )


def _second_order(candidates: list[Candidate]) -> Candidate:
    """A richer structure where it is called for in every respect, else the first-order one."""
    first = candidates[0]
    fit_to_use = [
        c
        for c in candidates[1:]
        if c.determined
        and not c.structure.integrates
        and c.bic < -DECISIVE
        and c.part < HALF * first.part
    ]
    if not fit_to_use:
        return first
    best = min(fit_to_use, key=lambda c: c.bic)
    simplest = min(c.free for c in fit_to_use if c.bic < best.bic + DECISIVE)
    return min((c for c in fit_to_use if c.free <= simplest), key=lambda c: c.bic)


def _why(chosen: Candidate, first: Candidate, runner_up: Candidate) -> str:
    """The choice in words."""
    name = runner_up.structure.name
    if chosen is not first:
        return (
            f"{chosen.structure.name} and dead time are taken: the criterion is "
            f"{-chosen.bic:.0f} better than for one lag, which misses PV by up to "
            f"{100 * first.part:.2g} % of the answer"
        )
    if runner_up.bic < -DECISIVE and first.part <= MATERIAL:
        return (
            f"{name} would fit {_than(runner_up.bic, 'one lag')}, but one lag is off by no more "
            f"than {100 * first.part:.2g} % of the answer, which no tuning notices"
        )
    if runner_up.bic < -DECISIVE:
        return (
            f"no structure that the data determine fits much better than one lag; the nearest, "
            f"{name}, {_than(runner_up.bic, 'one lag')}"
        )
    return f"one lag is enough: {name} would fit {_than(runner_up.bic, 'it')}"


def _than(bic: float, other: str) -> str:
    """A difference of the criterion in words."""
    if bic < -1:
        return f"better than {other} (criterion {-bic:.0f} lower)"
    if bic > 1:
        return f"no better than {other} (criterion {bic:.0f} higher)"
    return f"as well as {other}"
