"""What settings are tried against: conditions between them and the process, and events."""

import math
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from loop.digital_pid import AntiWindup, OutputLimits
from loop.experiment import Experiment, Manual, Ramp, Signal
from loop.record import Record
from loop.recorded_disturbance import RecordedDisturbance
from loop.sampled_process import scans_in
from loop.signals import Real
from loop.valve import Valve

# The share of a run that a loop spends in manual before it is switched to automatic.
IN_MANUAL = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What is between the settings and the process.

    Attributes
    ----------
    scan_time : float, optional
        Scan time of the controller; fine enough for a smooth picture if not given. [s]
    t_end : float, optional
        Length of a run; long enough to settle if not given. [s]
    limits : OutputLimits
        Limits of the output in range and rate. [OP], [OP/s]
    anti_windup : AntiWindup
        What the integral does at a limit.
    Tt : float, optional
        Tracking time of back-calculation. [s]
    pv_filter : float
        Time constant of a filter on PV, 0 for none. [s]
    noise : float
        Standard deviation of the sensor's white noise. [PV]
    resolution : float
        Smallest change that the sensor shows, 0 for any. [PV]
    valve : Valve, optional
        Valve that sticks; without friction if not given.
    pv0, op0 : float
        Where the loop rests. [PV], [OP]
    seed : int
        Seed of the noise, the same for every controller.
    """

    scan_time: float | None = None
    t_end: float | None = None
    limits: OutputLimits = field(default_factory=OutputLimits)
    anti_windup: AntiWindup = AntiWindup.BACK_CALCULATION
    Tt: float | None = None
    pv_filter: float = 0.0
    noise: float = 0.0
    resolution: float = 0.0
    valve: Valve | None = None
    pv0: float = 0.0
    op0: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        for name in ("scan_time", "t_end"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ValueError(f"{name} must be positive, got {value}")


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPointChange:
    """Move the set point.

    Attributes
    ----------
    size : float
        Change. [PV]
    rate : float, optional
        Speed of a ramp; a step if not given. [PV/s]
    """

    size: float
    rate: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.size) and self.size):
            raise ValueError(f"size must not be 0, got {self.size}")
        if self.rate is not None and not 0 < self.rate < math.inf:
            raise ValueError(f"rate must be positive, got {self.rate}")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadChange:
    """Add a load at the process input.

    Attributes
    ----------
    size : float
        Load. [OP]
    """

    size: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.size) and self.size):
            raise ValueError(f"size must not be 0, got {self.size}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """Switch from manual to automatic while the set point is away from PV.

    Attributes
    ----------
    size : float
        Set point less PV at the transfer; 0 for none. [PV]
    """

    size: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.size):
            raise ValueError(f"size must be finite, got {self.size}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replay:
    """Meet the disturbance of a record again, as if the loop had been in automatic throughout.

    Attributes
    ----------
    record : Record
        Routine data of the loop with a set point.
    """

    record: Record


Event: TypeAlias = SetPointChange | LoadChange | Transfer | Replay


def experiment_of(
    event: SetPointChange | LoadChange | Transfer, given: Conditions, t_end: float, dt: float
) -> Experiment:
    """Write an event down as an experiment from rest.

    A transfer runs without noise, so that its bump can be seen.

    Parameters
    ----------
    event : SetPointChange, LoadChange or Transfer
        What happens.
    given : Conditions
        What is between the settings and the process.
    t_end, dt : float
        Length and scan time. [s]
    """
    sp: Signal = given.pv0
    load, manual = 0.0, None
    match event:
        case SetPointChange():
            sp = given.pv0 + event.size
            if event.rate is not None:
                sp = Ramp(size=event.size, duration=abs(event.size) / event.rate)
        case LoadChange():
            load = event.size
        case _:
            sp, manual = given.pv0 + event.size, Manual(until=IN_MANUAL * t_end)
    return Experiment(
        t_end=t_end,
        dt=dt,
        sp=sp,
        load=load,
        noise=0.0 if manual else _noise(given, t_end, dt),
        resolution=given.resolution,
        limits=given.limits,
        anti_windup=given.anti_windup,
        Tt=given.Tt,
        pv0=given.pv0,
        op0=given.op0,
        valve=given.valve,
        pv_filter=given.pv_filter,
        manual=manual,
    )


def replay_of(replayed: RecordedDisturbance, given: Conditions, t_end: float) -> Experiment:
    """Write a recorded disturbance down as an experiment; its noise is in it already.

    Parameters
    ----------
    replayed : RecordedDisturbance
        The record as set point and disturbance.
    given : Conditions
        What is between the settings and the process.
    t_end : float
        Length. [s]
    """
    return Experiment(
        t_end=t_end,
        dt=replayed.dt,
        sp=replayed.sp,
        output_load=replayed.disturbance,
        resolution=given.resolution,
        limits=given.limits,
        anti_windup=given.anti_windup,
        Tt=given.Tt,
        pv0=float(replayed.pv[0]),
        op0=float(replayed.op[0]),
        valve=given.valve,
        pv_filter=given.pv_filter,
        manual=Manual(until=replayed.dt),
    )


def _noise(given: Conditions, t_end: float, dt: float) -> float | Real:
    """The same noise for every controller."""
    if not 0 <= given.noise < math.inf:
        raise ValueError(f"noise must be 0 or a positive standard deviation, got {given.noise}")
    rng = np.random.default_rng(given.seed)
    return rng.normal(0.0, given.noise, scans_in(t_end, dt)) if given.noise else 0.0
