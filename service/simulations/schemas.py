"""Bodies of simulation requests and answers; the answer is that of `loopwright simulate --json`."""

import math
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import ConfigDict, Field, JsonValue, model_validator

from advice.scenario import Conditions
from loop.digital_pid import AntiWindup, OutputLimits
from loop.valve import Choudhury, DeadBand, He, Kano, Valve
from service.analysis.schemas import ControllerBody
from service.models.schemas import AnyProcessBody
from service.records.stretches import Stretch
from service.schemas import Answer, Strict
from service.units import Positive, Quantity, Seconds, SecondsOrNone, Word

MOST_CONTROLLERS = 5
MOST_EVENTS = 5
MOST_DRAWS = 500

Size: TypeAlias = Annotated[float, Field(ge=0, le=1e12, allow_inf_nan=False)]
WindupName: TypeAlias = Literal["none", "clamping", "back calculation", "tracking", "velocity form"]


class NamedController(ControllerBody):
    """Settings with the name they have in the answer."""

    name: Word


class SlipJumpBody(Strict):
    """A sticking valve by two numbers."""

    model: Literal["Choudhury", "Kano"]
    S: Size = Field(description="Dead band plus stick band. [OP]")
    J: Size = Field(description="Slip jump. [OP]")

    def valve(self) -> Valve:
        """Turn it into the engineering one."""
        return (Choudhury if self.model == "Choudhury" else Kano)(S=self.S, J=self.J)


class FrictionBody(Strict):
    """A sticking valve by static and kinetic friction."""

    model: Literal["He"]
    fs: Size = Field(description="Static friction. [OP]")
    fd: Size = Field(description="Kinetic friction, at most the static one. [OP]")

    def valve(self) -> Valve:
        """Turn it into the engineering one."""
        return He(fs=self.fs, fd=self.fd)


class DeadBandBody(Strict):
    """Backlash."""

    model: Literal["DeadBand"]
    width: Size = Field(description="What a reversing output moves before the stem does. [OP]")

    def valve(self) -> Valve:
        """Turn it into the engineering one."""
        return DeadBand(width=self.width)


ValveBody: TypeAlias = Annotated[
    SlipJumpBody | FrictionBody | DeadBandBody, Field(discriminator="model")
]


class ConditionsBody(Strict):
    """What is between the settings and the process."""

    scan_time: Seconds | None = Field(None, description="Scan time; fine if not given. [s]")
    t_end: Seconds | None = Field(None, description="Length; long enough to settle. [s]")
    low: Quantity | None = Field(None, description="Lowest output. [OP]")
    high: Quantity | None = Field(None, description="Highest output. [OP]")
    rate: Positive | None = Field(None, description="Fastest move of the output. [OP/s]")
    anti_windup: WindupName = Field("back calculation", description="At a limit.")
    Tt: Seconds | None = Field(None, description="Tracking time of back-calculation. [s]")
    pv_filter: SecondsOrNone = Field(0.0, description="Time constant of a filter on PV. [s]")
    noise: Size = Field(0.0, description="Standard deviation of the sensor's noise. [PV]")
    resolution: Size = Field(0.0, description="Smallest change that the sensor shows. [PV]")
    valve: ValveBody | None = None
    pv0: Quantity = Field(0.0, description="Where PV rests. [PV]")
    op0: Quantity = Field(0.0, description="Where the output rests. [OP]")
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = Field(1, description="Seed of the noise.")

    def conditions(self) -> Conditions:
        """Turn them into the engineering ones.

        Raises
        ------
        ValueError
            A limit or the valve cannot be.
        """
        return Conditions(
            scan_time=self.scan_time,
            t_end=self.t_end,
            limits=OutputLimits(
                low=-math.inf if self.low is None else self.low,
                high=math.inf if self.high is None else self.high,
                rate=math.inf if self.rate is None else self.rate,
            ),
            anti_windup=AntiWindup(self.anti_windup),
            Tt=self.Tt,
            pv_filter=self.pv_filter,
            noise=self.noise,
            resolution=self.resolution,
            valve=None if self.valve is None else self.valve.valve(),
            pv0=self.pv0,
            op0=self.op0,
            seed=self.seed,
        )


class SetPointBody(Strict):
    """Move the set point."""

    kind: Literal["set point"]
    size: Quantity = Field(description="Change. [PV]")
    rate: Positive | None = Field(None, description="Speed of a ramp; a step if null. [PV/s]")


class LoadBody(Strict):
    """Add a load at the process input."""

    kind: Literal["load"]
    size: Quantity = Field(description="Load. [OP]")


class TransferBody(Strict):
    """Switch from manual to automatic."""

    kind: Literal["transfer"]
    size: Quantity = Field(0.0, description="Set point less PV at the transfer. [PV]")


class ReplayBody(Stretch):
    """Meet the disturbance of a stored record again."""

    kind: Literal["replay"]


EventBody: TypeAlias = Annotated[
    SetPointBody | LoadBody | TransferBody | ReplayBody, Field(discriminator="kind")
]


class FanBody(Strict):
    """Other processes to run the steps on."""

    spread: Annotated[float, Field(gt=0, lt=1)] | None = Field(
        None, description="All parameters off at once by up to this part. [-]"
    )
    count: Annotated[int, Field(ge=1, le=MOST_DRAWS)] = Field(
        100, description="Processes drawn from the spread; its corners come first. [-]"
    )
    draws: (
        Annotated[
            list[Annotated[list[Quantity], Field(min_length=2, max_length=4)]],
            Field(min_length=1, max_length=MOST_DRAWS),
        ]
        | None
    ) = Field(None, description="Parameters of each process, in the order of its kind.")

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.spread is None) == (self.draws is None):
            raise ValueError("give either spread or draws")
        return self


class Simulate(Strict):
    """Ask what settings will do."""

    process: AnyProcessBody
    controllers: Annotated[
        list[NamedController], Field(min_length=1, max_length=MOST_CONTROLLERS)
    ] = Field(description="Settings to compare, such as the new and the running ones.")
    events: Annotated[list[EventBody], Field(min_length=1, max_length=MOST_EVENTS)]
    conditions: ConditionsBody = Field(default_factory=ConditionsBody)
    fan: FanBody | None = Field(None, description="Other processes that the data allow.")

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        names = [controller.name for controller in self.controllers]
        if len(set(names)) < len(names):
            raise ValueError(f"controllers need names of their own, got {', '.join(names)}")
        return self


class SimulationBody(Answer):
    """What the settings will do: responses, measures, effort of the output, fan."""

    model_config = ConfigDict(extra="allow", from_attributes=True, allow_inf_nan=False)

    process: dict[str, JsonValue]
    conditions: dict[str, JsonValue]
    scan_time: float = Field(description="Scan time of the runs. [s]")
    t_end: float = Field(description="Length of the runs. [s]")
    draws: int = Field(description="Processes in the fan. [-]")
    events: list[dict[str, JsonValue]] = Field(
        description="For each event its runs, one for every controller."
    )
