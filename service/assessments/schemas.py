"""Bodies of assessment requests and answers."""

from datetime import UTC, datetime, timedelta
from typing import Annotated, Literal, Self, TypeAlias
from uuid import UUID

from pydantic import ConfigDict, Field, model_validator

from advice.rollup import PlantScorecard
from service.models.schemas import AnyProcessBody, Id
from service.schemas import Answer, Strict
from service.tunings.schemas import RunningBody
from service.units import Moment, Reason, Seconds

MOST_LOOPS = 10_000
# Within it every zone's instants have a day in UTC; samples lie within it too.
EARLIEST, LATEST = datetime(1970, 1, 1, tzinfo=UTC), datetime(2200, 1, 1, tzinfo=UTC)
LONGEST_PERIOD = timedelta(days=31)
CauseName: TypeAlias = Literal[
    "healthy", "valve", "tuning", "disturbance", "sensor", "constraint", "not in use",
    "not assessable",
]  # fmt: skip


class Period(Strict):
    """From when to when."""

    start: Moment = Field(description="First instant.", examples=["2026-01-31T00:00:00Z"])
    end: Moment = Field(description="First instant that no longer belongs to it.")

    @model_validator(mode="after")
    def _must_be_a_period(self) -> Self:
        if not timedelta(0) < self.end - self.start <= LONGEST_PERIOD:
            raise ValueError(
                f"end must be after start by at most {LONGEST_PERIOD.days} days, "
                f"got {self.start.isoformat()} to {self.end.isoformat()}"
            )
        if self.start < EARLIEST or self.end > LATEST:
            raise ValueError(
                f"a period lies between {EARLIEST.year} and {LATEST.year}, "
                f"got {self.start.isoformat()} to {self.end.isoformat()}"
            )
        return self


class PeriodsEffect(Answer):
    """Two periods of a loop, compared."""

    loop_id: UUID
    before: tuple[datetime, datetime] = Field(description="First period: from, up to.")
    after: tuple[datetime, datetime] = Field(description="Second period: from, up to.")
    effect: dict[str, object] = Field(
        description="Change, ratio of the root mean square errors with its 95 % interval, settings."
    )


class AssessLoop(Period):
    """Ask what one loop's routine data say.

    Model and settings come from the loop's approved sheet, unless they are stated here.
    """

    process: AnyProcessBody | None = Field(None, description="Process model, if not the sheet's.")
    running: RunningBody | None = Field(None, description="Settings that ran, with the process.")
    tau_c: Seconds | None = Field(
        None, description="Desired closed-loop time constant to be judged by. [s]"
    )

    @model_validator(mode="after")
    def _settings_need_a_process(self) -> Self:
        if self.running is not None and self.process is None:
            raise ValueError("running needs the process that it controls")
        return self


class AssessLoops(Period):
    """Ask what many loops' routine data say; a job works through them."""

    loop_ids: Annotated[list[Id], Field(min_length=1, max_length=MOST_LOOPS)] | None = Field(
        None, description="Loops; null for all that are not archived."
    )


class Overrule(Strict):
    """Put a person's diagnosis in place of the computed one."""

    cause: CauseName = Field(description="What is wrong with the loop.")
    reason: Reason = Field(description="How you know.")


class OverruleBody(Answer):
    """What a person said against an assessment."""

    id: UUID
    cause: CauseName
    reason: str
    author: str
    created_at: datetime


class AssessmentSummary(Answer):
    """An assessment in a list."""

    id: UUID
    loop_id: UUID
    job_id: UUID | None
    start: datetime
    end: datetime
    method: str = Field(description="Version of the method.")
    grade: float | None = Field(description="0 to 100; null where it is not assessable. [-]")
    cause: CauseName = Field(description="A person's word before the computed one.")
    computed_cause: CauseName
    confidence: str
    created_at: datetime
    author: str


class AssessmentBody(AssessmentSummary):
    """What a loop's routine data say: every index with its settings, the cause, the grade."""

    model_config = ConfigDict(from_attributes=True, allow_inf_nan=False)

    overrules: list[OverruleBody] = Field(description="The latest first.")
    assessment: dict[str, object] = Field(description="The document of `loopwright assess --json`.")


class AssessmentPage(Answer):
    """Assessments, and the cursor of the next page."""

    items: list[AssessmentSummary]
    next: str | None


class RollupBody(Answer):
    """A group of loops as one line."""

    name: str
    loops: int
    assessable: int
    points: float | None = Field(description="Mean grade by weight. [-]")
    cost: float | None = Field(
        description="What a day costs, over the loops whose worth is known. [money]"
    )
    priced: int = Field(description="Loops that the cost rests on.")
    causes: list[tuple[str, int]] = Field(description="What is wrong how often.")


class BadActorBody(Answer):
    """A loop that costs the plant."""

    name: UUID = Field(description="The assessment.")
    tag: str
    area: str
    unit: str
    weight: float
    points: float | None
    cause: str
    loss: float = Field(description="Weight times the points that are missing. [-]")
    cost: float | None = Field(
        description="Worth times the part of the points that is missing. [money]"
    )


class ScorecardBody(Answer):
    """How the plant stands after one job."""

    job_id: UUID
    plant: RollupBody
    areas: list[RollupBody]
    bad_actors: list[BadActorBody]

    @classmethod
    def of(cls, job_id: UUID, card: PlantScorecard) -> Self:
        """Lay a scorecard out as a document."""
        return cls(
            job_id=job_id,
            plant=RollupBody.model_validate(card.plant),
            areas=[RollupBody.model_validate(area) for area in card.areas],
            bad_actors=[BadActorBody.model_validate(loop) for loop in card.bad_actors],
        )
