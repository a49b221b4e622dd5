"""What users ask about Smith predictors; nothing is stored."""

from advice.body import Body
from advice.predictor import predictor_body, predictor_case
from loop.process import FOPDT
from service.errors import InvalidRequest
from service.models.schemas import stated_process
from service.smith_predictors.schemas import PredictLoop


def predict(wanted: PredictLoop) -> Body:
    """Tune a Smith predictor and sweep it.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    RuleNotApplicable, UnstableLoop
        There is no answer, with the reason.
    """
    process = stated_process(wanted.process)
    assert isinstance(process, FOPDT)  # noqa: S101 - the body allows no other
    try:
        return predictor_body(predictor_case(process, tau_c=wanted.tau_c, profile=wanted.profile))
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
