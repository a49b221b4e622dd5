"""Bodies of smooth-tuning requests and answers; the answer is that of `loopwright smooth`."""

from pydantic import ConfigDict, Field, JsonValue

from service.loops.schemas import ProfileName
from service.models.schemas import AnyProcessBody
from service.schemas import Answer, Strict
from service.units import Positive


class TuneSmoothly(Strict):
    """Ask for the slowest settings that still hold PV within what is allowed."""

    process: AnyProcessBody
    load: Positive = Field(description="Largest load step, as the output it takes. [OP]")
    allowed: Positive = Field(description="Largest deviation of PV. [PV]")
    profile: ProfileName = Field("general", description="Target profile.")


class SmoothBody(Answer):
    """Smooth tuning, and for an integrator averaging level control, verified and simulated."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    load: float
    allowed: float
    choices: list[dict[str, JsonValue]] = Field(
        description="name, settings or refusal, tau_c, reason, peak [PV], margins, sweep."
    )
    sentences: list[str]
