"""The fastest cascade whose loops both keep a profile while their models are wrong."""

from dataclasses import dataclass

from loop.errors import RuleNotApplicable, UnstableLoop
from loop.process import FOPDT
from tuning.cascade import Cascade, cascade, sweep_cascade
from tuning.profiles import Profile
from tuning.response_sweep import ResponseSweep, SweepVerdict, judge_sweep
from tuning.robust import robust_tau_c
from tuning.simc import RULE
from tuning.sweep import FACTORS

# Dead times of what the outer controller sees; the last stretch is halved to 1 %.
FASTEST, SLOWEST, GROWTH, HALVINGS = 0.7, 40.0, 2**0.5, 5
TITLE = "A cascade"


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustCascade:
    """A cascade that keeps a profile over ±50 % of each parameter of either process.

    Attributes
    ----------
    found : Cascade
        Both controllers.
    inner_tau_c, outer_tau_c : float
        Closed-loop time constants. [s]
    sweep : ResponseSweep
        What the outer loop keeps on the true inner one.
    verdict : SweepVerdict
        It passes.
    """

    found: Cascade
    inner_tau_c: float
    outer_tau_c: float
    sweep: ResponseSweep
    verdict: SweepVerdict


def robust_cascade(
    inner: FOPDT, outer: FOPDT, profile: Profile, *, inner_tau_c: float | None = None
) -> RobustCascade:
    """Find the smallest time constants at which both loops of a cascade keep a profile.

    The inner loop first, by `tuning.robust`. Then the outer, from .7 to 40 dead times of what it
    sees, with both ends of each of the six parameters and in the end with all eleven factors.

    Parameters
    ----------
    inner, outer : FOPDT
        From OP to the inner PV, and from there to the outer PV.
    profile : Profile
        Limits on the margins of both loops.
    inner_tau_c : float, optional
        Closed-loop time constant of the inner loop, if it is chosen already. [s]

    Raises
    ------
    RuleNotApplicable
        Nothing keeps the profile, or the inner process has no dead time to bound its speed.
    """
    speed = inner_tau_c
    if speed is None:
        speed = robust_tau_c(inner, RULE, "PI", profile).tau_c
    ends = (FACTORS[0], FACTORS[-1])

    missed = ""

    def passes(tau_c: float, factors: tuple[float, ...] = ends) -> RobustCascade | None:
        nonlocal missed
        try:
            found = cascade(inner, outer, inner_tau_c=speed, outer_tau_c=tau_c)
        except (RuleNotApplicable, UnstableLoop) as reason:
            missed = str(reason).rstrip(".")  # faster than the inner loop allows
            return None
        sweep = sweep_cascade(found, inner, outer, factors=factors)
        verdict = judge_sweep(sweep, profile)
        missed = verdict.missed
        if not verdict.passes:
            return None
        return RobustCascade(
            found=found, inner_tau_c=speed, outer_tau_c=tau_c, sweep=sweep, verdict=verdict
        )

    seen = outer.theta + inner.theta + speed / 2
    slow, fast = FASTEST * seen, 0.0
    while passes(slow) is None:
        if slow * GROWTH > SLOWEST * seen:
            raise RuleNotApplicable(
                TITLE,
                f"no outer tau_c up to {slow:.4g} s keeps the profile {profile.name} under ±50 % "
                f"of each parameter; there {missed}",
            )
        fast, slow = slow, slow * GROWTH
    for _ in range(HALVINGS if fast else 0):
        middle = (fast * slow) ** 0.5
        fast, slow = (fast, middle) if passes(middle) else (middle, slow)
    while (robust := passes(slow, FACTORS)) is None:  # an error between the ends was worse
        slow *= 1.02
    return robust
