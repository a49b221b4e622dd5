"""What is done to a loop in a simulation: set point, loads, noise, limits, start."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from loop.digital_pid import AntiWindup, OutputLimits
from loop.sampled_process import scans_in
from loop.sensor_faults import SensorFault
from loop.signals import Real
from loop.valve import Valve

# A day at 10 ms; above it, a forgotten unit is likelier than a plan.
MOST_SCANS = 10_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """Change by `size` at time `at`; between two scans it takes effect at the next.

    Attributes
    ----------
    size : float
        Change from the value at rest.
    at : float
        Instant of the change. [s]
    """

    size: float
    at: float = 0.0

    def over(self, t: Real) -> Real:
        """Change at every time, shape (n,)."""
        return np.where(t >= self.at, self.size, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """Change by `size` evenly over `duration`, from time `at` on.

    Attributes
    ----------
    size : float
        Whole change from the value at rest.
    duration : float
        Time from rest to the whole change. [s]
    at : float
        Start of the change. [s]
    """

    size: float
    duration: float
    at: float = 0.0

    def __post_init__(self) -> None:
        if not self.duration > 0:
            raise ValueError(f"duration must be positive, got {self.duration}")

    def over(self, t: Real) -> Real:
        """Change at every time, shape (n,)."""
        return np.asarray(self.size * np.clip((t - self.at) / self.duration, 0.0, 1.0))


Signal: TypeAlias = float | Step | Ramp | Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Manual:
    """Run in manual at first; the law follows the output, so that the transfer has no bump.

    Attributes
    ----------
    until : float
        Instant of the transfer to automatic. [s]
    op : Signal, optional
        Output by hand; `op0` if not given. Steps and ramps start from `op0`. [OP]
    """

    until: float
    op: Signal | None = None

    def __post_init__(self) -> None:
        if not self.until > 0:
            raise ValueError(f"until must be positive, got {self.until}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiment:
    """One experiment on one loop or on a batch of m loops.

    A signal is a number (held from t = 0 on), a `Step` or `Ramp` away from rest, or an array with
    one value a scan, shape (n,), in a batch also (n, m).

    Attributes
    ----------
    t_end, dt : float
        Length and scan time. [s]
    sp : Signal, optional
        Set point; `pv0` if not given. Steps and ramps start from `pv0`. [PV]
    load : Signal
        Disturbance added to the output at the process input. [OP]
    output_load : Signal
        Disturbance added to the process variable. [PV]
    noise : float or ndarray
        Standard deviation of white measurement noise, which needs `rng`, or the noise itself. [PV]
    rng : numpy.random.Generator, optional
        Source of the noise.
    resolution : float
        Smallest change that the sensor shows, 0 for any. [PV]
    limits : OutputLimits
        Limits of the controller output.
    anti_windup : AntiWindup
        What the integral does at a limit.
    Tt : float, optional
        Tracking time of back-calculation; by `tracking_time` if not given. [s]
    pv0, op0 : float
        Steady state before t = 0, in which set point and process variable agree. [PV], [OP]
    valve : Valve, optional
        Valve between output and process, at rest in the middle of its play; without friction if
        not given.
    faults : sequence of SensorFault
        Faults of the sensor, each on top of the one before.
    pv_filter : float
        Time constant of a first-order filter between the sensor and the law, 0 for none. [s]
    manual : Manual, optional
        Time in manual before the law takes over; none if not given.
    """

    t_end: float
    dt: float
    sp: Signal | None = None
    load: Signal = 0.0
    output_load: Signal = 0.0
    noise: float | Real = 0.0
    rng: np.random.Generator | None = None
    resolution: float = 0.0
    limits: OutputLimits = field(default_factory=OutputLimits)
    anti_windup: AntiWindup = AntiWindup.BACK_CALCULATION
    Tt: float | None = None
    pv0: float = 0.0
    op0: float = 0.0
    valve: Valve | None = None
    faults: Sequence[SensorFault] = ()
    pv_filter: float = 0.0
    manual: Manual | None = None

    def __post_init__(self) -> None:
        if not 0 < self.dt < math.inf:
            raise ValueError(f"dt must be positive, got {self.dt}")
        if not self.dt <= self.t_end < math.inf:
            raise ValueError(f"t_end must be at least dt = {self.dt} s, got {self.t_end}")
        if self.t_end / self.dt > MOST_SCANS:
            raise ValueError(
                f"{self.t_end / self.dt:.3g} scans are more than {MOST_SCANS:,}; "
                "take a longer dt or a shorter t_end"
            )
        if not (math.isfinite(self.pv0) and math.isfinite(self.op0)):
            raise ValueError(f"pv0 and op0 must be finite, got {self.pv0} and {self.op0}")
        if not self.limits.low <= self.op0 <= self.limits.high:
            raise ValueError(
                f"op0 must lie within the limits {self.limits.low} and {self.limits.high}, "
                f"got {self.op0}"
            )
        if not 0 <= self.resolution < math.inf:
            raise ValueError(f"resolution must be 0 or positive, got {self.resolution}")
        if self.Tt is not None and not self.Tt > 0:
            raise ValueError(f"Tt must be positive, got {self.Tt}")
        if not 0 <= self.pv_filter < math.inf:
            raise ValueError(f"pv_filter must be 0 or positive, got {self.pv_filter}")

    @property
    def t(self) -> Real:
        """Instants of the scans, shape (n,). [s]"""
        return np.arange(scans_in(self.t_end, self.dt)) * self.dt

    def set_point(self, t: Real) -> Real:
        """Set point at every scan, shape (n,) or (n, m). [PV]"""
        return _values("sp", self.pv0 if self.sp is None else self.sp, t, self.pv0)

    def input_load(self, t: Real) -> Real:
        """Disturbance at the process input at every scan, shape (n,) or (n, m). [OP]"""
        return _values("load", self.load, t, 0.0)

    def output_disturbance(self, t: Real) -> Real:
        """Disturbance of the process variable at every scan, shape (n,) or (n, m). [PV]"""
        return _values("output_load", self.output_load, t, 0.0)

    def output_by_hand(self, t: Real) -> list[float | None]:
        """Output in manual as a deviation from rest, none in automatic, for every scan. [OP]

        Raises
        ------
        ValueError
            The output by hand is not one value a scan within the limits.
        """
        if self.manual is None:
            return [None] * t.size
        op = _values("op", self.op0 if self.manual.op is None else self.manual.op, t, self.op0)
        if op.shape != t.shape:
            raise ValueError(f"op in manual must have the shape ({t.size},), got {op.shape}")
        held = op[t < self.manual.until]
        if held.size and not self.limits.low <= held.min() <= held.max() <= self.limits.high:
            raise ValueError(
                f"op in manual must lie within the limits {self.limits.low} and "
                f"{self.limits.high}, got {held.min()} to {held.max()}"
            )
        return [*(held - self.op0).tolist(), *[None] * (t.size - held.size)]

    def measurement_noise(self, t: Real, loops: int | None = None) -> Real:
        """Noise of the sensor at every scan, shape (n,) or for several loops (n, loops). [PV]"""
        if not isinstance(self.noise, (int, float)):
            return _values("noise", self.noise, t, 0.0)
        if not 0 <= self.noise < math.inf:
            raise ValueError(f"noise must be 0 or a positive standard deviation, got {self.noise}")
        if self.noise == 0:
            return np.zeros(t.size)
        if self.rng is None:
            raise ValueError("noise needs rng, for example numpy.random.default_rng(1)")
        shape = (t.size,) if loops is None else (t.size, loops)
        return self.rng.normal(0.0, self.noise, shape)


def _values(name: str, signal: Signal, t: Real, rest: float) -> Real:
    if isinstance(signal, (Step, Ramp)):
        values = rest + signal.over(t)
    else:
        values = np.asarray(signal, dtype=np.float64)
    if values.ndim == 0:
        values = np.full(t.size, float(values))
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{name} must be finite everywhere")
    return values
