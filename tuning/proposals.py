"""Every rule's settings for one process, or the reason why a rule has none."""

from dataclasses import dataclass

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import Process
from tuning.catalogue import RULES
from tuning.rule import STATUS_TEXT, Rule, Status, check_tau_c
from tuning.ultimate import SOURCE_TEXT, UltimatePoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """What one structure of one rule answers.

    Attributes
    ----------
    rule : str
        Name of the rule in the catalogue.
    structure : str
        P, PI, PD or PID.
    pid : PID or None
        The settings; None where the rule has no answer.
    refusal : str or None
        Why it has none, one sentence.
    tau_c : float or None
        Desired closed-loop time constant in use; None where the rule has none to choose. [s]
    tau_c_reason : str or None
        Where that tau_c comes from.
    status : str
        "confirmed" or "memory".
    notes : tuple of str
        What to know about these very settings.
    """

    rule: str
    structure: str
    pid: PID | None
    refusal: str | None = None
    tau_c: float | None = None
    tau_c_reason: str | None = None
    status: Status
    notes: tuple[str, ...] = ()


def tune_all(process: Process, *, tau_c: float | None = None) -> tuple[Proposal, ...]:
    """Ask every structure of every rule for settings.

    Parameters
    ----------
    process : Process
        Process model. [s]
    tau_c : float, optional
        Desired closed-loop time constant for the rules that have one; the others have nothing to
        choose and answer as published. Default: each rule's own formula. [s]

    Returns
    -------
    tuple of Proposal
        One for each structure, in the order of the catalogue, refusals included.

    Raises
    ------
    ValueError
        tau_c is not positive.
    """
    if tau_c is not None:
        check_tau_c(tau_c)
    return tuple(
        propose(process, rule, structure, tau_c=tau_c if rule.uses_tau_c else None)
        for rule in RULES.values()
        for structure in rule.structures
    )


def propose(
    process: Process, rule: Rule, structure: str, *, tau_c: float | None = None
) -> Proposal:
    """Ask one structure of one rule for settings; a refusal is an answer.

    Parameters
    ----------
    process : Process
        Process model. [s]
    rule : Rule
        Rule of the catalogue.
    structure : str
        One of the rule's structures.
    tau_c : float, optional
        Desired closed-loop time constant. [s]
    """
    reason = None
    used = tau_c
    try:
        # The settings come first: their refusal is the plainest, and then the default exists.
        pid = rule.structures[structure](process, tau_c)
        if rule.default_tau_c is not None:
            reason = "as chosen" if tau_c is not None else f"default: {rule.tau_c_text}"
            used = rule.default_tau_c(process) if tau_c is None else tau_c
    except RuleNotApplicable as refusal:
        return Proposal(
            rule=rule.name, structure=structure, pid=None, refusal=str(refusal), status=rule.status
        )
    except ValueError as limit:  # settings beyond every controller, from a process at its limits
        return Proposal(
            rule=rule.name,
            structure=structure,
            pid=None,
            refusal=f"{rule.title} gives settings that no controller takes: {limit}.",
            status=rule.status,
        )
    return Proposal(
        rule=rule.name,
        structure=structure,
        pid=pid,
        tau_c=used,
        tau_c_reason=reason,
        status=rule.status,
        notes=_all_notes(rule, rule.notes(structure, process, used)),
    )


def tune_from_ultimate(point: UltimatePoint) -> tuple[Proposal, ...]:
    """Ask the rules that rest on Ku and Pu alone, as after a relay test.

    Parameters
    ----------
    point : UltimatePoint
        Ultimate gain and period; its source is told with every answer. [OP/PV] and [s]
    """
    return tuple(
        Proposal(
            rule=rule.name,
            structure=structure,
            pid=formula(point),
            status=rule.status,
            notes=_all_notes(rule, (SOURCE_TEXT[point.source],)),
        )
        for rule in RULES.values()
        for structure, formula in (rule.from_ultimate or {}).items()
    )


def _all_notes(rule: Rule, notes: tuple[str, ...]) -> tuple[str, ...]:
    return (*notes, STATUS_TEXT["memory"]) if rule.status == "memory" else notes
