"""Bodies of frequency questions."""

from pydantic import Field

from service.assessments.schemas import Period
from service.schemas import Answer
from service.tunings.schemas import RunningBody


class ReadFrequencyTest(Period):
    """Ask what a frequency test of a loop says."""

    controller: RunningBody | None = Field(
        None, description="Settings whose margins on the measured process are wanted."
    )


class ResponseBody(Answer):
    """Measured points, in ascending frequency."""

    w: list[float] = Field(description="[rad/s]")
    re: list[float] = Field(description="[PV/OP]")
    im: list[float] = Field(description="[PV/OP]")
    sd: list[float] = Field(description="Of the error, as a complex number. [PV/OP]")
    coherence: list[float]


class FittedBody(Answer):
    """First order plus dead time through the points."""

    kind: str
    K: float = Field(description="[PV/OP]")
    tau: float = Field(description="[s]")
    theta: float = Field(description="[s]")
    standard_errors: list[float] = Field(description="Of K, tau, theta.")
    misfit: float = Field(description="1 where the model misses the points as the noise says. [-]")
    points: int


class MeasuredBody(Answer):
    """A margin with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


class MeasuredMarginsBody(Answer):
    """Margins straight from the points; null where they do not show it."""

    gain: MeasuredBody | None
    phase: MeasuredBody | None
    Ms: MeasuredBody | None
    w180: float | None
    wc: float | None
    remarks: list[str]


class FrequencyBody(Answer):
    """What a frequency test says."""

    response: ResponseBody
    model: FittedBody | None
    refusal: str | None = Field(description="Why there is no model.")
    margins: MeasuredMarginsBody | None
