"""Whether the samples are dense enough, and where they are missing."""

import numpy as np

from identification.experiment import Experiment
from identification.least_squares import LeastSquaresFit
from identification.steps import Step
from identification.verdict import Finding, Verdict
from loop.signals import Real

# Under three samples a time constant, tau rests on one or two readings.
COARSE = 3.0
# A hole of half a time constant within the first three of an answer hides a good part of it.
HOLE, ANSWER = 0.5, 3.0
# When the move itself happened in a hole, theta is uncertain by the hole: against tau + theta.
LATE, TOO_LATE = 0.2, 0.5
# Several times the usual spacing is a hole and no irregular sampling.
MUCH_LONGER = 3.0


def judge_timing(
    fit: LeastSquaresFit, experiment: Experiment, *, lagged: bool = True
) -> list[Finding]:
    """Compare spacing and holes of the samples with the model.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    experiment : Experiment
        Samples and moves.
    lagged : bool
        Whether the model has a lag; without one a hole over the jump is in the error of theta.
    """
    findings = []
    if lagged and fit.tau < COARSE * experiment.spacing:
        findings.append(
            Finding(
                verdict=Verdict.CARE,
                reason=f"samples every {experiment.spacing:.3g} s are coarse for a time constant "
                f"of {fit.tau:.3g} s",
            )
        )
    gaps = np.diff(experiment.t)
    for step in experiment.steps:
        findings += _move_in_hole(fit, experiment, step)
        if lagged:
            findings += _hole_in_answer(fit, experiment, step, gaps)
    return findings


def _move_in_hole(fit: LeastSquaresFit, experiment: Experiment, step: Step) -> list[Finding]:
    hole = experiment.hole_before(step)
    part = hole / (fit.tau + fit.theta)
    if hole <= MUCH_LONGER * experiment.spacing or part <= LATE:
        return []
    return [
        Finding(
            verdict=Verdict.REFUSED if part > TOO_LATE else Verdict.CARE,
            reason=f"OP moved somewhere within a gap of {hole:.3g} s before {step.start:.4g} s, so "
            f"the dead time is uncertain by as much beside tau + theta = "
            f"{fit.tau + fit.theta:.3g} s",
        )
    ]


def _hole_in_answer(
    fit: LeastSquaresFit, experiment: Experiment, step: Step, gaps: Real
) -> list[Finding]:
    arrival = step.end + fit.theta
    t = experiment.t
    over = (t[1:] > arrival) & (t[:-1] < arrival + ANSWER * fit.tau)
    hole = float(np.max(gaps, where=over, initial=0.0))
    if hole <= max(MUCH_LONGER * experiment.spacing, HOLE * fit.tau):
        return []
    return [
        Finding(
            verdict=Verdict.REFUSED if hole > ANSWER * fit.tau else Verdict.CARE,
            reason=f"a gap of {hole:.3g} s lies over the answer to the step at {step.start:.4g} s "
            f"(tau {fit.tau:.3g} s), and what OP did in it is not known",
        )
    ]
