"""What users ask about detuning; nothing is stored."""

from advice.body import Body
from advice.detuning import detuning_body, detuning_case
from service.detunings.schemas import Detune
from service.errors import InvalidRequest
from service.models.schemas import stated_process


def detune(wanted: Detune) -> Body:
    """Choose settings by one knob.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    RuleNotApplicable
        No settings reach the position, with the reason.
    """
    try:
        case = detuning_case(
            stated_process(wanted.process),
            wanted.knob,
            structure=wanted.structure,
            gain=wanted.gain,
            profile=wanted.profile,
            scan_time=wanted.scan_time,
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return detuning_body(case)
