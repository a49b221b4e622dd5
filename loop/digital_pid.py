"""The ISA PID as a plant controller runs it: once a scan, within limits, without wind-up.

Between two scans the measurement is taken to move in a straight line and the set point to hold.
Integral, derivative filter and lag are exact for that, so that the scan adds the delay of its hold
(half a scan) and nothing else, and the response converges to that of the continuous controller.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Self

import numpy as np
import numpy.typing as npt

from loop.batch import PIDBatch
from loop.controller import PID
from loop.signals import Flags, Real


class AntiWindup(StrEnum):
    """What the integral does while the output is at a limit.

    TRACKING sets it in every scan so that the law goes on from the output that was sent. VELOCITY
    adds the change of the law to the output that was sent, which with integral action is the same;
    a controller without integral action keeps the shift and drifts.
    """

    NONE = "none"
    CLAMPING = "clamping"
    BACK_CALCULATION = "back calculation"
    TRACKING = "tracking"
    VELOCITY = "velocity form"


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputLimits:
    """What the controller output may do.

    Attributes
    ----------
    low, high : float
        Smallest and largest output. [OP]
    rate : float
        Fastest change in either direction. [OP/s]
    """

    low: float = -math.inf
    high: float = math.inf
    rate: float = math.inf

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise ValueError(f"low must be below high, got {self.low} and {self.high}")
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate}")


def tracking_time(controller: PID) -> float:
    """Default Tt of back-calculation: sqrt(Ti Td) with a derivative, Ti without. [s]"""
    return math.sqrt(controller.Ti * controller.Td) if controller.Td else controller.Ti


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanLaw:
    """Numbers of the law for one scan of m controllers, every array of shape (m,).

    With m the measurement, r the set point, all as deviations from the initial rest:

    w = c r - m;  D = dD D' + kD (w - w')
    I = I' + kI (r' - (m + m')/2)
    v = kP (b r - m) + I + D
    F = dF F' + f1 v' + f0 v
    u = F within the limits
    I = I + track (u - F)                  back-calculation
    I = I' if that moved F further out     clamping
    I, F and v + track (u - F)             tracking and velocity form

    where the prime marks the scan before. The action's sign is in kP, kI and kD.
    """

    kP: Real
    kI: Real
    kD: Real
    dD: Real
    b: Real
    c: Real
    dF: Real
    f0: Real
    f1: Real
    track: Real

    def arrays(self) -> list[Real]:
        """All numbers, in the order above."""
        return [getattr(self, field.name) for field in fields(self)]

    def take(self, rows: npt.NDArray[np.intp]) -> Self:
        """Pick controllers by index.

        Parameters
        ----------
        rows : ndarray of int
            Indices; one may repeat.
        """
        return type(self)(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})


def scan_laws(
    controllers: Sequence[PID] | PIDBatch, dt: float, *, anti_windup: AntiWindup, Tt: float | None
) -> ScanLaw:
    """Discretise controllers for a scan time.

    kI = Kc dt/Ti, kD = Kc Td (1 - dD)/dt with dD = e^(-dt N/Td), dF = e^(-dt/tauF),
    track = 1 - e^(-dt/Tt) for back-calculation, 1 for tracking and velocity form, and 0 without
    integral action unless in velocity form

    Parameters
    ----------
    controllers : sequence of PID, length m, or PIDBatch of m controllers
        Controller settings; a PIDBatch has the set-point weights b = 1, c = 0.
    dt : float
        Scan time. [s]
    anti_windup : AntiWindup
        What the integral does at a limit.
    Tt : float, optional
        Tracking time of back-calculation; by `tracking_time` if not given. [s]
    """
    Kc, Ti, Td, Tf, b, c, tauF = _settings(controllers)
    dD, dF = _decay(dt, Tf), _decay(dt, tauF)
    lag = (1 - dF) * tauF / dt
    default = np.sqrt(Ti) * np.sqrt(np.where(Td > 0, Td, Ti))  # as `tracking_time`
    tracking = default if Tt is None else np.full_like(Ti, Tt)
    return ScanLaw(
        kP=Kc,
        kI=Kc * dt / Ti,
        kD=Kc * Td * (1 - dD) / dt,
        dD=dD,
        b=b,
        c=c,
        dF=dF,
        f0=1 - lag,
        f1=lag - dF,
        track=_track(anti_windup, np.isfinite(Ti), 1 - _decay(dt, tracking)),
    )


def _track(anti_windup: AntiWindup, integrates: Flags, back_calculated: Real) -> Real:
    match anti_windup:
        case AntiWindup.BACK_CALCULATION:
            return np.where(integrates, back_calculated, 0.0)
        case AntiWindup.TRACKING:
            return np.where(integrates, 1.0, 0.0)
        case AntiWindup.VELOCITY:
            return np.ones(integrates.size)
        case _:
            return np.zeros(integrates.size)


def _settings(controllers: Sequence[PID] | PIDBatch) -> list[Real]:
    """Kc with the action's sign, Ti, Td, Td/N, b, c, tauF; every array of shape (m,)."""
    if isinstance(controllers, PIDBatch):
        p = controllers
        Kc, Ti, Td, N, tauF, sign = (
            np.broadcast_to(values, p.shape).ravel()
            for values in (p.Kc, p.Ti, p.Td, p.N, p.tauF, p.sign)
        )
        return [sign * Kc, Ti, Td, Td / N, np.ones(Kc.size), np.zeros(Kc.size), tauF]
    rows = [
        (p.action.sign * p.Kc, p.Ti, p.Td, p.filter_time, p.b, p.c, p.tauF) for p in controllers
    ]
    return list(np.array(rows).T)


def _decay(dt: float, time_constant: Real) -> Real:
    """e^(-dt/T), 0 for T = 0."""
    safe = np.where(time_constant > 0, time_constant, 1.0)
    return np.where(time_constant > 0, np.exp(-dt / safe), 0.0)
