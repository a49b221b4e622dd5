"""Whether a model of another structure than one lag with dead time is fit for tuning, and why.

The limits are those of `identification.verdict`.
"""

from dataclasses import replace

import numpy as np

from identification.candidate import Candidate, Choice
from identification.candidates import MATERIAL
from identification.experiment import Experiment
from identification.least_squares import LeastSquaresFit
from identification.plausibility import FOUND
from identification.simplification import first_order_equivalent
from identification.structures import PURE_DELAY
from identification.timing import judge_timing
from identification.verdict import (
    FAR_OFF,
    LONG_ENOUGH,
    SHORT,
    TOO_FAR_OFF,
    TOO_SHORT,
    TOO_WIDE,
    WIDE,
    Finding,
    Verdict,
    graded,
    judge_dead_time,
)
from loop.signals import Real

# A first-order lag that is surely longer than so many holds is an integrator to any loop that was
# tuned on the record.
SLOW = 3.0


def judge_structure(
    choice: Choice, fit: LeastSquaresFit, experiment: Experiment, intervals: Real
) -> list[Finding]:
    """Everything that speaks for or against the chosen structure.

    Parameters
    ----------
    choice : Choice
        Structure that is not one lag with dead time.
    fit : LeastSquaresFit
        First-order fit of the same record.
    experiment : Experiment
        Samples and moves.
    intervals : ndarray, shape (p, 2)
        95 % intervals of the parameters.
    """
    chosen = choice.chosen
    steps = experiment.steps
    ends = [*(s.start for s in steps[1:]), float(experiment.t[-1])]
    hold = max(b - a.end for a, b in zip(steps, ends, strict=True))
    theta = float(chosen.values[-1])
    findings = [
        Finding(verdict=Verdict.TRUSTED, reason=choice.reason),
        *_answer(chosen),
        _misfit(chosen, steps[0].start),
        _errors(chosen, intervals),
        judge_dead_time(replace(fit, theta=theta), intervals[-1], experiment.spacing),
    ]
    if chosen.structure.integrates:
        findings.append(_ramp(choice, hold))
        return findings
    tau, late = first_order_equivalent(chosen)
    like = replace(fit, tau=tau, theta=late)
    if not experiment.waves:
        findings.append(_length(like, hold))
    lagged = chosen.structure is not PURE_DELAY
    return findings + judge_timing(like, experiment, lagged=lagged)


def _answer(chosen: Candidate) -> list[Finding]:
    """Refuse a gain that chance could have made."""
    gain, error = float(chosen.values[0]), float(chosen.standard_errors[0])
    if abs(gain) >= FOUND * error:
        return []
    return [
        Finding(
            verdict=Verdict.REFUSED,
            reason=f"nothing in PV follows OP for certain: the gain of {gain:.3g} stands "
            f"{abs(gain) / error:.1f} standard errors from none, and {FOUND:g} are needed",
        )
    ]


def _misfit(chosen: Candidate, first_move: float) -> Finding:
    verdict = graded(chosen.part, FAR_OFF, TOO_FAR_OFF)
    size = f"{100 * chosen.part:.2g} % of the answer"
    where = f"between {chosen.misfit.start:.4g} s and {chosen.misfit.end:.4g} s"
    if chosen.part == 0:
        text = "no error of the model stands out from the noise anywhere"
    elif verdict is Verdict.TRUSTED:
        text = f"the model is off by no more than {size} anywhere"
    elif chosen.misfit.end < first_move:
        text = f"PV moved before the step: by {size} {where}"
    else:
        text = f"the model misses PV by {size} {where}; PV does something else than answer OP"
    return Finding(verdict=verdict, reason=text)


def _errors(chosen: Candidate, intervals: Real) -> Finding:
    """Compare the 95 % intervals with what tuning is verified for."""
    names = chosen.structure.names
    half = np.diff(intervals, axis=1)[:, 0] / 2
    times = [n in ("tau", "tau1", "tau2", "T") for n in names]
    # Lags and dead time add up to how long the process takes, and each counts by its part of that.
    total = float(np.sum(np.abs(chosen.values[times]))) + float(chosen.values[-1])
    parts = {}
    for name, value, width in zip(names, chosen.values.tolist(), half.tolist(), strict=True):
        size = abs(value) if name in ("K", "zeta") else total
        parts[name] = width / size if size else 0.0
    if chosen.structure.integrates:  # the dead time alone is all there is: see its own finding
        parts.pop("theta")
    verdict = graded(max(parts.values()), WIDE, TOO_WIDE)
    text = ", ".join(
        f"{name} {value:.4g} ± {width:.2g}"
        for name, value, width in zip(names, chosen.values, half, strict=True)
    )
    text = f"the parameters are known within {text} (95 %)"
    if verdict is Verdict.REFUSED:
        text += "; beyond ±50 % no tuning is verified"
    return Finding(verdict=verdict, reason=text)


def _length(like: LeastSquaresFit, hold: float) -> Finding:
    seen = 1 - float(np.exp(-max(hold - like.theta, 0.0) / like.tau))
    text = f"the longest hold shows {seen:.0%} of the final change"
    if seen < LONG_ENOUGH:
        text += ": PV is still moving, and gain and lags trade off"
    return Finding(verdict=graded(1 - seen, 1 - SHORT, 1 - TOO_SHORT), reason=text)


def _ramp(choice: Choice, hold: float) -> Finding:
    """Say how far an integrator is told from a slow lag."""
    first = next(c for c in choice.candidates if c.structure.name == "first order")
    low = float(first.values[1] - 2 * first.standard_errors[1])
    if first.part > MATERIAL or low > SLOW * hold:
        return Finding(
            verdict=Verdict.TRUSTED,
            reason=f"PV does not settle in the {hold:.4g} s that OP is held longest, and no lag "
            "that would settle later fits",
        )
    return Finding(
        verdict=Verdict.CARE,
        reason=f"PV does not settle in the {hold:.4g} s that OP is held longest; it may later, "
        f"with a lag of more than {max(low, hold):.3g} s, which is no worse to control",
    )
