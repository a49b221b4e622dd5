"""Bodies of plant-wide questions."""

from typing import Annotated

from pydantic import Field

from service.assessments.schemas import Period
from service.models.schemas import Id
from service.schemas import Answer

MOST_LOOPS = 100  # some seconds of work; a plant's area has fewer that oscillate


class LookAtPlant(Period):
    """Ask which loops oscillate together, and where it comes from."""

    loop_ids: Annotated[list[Id], Field(min_length=2, max_length=MOST_LOOPS)]


class SuspectBody(Answer):
    """One loop of a group."""

    tag: str
    nonlinearity: float | None = Field(description="Above 1: not that of a linear loop. [-]")
    reason: str


class GroupBody(Answer):
    """Loops that oscillate together."""

    period: float = Field(description="[s]")
    similarity: float = Field(description="Least similarity of two of them. [-]")
    source: str | None = Field(description="Where it likely begins; null where the data don't say.")
    reason: str
    suspects: list[SuspectBody] = Field(description="The likeliest source first.")


class CascadeBody(Answer):
    """An outer loop whose output is an inner loop's set point."""

    outer: str
    inner: str
    explained: float = Field(description="Part of the inner set point's moves. [-]")


class PlantOscillationsBody(Answer):
    """What loops have in common over one period."""

    groups: list[GroupBody]
    cascades: list[CascadeBody]
    left_out: list[tuple[str, str]] = Field(description="Loops not looked at, and why.")
