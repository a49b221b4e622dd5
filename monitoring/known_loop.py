"""What is known of a loop before its data are looked at: its model and its settings."""

from dataclasses import dataclass, field

import numpy as np

from loop.controller import PID
from loop.digital_pid import OutputLimits
from loop.process import Process

# What a model is trusted to where nobody stated it: the usual spread between two step tests.
USUAL_UNCERTAINTY = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownLoop:
    """The loop as its sheet states it.

    Attributes
    ----------
    process : Process
        Process model.
    controller : PID, optional
        Settings in the controller.
    limits : OutputLimits
        Limits of the output.
    scan_time : float, optional
        Scan time of the controller; that of the data if not given. [s]
    uncertainty : float
        Part by which each parameter of the model may be off. [-]
    """

    process: Process
    controller: PID | None = None
    limits: OutputLimits = field(default_factory=OutputLimits)
    scan_time: float | None = None
    uncertainty: float = USUAL_UNCERTAINTY

    def __post_init__(self) -> None:
        if self.scan_time is not None and not (np.isfinite(self.scan_time) and self.scan_time > 0):
            raise ValueError(f"scan_time must be positive, got {self.scan_time}")
        if not 0 <= self.uncertainty < 1:
            raise ValueError(f"uncertainty must lie within 0 and 1, got {self.uncertainty}")

    @property
    def pace(self) -> float:
        """Dead time and lags together: how long the process takes to answer. [s]"""
        return self.process.theta + lags(self.process)

    @property
    def unstable(self) -> bool:
        """Whether the process runs away by itself, beyond integrating."""
        poles = np.roots(self.process.denominator)
        return bool(np.any(poles.real > 1e-9 * np.max(np.abs(poles), initial=0.0)))


def lags(process: Process) -> float:
    """Sum of the time constants of a process, integrators left out. [s]

    Parameters
    ----------
    process : Process
        Process model.
    """
    poles = np.roots(process.denominator)
    moving = poles[np.abs(poles) > 1e-9 * np.max(np.abs(poles), initial=0.0)]
    return float(np.sum(1 / np.abs(moving)))
