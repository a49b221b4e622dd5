"""Bodies of model requests and answers."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Literal, Self, TypeAlias
from uuid import UUID

from pydantic import ConfigDict, Field, TypeAdapter, model_validator

from advice.tune import StatedProcess
from loop.process import (
    FOPDT,
    IPDT,
    SOPDT,
    DoubleIntegrator,
    PureDelay,
    TransferFunction,
)
from service.errors import InvalidRequest
from service.schemas import Answer, Strict
from service.units import Quantity, Seconds, SecondsOrNone

# Both arrive as text, which a strict body would otherwise refuse.
Id: TypeAlias = Annotated[UUID, Field(strict=False)]
Moment: TypeAlias = Annotated[datetime, Field(strict=False)]
Verdict: TypeAlias = Literal["trusted", "use with care", "refused", "stated"]

# High enough for every plant model worth a PID; roots of longer polynomials lose their digits.
MOST_COEFFICIENTS = 16
Coefficients: TypeAlias = Annotated[
    list[Quantity], Field(min_length=1, max_length=MOST_COEFFICIENTS)
]


class _Stated(Strict):
    """A process that a person states."""

    @model_validator(mode="after")
    def _must_be_a_process(self) -> Self:
        stated_process(self)  # the model's own rules decide, and its sentence is the answer
        return self


class FOPDTBody(_Stated):
    """First order plus dead time, K e^(-theta s)/(tau s + 1)."""

    kind: Literal["FOPDT"]
    K: Quantity = Field(description="Steady-state gain. [PV/OP]")
    tau: Seconds = Field(description="Time constant. [s]")
    theta: SecondsOrNone = Field(description="Dead time. [s]")


class SOPDTBody(_Stated):
    """Second order plus dead time, K e^(-theta s)/((tau1 s + 1)(tau2 s + 1))."""

    kind: Literal["SOPDT"]
    K: Quantity = Field(description="Steady-state gain. [PV/OP]")
    tau1: Seconds = Field(description="Longer time constant. [s]")
    tau2: Seconds = Field(description="Shorter time constant. [s]")
    theta: SecondsOrNone = Field(description="Dead time. [s]")


class IPDTBody(_Stated):
    """Integrator plus dead time, K e^(-theta s)/s."""

    kind: Literal["IPDT"]
    K: Quantity = Field(description="Slope of PV per unit of OP. [PV/OP/s]")
    theta: SecondsOrNone = Field(description="Dead time. [s]")


class DoubleIntegratorBody(_Stated):
    """Two integrators plus dead time, K e^(-theta s)/s^2."""

    kind: Literal["DoubleIntegrator"]
    K: Quantity = Field(description="Acceleration of PV per unit of OP. [PV/OP/s^2]")
    theta: SecondsOrNone = Field(description="Dead time. [s]")


class PureDelayBody(_Stated):
    """Gain plus dead time and nothing else, K e^(-theta s)."""

    kind: Literal["PureDelay"]
    K: Quantity = Field(description="Steady-state gain. [PV/OP]")
    theta: Seconds = Field(description="Dead time. [s]")


class IntegratorWithLagBody(_Stated):
    """Integrator with a lag plus dead time, K e^(-theta s)/(s (tau s + 1))."""

    kind: Literal["IntegratorWithLag"]
    K: Quantity = Field(description="Slope of PV per unit of OP, in the end. [PV/OP/s]")
    tau: Seconds = Field(description="Time constant. [s]")
    theta: SecondsOrNone = Field(description="Dead time. [s]")


class TransferFunctionBody(_Stated):
    """Any proper rational process plus dead time; stable or integrating, or no rule covers it."""

    kind: Literal["TransferFunction"]
    numerator: Coefficients = Field(description="Coefficients, highest power first. [time in s]")
    denominator: Coefficients = Field(description="Coefficients, highest power first. [time in s]")
    theta: SecondsOrNone = Field(description="Dead time. [s]")


ProcessBody: TypeAlias = Annotated[
    FOPDTBody | SOPDTBody | IPDTBody | DoubleIntegratorBody, Field(discriminator="kind")
]
AnyProcessBody: TypeAlias = Annotated[
    FOPDTBody
    | SOPDTBody
    | IPDTBody
    | DoubleIntegratorBody
    | PureDelayBody
    | IntegratorWithLagBody
    | TransferFunctionBody,
    Field(discriminator="kind"),
]

_PROCESS: TypeAdapter[_Stated] = TypeAdapter(AnyProcessBody)


def stated_process(body: _Stated) -> StatedProcess:
    """Turn a stated process into the engineering model.

    Raises
    ------
    ValueError
        A parameter is out of its range.
    """
    values = body.model_dump(exclude={"kind"})
    match body:
        case FOPDTBody():
            return FOPDT(**values)
        case SOPDTBody():
            return SOPDT(**values)
        case IPDTBody():
            return IPDT(**values)
        case PureDelayBody():
            return PureDelay(**values)
        case IntegratorWithLagBody():
            return TransferFunction((body.K,), (body.tau, 1.0, 0.0), body.theta)
        case TransferFunctionBody():
            return TransferFunction(tuple(body.numerator), tuple(body.denominator), body.theta)
        case _:
            return DoubleIntegrator(**values)


def process_from(kind: str, parameters: Mapping[str, object]) -> StatedProcess:
    """Read a stored process."""
    return stated_process(_PROCESS.validate_python({"kind": kind, **parameters}))


def id_from(text: str) -> UUID:
    """Read the id that a page starts after.

    Raises
    ------
    InvalidRequest
        The text is not an id.
    """
    try:
        return UUID(text)
    except ValueError as error:
        detail = "This cursor is not the `next` of any page."
        raise InvalidRequest("query/cursor", detail) from error


class NewModel(Strict):
    """Ask for a model: identified from a record, or stated."""

    record_id: Id | None = Field(None, description="Record to identify the process from.")
    start: Moment | None = Field(None, description="Use the record from here on.")
    end: Moment | None = Field(None, description="Use the record up to here.")
    op_before: Quantity | None = Field(
        None, description="Output before the first row, if the step is at that row. [OP]"
    )
    process: AnyProcessBody | None = Field(None, description="The process, if it is known already.")
    bootstrap: bool = Field(
        False,
        description="Whether intervals by bootstrap are wanted too; it takes a second.",
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.record_id is None) == (self.process is None):
            raise ValueError("give either record_id or process")
        of_record = self.start or self.end or self.op_before is not None or self.bootstrap
        if self.process is not None and of_record:
            raise ValueError("start, end, op_before and bootstrap go with record_id")
        for name in ("start", "end"):
            instant: datetime | None = getattr(self, name)
            if instant is not None and instant.tzinfo is None:
                raise ValueError(f"{name} must say its time zone, such as 2026-01-31T08:00:00Z")
        return self


class ModelBody(Answer):
    """A process model with its verdict; K, tau, theta are null where it was refused.

    Further members depend on the kind: standard errors, correlation, fit, steps.
    """

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    id: UUID
    loop_id: UUID
    record_id: UUID | None
    kind: str | None = Field(description="FOPDT, SOPDT, IPDT and so on, or null.")
    verdict: Verdict
    reasons: list[str]
    created_at: datetime
    author: str


class ModelPage(Answer):
    """Models of a loop, newest first, and the cursor of the next page."""

    items: list[ModelBody]
    next: str | None
