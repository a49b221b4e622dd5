"""Bodies of cascade requests and answers; the answer is that of `loopwright cascade`."""

from pydantic import ConfigDict, Field, JsonValue

from service.loops.schemas import ProfileName
from service.models.schemas import FOPDTBody
from service.schemas import Answer, Strict
from service.units import Seconds


class TuneCascade(Strict):
    """Ask for both controllers of a cascade and what both loops keep."""

    inner: FOPDTBody = Field(description="From OP to the inner PV.")
    outer: FOPDTBody = Field(description="From the inner PV to the outer PV.")
    inner_tau_c: Seconds | None = Field(
        None,
        description="Closed-loop time constant of the inner loop; null for the smallest that "
        "keeps the profile. [s]",
    )
    outer_tau_c: Seconds | None = Field(
        None,
        description="Closed-loop time constant of the outer loop; null for the smallest that "
        "keeps the profile on the true inner loop. [s]",
    )
    profile: ProfileName = Field("general", description="Target profile of both loops.")


class CascadeBody(Answer):
    """A cascade: both controllers, sweeps, and what a single loop would do."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    inner: dict[str, JsonValue]
    outer: dict[str, JsonValue]
    speed_ratio: float = Field(description="Crossover of the inner loop over the outer's. [-]")
    fast_enough: bool = Field(description="Whether that is five or more.")
    single_loop: dict[str, JsonValue] = Field(description="One PI from OP to the outer PV.")
    inner_load: dict[str, JsonValue] | None = Field(
        description="What a unit load at the inner process does, with both."
    )
    sentences: list[str]
