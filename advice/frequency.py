"""What a frequency test says: measured response, model, and margins without a model."""

from dataclasses import dataclass

from advice.body import Body, Json, number, numbers
from identification.frequency_fit import FrequencyFit, fit_frequency_response
from identification.frequency_margins import MeasuredMargins, measured_margins
from identification.frequency_response import FrequencyResponse, frequency_response
from identification.frequency_test import looks_like_frequency_test
from loop.controller import PID
from loop.errors import FitNotTrusted, PoorExcitation
from loop.record import Record


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyCase:
    """A frequency test and everything that follows from it.

    Attributes
    ----------
    response : FrequencyResponse
        Measured points.
    fit : FrequencyFit or None
        First order plus dead time through them; None where the points carry none.
    refusal : str
        Why there is no model; empty where there is one.
    controller : PID or None
        Settings whose margins were asked for.
    margins : MeasuredMargins or None
        Those margins, straight from the points.
    """

    response: FrequencyResponse
    fit: FrequencyFit | None
    refusal: str
    controller: PID | None
    margins: MeasuredMargins | None


def frequency_case(record: Record, controller: PID | None = None) -> FrequencyCase:
    """Read a chirp, sine steps or a multisine in manual.

    Parameters
    ----------
    record : Record
        The test, evenly sampled.
    controller : PID, optional
        Settings whose margins are wanted.

    Raises
    ------
    PoorExcitation
        The record carries no response.
    """
    response = frequency_response(record)
    fit, refusal = None, ""
    try:
        fit = fit_frequency_response(response)
    except (FitNotTrusted, PoorExcitation) as reason:
        refusal = str(reason)
    return FrequencyCase(
        response=response,
        fit=fit,
        refusal=refusal,
        controller=controller,
        margins=None if controller is None else measured_margins(response, controller),
    )


def measured_beside(record: Record, controller: PID | None) -> FrequencyCase | None:
    """Read the response of a record that is a frequency test, None for every other.

    Parameters
    ----------
    record : Record
        One loop over one stretch of time.
    controller : PID or None
        Settings whose margins are wanted.
    """
    if not looks_like_frequency_test(record):
        return None
    try:
        return frequency_case(record, controller)
    except PoorExcitation:
        return None


def frequency_body(case: FrequencyCase) -> Body:
    """Turn a case into the JSON document of the command line and the API."""
    points = case.response
    return {
        "response": {
            "w": numbers(points.w),
            "re": numbers(points.G.real),
            "im": numbers(points.G.imag),
            "sd": numbers(points.sd),
            "coherence": numbers(points.coherence),
        },
        "model": _model(case.fit),
        "refusal": case.refusal or None,
        "margins": _margins(case.margins),
    }


def _model(fit: FrequencyFit | None) -> Json:
    if fit is None:
        return None
    return {
        "kind": "FOPDT",
        "K": fit.process.K,
        "tau": fit.process.tau,
        "theta": fit.process.theta,
        "standard_errors": numbers(fit.standard_errors),
        "misfit": number(fit.misfit),
        "points": fit.points,
    }


def _margins(found: MeasuredMargins | None) -> Json:
    if found is None:
        return None
    body: dict[str, Json] = {
        name: _with_ends(getattr(found, name)) for name in ("gain", "phase", "Ms")
    }
    return {
        **body,
        "w180": None if found.w180 is None else number(found.w180),
        "wc": None if found.wc is None else number(found.wc),
        "remarks": list(found.remarks),
    }


def _with_ends(value: tuple[float, float, float] | None) -> Json:
    if value is None:
        return None
    return dict(zip(("value", "low", "high"), (number(part) for part in value), strict=True))
