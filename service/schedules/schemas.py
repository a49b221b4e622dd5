"""Bodies of schedule requests and answers; the answer is that of `loopwright schedule`."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, JsonValue

from service.loops.schemas import ProfileName
from service.models.schemas import FOPDTBody
from service.schemas import Answer, Strict
from service.units import Quantity, Seconds, Word

MOST_POINTS = 50


class PointBody(Strict):
    """An operating point."""

    at: Quantity = Field(description="Value of the scheduling variable. [its own unit]")
    process: FOPDTBody = Field(description="The process there.")


class ScheduleSettings(Strict):
    """Ask for settings over operating points, and whether the points are close enough."""

    points: Annotated[list[PointBody], Field(min_length=2, max_length=MOST_POINTS)]
    rule: Word = Field("simc", description="Rule of the catalogue.")
    structure: Literal["P", "PI", "PD", "PID"] = Field("PI", description="One of its structures.")
    tau_c: Seconds | None = Field(
        None,
        description="Closed-loop time constant at every point; the rule's own, of SIMC twice the "
        "dead time, if null. [s]",
    )
    profile: ProfileName = Field("general", description="Target profile.")


class ScheduleBody(Answer):
    """Settings by operating point, and what happens between the points."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    points: list[dict[str, JsonValue]]
    gaps: list[dict[str, JsonValue]] = Field(
        description="held_Ms where settings step, between_Ms half way on a line; null for unstable."
    )
    sentences: list[str]
