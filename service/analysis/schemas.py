"""Bodies of analysis requests and answers; the answer is that of `loopwright analyse --json`."""

import math
from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import ConfigDict, Field, JsonValue

from advice.analyse import Task
from loop.compensators import Compensator, Lag, Lead, LeadLag, Notch
from loop.controller import PID, Action
from loop.feedback_sign import feedback_action
from loop.process import Process
from service.loops.schemas import ProfileName
from service.models.schemas import AnyProcessBody
from service.schemas import Answer, Strict
from service.tunings.schemas import MarginsBody
from service.units import Positive, Quantity, Seconds, SecondsOrNone

MOST_LOOPS = 20_000  # well under a second of work


class ControllerBody(Strict):
    """Controller settings in the ISA form."""

    Kc: Positive = Field(description="Controller gain. [OP/PV]")
    Ti: Seconds | None = Field(None, description="Integral time; null for none. [s]")
    Td: SecondsOrNone = Field(0.0, description="Derivative time. [s]")
    N: Annotated[float, Field(gt=0, le=1e6)] | None = Field(
        10.0, description="Derivative filter ratio; null for no filter. [-]"
    )
    b: Annotated[float, Field(ge=0, le=2)] = Field(1.0, description="Set-point weight. [-]")
    c: Annotated[float, Field(ge=0, le=2)] = Field(
        0.0, description="Set-point weight of the derivative. [-]"
    )
    tauF: SecondsOrNone = Field(0.0, description="Lag in series. [s]")
    action: Literal["reverse", "direct"] | None = Field(
        None, description="By default the one that the sign of the process gain asks for."
    )

    def settings(self, process: Process) -> PID:
        """Turn the stated settings into a controller for a process."""
        own = feedback_action(process)
        return PID(
            Kc=self.Kc,
            Ti=math.inf if self.Ti is None else self.Ti,
            Td=self.Td,
            N=math.inf if self.N is None else self.N,
            b=self.b,
            c=self.c,
            tauF=self.tauF,
            action=own if self.action is None else Action(self.action),
        )


class LeadBody(Strict):
    """Phase lead, (T s + 1)/(alpha T s + 1)."""

    kind: Literal["Lead"]
    T: Seconds = Field(description="Time constant of the zero. [s]")
    alpha: Positive = Field(description="Pole over zero, below 1. [-]")

    def made(self) -> Compensator:
        """Turn it into the engineering one."""
        return Lead(T=self.T, alpha=self.alpha)


class LagBody(Strict):
    """Low-frequency gain, beta (T s + 1)/(beta T s + 1)."""

    kind: Literal["Lag"]
    T: Seconds = Field(description="Time constant of the zero. [s]")
    beta: Positive = Field(description="Static gain, above 1. [-]")

    def made(self) -> Compensator:
        """Turn it into the engineering one."""
        return Lag(T=self.T, beta=self.beta)


class LeadLagBody(Strict):
    """Lead or lag, (T_lead s + 1)/(T_lag s + 1)."""

    kind: Literal["LeadLag"]
    T_lead: Seconds = Field(description="Time constant of the zero. [s]")
    T_lag: Seconds = Field(description="Time constant of the pole. [s]")

    def made(self) -> Compensator:
        """Turn it into the engineering one."""
        return LeadLag(T_lead=self.T_lead, T_lag=self.T_lag)


class NotchBody(Strict):
    """Notch at w0."""

    kind: Literal["Notch"]
    w0: Positive = Field(description="Frequency. [rad/s]")
    zeta_zero: Positive = Field(description="Damping of the zeros. [-]")
    zeta_pole: Positive = Field(description="Damping of the poles, above that of the zeros. [-]")

    def made(self) -> Compensator:
        """Turn it into the engineering one."""
        return Notch(w0=self.w0, zeta_zero=self.zeta_zero, zeta_pole=self.zeta_pole)


AnyCompensator: TypeAlias = Annotated[
    LeadBody | LagBody | LeadLagBody | NotchBody, Field(discriminator="kind")
]


class TaskBody(Strict):
    """What the loop has to do; what is left out is not asked."""

    load: Quantity | None = Field(None, description="Largest load step, process input. [OP]")
    allowed: Positive | None = Field(None, description="Deviation of PV that may happen. [PV]")
    frequency: Positive | None = Field(None, description="Highest load frequency. [rad/s]")
    ramp: Quantity | None = Field(None, description="Fastest lasting change of the load. [OP/s]")
    unmodelled: SecondsOrNone = Field(
        0.0, description="Lags and dead times that the model leaves out. [s]"
    )
    op_room: Positive | None = Field(None, description="How far the output can move. [OP]")
    set_point_change: Quantity | None = Field(None, description="Largest change of SP. [PV]")
    relative_gain: Quantity | None = Field(None, description="Relative gain of the pairing. [-]")
    wc: Positive | None = Field(None, description="Gain crossover wanted. [rad/s]")

    def task(self) -> Task:
        """Turn it into the engineering one."""
        return Task(**self.model_dump())


class AnalyseLoop(Strict):
    """Ask for everything the classical toolbox says of a process with a controller."""

    process: AnyProcessBody
    controller: ControllerBody
    compensators: Annotated[list[AnyCompensator], Field(max_length=4)] = Field(
        [], description="In series with the controller."
    )
    scan_time: SecondsOrNone = Field(0.0, description="Half of it counts as dead time. [s]")
    profile: ProfileName = Field("general", description="Target profile.")
    task: TaskBody | None = None
    points: Annotated[int, Field(ge=2, le=2000)] = Field(
        300, description="Frequencies of the curves, beside the crossovers."
    )
    pade_order: Annotated[int, Field(ge=1, le=12)] | None = Field(
        None, description="Takes a dead time into Routh's array, which has none otherwise."
    )
    figures: bool = Field(True, description="Whether to add Plotly documents.")


