"""A tuning case as the JSON document that the command line prints and the API answers."""

from collections.abc import Mapping

from advice.body import (
    Body,
    margins_body,
    number,
    numbers,
    process_body,
    profile_body,
    settings_body,
)
from advice.frequency import frequency_body
from advice.model_body import (
    as_found_body,
    data_body,
    model_body,
    relay_body,
    relay_only_body,
    stated_model_body,
)
from advice.next_test import after, next_test_body
from advice.tune import TuningCase
from loop.half_rule import Reduction
from loop.margin_batch import MarginBatch
from loop.signals import Flags
from tuning.answer import Tuning
from tuning.catalogue import rule_of
from tuning.full_process import FullProcess
from tuning.verification import Verification, Worst


def sweep_body(verification: Verification) -> Body:
    """The ±50 % sweep: every margin at every plant, the worst ones, and the joint corners."""
    return {
        "parameters": list(verification.parameters),
        "factors": numbers(verification.factors),
        **_batch_body(verification.sweep),
        "worst": _worst_body(verification.worst),
        "passes": verification.one_at_a_time_passes,
        "corners": {
            "factors": numbers(verification.corner_factors),
            **_batch_body(verification.corners),
            "worst": _worst_body(verification.worst_corner),
            "passes": verification.corners_pass,
        },
    }


def _batch_body(found: MarginBatch) -> Body:
    stable: Flags = found.stable
    return {
        "stable": stable.tolist(),
        "gain": numbers(found.gain),
        "phase": numbers(found.phase),
        "delay": numbers(found.delay),
        "Ms": numbers(found.Ms),
        "Mt": numbers(found.Mt),
    }


def _worst_body(worst: Mapping[str, Worst]) -> Body:
    return {
        name: {
            "value": number(case.value),
            "parameter": case.parameter,
            "factor": case.factor,
            "where": case.where,
        }
        for name, case in worst.items()
    }


def verification_body(verification: Verification) -> Body:
    """Margins at the model, sweep and verdict."""
    return {
        "stable": verification.stable,
        "margins": margins_body(verification.nominal),
        "sweep": sweep_body(verification),
        "nominal_passes": verification.nominal_passes,
        "passes": verification.passes,
        "verdict": verification.verdict,
    }


def tuning_body(tuning: Tuning) -> Body:
    """One rule's settings, where they come from, and what they keep."""
    proposal, found = tuning.proposal, tuning.verification
    if proposal.pid is None:
        raise ValueError("a refusal has no settings")
    unverified: Body = {"stable": None, "margins": None, "sweep": None, "passes": False}
    return {
        "rule": proposal.rule,
        "structure": proposal.structure,
        **settings_body(proposal.pid),
        "tau_c": proposal.tau_c,
        "tau_c_reason": proposal.tau_c_reason,
        "source": rule_of(proposal.rule).source,
        "status": proposal.status,
        "notes": list(proposal.notes),
        **(unverified if found is None else verification_body(found)),
        "passes": tuning.passes,
        "full_process": None if tuning.full is None else full_process_body(tuning.full),
    }


def full_process_body(full: FullProcess) -> Body:
    """What settings from a low-order model keep on the process it stands for."""
    return {
        "model": type(full.reduction.model).__name__,
        "stable": full.stable,
        "margins": margins_body(full.margins),
        "passes": full.passes,
        "verdict": full.sentence,
    }


def reduction_body(reduction: Reduction) -> Body:
    """A low-order model by the half rule, and what it neglects."""
    return {"model": process_body(reduction.model), "neglected": list(reduction.steps)}


def refusal_body(tuning: Tuning) -> Body:
    """Why one structure of one rule has no settings here."""
    proposal = tuning.proposal
    return {
        "rule": proposal.rule,
        "structure": proposal.structure,
        "reason": proposal.refusal,
    }


def case_model_body(case: TuningCase) -> Body:
    """The model that a case rests on, whichever way it came."""
    if case.relay is not None:
        if case.process is None:
            return relay_only_body(case.relay)
        return {**model_body(case.relay.model), "relay": relay_body(case.relay)}
    if case.model is not None:
        return model_body(case.model)
    if case.process is not None:
        return stated_model_body(case.process)
    return {
        "kind": None,
        "K": None,
        "tau": None,
        "theta": None,
        "parameters": None,
        "verdict": "refused",
        "reasons": [case.recommended_reason],
    }


def case_body(case: TuningCase) -> Body:
    """The whole case: data, model, every rule, recommendation.

    Parameters
    ----------
    case : TuningCase
        What `advice.tune` answered.
    """
    best, following = case.best, after(case)
    running: Body | None = None
    if case.running is not None:
        running = {**settings_body(case.running)}
        if case.running_verification is not None:
            running |= verification_body(case.running_verification)
        if case.running_full is not None:
            running["full_process"] = full_process_body(case.running_full)
    return {
        "data": None if case.record is None else data_body(case.record),
        "process": None if case.process is None else process_body(case.process),
        "reductions": [reduction_body(reduction) for reduction in case.reductions],
        "model": case_model_body(case),
        "profile": profile_body(case.profile),
        "tunings": [tuning_body(t) for t in case.tunings if t.proposal.pid is not None],
        "refusals": [refusal_body(t) for t in case.tunings if t.proposal.pid is None],
        "recommended": None if best is None else tuning_body(best),
        "recommended_reason": case.recommended_reason,
        "running": running,
        "frequency": None if case.frequency is None else frequency_body(case.frequency),
        "as_found": None if case.as_found is None else as_found_body(case.as_found),
        "next_test": None if following is None else next_test_body(following),
    }
