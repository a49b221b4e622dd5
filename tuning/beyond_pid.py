"""When a PID is not enough: the reason, its number, and what would help."""

import math
from dataclasses import dataclass

import numpy as np

from loop.errors import RuleNotApplicable
from loop.process import FOPDT, SOPDT, Process
from loop.signals import Real
from tuning.load_limits import lowest_peak
from tuning.performance_limits import Bound, performance_limits

# theta over tau above which a derivative gains next to nothing.
DEAD_TIME_DOMINANT = 1.0
# Relative gains outside of this mean that the loops fight each other.
RGA_LOW, RGA_HIGH = 0.67, 1.5
# Peak of |T| that a robust loop keeps.
ROBUST_PEAK = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One reason why a PID alone falls short.

    Attributes
    ----------
    reason : str
        Short name of the reason.
    number : float
        What was found, in the unit of the sentence.
    limit : float
        Where it begins to matter.
    sentence : str
        What it means.
    helps : tuple of str
        What would help, the simplest first.
    """

    reason: str
    number: float
    limit: float
    sentence: str
    helps: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BeyondPID:
    """Whether a PID is enough.

    Attributes
    ----------
    enough : bool
        Nothing found speaks against a PID alone.
    findings : tuple of Finding
        What does.
    sentence : str
        The answer in words.
    """

    enough: bool
    findings: tuple[Finding, ...]
    sentence: str


def beyond_pid(
    process: Process,
    *,
    load: float | None = None,
    allowed: float | None = None,
    op_room: float | None = None,
    set_point_change: float | None = None,
    relative_gain: float | None = None,
) -> BeyondPID:
    """Say whether a PID is enough for a process and its task, and what would help if not.

    Parameters
    ----------
    process : Process
        Process model.
    load : float, optional
        Largest load step at the process input. [OP]
    allowed : float, optional
        Deviation of PV that may happen. [PV]
    op_room : float, optional
        How far the output can move from where it rests. [OP]
    set_point_change : float, optional
        Largest change of the set point. [PV]
    relative_gain : float, optional
        Relative gain of this pairing of PV and OP, from `relative_gains`. [-]
    """
    findings = [
        *_dead_time(process),
        *_right_half_plane(process),
        *_interaction(relative_gain),
        *_peak(process, load, allowed),
        *_constraint(process, load, op_room, set_point_change),
    ]
    if findings:
        reasons = "; ".join(f"{f.reason} ({f.number:.3g})" for f in findings)
        sentence = f"A PID alone is not enough: {reasons}."
    else:
        sentence = "A PID is enough: nothing stated here asks for more."
    return BeyondPID(enough=not findings, findings=tuple(findings), sentence=sentence)


def _dead_time(process: Process) -> list[Finding]:
    match process:
        case FOPDT(tau=lag) | SOPDT(tau1=lag):
            ratio = process.theta / lag
        case _:
            return []
    if ratio <= DEAD_TIME_DOMINANT:
        return []
    return [
        Finding(
            reason="dead time dominates",
            number=ratio,
            limit=DEAD_TIME_DOMINANT,
            sentence=f"theta/tau is {ratio:.3g}: a derivative cannot look ahead of the dead time, "
            "and a PI is as good as a PID.",
            helps=(
                "a PI with little gain and mostly integral action",
                "a Smith predictor, swept over errors of its model before it runs",
                "feed-forward of a measured load",
                "model predictive control",
            ),
        )
    ]


def _right_half_plane(process: Process) -> list[Finding]:
    found = []
    for limit in performance_limits(process):
        if limit.bound is Bound.WC_BELOW and "zero" in limit.cause:
            found.append(
                Finding(
                    reason="PV first moves the wrong way",
                    number=limit.value,
                    limit=limit.value,
                    sentence=limit.sentence,
                    helps=(
                        "a slower loop",
                        "another manipulated variable, or another place to measure",
                        "feed-forward of a measured load",
                    ),
                )
            )
        elif limit.bound in (Bound.MS, Bound.MT) and limit.value > ROBUST_PEAK:
            found.append(
                Finding(
                    reason="the unstable process leaves no robust loop",
                    number=limit.value,
                    limit=ROBUST_PEAK,
                    sentence=limit.sentence,
                    helps=(
                        "less dead time: a faster sensor or actuator",
                        "stabilising by an inner loop on a faster variable",
                    ),
                )
            )
    return found


def _interaction(relative_gain: float | None) -> list[Finding]:
    if relative_gain is None:
        return []
    if not math.isfinite(relative_gain):
        raise ValueError(f"the relative gain must be finite, got {relative_gain}")
    if RGA_LOW <= relative_gain <= RGA_HIGH:
        return []
    if relative_gain < 0:
        what = (
            "the sign of the loop turns when the other loop closes: this pairing must not be used"
        )
        helps: tuple[str, ...] = ("another pairing", "a decoupler", "model predictive control")
    else:
        gain = 1 / relative_gain if relative_gain else math.inf
        what = f"closing the other loop multiplies the process gain by {gain:.3g}"
        helps = (
            "another pairing",
            "one loop much slower than the other",
            "a decoupler",
            "model predictive control",
        )
    return [
        Finding(
            reason="the loops interact",
            number=relative_gain,
            limit=RGA_LOW if relative_gain < RGA_LOW else RGA_HIGH,
            sentence=f"The relative gain is {relative_gain:.3g}: {what}.",
            helps=helps,
        )
    ]


def _peak(process: Process, load: float | None, allowed: float | None) -> list[Finding]:
    if load is None or allowed is None:
        return []
    found = lowest_peak(process, load, allowed=allowed)
    if found.possible:
        return []
    return [
        Finding(
            reason="the load is faster than the dead time",
            number=found.peak,
            limit=allowed,
            sentence=found.sentence,
            helps=(
                "feed-forward of the load, if it can be measured",
                "a cascade: an inner loop that sees the load before PV does",
                "less dead time, or more capacity to smooth the load",
            ),
        )
    ]


def _constraint(
    process: Process, load: float | None, op_room: float | None, change: float | None
) -> list[Finding]:
    if op_room is None:
        return []
    if not (op_room > 0 and math.isfinite(op_room)):
        raise ValueError(f"op_room must be positive, got {op_room}")
    needs = []
    if load is not None:
        needs.append((abs(load), f"a load of {abs(load):.4g}"))
    last = process.denominator[-1]
    if change is not None and last and process.numerator[-1]:
        gain = abs(process.numerator[-1] / last)
        needs.append((abs(change) / gain, f"a set-point change of {abs(change):.4g}"))
    return [
        Finding(
            reason="the output runs into its limit",
            number=need,
            limit=op_room,
            sentence=f"At rest {what} takes {need:.4g} of output, of which {op_room:.4g} is there: "
            "no controller can hold PV.",
            helps=(
                "a larger actuator, or a second one in split range",
                "smaller steps of the set point",
                "model predictive control, which keeps a constraint but does not remove it",
            ),
        )
        for need, what in needs
        if need > op_room
    ]


def relative_gains(gains: Real) -> Real:
    """Relative gain array of a square process, RGA = K * (K^-1)^T, element by element [1]_.

    Parameters
    ----------
    gains : ndarray, shape (n, n)
        Static gain from OP j (column) to PV i (row). [PV/OP]

    Raises
    ------
    RuleNotApplicable
        The matrix is singular: the outputs do not move the variables independently.

    References
    ----------
    .. [1] E. H. Bristol, "On a new measure of interaction for multivariable process control",
       IEEE Trans. Automatic Control 11 (1966) 133-134.
    """
    K = np.asarray(gains, dtype=float)
    if K.ndim != 2 or K.shape[0] != K.shape[1] or not np.all(np.isfinite(K)):
        raise ValueError(f"gains must be a square matrix of finite numbers, got shape {K.shape}")
    # Scaling rows and columns changes nothing but the rounding.
    rows = np.max(np.abs(K), axis=1, initial=0.0)
    if not np.all(rows > 0) or np.linalg.cond(K / rows[:, None]) > 1e12:
        raise RuleNotApplicable(
            "The relative gain array",
            "the gain matrix is singular, so the outputs do not move the variables independently",
        )
    return np.asarray(K * np.linalg.inv(K).T)
