"""HTTP routes of feed-forward."""

from fastapi import APIRouter

from advice.body import Body
from service.access import Engineer
from service.audit import declares
from service.feed_forwards import actions
from service.feed_forwards.schemas import FeedForwardBody, FeedLoadForward
from service.limits import HEAVY

router = APIRouter(prefix="/v1", tags=["beyond one loop"])


@router.post(
    "/feed-forwards",
    response_model=FeedForwardBody,
    openapi_extra=declares(None),
    dependencies=[HEAVY],
)
def feed_load_forward(body: FeedLoadForward, _: Engineer) -> Body:
    """Work out the feed-forward of a measured load, and what it leaves; nothing is stored."""
    return actions.feed_load_forward(body)
