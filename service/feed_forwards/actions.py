"""What users ask about feed-forward; nothing is stored."""

from advice.body import Body
from advice.feed_forward import feed_forward_body
from loop.process import FOPDT
from service.errors import InvalidRequest
from service.feed_forwards.schemas import FeedLoadForward
from service.models.schemas import stated_process
from tuning.feed_forward import feed_forward


def feed_load_forward(wanted: FeedLoadForward) -> Body:
    """Work out the feed-forward of a measured load.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    RuleNotApplicable, UnstableLoop
        There is no answer, with the reason.
    """
    process, load = stated_process(wanted.process), stated_process(wanted.load)
    assert isinstance(process, FOPDT)  # noqa: S101 - the body allows no other
    assert isinstance(load, FOPDT)  # noqa: S101
    try:
        found = feed_forward(process, load, largest_ratio=wanted.largest_ratio)
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return feed_forward_body(found, process, load)
