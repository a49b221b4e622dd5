"""Bodies of detuning requests and answers; the answer is that of `loopwright detune --json`."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, JsonValue

from service.loops.schemas import ProfileName
from service.models.schemas import AnyProcessBody
from service.schemas import Answer, Strict
from service.units import Positive, SecondsOrNone


class Detune(Strict):
    """Ask for settings by one knob."""

    process: AnyProcessBody
    knob: Annotated[float, Field(ge=0, le=1)] | Literal["calm", "normal", "fast"] = Field(
        "normal", description="0 calm, 0.5 normal, 1 fast. [-]"
    )
    structure: Literal["PI", "PID"] = Field("PI", description="Terms in use.")
    gain: Positive | None = Field(
        None, description="Gain to detune an AMIGO PI to, for FOPDT and IPDT. [OP/PV]"
    )
    profile: ProfileName = Field("general", description="Target profile.")
    scan_time: SecondsOrNone = Field(0.0, description="Half of it counts as dead time. [s]")


class DetuningBody(Answer):
    """Settings of least load area at one position, the front, and AMIGO at a stated gain."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    structure: str
    knob: float
    settings: dict[str, JsonValue] = Field(description="With load_IAE, load_IE and margins.")
    verification: dict[str, JsonValue] | None
    front: list[dict[str, JsonValue]]
    amigo: dict[str, JsonValue] | None
    sentences: list[str]
