"""What users ask about cascades; nothing is stored."""

from advice.body import Body
from advice.cascade import cascade_body, cascade_case
from loop.process import FOPDT
from service.cascades.schemas import TuneCascade
from service.errors import InvalidRequest
from service.models.schemas import stated_process


def tune_cascade(wanted: TuneCascade) -> Body:
    """Tune a cascade from inside out and sweep both loops.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    RuleNotApplicable, UnstableLoop
        There is no answer, with the reason.
    """
    inner, outer = stated_process(wanted.inner), stated_process(wanted.outer)
    assert isinstance(inner, FOPDT)  # noqa: S101 - the body allows no other
    assert isinstance(outer, FOPDT)  # noqa: S101
    try:
        case = cascade_case(
            inner,
            outer,
            inner_tau_c=wanted.inner_tau_c,
            outer_tau_c=wanted.outer_tau_c,
            profile=wanted.profile,
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return cascade_body(case)
