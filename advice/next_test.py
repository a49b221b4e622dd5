"""The test to run next, where the one that was run was refused."""

from dataclasses import asdict, dataclass

import numpy as np

from advice.body import Body
from advice.display import digits
from advice.planning import plan_body, plan_sentences
from advice.tune import TuningCase
from identification.planner import StepPlan, Wishes, plan_steps
from identification.pulse_planner import PulsePlan, PulseWishes, plan_pulses
from loop.process import FOPDT, IPDT, SOPDT, Process
from loop.record import Record
from loop.signals import Real

# The median absolute deviation of normal noise is so many standard deviations.
MEDIAN_DEVIATION = 0.6745
# Noise below this part of PV's range is arithmetic, and no test is planned on none.
LEAST_NOISE = 1e-3
# Deviations to try, in standard deviations of the noise, and moves that are few.
DEVIATIONS, FEW_MOVES = (5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0), 4
# A refused model may be off by so much; without any, the record's range tells the gain at best
# within three times, and its length the time constant.
REFUSED, UNKNOWN = 2.0, 3.0
# A record that says nothing of the speed is taken for so many time constants.
LENGTHS = 6.0


@dataclass(frozen=True, slots=True, kw_only=True)
class NextTest:
    """What to run after a test that was refused.

    Attributes
    ----------
    reason : str
        What the plan rests on.
    noise : float or None
        Noise of PV in the record, None where PV was not recorded. [PV]
    guess : FOPDT, IPDT or None
        Process that the plan assumes; None where the record says nothing of it.
    plan : StepPlan, PulsePlan or None
        The test, by pulses for a process that integrates; None where nothing is known of it.
    """

    reason: str
    noise: float | None
    guess: FOPDT | IPDT | None
    plan: StepPlan | PulsePlan | None


def next_test(record: Record, fitted: Process | None, noise: float | None) -> NextTest:
    """Plan the test to run after one that was refused.

    Parameters
    ----------
    record : Record
        The test that was refused.
    fitted : Process or None
        What least squares gave all the same.
    noise : float or None
        Noise about that fit. [PV]
    """
    pv, op = record.pv[np.isfinite(record.pv)], record.op[np.isfinite(record.op)]
    if pv.size < 3 or np.ptp(pv) == 0:
        return NextTest(
            reason="PV was not recorded, or stands still to its last digit: check the tag and the "
            "transmitter before any test.",
            noise=None, guess=None, plan=None,
        )  # fmt: skip
    sd = max(_noise(pv) if noise is None else noise, LEAST_NOISE * float(np.ptp(pv)))
    guess = _guess(record, fitted)
    if guess is not None:
        reason, factor = "It assumes the refused model, off by up to two times.", REFUSED
    elif op.size and np.ptp(op) > 0:
        guess = FOPDT(
            K=float(np.ptp(pv)) / float(np.ptp(op)),
            tau=max(record.span / LENGTHS, 1e-6),
            theta=max(record.span / LENGTHS**2, 1e-6),
        )
        reason = (
            "The record says little of the process: a gain no larger than PV's range over OP's and "
            "a time constant of a sixth of the record are assumed, off by up to three times."
        )
        factor = UNKNOWN
    else:
        return NextTest(
            reason=(
                "OP did not move, so that nothing is known of the process. In manual, with PV at "
                f"rest, move OP until PV moves by {digits(10 * sd, 2)} (ten times its noise), wait "
                "until PV stands still, and move it back; upload all of it."
            ),
            noise=sd, guess=None, plan=None,
        )  # fmt: skip
    return NextTest(reason=reason, noise=sd, guess=guess, plan=_plan(guess, sd, factor))


def after(case: TuningCase) -> NextTest | None:
    """Plan the test to run after a case, None where its record carried a model.

    Parameters
    ----------
    case : TuningCase
        What `advice.tune` answered.
    """
    if case.record is None or case.process is not None:
        return None
    model = case.model
    return next_test(
        case.record,
        None if model is None else model.fitted,
        None if model is None else model.noise_sd,
    )


def _guess(record: Record, fitted: Process | None) -> FOPDT | IPDT | None:
    """The refused model as one lag or an integrator, where its numbers can be meant."""
    if isinstance(fitted, SOPDT):
        half = fitted.tau2 / 2
        fitted = FOPDT(K=fitted.K, tau=fitted.tau1 + half, theta=fitted.theta + half)
    if not isinstance(fitted, FOPDT | IPDT):
        return None
    known = np.isfinite(record.pv) & np.isfinite(record.op)
    pv, op = record.pv[known], record.op[known]
    largest = UNKNOWN * float(np.ptp(pv)) / max(float(np.ptp(op)), 1e-300)
    if isinstance(fitted, IPDT):
        # What OP summed up would have moved PV by no more than a few times what it did; and pulses
        # are planned around a dead time.
        summed = np.cumsum((op[:-1] - op[0]) * np.diff(record.t[known]))
        moved = abs(fitted.K) * float(np.ptp(summed)) < UNKNOWN * float(np.ptp(pv))
        return fitted if moved and 0 < fitted.theta < record.span else None
    meant = abs(fitted.K) < largest and record.sample_time / 2 < fitted.tau < record.span
    return fitted if meant else None


def _plan(guess: FOPDT | IPDT, noise: float, factor: float) -> StepPlan | PulsePlan:
    """Smallest deviation that few moves do with, or the largest tried."""
    for deviation in DEVIATIONS:
        plan = _test(guess, noise, factor, deviation=factor * deviation * noise)
        if plan.reaches and len(plan.times) <= FEW_MOVES:
            break
    return plan


def _test(
    guess: FOPDT | IPDT, noise: float, factor: float, *, deviation: float
) -> StepPlan | PulsePlan:
    if isinstance(guess, IPDT):
        return plan_pulses(
            PulseWishes(guess=guess, noise=noise, deviation=deviation, factor=factor)
        )
    return plan_steps(Wishes(guess=guess, noise=noise, deviation=deviation, factor=factor))


def _noise(pv: Real) -> float:
    """Standard deviation of white noise, from second differences. [PV]"""
    rough = np.abs(pv[2:] - 2 * pv[1:-1] + pv[:-2])
    return float(np.median(rough)) / MEDIAN_DEVIATION / 6**0.5


def next_test_body(found: NextTest) -> Body:
    """The test to run next as a JSON document."""
    guess = found.guess
    return {
        "reason": found.reason,
        "noise_sd": found.noise,
        "guess": None if guess is None else {"kind": type(guess).__name__} | asdict(guess),
        "plan": None if found.plan is None else plan_body(found.plan),
    }


def next_test_sentences(found: NextTest) -> list[str]:
    """The test to run next in words, its reason first."""
    return [found.reason, *([] if found.plan is None else plan_sentences(found.plan))]
