"""What users ask about smooth tuning; nothing is stored."""

from advice.body import Body
from advice.smooth import smooth_body, smooth_case
from service.errors import InvalidRequest
from service.models.schemas import stated_process
from service.smooth_tunings.schemas import TuneSmoothly


def tune_smoothly(wanted: TuneSmoothly) -> Body:
    """Tune as slowly as a load permits.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    RuleNotApplicable, UnstableLoop
        There is no answer, with the reason.
    """
    try:
        case = smooth_case(
            stated_process(wanted.process),
            load=wanted.load,
            allowed=wanted.allowed,
            profile=wanted.profile,
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return smooth_body(case)
