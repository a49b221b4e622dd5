"""Whether a fitted model is fit for tuning, and why.

The tuning that follows is verified over ±50 % of each parameter. A model whose error can be larger
than that is refused, since nothing downstream would cover it; one that uses up a good part of it
is to be used with care.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from identification.disturbances import Explanation
from identification.gains import StepGains
from identification.least_squares import LeastSquaresFit
from identification.quality import Misfit
from identification.step_methods import Spread, spread
from identification.step_reading import StepReading
from loop.signals import Real

# Half-widths of the 95 % intervals against the ±50 % that tuning is verified for: all of it, and
# two fifths.
TOO_WIDE, WIDE = 0.5, 0.2
# Systematic error against the size of the answer. Two equal lags fitted by one lag with dead time,
# the usual simplification, are off by about a twentieth; a quarter is another process.
TOO_FAR_OFF, FAR_OFF = 0.25, 0.06
# Part of the final change that was seen. Half: K is extrapolated by a factor of two. 86 % is two
# time constants, where K and tau stop trading off; 95 % three, from where K is simply read off.
TOO_SHORT, SHORT, LONG_ENOUGH = 0.5, 0.86, 0.95
TOO_SHORT_SEVERAL = 0.25
# Two readings of the same test that differ by more mean that it is no first-order process.
APART = 0.25
# Gains of single steps, as a part of the common one.
GAINS_APART, GAINS_TOO_FAR_APART = 0.25, 0.5
CERTAIN = 4.0


class Verdict(StrEnum):
    """What a model may be used for."""

    TRUSTED = "trusted"
    CARE = "use with care"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One fact about a model and what it means for its use."""

    verdict: Verdict
    reason: str


def worst(findings: list[Finding]) -> Verdict:
    """Most severe verdict of all findings."""
    order = (Verdict.REFUSED, Verdict.CARE)
    return next((v for v in order if any(f.verdict is v for f in findings)), Verdict.TRUSTED)


def graded(value: float, care: float, refuse: float) -> Verdict:
    """Verdict on a number that is better smaller."""
    if value > refuse:
        return Verdict.REFUSED
    return Verdict.CARE if value > care else Verdict.TRUSTED


def judge_errors(fit: LeastSquaresFit, intervals: Real) -> Finding:
    """Compare the 95 % intervals with what tuning is verified for.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    intervals : ndarray, shape (3, 2)
        Of K, tau, theta.
    """
    half = np.diff(intervals, axis=1)[:, 0] / 2
    # A dead time that is small beside tau can be off by all of itself and the loop, tuned for its
    # upper end, still be right.
    sizes = (abs(fit.K), fit.tau, fit.theta + fit.tau)
    relative = [float(h / s) for h, s in zip(half, sizes, strict=True)]
    verdict = graded(max(relative), WIDE, TOO_WIDE)
    if max(relative) > 1:
        text = "K, tau and theta are not determined by the record, their errors exceed themselves"
        return Finding(verdict=verdict, reason=text)
    text = (
        f"K is known within ±{_percent(relative[0])}, tau within ±{_percent(relative[1])} and "
        f"theta within ±{half[2]:.2g} s (95 %)"
    )
    if verdict is Verdict.REFUSED:
        text += "; beyond ±50 % no tuning is verified"
    return Finding(verdict=verdict, reason=text)


def judge_dead_time(fit: LeastSquaresFit, interval: Real, spacing: float) -> Finding:
    """Say what is known of the dead time, which alone sets the speed of some rules.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    interval : ndarray, shape (2,)
        Of theta. [s]
    spacing : float
        Time between samples. [s]
    """
    upper = float(interval[1])
    if fit.theta < spacing:
        return Finding(
            verdict=Verdict.CARE,
            reason=f"no dead time beyond one sample of {spacing:.3g} s is seen; it may be up to "
            f"{max(upper, spacing):.3g} s, so choose tau_c no smaller",
        )
    if upper - fit.theta > TOO_WIDE * fit.theta:
        return Finding(
            verdict=Verdict.CARE,
            reason=f"the dead time of {fit.theta:.3g} s may be up to {upper:.3g} s (95 %), more "
            "than +50 %, so choose tau_c no smaller than that",
        )
    text = (
        f"the dead time of {fit.theta:.3g} s is no longer than {upper:.3g} s (95 %), a late stamp "
        "of PV counted in"
    )
    return Finding(verdict=Verdict.TRUSTED, reason=text)


def judge_length(fit: LeastSquaresFit, readings: tuple[StepReading, ...], end: float) -> Finding:
    """Say how much of the final change the record shows, and what is known where it is little.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    readings : tuple of StepReading
        The steps.
    end : float
        Time of the last sample. [s]
    """
    steps = [r.step for r in readings]
    holds = [
        b - a.end - fit.theta
        for a, b in zip(steps, [*(s.start for s in steps[1:]), end], strict=True)
    ]
    longest = max(0.0, *holds)
    seen = 1 - float(np.exp(-longest / fit.tau))
    text = f"the longest hold shows {seen:.0%} of the final change"
    if seen >= LONG_ENOUGH:
        return Finding(verdict=Verdict.TRUSTED, reason=text)
    slope, error = initial_slope(fit)
    text += (
        f": PV is still moving, K and tau trade off, and their ratio K/tau = {slope:.4g} "
        f"± {2 * error:.2g} PV/OP/s is what is known"
    )
    if seen >= SHORT:
        return Finding(verdict=Verdict.TRUSTED, reason=text)
    # Several moves show K otherwise than by waiting for the end, but not from next to nothing.
    refused = seen < (TOO_SHORT_SEVERAL if len(steps) > 2 else TOO_SHORT)
    return Finding(verdict=Verdict.REFUSED if refused else Verdict.CARE, reason=text)


