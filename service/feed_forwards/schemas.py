"""Bodies of feed-forward requests and answers; the answer is that of `loopwright feedforward`."""

from typing import Annotated

from pydantic import ConfigDict, Field

from service.models.schemas import FOPDTBody
from service.schemas import Answer, Strict


class FeedLoadForward(Strict):
    """Ask for the feed-forward of a measured load."""

    process: FOPDTBody = Field(description="From OP to PV.")
    load: FOPDTBody = Field(description="From the measured load to PV.")
    largest_ratio: Annotated[float, Field(ge=1, le=1000)] = Field(
        10.0, description="Largest lead over lag. [-]"
    )


class FeedForwardBody(Answer):
    """Feed-forward gain (T_lead s + 1)/(T_lag s + 1) e^(-delay s), from the load to OP."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    gain: float = Field(description="Static feed-forward. [OP/load]")
    T_lead: float = Field(description="[s]")
    T_lag: float = Field(description="[s]")
    delay: float = Field(description="Dead time to wait before acting. [s]")
    late: float = Field(description="Dead time by which it comes too late. [s]")
    realisable: bool = Field(description="Whether it cancels the load, at the models.")
    peak_without: float = Field(description="Peak of PV for a unit load step. [PV/load]")
    peak_static: float = Field(description="With the static gain alone. [PV/load]")
    peak: float = Field(description="With the lead-lag. [PV/load]")
    worst_part: float = Field(
        description="Part of the peak that is left with one parameter off by up to 50 %. [-]"
    )
    worst: str
    sentences: list[str]
