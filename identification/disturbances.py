"""Decide whether a record shows a drift or an unsteady start besides the answer to the output.

Either can also be an artefact: after a single move a slow tail of the process looks like a drift.
A drift is therefore fitted only where the record tells the two apart, and the answer with the
other reading is stated where it does not.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from identification.condense import Samples
from identification.held_input import HeldInput
from identification.least_squares import LeastSquaresFit, fopdt_least_squares
from identification.quality import Colour, residual_colour
from identification.steps import Step
from loop.signals import Real

# Three standard errors: in one record of 400 without drift one is fitted, which only widens errors.
SEEN = 3.0
# A residual whose neighbours add less than half to the variance of a mean is as good as white.
NEARLY_WHITE = 1.5
FEWEST, FEWEST_BEFORE = 5, 20
# Two values that differ by less than a third say the same, if both are no noise.
AGREES = 0.33
# A drift is a straight line: where it is the cause, nearly nothing systematic remains.
MOSTLY = 0.8
# Less than this part of PV's range is nothing, however small the errors.
SMALLEST = 0.002


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """Fit with what was decided about drift and start.

    Attributes
    ----------
    fit : LeastSquaresFit
        The fit.
    colour : Colour
        Of its residual.
    notes : tuple of str
        What was decided, in words.
    rival : LeastSquaresFit or None
        Fit with a drift where the record does not tell it from a slow tail of the process.
    """

    fit: LeastSquaresFit
    colour: Colour
    notes: tuple[str, ...]
    rival: LeastSquaresFit | None


class Model(Protocol):
    """Anything that predicts PV."""

    def predict(self, t: Real) -> Real:
        """Model's PV at the record's times. [PV]"""


def weighted_residual(fit: Model, samples: Samples) -> Real:
    """PV less model, each value times the root of the readings behind it. [PV]

    Parameters
    ----------
    fit : Model
        What predicts PV.
    samples : Samples
        What was fitted.
    """
    residual = samples.pv - fit.predict(samples.t)
    return residual if samples.weight is None else residual * np.sqrt(samples.weight)


def explain(
    samples: Samples, held: HeldInput, steps: tuple[Step, ...], *, start_may_differ: bool
) -> Explanation:
    """Fit a record with as much drift and unsteady start as it shows.

    Parameters
    ----------
    samples : Samples
        Process values.
    held : HeldInput
        The output.
    steps : tuple of Step
        Its moves.
    start_may_differ : bool
        Whether a start off rest can be told from an answer: not where the first move is at the
        first sample.
    """

    def fitted(*, drift: bool, start: bool) -> tuple[LeastSquaresFit, Colour]:
        fit = fopdt_least_squares(
            samples.t, samples.pv, held, weight=samples.weight, drift=drift, start=start
        )
        return fit, residual_colour(weighted_residual(fit, samples))

    fit, colour = fitted(drift=False, start=False)
    notes: list[str] = []
    rival: LeastSquaresFit | None = None
    with_drift, drift_colour = fitted(drift=True, start=False)
    drift = False
    least = SMALLEST * float(np.ptp(samples.pv))
    by_drift = with_drift.drift * float(samples.t[-1] - samples.t[0])
    if abs(by_drift) > least and _seen(with_drift.drift, with_drift.drift_error, drift_colour):
        told = _drift_evidence(samples, steps, (fit, with_drift), (colour, drift_colour))
        drift = bool(told)
        if drift:
            fit, colour = with_drift, drift_colour
            notes.append(f"a drift of {fit.drift:.3g} per s is fitted, {told}")
        else:
            rival = with_drift
    if start_may_differ:
        with_start, start_colour = fitted(drift=drift, start=True)
        seen = _seen(with_start.start, with_start.start_error, start_colour)
        if abs(with_start.start) > least and seen and _shows_before(samples, steps, with_start):
            fit, colour = with_start, start_colour
            notes.append(
                f"PV starts {fit.start:+.3g} off rest, which is fitted as dying out with tau"
            )
    return Explanation(fit=fit, colour=colour, notes=tuple(notes), rival=rival)


def _seen(value: float, error: float, colour: Colour) -> bool:
    return bool(abs(value) > SEEN * error * colour.inflation**0.5)


def _shows_before(samples: Samples, steps: tuple[Step, ...], with_start: LeastSquaresFit) -> bool:
    """Whether PV moves before the first move of OP as a start off rest would have it.

    Without that, the dying start and the answer can be two large errors that cancel.
    """
    before = samples.t < steps[0].start
    if np.count_nonzero(before) < FEWEST:
        return False
    t = samples.t[before]
    dying = np.exp(-(t - samples.t[0]) / with_start.tau)
    pv = samples.pv[before] - with_start.drift * (t - samples.t[0])
    size, error = _slope(dying, pv)
    return abs(size) > SEEN * error and abs(size - with_start.start) < max(
        SEEN * error, AGREES * abs(with_start.start)
    )


def _drift_evidence(
    samples: Samples,
    steps: tuple[Step, ...],
    fits: tuple[LeastSquaresFit, LeastSquaresFit],
    colours: tuple[Colour, Colour],
) -> str:
    """What tells a drift from a slow tail, in words; empty where nothing does.

    Fits and colours are those without and with the drift.
    """
    plain, with_drift = fits
    before = samples.t < steps[0].start
    if np.count_nonzero(before) >= FEWEST_BEFORE:
        slope, error = _slope(samples.t[before], samples.pv[before])
        agrees = abs(slope - with_drift.drift) < max(SEEN * error, AGREES * abs(with_drift.drift))
        if abs(slope) > SEEN * error and agrees:
            return "which PV also shows before the first move"
        if not agrees:
            return ""
    if colours[1].inflation < NEARLY_WHITE < colours[0].inflation:
        return "which leaves a white residual"
    if len({step.direction for step in steps}) == 2:
        rough = np.diff(weighted_residual(plain, samples))
        systematic = plain.sse - float(rough @ rough) / 2
        if plain.sse - with_drift.sse > MOSTLY * systematic:
            return "which explains most of what a model without it misses"
    return ""


def _slope(x: Real, pv: Real) -> tuple[float, float]:
    """Slope of PV over x and its standard error, correlation of neighbours included."""
    about = x - x.mean()
    power = float(about @ about)
    slope = float(about @ pv) / power
    left = pv - pv.mean() - slope * about
    variance = float(left @ left) / (x.size - 2) * residual_colour(left).inflation
    return slope, (variance / power) ** 0.5
