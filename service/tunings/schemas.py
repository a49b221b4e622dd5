"""Bodies of tuning requests and answers; the answer is the document of `loopwright tune --json`."""

from datetime import datetime
from typing import Annotated, Self
from uuid import UUID

from pydantic import ConfigDict, Field, model_validator

from service.loops.schemas import ProfileName
from service.models.schemas import AnyProcessBody, Id
from service.schemas import Answer, Strict
from service.units import Positive, Seconds, SecondsOrNone

MOST_PROCESSES = 200  # about two seconds of work
# Of those that swing by themselves, whose settings take five to twenty times as long.
MOST_SWINGING = 20


class RunningBody(Strict):
    """Settings in the controller now, ISA form, to compare with."""

    Kc: Positive = Field(description="Controller gain. [OP/PV]")
    Ti: Seconds | None = Field(None, description="Integral time; null for none. [s]")
    Td: SecondsOrNone = Field(0.0, description="Derivative time. [s]")
    N: Annotated[float, Field(gt=0, le=1e6)] = Field(10.0, description="Filter ratio. [-]")


class _Wishes(Strict):
    profile: ProfileName | None = Field(
        None, description="Target profile; by default the loop's own, or general."
    )
    tau_c: Seconds | None = Field(
        None, description="Desired closed-loop time constant; by default each rule's own. [s]"
    )
    scan_time: SecondsOrNone | None = Field(
        None, description="Scan time of the controller; by default the loop's own, or 0. [s]"
    )
    running: RunningBody | None = None


class _RobustWishes(_Wishes):
    proof: bool = Field(
        False,
        description="Prove the worst margins with all parameters off by up to 50 % at once.",
    )
    optimal: bool = Field(
        False,
        description="Add the PI and PID of least load area under the profile: over ±50 % of all "
        "parameters at once, and from calm to fast.",
    )


class TuneLoop(_RobustWishes):
    """Ask for verified settings of a loop, on a stored model or on a stated process."""

    model_id: Id | None = Field(None, description="Model of this loop.")
    process: AnyProcessBody | None = Field(None, description="The process, if it is known already.")

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.model_id is None) == (self.process is None):
            raise ValueError("give either model_id or process")
        return self


class TuneProcess(_RobustWishes):
    """Ask for verified settings of a process, without a loop; nothing is stored."""

    process: AnyProcessBody


class TuneProcesses(_Wishes):
    """Ask for verified settings of many processes, 20 swinging ones at most; nothing is stored."""

    processes: Annotated[list[AnyProcessBody], Field(min_length=1, max_length=MOST_PROCESSES)]


class MarginsBody(Answer):
    """Margins of one loop; null stands for infinite."""

    gain: float | None = Field(description="Gain margin. [-]")
    gain_reduction: float | None = Field(description="Gain reduction margin. [-]")
    phase: float | None = Field(description="Phase margin. [deg]")
    delay: float | None = Field(description="Delay margin. [s]")
    Ms: float | None = Field(description="Peak of |S|. [-]")
    Mt: float | None = Field(description="Peak of |T|. [-]")


class SettingsBody(Answer):
    """One rule's settings in the ISA form, and what they keep."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    rule: str
    structure: str
    form: str
    action: str
    Kc: float = Field(description="Controller gain. [OP/PV]")
    Ti: float | None = Field(description="Integral time, null for no integral action. [s]")
    Td: float = Field(description="Derivative time. [s]")
    N: float | None = Field(description="Derivative filter ratio, null for no filter. [-]")
    b: float
    c: float
    tauF: float = Field(description="Lag in series with the controller. [s]")
    tau_c: float | None = Field(description="Desired closed-loop time constant. [s]")
    margins: MarginsBody | None
    passes: bool = Field(description="Whether the profile holds under ±50 % of each parameter.")


class RefusalBody(Answer):
    """Why a rule has no settings here."""

    rule: str
    structure: str
    reason: str


class CaseBody(Answer):
    """Every rule's settings for one process, verified, and the recommendation."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    tunings: list[SettingsBody]
    refusals: list[RefusalBody]
    recommended: SettingsBody | None
    recommended_reason: str


class TuningBody(CaseBody):
    """A stored case of a loop."""

    id: UUID
    loop_id: UUID
    model_id: UUID | None
    created_at: datetime
    author: str


class TuningSummary(Answer):
    """A stored case in a list: the recommendation alone."""

    id: UUID
    loop_id: UUID
    model_id: UUID | None
    profile: str
    recommended: SettingsBody | None
    recommended_reason: str
    created_at: datetime
    author: str


class TuningPage(Answer):
    """Cases of a loop, newest first, and the cursor of the next page."""

    items: list[TuningSummary]
    next: str | None


class CasesBody(Answer):
    """One case for each process, in the order of the request."""

    items: list[CaseBody]
