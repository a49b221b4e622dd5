"""Bodies of loop requests and answers."""

from datetime import datetime
from typing import Annotated, Literal, Self, TypeAlias
from uuid import UUID

from pydantic import Field, model_validator

from service.schemas import Answer, Strict
from service.units import Line, Positive, Quantity, Seconds, Unit, Word

Action: TypeAlias = Literal["reverse", "direct"]
Form: TypeAlias = Literal["isa", "parallel", "series"]
TimeUnit: TypeAlias = Literal["s", "min"]
GainBasis: TypeAlias = Literal["eu", "percent"]
KindName: TypeAlias = Literal[
    "flow", "pressure", "level", "averaging_level", "temperature", "analyser", "other"
]
ProfileName: TypeAlias = Literal["process", "general", "servo", "aerospace", "disk_drive", "hvac"]
# Fields for which null says something: not known, or none.
MAY_BE_NULL = {"sample_time", "largest_load", "worth", "limit_low", "limit_high"}
Weight: TypeAlias = Annotated[float, Field(gt=0, le=1e6)]


class NewLoop(Strict):
    """Describe a loop. What its controller block looks like is asked, never assumed."""

    tag: Word = Field(description="Name of the loop, unique in the plant.", examples=["TIC-101"])
    description: Line = ""
    area: Line = Field("", description="Area of the plant.")
    unit: Line = Field("", description="Process unit.")
    pv_low: Quantity = Field(description="Low end of the PV range. [PV]")
    pv_high: Quantity = Field(description="High end of the PV range. [PV]")
    pv_unit: Unit = Field(description="Engineering unit of PV.", examples=["degC"])
    op_low: Quantity = Field(0.0, description="Low end of the OP range. [OP]")
    op_high: Quantity = Field(100.0, description="High end of the OP range. [OP]")
    op_unit: Unit = Field("%", description="Unit of OP.")
    action: Action = Field(description="reverse: OP falls when PV rises (K > 0); direct: OP rises.")
    form: Form = Field(description="Form of the controller block.")
    time_unit: TimeUnit = Field(description="Unit of the block's times.")
    gain_basis: GainBasis = Field(
        description="eu: gain in OP/PV; percent: in % of OP span per % of PV span."
    )
    sample_time: Seconds | None = Field(None, description="Scan time of the block. [s]")
    profile: ProfileName = Field("general", description="Target profile of its margins.")
    largest_load: Positive | None = Field(
        None, description="Largest expected load, at the process input. [OP]"
    )
    kind: KindName = Field("other", description="What it controls: decides how it is assessed.")
    weight: Weight = Field(1.0, description="How much it matters among the plant's loops. [-]")
    worth: Positive | None = Field(
        None,
        description="What a day costs in which it does nothing right; null: not known. [money]",
    )
    limit_low: Quantity | None = Field(
        None, description="Lowest PV that the process allows; null: none. [PV]"
    )
    limit_high: Quantity | None = Field(
        None, description="Highest PV that the process allows; null: none. [PV]"
    )

    @model_validator(mode="after")
    def _ranges_must_span(self) -> Self:
        for name in ("pv", "op"):
            low, high = getattr(self, f"{name}_low"), getattr(self, f"{name}_high")
            if not high > low:
                raise ValueError(f"{name}_high must be above {name}_low, got {low} to {high}")
        low_, high_ = self.limit_low, self.limit_high
        if low_ is not None and high_ is not None and not high_ > low_:
            raise ValueError(f"limit_high must be above limit_low, got {low_} to {high_}")
        return self


class LoopChanges(Strict):
    """Fields of a loop to change; those left out stay as they are."""

    tag: Word | None = None
    description: Line | None = None
    area: Line | None = None
    unit: Line | None = None
    pv_low: Quantity | None = None
    pv_high: Quantity | None = None
    pv_unit: Unit | None = None
    op_low: Quantity | None = None
    op_high: Quantity | None = None
    op_unit: Unit | None = None
    action: Action | None = None
    form: Form | None = None
    time_unit: TimeUnit | None = None
    gain_basis: GainBasis | None = None
    sample_time: Seconds | None = Field(None, description="null: not known. [s]")
    profile: ProfileName | None = None
    largest_load: Positive | None = Field(None, description="null: not known. [OP]")
    kind: KindName | None = None
    weight: Weight | None = None
    worth: Positive | None = Field(None, description="null: not known. [money]")
    limit_low: Quantity | None = Field(None, description="null: none. [PV]")
    limit_high: Quantity | None = Field(None, description="null: none. [PV]")
    archived: bool | None = Field(None, description="Archived loops leave the list, not the plant.")

    @model_validator(mode="after")
    def _null_only_where_it_means_unknown(self) -> Self:
        for name in sorted(self.model_fields_set - MAY_BE_NULL):
            if getattr(self, name) is None:
                raise ValueError(f"{name} cannot be null; leave it out to keep it as it is")
        return self


class LoopBody(Answer):
    """A loop."""

    id: UUID
    tag: str
    description: str
    area: str
    unit: str
    pv_low: float
    pv_high: float
    pv_unit: str
    op_low: float
    op_high: float
    op_unit: str
    action: Action
    form: Form
    time_unit: TimeUnit
    gain_basis: GainBasis
    sample_time: float | None
    profile: ProfileName
    largest_load: float | None
    kind: KindName
    weight: float
    worth: float | None
    limit_low: float | None
    limit_high: float | None
    archived: bool
    version: int = Field(description="Counts changes; the ETag is this number in quotes.")
    created_at: datetime
    created_by: str
    changed_at: datetime


class LoopPage(Answer):
    """Loops by tag, and the cursor of the next page."""

    items: list[LoopBody]
    next: str | None
