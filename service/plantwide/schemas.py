"""Bodies of plant-wide questions."""

from typing import Annotated

from pydantic import Field

from service.assessments.schemas import Period
from service.models.schemas import Id
from service.schemas import Answer

MOST_LOOPS = 100  # some seconds of work; a plant's area has fewer that oscillate


class LookAtPlant(Period):
    """Ask which loops oscillate together, and where it comes from."""

    loop_ids: Annotated[list[Id], Field(min_length=2, max_length=MOST_LOOPS)]


class SuspectBody(Answer):
    """One loop of a group."""

    tag: str
    probability: float = Field(description="That the oscillation begins, or enters, here. [-]")
    nonlinearity: float | None = Field(description="Above 1: not that of a linear loop. [-]")
    stiction: float | None = Field(description="Probability that its valve sticks. [-]")
    coherence: float = Field(description="With the loop that shows the oscillation best. [-]")
    share: float = Field(description="Part of its variance at the period of the group. [-]")
    oscillates: bool = Field(description="An oscillation of its own was found.")
    evidence: list[str] = Field(description="What is known of it, one fact a sentence.")
    reason: str = Field(description="The same as one text.")


class ArrowBody(Answer):
    """What the past of one loop adds to the prediction of another (Granger)."""

    cause: str
    effect: str
    strength: float = Field(description="ln(RSS without the cause / with it). [-]")
    p_value: float = Field(description="Of the F test. [-]")
    beyond: float | None = Field(
        description="Standard deviations above causes shifted in time; null where the F test sees "
        "nothing. [-]"
    )
    significant: bool = Field(description="Both tests agree.")


class TransferredInformationBody(Answer):
    """Transfer entropy from one loop to another."""

    cause: str
    effect: str
    value: float | None = Field(description="Null where the record is too short. [nat]")
    by_chance: float | None = Field(description="Mean over causes shifted in time. [nat]")
    p_value: float | None = Field(description="Of the shifted causes. [-]")
    beyond: float | None = Field(description="Standard deviations above shifted causes. [-]")
    significant: bool
    delay: float | None = Field(description="At which the cause tells most. [s]")


class DelayBody(Answer):
    """By how much one loop follows another."""

    first: str
    second: str
    delay: float = Field(description="The second follows by so much; negative: it leads. [s]")
    error: float = Field(description="Standard error. [s]")
    sign: int = Field(description="-1 where it follows the mirror image.")
    correlation: float = Field(description="At that delay, without sign. [-]")
    rival: float = Field(description="The next best delay. [s]")
    clear: bool = Field(description="It stands out; otherwise it is known up to the rivals only.")
    phase_delay: float | None = Field(description="From the harmonics, up to whole periods. [s]")


class GraphBody(Answer):
    """Arrows and delays as matrices, for a picture."""

    tags: list[str] = Field(description="Names of rows and columns, the likeliest source first.")
    strength: list[list[float | None]] = Field(
        description="From the loop of the row to that of the column; null for no arrow. [-]"
    )
    delay: list[list[float | None]] = Field(
        description="The loop of the column follows that of the row; null where not known. [s]"
    )


class GroupBody(Answer):
    """Loops that oscillate together."""

    period: float = Field(description="[s]")
    similarity: float = Field(description="Least similarity of two of them. [-]")
    source: str | None = Field(
        description="Where it likely begins or enters; null where the data don't say."
    )
    elsewhere: float = Field(
        description="Probability that it reaches several of them at once from outside. [-]"
    )
    reason: str
    suspects: list[SuspectBody] = Field(description="The likeliest source first.")
    arrows: list[ArrowBody] = Field(description="Every ordered pair that was tested.")
    order: int | None = Field(description="Lags of the regressions behind the arrows.")
    delays: list[DelayBody] = Field(description="Every pair that was measured.")
    graph: GraphBody
    transfers: list[TransferredInformationBody] = Field(
        description="Between the likeliest source and its two nearest rivals, in small groups; "
        "evidence beside the probabilities."
    )
    doubts: list[str] = Field(description="What could not be judged, and why.")


class CascadeBody(Answer):
    """An outer loop whose output is an inner loop's set point."""

    outer: str
    inner: str
    explained: float = Field(description="Part of the inner set point's moves. [-]")


class PlantOscillationsBody(Answer):
    """What loops have in common over one period."""

    groups: list[GroupBody]
    cascades: list[CascadeBody]
    left_out: list[tuple[str, str]] = Field(description="Loops not looked at, and why.")
