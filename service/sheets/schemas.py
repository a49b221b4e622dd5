"""Bodies of loop sheet requests and answers."""

import math
from abc import abstractmethod
from datetime import datetime
from typing import Annotated, Literal, Self, TypeAlias
from uuid import UUID

from pydantic import Field, model_validator

from loop.controller import DEFAULT_N, PID, Action, ParallelPID, SeriesPID
from service.blocks import Controller
from service.loops.schemas import Action as ActionName
from service.loops.schemas import GainBasis, ProfileName, TimeUnit
from service.models.schemas import Id
from service.schemas import Answer, Strict
from service.units import Positive, Quantity, Reason, Seconds, SecondsOrNone

Weight: TypeAlias = Annotated[float, Field(ge=0, le=2, allow_inf_nan=False)]
Gain: TypeAlias = Annotated[float, Field(ge=1e-9, le=1e9, allow_inf_nan=False)]
GainOrNone: TypeAlias = Annotated[float, Field(ge=0, le=1e9, allow_inf_nan=False)]
AntiWindup: TypeAlias = Literal["none", "back_calculation", "clamping"]
Status: TypeAlias = Literal["draft", "approved", "superseded", "rejected", "withdrawn"]


class _Settings(Strict):
    """What every form of controller has. Times and rates are in the loop's own time unit."""

    b: Weight = Field(1.0, description="Set-point weight of the proportional part. [-]")
    c: Weight = Field(0.0, description="Set-point weight of the derivative part. [-]")
    pv_filter: SecondsOrNone = Field(0.0, description="Time constant of the PV filter. [time]")
    anti_windup: AntiWindup = Field(description="How the integral is kept at a limit.")
    Tt: Seconds | None = Field(None, description="Tracking time of back-calculation. [time]")
    op_low: Quantity | None = Field(None, description="Low output limit; null: of the range. [OP]")
    op_high: Quantity | None = Field(
        None, description="High output limit; null: of the range. [OP]"
    )
    op_rate: Positive | None = Field(None, description="Output rate limit; null: none. [OP/time]")
    sp_ramp: Positive | None = Field(None, description="Set-point ramp; null: none. [PV/time]")
    scan_time: Seconds | None = Field(
        None, description="Scan time; null: not known, margins without the hold. [s]"
    )

    @abstractmethod
    def controller(self, action: Action) -> Controller:
        """Give the controller in the block's own units."""

    @model_validator(mode="after")
    def _must_be_a_controller(self) -> Self:
        if (self.Tt is None) == (self.anti_windup == "back_calculation"):
            raise ValueError("Tt belongs to back_calculation, and back_calculation needs it")
        if self.op_low is not None and self.op_high is not None and not self.op_low < self.op_high:
            raise ValueError(f"op_high must be above op_low, got {self.op_low} to {self.op_high}")
        self.controller(Action.REVERSE)  # the domain's own rules decide
        return self


class IsaSettings(_Settings):
    """ISA form, Kc [(b sp - pv) + (1/(Ti s)) e + Td s/(1 + Td s/N) (c sp - pv)]."""

    form: Literal["isa"]
    Kc: Gain = Field(description="Gain. [gain basis]")
    Ti: Seconds | None = Field(description="Integral time; null: no integral action. [time]")
    Td: SecondsOrNone = Field(0.0, description="Derivative time. [time]")
    N: Positive | None = Field(DEFAULT_N, description="Derivative filter; null: no filter. [-]")

    def controller(self, action: Action) -> PID:
        """Give the controller in the block's own units."""
        return PID(
            Kc=self.Kc,
            Ti=math.inf if self.Ti is None else self.Ti,
            Td=self.Td,
            N=math.inf if self.N is None else self.N,
            b=self.b,
            c=self.c,
            tauF=self.pv_filter,
            action=action,
        )


class ParallelSettings(_Settings):
    """Parallel form, Kp + Ki/s + Kd s/(Tf s + 1)."""

    form: Literal["parallel"]
    Kp: GainOrNone = Field(description="Proportional gain. [gain basis]")
    Ki: GainOrNone = Field(description="Integral gain; 0: no integral action. [gain/time]")
    Kd: GainOrNone = Field(0.0, description="Derivative gain. [gain time]")
    Tf: SecondsOrNone = Field(0.0, description="Time of the derivative filter. [time]")

    def controller(self, action: Action) -> ParallelPID:
        """Give the controller in the block's own units."""
        return ParallelPID(
            Kp=self.Kp,
            Ki=self.Ki,
            Kd=self.Kd,
            Tf=self.Tf,
            b=self.b,
            c=self.c,
            tauF=self.pv_filter,
            action=action,
        )


