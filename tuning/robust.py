"""The fastest setting that a profile allows under ±50 % of model error."""

from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.margin_batch import batch_margins
from loop.process import Process
from loop.signals import Real
from tuning.profiles import Profile
from tuning.rule import Rule
from tuning.shortfall import profile_holds
from tuning.sweep import FACTORS, Sweep, sweep_of
from tuning.verification import Verification, controller_column, verify, verify_many

# The search, in dead times. Nothing faster than its floor is proposed.
FLOOR, CEILING, POINTS = 0.05, 200.0, 40
# Each refinement divides the last stretch by 27; two leave 0.03 %.
REFINEMENTS, INSIDE = 2, 26
# On every rule and process tried the worst case of a sweep lies at an end of a parameter.
FIRST_LOOK = (FACTORS[0], FACTORS[-1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobustTauC:
    """The smallest desired closed-loop time constant that passes a profile.

    Attributes
    ----------
    tau_c : float
        Smallest tau_c that passes, to 0.03 %, on the safe side. [s]
    pid : PID
        Settings of the rule at that tau_c.
    verification : Verification
        What they keep; it passes.
    """

    tau_c: float
    pid: PID
    verification: Verification


def robust_tau_c(
    process: Process, rule: Rule, structure: str, profile: Profile, *, sample_time: float = 0.0
) -> RobustTauC:
    """Find the smallest tau_c whose settings pass a profile under ±50 % of model error.

    Verdicts need not be monotone in tau_c, so the whole range of 0.05 to 200 dead times is scanned
    (40 points), and only the stretch before the first passing point is divided. The search looks
    at both ends of each parameter; its answer must pass the whole sweep, and where an interior
    factor is worse the search is made again with all eleven.

    Parameters
    ----------
    process : Process
        Process model. [s]
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
        The rule does not take the process, there is no dead time to bound the speed, or no tau_c
        passes; the sentence then has the closest one and what it misses.
    ValueError
        The rule has no tau_c, or there is no such structure.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> from tuning.profiles import PROFILES
    >>> from tuning.simc import RULE
    >>> found = robust_tau_c(FOPDT(K=2.0, tau=60.0, theta=30.0), RULE, "PI", PROFILES["general"])
    >>> round(found.tau_c / 30.0, 2)
    1.14
    """
    if not rule.uses_tau_c:
        raise ValueError(f"{rule.name} has no tau_c to choose")
    if structure not in rule.structures:
        raise ValueError(f"{rule.name} has {', '.join(rule.structures)}, not {structure}")
    title = f"{rule.title} {structure}"
    theta = process.theta + sample_time / 2
    if theta == 0:
        raise RuleNotApplicable(
            f"The smallest passing tau_c of {title}",
            "without dead time nothing in the model bounds the speed; choose tau_c",
        )
    search = _Search(process, rule, structure, profile, sample_time)
    grid = search.within_limits(theta * np.geomspace(FLOOR, CEILING, POINTS))
    found = search.answer(_smallest(search, grid, FIRST_LOOK))
    if found is not None and not found.verification.passes:
        found = search.answer(_smallest(search, grid, FACTORS))
    if found is None:
        raise _nothing_passes(search, title, grid)
    return found


@dataclass(frozen=True, slots=True)
class _Search:
    process: Process
    rule: Rule
    structure: str
    profile: Profile
    sample_time: float

    def within_limits(self, tau_c: Real) -> Real:
        """Leave out what gives settings that no controller takes, as at the limits of models."""
        kept, limit = [], None
        for x in tau_c:
            try:
                self.settings(np.array([x]))
            except ValueError as refusal:
                limit = refusal
            else:
                kept.append(float(x))
        if not kept:
            raise RuleNotApplicable(
                f"{self.rule.title} {self.structure}",
                f"at no tau_c does it give settings that a controller takes: {limit}",
            )
        return np.array(kept)

    def settings(self, tau_c: Real) -> list[PID]:
        tune = self.rule.structures[self.structure]
        return [tune(self.process, float(x)) for x in tau_c]

    def answer(self, tau_c: float | None) -> RobustTauC | None:
        if tau_c is None:
            return None
        pid = self.settings(np.array([tau_c]))[0]
        found = verify(self.process, pid, self.profile, sample_time=self.sample_time)
        return RobustTauC(tau_c=tau_c, pid=pid, verification=found)

    def passes(self, tau_c: Real, sweep: Sweep) -> list[bool]:
        found = batch_margins(
            sweep.plants, controller_column(self.settings(tau_c)), sample_time=self.sample_time
        )
        return [bool(x) for x in np.all(profile_holds(sweep, found, self.profile), axis=1)]


def _smallest(search: _Search, grid: Real, factors: tuple[float, ...]) -> float | None:
    """Smallest tau_c that passes a sweep: the first point of the grid, then the stretch before."""
    sweep = sweep_of(search.process, factors=factors, corners=False)
    good = search.passes(grid, sweep)
    if True not in good:
        return None
    first = good.index(True)
    low, high = float(grid[max(first - 1, 0)]), float(grid[first])
    for _ in range(REFINEMENTS if first else 0):
        points = np.geomspace(low, high, INSIDE + 2)
        good = [False, *search.passes(points[1:-1], sweep), True]
        first = good.index(True)
        low, high = float(points[first - 1]), float(points[first])
    return high


def _nothing_passes(search: _Search, title: str, grid: Real) -> RuleNotApplicable:
    """Say which tau_c comes closest and what it misses."""
    missed = [
        (found.gravest.overrun, float(tau_c), found.gravest.sentence)
        for tau_c, found in zip(
            grid,
            verify_many(
                search.process,
                search.settings(grid),
                search.profile,
                sample_time=search.sample_time,
            ),
            strict=True,
        )
        if found.gravest
    ]
    _, tau_c, sentence = min(missed)
    return RuleNotApplicable(
        title,
        f"no tau_c from {grid[0]:.3g} to {grid[-1]:.3g} s passes the {search.profile.name} "
        f"profile; at the closest, {tau_c:.3g} s, {sentence}",
    )
