"""Causes, actions, and the diagnosis that names them."""

from dataclasses import dataclass
from enum import StrEnum

from monitoring.basis import Confidence

# How a valve that does not move is told from a measurement that does not.
MOVE_IT = (
    "To tell: put the loop in manual, move OP by a few percent up and back, and watch PV and the "
    "stem; check the positioner."
)


class Cause(StrEnum):
    """What is wrong with a loop."""

    HEALTHY = "healthy"
    VALVE = "valve"
    TUNING = "tuning"
    DISTURBANCE = "disturbance"
    SENSOR = "sensor"
    CONSTRAINT = "constraint"
    NOT_IN_USE = "not in use"
    NOT_ASSESSABLE = "not assessable"


class Action(StrEnum):
    """What to do next."""

    NOTHING = "nothing"
    CHECK_VALVE = "check the valve"
    RETUNE = "retune"
    IDENTIFY = "identify the process again, then retune"
    LOOK_UPSTREAM = "look upstream"
    CHECK_SENSOR = "check the measurement"
    CHECK_RANGE = "check the operating point and the size of the valve"
    ASK_OPERATORS = "ask why the loop is not in automatic"
    GET_DATA = "get better data"


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """What is wrong, how sure that is, and what to do.

    Attributes
    ----------
    cause : Cause
        The likeliest cause.
    confidence : Confidence
        How far to trust it.
    evidence : tuple of str
        What it rests on.
    action : Action
        What to do next.
    others : tuple of Cause
        Further causes that the data show or leave open.
    """

    cause: Cause
    confidence: Confidence
    evidence: tuple[str, ...]
    action: Action
    others: tuple[Cause, ...] = ()


def not_assessable(reason: str) -> Diagnosis:
    """Say why nothing can be said."""
    return Diagnosis(
        cause=Cause.NOT_ASSESSABLE,
        confidence=Confidence.NONE,
        evidence=(reason,),
        action=Action.GET_DATA,
    )
