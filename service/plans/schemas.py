"""Bodies of plan requests and answers; the answer is that of `loopwright plan --json`."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from service.models.schemas import FOPDTBody, IPDTBody
from service.schemas import Answer, Strict
from service.units import Positive, Seconds

NotNegative = Annotated[float, Field(ge=0, le=1e12, allow_inf_nan=False)]


class PlanTest(Strict):
    """Ask for a plan of a test by steps, pulses or a relay."""

    kind: Literal["steps", "relay"] = Field("steps", description="Moves in manual, or a relay.")
    process: Annotated[FOPDTBody | IPDTBody, Field(discriminator="kind")] = Field(
        description="The process as far as anybody knows; one that integrates gets pulses."
    )
    noise: Positive = Field(description="Standard deviation of PV's noise. [PV]")
    deviation: Positive = Field(description="How far PV may move from rest. [PV]")
    precision: Annotated[float, Field(gt=0, le=10)] = Field(
        0.1, description="Wanted half-width of the 95 % intervals. [-]"
    )
    factor: Annotated[float, Field(ge=1, le=5)] = Field(
        1.5, description="K, tau and theta may each be so many times larger or smaller. [-]"
    )
    room_up: NotNegative | None = Field(None, description="How far OP may go up. [OP]")
    room_down: NotNegative | None = Field(None, description="How far OP may go down. [OP]")
    sample_time: Seconds | None = Field(None, description="Where it cannot be chosen. [s]")


class PlanBody(Answer):
    """A test to run: what to do, what to expect, when to stop."""

    model_config = ConfigDict(extra="allow", allow_inf_nan=False)

    kind: Literal["steps", "pulses", "relay"]
    duration: float = Field(description="Length of the record, if the guess is right. [s]")
    sample_time: float = Field(description="Longest time between samples. [s]")
    expected_errors: list[float] = Field(
        description="Standard errors of K, tau, theta, or of K and theta for pulses, if the guess "
        "is right. [PV/OP], [s], [s] or [PV/OP/s], [s]"
    )
    largest_errors: list[float] = Field(description="The same if it is off by the factor.")
    reaches: bool = Field(description="Whether the wanted precision is reached all the same.")
    abort_deviation: float = Field(description="Stop when PV is further from rest. [PV]")
    abort_time: float = Field(description="Stop when the test has taken so long. [s]")
    instructions: list[str] = Field(description="The plan in words.")