class NyquistBody(Answer):
    """Encirclements of -1; Z = N + P."""

    encirclements: int = Field(description="Clockwise turns about -1, N.")
    open_loop: int = Field(description="Unstable open-loop poles, P.")
    closed_loop: int = Field(description="Unstable closed-loop poles, Z.")


class AnalysisBody(Answer):
    """What the toolbox says; parts that this loop does not have are null, and notes say why.

    Further members: curves, poles, root_locus, routh, bode_integral, limits, figures and the
    answers to the task.
    """

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    stable: bool
    unstable_poles: int | None = Field(description="null for infinitely many.")
    margins: MarginsBody | None
    passes: bool = Field(description="Whether the margins at the model keep the profile.")
    nyquist: NyquistBody | None
    notes: list[str]


Column: TypeAlias = Annotated[list[Quantity], Field(min_length=1, max_length=MOST_LOOPS)]
Values: TypeAlias = Quantity | Column


class ProcessColumns(Strict):
    """Processes K e^(-theta s)/(s^integrators (tau1 s + 1)(tau2 s + 1)), one a row.

    A single number stands for every row.
    """

    K: Values = Field(description="Gain. [PV/OP per s^integrators]")
    theta: Values = Field(0.0, description="Dead time. [s]")
    tau1: Values = Field(0.0, description="Lag, 0 for none. [s]")
    tau2: Values = Field(0.0, description="Second lag, 0 for none. [s]")
    integrators: Annotated[int, Field(ge=0, le=2)] = Field(0, description="0, 1 or 2.")


class ControllerColumns(Strict):
    """Controllers in the ISA form, one a row; a single number stands for every row.

    The action follows the sign of the process gain.
    """

    Kc: Values = Field(description="Controller gain, positive. [OP/PV]")
    Ti: Values | None = Field(None, description="Integral time; null for none. [s]")
    Td: Values = Field(0.0, description="Derivative time. [s]")
    N: Values = Field(10.0, description="Derivative filter ratio. [-]")
    tauF: Values = Field(0.0, description="Lag in series. [s]")


class AnalyseLoops(Strict):
    """Ask for the margins of many loops, stated and answered as columns."""

    process: ProcessColumns
    controller: ControllerColumns
    scan_time: SecondsOrNone = Field(0.0, description="Half of it counts as dead time. [s]")


Numbers: TypeAlias = list[float | None]


class LoopsBody(Answer):
    """Margins of many loops as columns, in the order of the request; null for infinite.

    An unstable loop has margins 0 and peaks null.
    """

    count: int
    stable: list[bool]
    gain: Numbers = Field(description="Gain margin. [-]")
    gain_reduction: Numbers = Field(description="Gain reduction margin. [-]")
    phase: Numbers = Field(description="Phase margin. [deg]")
    delay: Numbers = Field(description="Delay margin. [s]")
    Ms: Numbers = Field(description="Peak of |S|. [-]")
    Mt: Numbers = Field(description="Peak of |T|. [-]")


def column(values: Values) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
    """A number or a column as an array that broadcasts."""
    return np.asarray(values, dtype=np.float64)


class ExportModel(Strict):
    """Ask for a process model as a script for another tool."""

    process: AnyProcessBody
    target: Literal["python", "python-control", "matlab", "julia", "gekko", "do-mpc", "modelica"]
    sample_time: Seconds | None = Field(None, description="For gekko and do-mpc. [s]")


class ScriptBody(Answer):
    """A script."""

    target: str
    file_name: str
    text: str


Part: TypeAlias = Annotated[float, Field(ge=0, lt=1)]


class PoleBody(Strict):
    """A pole; of a pair either one."""

    real: Quantity = Field(description="[rad/s]")
    imag: Quantity = Field(0.0, description="[rad/s]")


class SpecifyResponse(Strict):
    """Ask for the region of the s-plane that a step response leaves to its dominant poles."""

    overshoot: Part | None = Field(None, description="Largest overshoot over the step. [-]")
    phase: Annotated[float, Field(gt=0, lt=90)] | None = Field(
        None, description="Smallest phase margin of the loop behind it. [deg]"
    )
    settling: Seconds | None = Field(None, description="Longest time to settle. [s]")
    rise: Seconds | None = Field(None, description="Longest time from 10 to 90 %. [s]")
    band: Annotated[float, Field(gt=0, lt=1)] = Field(
        0.02, description="Half-width of the settling band over the step. [-]"
    )
    poles: Annotated[list[PoleBody], Field(max_length=100)] = Field(
        [], description="Stable poles to hold to it."
    )


class RegionBody(Answer):
    """Where dominant poles may lie, and poles read back as step responses."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    zeta_min: float = Field(description="Least damping. [-]")
    phase_margin_min: float = Field(description="Phase margin at that damping. [deg]")
    edge: dict[str, Numbers] = Field(
        description="At each damping zeta the least wn, and the pole there: real, imag. [rad/s]"
    )
    poles: list[dict[str, JsonValue]]
    sentences: list[str]


class RelateLoops(Strict):
    """Ask how loops disturb each other."""

    gains: Annotated[
        list[Annotated[list[Quantity], Field(min_length=2, max_length=7)]],
        Field(min_length=2, max_length=7),
    ] = Field(description="Static gain from OP (column) to PV (row). [PV/OP]")


class InteractionBody(Answer):
    """Relative gains, and the pairing that interacts least."""

    gains: list[list[float]]
    relative_gains: list[list[float]]
    pairing: list[int] | None = Field(
        description="For each PV its OP, from 1; null where every pairing has a negative gain."
    )
    interacts: bool = Field(description="Whether the loops fight each other all the same.")
    sentences: list[str]
