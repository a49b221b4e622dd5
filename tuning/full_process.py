"""Rules on a process of any order: by its low-order models, and held to the process itself."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from loop.chain_margins import full_margins
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.half_rule import Reduction, half_rule
from loop.margins import Margins
from loop.process import Process, TransferFunction
from tuning.profiles import Profile
from tuning.proposals import Proposal, propose
from tuning.ranking import Recommendation, recommend
from tuning.rule import Rule
from tuning.shortfall import MARGIN_NAMES, missed_limit
from tuning.verification import Verification

ORDERS: tuple[Literal[1, 2], ...] = (1, 2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FullProcess:
    """What settings from a low-order model keep on the process it stands for.

    Attributes
    ----------
    reduction : Reduction
        The model that the rule was given, and what it neglects.
    stable : bool
        Whether the loop with the process is stable.
    margins : Margins
        Margins with the process; of an unstable loop 0, and infinite for Ms and Mt.
    missed : tuple of str
        Limits of the profile that do not hold there, in words.
    """

    reduction: Reduction
    stable: bool
    margins: Margins
    missed: tuple[str, ...]

    @property
    def passes(self) -> bool:
        """Whether every limit of the profile holds on the process."""
        return self.stable and not self.missed

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        if not self.stable:
            return "On the full process the loop is unstable."
        if self.missed:
            return f"On the full process {', '.join(self.missed)}."
        return (
            f"On the full process the profile holds: gain margin {self.margins.gain:.3g}, "
            f"phase margin {self.margins.phase:.3g}°, Ms {self.margins.Ms:.3g}."
        )


def is_low_order(process: Process) -> bool:
    """Whether the rules take the process as it is."""
    if not isinstance(process, TransferFunction):
        return True
    match process:
        case TransferFunction(numerator=(_,), denominator=(d2, d1, 0.0)) if d1 and d2 / d1 > 0:
            return True
        case _:
            return False


def simplest(process: Process) -> Process:
    """Write a transfer function that is a low-order model exactly as that model.

    Parameters
    ----------
    process : Process
        Process of any order. [s]

    Examples
    --------
    >>> simplest(TransferFunction((2.0,), (120.0, 1.0), 30.0))
    FOPDT(K=2.0, tau=120.0, theta=30.0)
    """
    if is_low_order(process):
        return process
    for order in ORDERS:
        try:
            found = half_rule(process, order=order)
        except (RuleNotApplicable, ValueError):
            continue
        if found.exact:
            return found.model
    return process


def reductions_of(process: Process, *, tau_c: float | None = None) -> tuple[Reduction, ...]:
    """Reduce a process to a first-order and a second-order model, where they exist.

    Parameters
    ----------
    process : Process
        Process of any order. [s]
    tau_c : float, optional
        Desired closed-loop time constant. [s]

    Raises
    ------
    RuleNotApplicable
        There is neither: the process is unstable, oscillates, has complex zeros or no dynamics.
    """
    found: list[Reduction] = []
    refusals: list[RuleNotApplicable] = []
    for order in ORDERS:
        try:
            found.append(half_rule(process, order=order, tau_c=tau_c))
        except RuleNotApplicable as refusal:
            refusals.append(refusal)
    if not found:
        raise refusals[0]
    return tuple(found)


def propose_on(
    reductions: Sequence[Reduction], rule: Rule, structure: str, *, tau_c: float | None
) -> tuple[Proposal, Reduction]:
    """Ask a rule for settings on the closest model that it takes.

    Parameters
    ----------
    reductions : sequence of Reduction
        Models of one process, the simplest first.
    rule : Rule
        Rule of the catalogue.
    structure : str
        One of its structures.
    tau_c : float, optional
        Desired closed-loop time constant. [s]

    Returns
    -------
    proposal : Proposal
        Settings or the refusal; its notes say which model it rests on.
    reduction : Reduction
        That model.
    """
    kinds = rule.takes[structure]
    taken = [one for one in reductions if type(one.model).__name__ in kinds]
    used = taken[-1] if taken else reductions[0]
    found = propose(used.model, rule, structure, tau_c=tau_c)
    return on_model(found, used), used


def on_model(proposal: Proposal, reduction: Reduction) -> Proposal:
    """Note on which model of the process the settings rest.

    Parameters
    ----------
    proposal : Proposal
        Settings, or a refusal, which is left as it is.
    reduction : Reduction
        The model.
    """
    if proposal.pid is None:
        return proposal
    kind = type(reduction.model).__name__
    note = f"settings for the {kind} model by the half rule"
    return replace(proposal, notes=(*proposal.notes, note))


def recommend_on_both(
    proposals: Sequence[Proposal],
    verified: Sequence[Verification | None],
    full: Sequence[FullProcess | None],
) -> Recommendation:
    """Recommend among what holds on the swept model and on the process, or say why nothing is.

    Parameters
    ----------
    proposals : sequence of Proposal
        What the rules answered.
    verified : sequence of Verification or None
        What each keeps on the model and under ±50 % of its parameters.
    full : sequence of FullProcess or None
        What each keeps on the process.
    """
    holding = [
        v if f is not None and f.passes else None for v, f in zip(verified, full, strict=True)
    ]
    best = recommend(proposals, holding)
    on_the_model = best if best.index is not None else recommend(proposals, verified)
    if on_the_model.index is None:
        return on_the_model
    found = full[on_the_model.index]
    said = "" if found is None else found.sentence
    if best.index is not None:
        return replace(best, reason=f"{best.reason} {said}")
    return Recommendation(
        index=None,
        reason="No settings with integral action pass on the low-order model and on the full "
        f"process both. The best on the model: {said}",
    )


def on_full_process(
    process: Process,
    cases: Sequence[tuple[PID, Reduction]],
    profile: Profile,
    *,
    sample_time: float = 0.0,
) -> list[FullProcess]:
    """Hold settings to a profile on the process itself, with its exact dead time.

    Parameters
    ----------
    process : Process
        Process of any order. [s]
    cases : sequence of tuple of PID and Reduction
        Settings, and the model they were made for.
    profile : Profile
        Limits on the margins.
    sample_time : float
        Scan time of the controller; half of it counts as dead time. [s]
    """
    if not cases:
        return []
    batch = full_margins(process, tuple(pid for pid, _ in cases), sample_time=sample_time)
    found = []
    for row, (_, reduction) in enumerate(cases):
        one = Margins(
            gain=float(batch.gain[row]),
            gain_reduction=float(batch.gain_reduction[row]),
            phase=float(batch.phase[row]),
            delay=float(batch.delay[row]),
            Ms=float(batch.Ms[row]),
            Mt=float(batch.Mt[row]),
        )
        found.append(
            FullProcess(
                reduction=reduction,
                stable=bool(batch.stable[row]),
                margins=one,
                missed=_missed(one, profile, process.theta) if batch.stable[row] else (),
            )
        )
    return found


def _missed(found: Margins, profile: Profile, theta: float) -> tuple[str, ...]:
    limits: dict[str, float | None] = {
        "gain": profile.gain,
        "phase": profile.phase,
        "Ms": profile.Ms,
        "Mt": profile.Mt,
        "delay": None if profile.delay_over_theta is None else profile.delay_over_theta * theta,
    }
    said = []
    for name, limit in limits.items():
        value = getattr(found, name)
        if limit is not None and (value < limit if MARGIN_NAMES[name][1] else value > limit):
            said.append(missed_limit(name, value, limit))
    return tuple(said)
