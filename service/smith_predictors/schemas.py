"""Bodies of predictor requests and answers; the answer is that of `loopwright predictor`."""

from pydantic import ConfigDict, Field

from service.loops.schemas import ProfileName
from service.models.schemas import FOPDTBody
from service.schemas import Answer, Strict
from service.tunings.schemas import MarginsBody
from service.units import Seconds


class PredictLoop(Strict):
    """Ask for a Smith predictor and what it keeps while its model is wrong."""

    process: FOPDTBody = Field(description="The model to run inside, with dead time.")
    tau_c: Seconds | None = Field(
        None,
        description="Closed-loop time constant after the dead time; null for the smallest that "
        "keeps the profile with each parameter off by up to 50 %. [s]",
    )
    profile: ProfileName = Field("general", description="Target profile.")


class PredictorBody(Answer):
    """A Smith predictor: settings, model to program, sweep, and the PI of the same load area.

    Further members: settings, model, sweep, pi_of_the_same_load_area.
    """

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    tau_c: float = Field(description="Closed-loop time constant after the dead time. [s]")
    tau_c_reason: str
    margins: MarginsBody = Field(description="At the model.")
    passes: bool = Field(description="Whether the profile holds under ±50 % of each parameter.")
    verdict: str
    load_area: float = Field(description="Area of PV after a unit load step. [PV s/OP]")
    sentences: list[str]