class SeriesSettings(_Settings):
    """Series form, Kc (1 + 1/(Ti s)) (Td s + 1)/(alpha Td s + 1)."""

    form: Literal["series"]
    Kc: Gain = Field(description="Gain. [gain basis]")
    Ti: Seconds | None = Field(description="Integral time; null: no integral action. [time]")
    Td: SecondsOrNone = Field(0.0, description="Derivative time. [time]")
    alpha: Annotated[float, Field(ge=0, le=1)] = Field(
        0.1, description="Filter time over derivative time. [-]"
    )

    def controller(self, action: Action) -> SeriesPID:
        """Give the controller in the block's own units."""
        return SeriesPID(
            Kc=self.Kc,
            Ti=math.inf if self.Ti is None else self.Ti,
            Td=self.Td,
            alpha=self.alpha,
            b=self.b,
            c=self.c,
            tauF=self.pv_filter,
            action=action,
        )


Settings: TypeAlias = Annotated[
    IsaSettings | ParallelSettings | SeriesSettings, Field(discriminator="form")
]


class NewSheet(Strict):
    """Draft a version of the loop sheet. Margins are computed here, never taken from outside."""

    settings: Settings
    model_id: Id | None = Field(None, description="Model the margins come from.")
    tuning_id: Id | None = Field(None, description="Tuning it came from.")
    profile: ProfileName | None = Field(None, description="Target profile; null: the loop's.")
    reason: Reason = Field(description="Why these settings.")


class DecisionRequest(Strict):
    """Decide on a draft."""

    reason: Reason = Field(description="Why.")


class BlockBody(Answer):
    """The controller block as it was when the sheet was written."""

    form: Literal["isa", "parallel", "series"]
    time_unit: TimeUnit
    gain_basis: GainBasis
    action: ActionName
    pv_low: float
    pv_high: float
    pv_unit: str
    op_low: float
    op_high: float
    op_unit: str


class CanonicalBody(Answer):
    """The same controller in ISA form, seconds and engineering units."""

    Kc: float = Field(description="[OP/PV]")
    Ti: float | None = Field(description="null: no integral action. [s]")
    Td: float = Field(description="[s]")
    N: float | None = Field(description="null: no filter. [-]")
    b: float
    c: float
    tauF: float = Field(description="Lag in series: the PV filter. [s]")
    action: ActionName


class MarginsBody(Answer):
    """Margins of the loop at its model; null is infinite."""

    gain: float | None
    gain_reduction: float | None
    phase: float | None
    delay: float | None
    Ms: float | None
    Mt: float | None


class EvidenceBody(Answer):
    """What the linked process says about these settings."""

    margins: MarginsBody
    passes: bool = Field(description="Whether the profile holds over ±50 % of each parameter.")
    verdict: str


class DecisionBody(Answer):
    """What became of the draft."""

    decision: Literal["approved", "rejected", "withdrawn"]
    reason: str
    author: str
    created_at: datetime


class SheetBody(Answer):
    """One version of a loop sheet."""

    loop_id: UUID
    version: int
    status: Status
    block: BlockBody
    settings: Settings
    units: dict[str, str]
    canonical: CanonicalBody
    model_id: UUID | None
    tuning_id: UUID | None
    process: dict[str, object] | None
    evidence: EvidenceBody | None
    profile: ProfileName
    reason: str
    author: str
    created_at: datetime
    decision: DecisionBody | None


class SheetPage(Answer):
    """Versions, newest first, and the cursor of the next page."""

    items: list[SheetBody]
    next: str | None


class Change(Answer):
    """One field that differs."""

    field: str
    before: bool | float | str | list[object] | None
    after: bool | float | str | list[object] | None


class SheetDiff(Answer):
    """What differs between two versions, field by field."""

    before: int
    after: int
    changes: list[Change]


class ProposedSettings(Answer):
    """A tuning's settings, written for this loop's block."""

    rule: str | None
    structure: str | None
    settings: Settings
    units: dict[str, str]


class SheetEffect(Answer):
    """What a sheet in force did to the control error."""

    loop_id: UUID
    version: int
    changed_at: datetime = Field(description="Instant at which the settings changed.")
    before: tuple[datetime, datetime] = Field(description="Period before: from, up to.")
    after: tuple[datetime, datetime] = Field(description="Period after: from, up to.")
    effect: dict[str, object] = Field(
        description="Change, ratio of the root mean square errors with its 95 % interval, settings."
    )
