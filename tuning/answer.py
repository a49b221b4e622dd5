"""The whole answer to one process: every rule, verified, with a recommendation."""

from dataclasses import dataclass, replace

from loop.errors import RuleNotApplicable
from loop.process import Process
from tuning.catalogue import RULES
from tuning.profiles import Profile
from tuning.proposals import Proposal, tune_all
from tuning.ranking import Recommendation, recommend
from tuning.robust import robust_tau_c
from tuning.verification import Verification, verify_many


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuning:
    """One proposal with what it keeps.

    Attributes
    ----------
    proposal : Proposal
        Settings, or the refusal.
    verification : Verification or None
        Margins and verdict; None for a refusal.
    """

    proposal: Proposal
    verification: Verification | None


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
    """

    profile: Profile
    tunings: tuple[Tuning, ...]
    recommendation: Recommendation


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
        Process model. [s]
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
        The process is a transfer function other than K/(s (tau2 s + 1)).
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
