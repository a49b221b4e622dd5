"""The fastest setting of a rule that a profile allows with all parameters of the model off at once.

Beside `robust_tau_c`, which moves one parameter at a time and which the verdicts rest on; this one
is reported and gates nothing.
"""

from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.margin_batch import batch_margins
from loop.process import Process
from loop.signals import Real
from tuning.box_verdict import BoxVerdict, hold_box
from tuning.profiles import Profile
from tuning.robust import CEILING, POINTS, REFINEMENTS, robust_tau_c
from tuning.rule import Rule
from tuning.shortfall import profile_holds
from tuning.sweep import sweep_of
from tuning.verification import controller_column

INSIDE = 24
# The corners' answer is slowed down by this until the whole box is proven.
STEP, STEPS = 1.004, 60


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointTauC:
    """The smallest tau_c that is proven over the whole box of ±50 %.

    Attributes
    ----------
    tau_c : float
        Smallest tau_c that is proven, to half a percent. [s]
    alone : float
        That of `robust_tau_c`, with one parameter off at a time. [s]
    pid : PID
        Settings of the rule at `tau_c`.
    verdict : BoxVerdict
        The proof.
    """

    tau_c: float
    alone: float
    pid: PID
    verdict: BoxVerdict


def joint_tau_c(
    process: Process, rule: Rule, structure: str, profile: Profile, *, sample_time: float = 0.0
) -> JointTauC:
    """Find the smallest tau_c that passes a profile with every parameter anywhere within ±50 %.

    The range from the one-at-a-time answer to 200 dead times is scanned with the corners; the
    first that passes is slowed down in steps of .4 % until the whole box is proven.

    Parameters
    ----------
    process : Process
        Process model, of a kind that `verify` takes. [s]
    rule : Rule
        A rule with a tau_c to choose.
    structure : str
        One of its structures.
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time of the controller; half of it counts as dead time. [s]

    Raises
    ------
    RuleNotApplicable
        As `robust_tau_c`, or no tau_c is proven.
    ValueError
        The rule has no tau_c, or there is no such structure.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> from tuning.profiles import PROFILES
    >>> from tuning.simc import RULE
    >>> found = joint_tau_c(FOPDT(K=2.0, tau=60.0, theta=30.0), RULE, "PI", PROFILES["general"])
    >>> found.verdict.holds, found.tau_c > found.alone
    (True, True)
    """
    alone = robust_tau_c(process, rule, structure, profile, sample_time=sample_time).tau_c
    theta = process.theta + sample_time / 2
    tune = rule.structures[structure]
    sweep = sweep_of(process, factors=(0.5, 1.5))

    def passes(tau_c: Real) -> list[bool]:
        settings = controller_column([tune(process, float(x)) for x in tau_c])
        found = batch_margins(sweep.plants, settings, sample_time=sample_time)
        return [bool(x) for x in np.all(profile_holds(sweep, found, profile), axis=1)]

    high = max(CEILING * theta, 2 * alone)
    points = np.geomspace(alone, high, POINTS)
    bracket = _first(points, passes(points))
    if bracket is not None:
        low, tau_c = bracket
        for _ in range(REFINEMENTS):
            points = np.geomspace(low, tau_c, INSIDE)
            low, tau_c = _first(points, [*passes(points[:-1]), True]) or (low, tau_c)
        for _ in range(STEPS):
            pid = tune(process, tau_c)
            verdict = hold_box(process, pid, profile, sample_time=sample_time)
            if verdict.holds:
                return JointTauC(tau_c=tau_c, alone=alone, pid=pid, verdict=verdict)
            tau_c *= STEP
    raise RuleNotApplicable(
        f"{rule.title} {structure}",
        f"no tau_c up to {high:.3g} s is proven to pass the {profile.name} profile with all "
        "parameters off by up to 50 % at once",
    )


def _first(points: Real, good: list[bool]) -> tuple[float, float] | None:
    """The first point that passes and the one before it."""
    if True not in good:
        return None
    at = good.index(True)
    return float(points[max(at - 1, 0)]), float(points[at])
