"""A tuning case as the JSON document that the command line prints and the API answers.

Numbers keep full precision. null stands for an infinite margin, for Ti without integral action,
and for a number that does not exist; NaN and infinity never appear.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import TypeAlias

import numpy as np

from advice.next_test import after, next_test_body
from advice.tune import TuningCase
from identification.candidates import Candidate
from identification.identify import Identification
from identification.quality import Colour
from identification.relay_model import RelayModel
from identification.running_controller import RunningController
from identification.step_reading import StepReading
from identification.theta_interval import profile_interval
from loop.controller import PID
from loop.half_rule import Reduction
from loop.margin_batch import MarginBatch
from loop.margins import Margins
from loop.process import FOPDT, Process
from loop.record import Record
from loop.signals import Flags, Real
from tuning.answer import Tuning
from tuning.catalogue import RULES
from tuning.full_process import FullProcess
from tuning.profiles import Profile
from tuning.verification import Verification, Worst

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"
Body: TypeAlias = dict[str, Json]


def number(value: float | None) -> float | None:
    """A JSON number, null for infinity and for what does not exist."""
    return None if value is None or not math.isfinite(value) else float(value)


def numbers(values: Real) -> Json:
    """An array of any shape as nested JSON lists."""
    finite = np.isfinite(values)
    if finite.all():  # nearly always, and ten times faster
        listed: Json = values.tolist()
        return listed
    held = values.astype(object)
    held[~finite] = None
    with_nulls: Json = held.tolist()
    return with_nulls


def process_body(process: Process) -> Body:
    """A process with its kind and its parameters."""
    return {"kind": type(process).__name__, **process_parameters(process)}


def margins_body(margins: Margins) -> Body:
    """The six margins of one loop."""
    return {name: number(value) for name, value in asdict(margins).items()}


def profile_body(profile: Profile) -> Body:
    """The limits a verdict rests on."""
    return {**asdict(profile), "gain_dB": 20 * math.log10(profile.gain)}


def settings_body(pid: PID) -> Body:
    """Controller settings in the ISA form."""
    return {
        "form": "ISA",
        "action": pid.action.value,
        "Kc": pid.Kc,
        "Ti": number(pid.Ti),
        "Td": pid.Td,
        "N": number(pid.N),
        "b": pid.b,
        "c": pid.c,
        "tauF": pid.tauF,
    }


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
        "source": RULES[proposal.rule].source,
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


def stated_model_body(process: Process) -> Body:
    """A process that was stated, in the shape of an identified model."""
    parameters = process_parameters(process)
    return {
        "kind": type(process).__name__,
        "K": parameters.get("K"),
        "tau": parameters.get("tau"),
        "theta": parameters.get("theta"),
        "parameters": parameters,
        "verdict": "stated",
        "reasons": ["The process was stated, not identified; its errors are not known."],
    }


def data_body(record: Record) -> Body:
    """What the record holds."""
    known = np.isfinite(record.pv) & np.isfinite(record.op)
    return {
        "tag": record.tag,
        "rows": len(record),
        "gaps": int(np.count_nonzero(~known)),
        "span": number(record.span),
        "sample_time": number(record.sample_time),
        "start": None if record.start is None else record.start.isoformat(),
        "op_before": record.op_before,
        "pv_unit": record.pv_unit,
        "op_unit": record.op_unit,
    }


def model_body(model: Identification) -> Body:
    """An identified model: parameters with errors, verdict, reasons and evidence.

    K, tau and theta are null where the model was refused; `fitted` then holds what least squares
    gave all the same, which must not be used. Errors belong to the parameters of `structure`, of
    which `parameters` may be a simplification that tuning rules take.
    """
    parameters = None if model.process is None else process_parameters(model.process)
    # A relay's wave is fitted by one lag alone.
    names = ("K", "tau", "theta") if model.structure is None else model.structure.structure.names
    errors: Body | None = None
    if model.standard_errors is not None:
        errors = dict(zip(names, map(number, model.standard_errors), strict=True))
    return {
        "kind": model.kind,
        **{n: None if parameters is None else parameters.get(n) for n in ("K", "tau", "theta")},
        "parameters": parameters,
        "verdict": model.verdict.value,
        "reasons": list(model.reasons),
        "standard_errors": errors,
        "intervals_95": None
        if model.intervals is None
        else dict(zip(names, map(numbers, model.intervals), strict=True)),
        "theta_profile_95": _dead_time_profile(model),
        "correlation": None if model.correlation is None else numbers(model.correlation),
        "fitted": None if model.fitted is None else process_parameters(model.fitted),
        "fit_percent": number(model.fit_percent),
        "noise_sd": number(model.noise_sd),
        "residual": None if model.colour is None else residual_body(model.colour),
        "pv0": number(model.pv0),
        "drift": number(model.drift),
        "drift_error": number(model.drift_error),
        "start": number(model.start),
        "rows": model.rows,
        "samples": model.samples,
        "spikes": model.spikes,
        "span": number(model.span),
        "longest_gap": number(model.longest_gap),
        "steps": [step_body(reading) for reading in model.steps],
        "structure": None if model.structure is None else structure_body(model.structure),
        "candidates": []
        if model.choice is None
        else [structure_body(candidate) for candidate in model.choice.candidates],
    }


def _dead_time_profile(model: Identification) -> Json:
    """Interval of theta that follows the sum of squares; null without a first-order model."""
    if not isinstance(model.process, FOPDT) or model.structure is None:
        return None
    if model.structure.structure.name != "first order":
        return None
    return [number(end) for end in profile_interval(model)]


def structure_body(candidate: Candidate) -> Body:
    """A process structure fitted to the record, with the figures that speak for or against it."""
    names = candidate.structure.names
    return {
        "name": candidate.structure.name,
        "formula": candidate.structure.formula,
        "units": dict(zip(names, candidate.structure.units, strict=True)),
        "parameters": dict(zip(names, map(number, candidate.values.tolist()), strict=True)),
        "standard_errors": dict(
            zip(names, map(number, candidate.standard_errors.tolist()), strict=True)
        ),
        "free_parameters": candidate.free,
        "criterion": number(candidate.bic),
        "largest_misfit": number(candidate.part),
        "noise_sd": number(candidate.fit.noise_sd),
        "residual": residual_body(candidate.colour),
        "determined": candidate.determined,
    }


def process_parameters(process: Process) -> Body:
    """The parameters of a model by name."""
    return {
        name: [number(c) for c in value] if isinstance(value, tuple) else number(value)
        for name, value in asdict(process).items()
    }


def residual_body(colour: Colour) -> Body:
    """Whether the residual is white."""
    return {
        "white": colour.white,
        "lag1": number(colour.lag1),
        "ljung_box": number(colour.statistic),
        "lags": colour.lags,
        "p_value": number(colour.p_value),
        "inflation": number(colour.inflation),
    }


def step_body(reading: StepReading) -> Body:
    """One move of the output with what PV says about it alone."""
    smith = reading.two_point
    return {
        "time": number(reading.step.instant),
        "start": number(reading.step.start),
        "end": number(reading.step.end),
        "op_from": number(reading.step.op_from),
        "op_to": number(reading.step.op_to),
        "direction": reading.step.direction,
        "steady_before": reading.steady_before,
        "steady_after": reading.steady_after,
        "smith_two_point": None if smith is None else process_parameters(smith.process),
        "methods": {
            method.method: None if method.process is None else process_parameters(method.process)
            for method in reading.methods
        },
        "remark": reading.remark,
    }


def relay_body(found: RelayModel) -> Body:
    """What a relay test says beside the model: its cycles, and both ultimate points."""
    values = asdict(found.relay)
    del values["remarks"]
    exact = found.ultimate
    return {
        **{name: number(value) for name, value in values.items()},
        "load": number(found.load),
        "exact": None if exact is None else dict(asdict(exact)),
        "from_half_periods": None if found.inverted is None else process_parameters(found.inverted),
    }


def relay_only_body(found: RelayModel) -> Body:
    """A relay test in the place of a model, where no model could be had from it."""
    return {
        "kind": "relay",
        "tau": None,
        "theta": None,
        "parameters": None,
        "verdict": "use with care",
        "reasons": list(found.model.reasons),
        **relay_body(found),
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


def as_found_body(found: RunningController) -> Body:
    """Settings that routine data show to run, with their errors and reasons."""
    intervals = {"Kc": found.Kc, "Ti": found.Ti, "Td": found.Td}
    return {
        "verdict": found.verdict.value,
        "reasons": list(found.reasons),
        "settings": None if found.pid is None else settings_body(found.pid),
        "intervals_95": {name: values and list(values) for name, values in intervals.items()},
        "unexplained": number(found.unexplained),
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
        "as_found": None if case.as_found is None else as_found_body(case.as_found),
        "next_test": None if following is None else next_test_body(following),
    }
