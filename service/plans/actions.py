"""What users ask about tests to come; nothing is stored."""

import math

from advice.body import Body
from advice.planning import plan_body, plan_test, wishes_for
from loop.process import FOPDT, IPDT
from service.errors import InvalidRequest
from service.models.schemas import stated_process
from service.plans.schemas import PlanTest


def plan(wanted: PlanTest) -> Body:
    """Plan a test by steps, pulses or a relay.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    NoLimitCycle
        A relay would not cycle clear of the noise.
    """
    guess = stated_process(wanted.process)
    assert isinstance(guess, FOPDT | IPDT)  # noqa: S101 - the body allows no other
    try:
        wishes = wishes_for(
            guess,
            noise=wanted.noise,
            deviation=wanted.deviation,
            precision=wanted.precision,
            factor=wanted.factor,
            room_up=math.inf if wanted.room_up is None else wanted.room_up,
            room_down=math.inf if wanted.room_down is None else wanted.room_down,
            sample_time=wanted.sample_time,
        )
        return plan_body(plan_test(wishes, wanted.kind))
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
