"""What users ask about schedules; nothing is stored."""

from advice.body import Body
from advice.schedule import schedule_body, schedule_for
from loop.process import FOPDT
from service.errors import InvalidRequest
from service.models.schemas import stated_process
from service.schedules.schemas import PointBody, ScheduleSettings


def schedule(wanted: ScheduleSettings) -> Body:
    """Tune at every operating point and look between them.

    Raises
    ------
    InvalidRequest
        A number cannot be.
    RuleNotApplicable, UnstableLoop
        There is no answer, with the reason.
    """
    try:
        found = schedule_for(
            [(point.at, _process(point)) for point in wanted.points],
            rule=wanted.rule,
            structure=wanted.structure,
            tau_c=wanted.tau_c,
            profile=wanted.profile,
        )
    except ValueError as error:
        raise InvalidRequest("body", str(error)) from error
    return schedule_body(found)


def _process(point: PointBody) -> FOPDT:
    process = stated_process(point.process)
    assert isinstance(process, FOPDT)  # noqa: S101 - the body allows no other
    return process
