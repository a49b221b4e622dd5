"""The whole answer to one process: every rule, verified, with a recommendation."""

from dataclasses import dataclass, replace

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.half_rule import Reduction
from loop.process import Process
from loop.swing import Swing, swing_of
from tuning.catalogue import RULES
from tuning.full_process import (
    FullProcess,
    is_low_order,
    on_full_process,
    on_model,
    propose_on,
    recommend_on_both,
    reductions_of,
    simplest,
)
from tuning.profiles import Profile
from tuning.proposals import Proposal, tune_all
from tuning.ranking import Recommendation, recommend
from tuning.robust import robust_tau_c
from tuning.rule import check_tau_c
from tuning.swinging import tune_swing
from tuning.verification import Verification, verify_many


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuning:
    """One proposal with what it keeps.

    Attributes
    ----------
    proposal : Proposal
        Settings, or the refusal.
    verification : Verification or None
        Margins and verdict on the model that the rule was given; None for a refusal.
    full : FullProcess or None
        What they keep on the process itself, where that was reduced for the rule.
    """

    proposal: Proposal
    verification: Verification | None
    full: FullProcess | None = None

    @property
    def passes(self) -> bool:
        """Whether the profile holds: on the swept model and, where there is one, the process."""
        held = self.verification is not None and self.verification.passes
        return held and (self.full is None or self.full.passes)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tunings:
    """Every rule's answer for one process under one profile.

    Attributes
    ----------
    profile : Profile
        Limits that were asked for.
    tunings : tuple of Tuning
        One for each structure of each rule, in the order of the catalogue, then SIMC at the
        smallest tau_c that passes, where its own speed does not pass.
    recommendation : Recommendation
        Index into `tunings` and the reason.
    reductions : tuple of Reduction
        Low-order models that stood for the process; empty where the rules take it as it is.
    """

    profile: Profile
    tunings: tuple[Tuning, ...]
    recommendation: Recommendation
    reductions: tuple[Reduction, ...] = ()


def tunings(
    process: Process,
    profile: Profile,
    *,
    tau_c: float | None = None,
    sample_time: float = 0.0,
) -> Tunings:
    """Tune a process by every rule, verify everything and recommend.

    Parameters
    ----------
    process : Process
        Process model of any order. What the rules do not take as it is they get as a first-order
        and a second-order model by the half rule; ±50 % of model error then moves that model, and
        the margins at the process itself must hold as well. One that swings by itself,
        K/(T^2 s^2 + 2 zeta T s + 1), gets settings computed for it. [s]
    profile : Profile
        Limits on the margins.
    tau_c : float, optional
        Desired closed-loop time constant for the rules that have one. Default: each rule's own
        formula. [s]
    sample_time : float
        Scan time of the controller; half of it counts as dead time in every margin. [s]

    Raises
    ------
    RuleNotApplicable
        The process is unstable, has complex zeros, or oscillates and is of an order above two.
    ValueError
        tau_c or the sample time is out of range, or ±50 % of the model is.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> from tuning.profiles import PROFILES
    >>> found = tunings(FOPDT(K=2.0, tau=120.0, theta=30.0), PROFILES["general"])
    >>> best = found.tunings[found.recommendation.index].proposal
    >>> best.rule, best.structure, round(best.tau_c, 1)
    ('simc', 'PI', 42.9)
    """
    process = simplest(process)
    swing = swing_of(process)
    if swing is not None:
        if tau_c is not None:
            check_tau_c(tau_c)
        return _of_swing(swing, profile, sample_time)
    if not is_low_order(process):
        return _of_any_order(process, profile, tau_c=tau_c, sample_time=sample_time)
    proposals = list(tune_all(process, tau_c=tau_c))
    verified = _verify(process, proposals, profile, sample_time)
    for i, (proposal, found) in enumerate(zip(proposals, verified, strict=True)):
        if proposal.rule == "simc" and found is not None and not found.passes:
            slower = _robust(process, proposals[i], profile, sample_time)
            proposals.append(slower.proposal)
            verified.append(slower.verification)
            break
    return Tunings(
        profile=profile,
        tunings=tuple(
            Tuning(proposal=p, verification=v) for p, v in zip(proposals, verified, strict=True)
        ),
        recommendation=recommend(proposals, verified),
    )


