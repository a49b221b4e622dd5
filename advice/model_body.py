"""What a record says, as JSON: its data, the identified model with its evidence, a relay test."""

from dataclasses import asdict

import numpy as np

from advice.body import Body, Json, number, numbers, process_parameters, settings_body
from identification.candidate import Candidate
from identification.identify import Identification
from identification.quality import Colour
from identification.relay_model import RelayModel
from identification.running_controller import RunningController
from identification.step_reading import StepReading
from identification.theta_interval import profile_interval
from loop.process import FOPDT, Process
from loop.record import Record


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
        "dead_band": None
        if model.dead_band is None
        else {
            "width": number(model.dead_band.width),
            "standard_error": number(model.dead_band.error),
            "part_of_largest_move": number(model.dead_band.width / model.dead_band.largest),
        },
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