def initial_slope(fit: LeastSquaresFit) -> tuple[float, float]:
    """K/tau and its standard error, from the covariance of both. [PV/OP/s]"""
    slope = fit.K / fit.tau
    gradient = np.array([1 / fit.tau, -slope / fit.tau])
    return slope, float(gradient @ fit.covariance[:2, :2] @ gradient) ** 0.5


def judge_misfit(misfit: Misfit, swing: float, first_move: float) -> Finding:
    """Compare the largest systematic error with the answer.

    Parameters
    ----------
    misfit : Misfit
        Largest error of the model that is no noise.
    swing : float
        Size of the answer. [PV]
    first_move : float
        When OP first moved. [s]
    """
    part = misfit.size / swing
    verdict = graded(part, FAR_OFF, TOO_FAR_OFF)
    where = f"between {misfit.start:.4g} s and {misfit.end:.4g} s"
    if part == 0:
        text = "no error of the model stands out from the noise anywhere"
    elif verdict is Verdict.TRUSTED:
        text = f"the model is off by no more than {_percent(part)} of the answer anywhere"
    elif misfit.end < first_move:
        text = f"PV moved before the step: by {_percent(part)} of the answer {where}"
    else:
        text = f"the model misses PV by {_percent(part)} of the answer {where}"
        text += (
            "; PV does something else than answer OP, or the process is of another kind"
            if verdict is Verdict.REFUSED
            else "; the process is not quite first order"
        )
    return Finding(verdict=verdict, reason=text)


def judge_two_point(fit: LeastSquaresFit, readings: tuple[StepReading, ...]) -> list[Finding]:
    """Compare the fit with Smith's reading of every step that has one.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit.
    readings : tuple of StepReading
        The steps.
    """
    apart = []
    for reading in readings:
        if reading.two_point is not None:
            p = reading.two_point.process
            apart.append(
                max(
                    abs(p.K / fit.K - 1),
                    abs(p.tau + p.theta - fit.tau - fit.theta) / (fit.tau + fit.theta),
                )
            )
    if not apart:
        return []
    most = max(apart)
    others = spread(tuple(m for reading in readings for m in reading.methods))
    lie = "" if others is None else f"; {_apart(others)}"
    if most > APART:
        text = f"Smith's two points differ from the fit by {_percent(most)} in K or tau + theta"
        return [Finding(verdict=Verdict.CARE, reason=text + lie)]
    text = f"Smith's two points agree within {_percent(most)} in K and tau + theta"
    return [Finding(verdict=Verdict.TRUSTED, reason=text + lie)]


def _apart(others: Spread) -> str:
    """How far graphical readings lie apart."""
    return (
        f"graphical methods read tau {others.tau[0]:.3g} to {others.tau[1]:.3g} s and theta "
        f"{others.theta[0]:.3g} to {others.theta[1]:.3g} s"
    )


def judge_gains(fit: LeastSquaresFit, gains: StepGains) -> list[Finding]:
    """Compare the gains of the single steps.

    Parameters
    ----------
    fit : LeastSquaresFit
        Fit with one gain for all.
    gains : StepGains
        A gain for every step.
    """
    known = gains.errors < abs(fit.K) / CERTAIN
    if np.count_nonzero(known) < 2:
        return []
    off = np.abs(gains.gains - fit.K)
    certain = known & (off > CERTAIN * gains.errors)
    most = float(np.max(off / abs(fit.K), where=certain, initial=0.0))
    verdict = graded(most, GAINS_APART, GAINS_TOO_FAR_APART)
    each = ", ".join(f"{gain:.3g}" for gain in gains.gains[known])
    if verdict is Verdict.TRUSTED:
        return [Finding(verdict=verdict, reason=f"the steps agree on the gain ({each})")]
    text = f"the gain is not the same for all steps ({each}), {_percent(most)} off their common one"
    return [Finding(verdict=verdict, reason=text)]


def judge_rival(explanation: Explanation) -> list[Finding]:
    """Say what the model would be if what looks like a slow tail were a drift.

    Parameters
    ----------
    explanation : Explanation
        Fit and its rival with a drift.
    """
    fit, rival = explanation.fit, explanation.rival
    if rival is None:
        return []
    change = max(abs(rival.K / fit.K - 1), abs(rival.tau / fit.tau - 1))
    verdict = Verdict.CARE if change > WIDE else Verdict.TRUSTED
    text = (
        "PV also creeps, by a slow tail of the process or by a drift, which the record does not "
        f"tell apart; with a drift of {rival.drift:.3g} per s it would be K {rival.K:.4g}, "
        f"tau {rival.tau:.4g} s, theta {rival.theta:.4g} s"
    )
    return [Finding(verdict=verdict, reason=text)]


def _percent(part: float) -> str:
    return f"{100 * part:.2g} %" if part < 0.995 else f"{100 * part:.0f} %"