def _of_swing(swing: Swing, profile: Profile, sample_time: float) -> Tunings:
    """Computed settings for a process that swings by itself; the published rules refuse it."""
    answered = tune_swing(swing, profile, sample_time=sample_time)
    return Tunings(
        profile=profile,
        tunings=tuple(Tuning(proposal=p, verification=v) for p, v in answered),
        recommendation=recommend([p for p, _ in answered], [v for _, v in answered]),
    )


def _of_any_order(
    process: Process, profile: Profile, *, tau_c: float | None, sample_time: float
) -> Tunings:
    """Tune by the low-order models, and hold the settings to the process as well."""
    if tau_c is not None:
        check_tau_c(tau_c)
    reductions = reductions_of(process, tau_c=tau_c)
    asked = [
        propose_on(reductions, rule, structure, tau_c=tau_c if rule.uses_tau_c else None)
        for rule in RULES.values()
        for structure in rule.structures
    ]
    verified: list[Verification | None] = [None] * len(asked)
    for reduction in reductions:
        mine = [i for i, (_, used) in enumerate(asked) if used is reduction]
        found = _verify(reduction.model, [asked[i][0] for i in mine], profile, sample_time)
        for i, one in zip(mine, found, strict=True):
            verified[i] = one
    _add_slower_simc(asked, verified, profile, sample_time)
    settings: list[tuple[PID, Reduction]] = [(p.pid, used) for p, used in asked if p.pid]
    full = iter(on_full_process(process, settings, profile, sample_time=sample_time))
    answered = [
        Tuning(proposal=p, verification=v, full=next(full) if p.pid else None)
        for (p, _), v in zip(asked, verified, strict=True)
    ]
    return Tunings(
        profile=profile,
        tunings=tuple(answered),
        recommendation=recommend_on_both(
            [t.proposal for t in answered], verified, [t.full for t in answered]
        ),
        reductions=reductions,
    )


def _add_slower_simc(
    asked: list[tuple[Proposal, Reduction]],
    verified: list[Verification | None],
    profile: Profile,
    sample_time: float,
) -> None:
    for (proposal, reduction), found in zip(tuple(asked), tuple(verified), strict=True):
        if proposal.rule == "simc" and found is not None and not found.passes:
            slower = _robust(reduction.model, proposal, profile, sample_time)
            asked.append((on_model(slower.proposal, reduction), reduction))
            verified.append(slower.verification)


def _verify(
    process: Process, proposals: list[Proposal], profile: Profile, sample_time: float
) -> list[Verification | None]:
    """Verify all settings in one batch; a refusal has nothing to verify."""
    settings = [p.pid for p in proposals if p.pid is not None]
    found = iter(verify_many(process, settings, profile, sample_time=sample_time))
    return [None if p.pid is None else next(found) for p in proposals]


def _robust(process: Process, published: Proposal, profile: Profile, sample_time: float) -> Tuning:
    """SIMC at the smallest tau_c that passes, or why there is none."""
    reason = f"smallest that passes the {profile.name} profile"
    try:
        found = robust_tau_c(
            process, RULES["simc"], published.structure, profile, sample_time=sample_time
        )
    except RuleNotApplicable as refusal:
        return Tuning(
            proposal=replace(
                published, pid=None, refusal=str(refusal), tau_c=None, tau_c_reason=reason, notes=()
            ),
            verification=None,
        )
    return Tuning(
        proposal=replace(
            published,
            pid=found.pid,
            tau_c=found.tau_c,
            tau_c_reason=reason,
            notes=RULES["simc"].notes(published.structure, process, found.tau_c),
        ),
        verification=found.verification,
    )
