"""Bodies of conditioning requests and answers; the answer is that of `loopwright condition`."""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from service.analysis.schemas import ControllerBody
from service.models.schemas import AnyProcessBody
from service.records.stretches import Stretch
from service.schemas import Answer, Strict
from service.tunings.schemas import MarginsBody
from service.units import Positive, Seconds, SecondsOrNone


class ConditionLoop(Strict):
    """Ask for the details around a controller: scan time, filters, N, b, Tt."""

    process: AnyProcessBody
    controller: ControllerBody
    scan_time: Seconds | None = Field(
        None, description="Scan time; the longest within the allowed cost if null. [s]"
    )
    computation: SecondsOrNone = Field(
        0.0, description="Delay from reading PV to writing the output. [s]"
    )
    noise: Positive | None = Field(
        None, description="Standard deviation of the sensor's white noise. [PV]"
    )
    record: Stretch | None = Field(None, description="Routine data to measure the noise in.")
    travel: Positive | None = Field(
        None, description="Sum of the output's moves in a day that noise may cause. [OP/day]"
    )
    phase_cost: Annotated[float, Field(gt=0, lt=90)] = Field(
        5.0, description="Phase at the crossover that a scan, and again a filter, may cost. [deg]"
    )
    overshoot: Annotated[float, Field(ge=0, le=1000)] = Field(
        5.0, description="Overshoot of a set-point step that may be. [%]"
    )
    attenuation: Annotated[float, Field(ge=1e-6, lt=1)] = Field(
        0.1, description="Gain of the anti-alias filter at half the scan rate. [-]"
    )
    order: Literal[1, 2] = Field(2, description="Order of the anti-alias filter. [-]")
    swing: Positive | None = Field(
        None, description="Frequency of a swing to look for in the samples. [rad/s]"
    )

    @model_validator(mode="after")
    def _one_noise(self) -> Self:
        if self.noise is not None and self.record is not None:
            raise ValueError("give either noise or a record to measure it in")
        return self


class ConditioningBody(Answer):
    """Details around a controller; what has no answer is null, and notes say why.

    Further members: measured_noise, scan, pv_filter, filter_ratios, set_point_weight, anti_alias.
    """

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    margins: MarginsBody = Field(description="Of the continuous loop.")
    wc: float = Field(description="Highest gain crossover. [rad/s]")
    longest_scan_time: float | None = Field(description="Within the allowed cost. [s]")
    scan_time: float | None = Field(description="What the rest rests on. [s]")
    Tt: float | None = Field(description="Tracking time of back-calculation. [s]")
    notes: list[str]
    sentences: list[str]
