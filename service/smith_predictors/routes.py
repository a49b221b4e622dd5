"""HTTP routes of Smith predictors."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Engineer
from service.audit import declares
from service.limits import HEAVY
from service.smith_predictors import actions
from service.smith_predictors.schemas import PredictLoop, PredictorBody

router = APIRouter(prefix="/v1", tags=["beyond one loop"])


@router.post(
    "/smith-predictors",
    response_model=PredictorBody,
    openapi_extra=declares(None),
    dependencies=[HEAVY],
)
def predict(body: PredictLoop, _: Engineer) -> Body:
    """Tune a Smith predictor and sweep the errors of its model; nothing is stored."""
    return actions.predict(body)
