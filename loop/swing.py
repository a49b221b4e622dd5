"""A process that swings by itself, and the margins of many such loops at once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from loop.batch import MarginBatch, PIDBatch, ProcessBatch, common_shape
from loop.lag_loops import LagLoops
from loop.process import Process, TransferFunction
from loop.scan_batch import scan_margins


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing:
    """K e^(-theta s)/(T^2 s^2 + 2 zeta T s + 1) with zeta below 1.

    Attributes
    ----------
    K : float
        Gain. [PV/OP]
    T : float
        Time constant. [s]
    zeta : float
        Damping. [-]
    theta : float
        Dead time. [s]
    """

    K: float
    T: float
    zeta: float
    theta: float

    @property
    def process(self) -> Process:
        """The process itself."""
        return TransferFunction((self.K,), (self.T**2, 2 * self.zeta * self.T, 1.0), self.theta)

    def scaled(
        self, K: float = 1.0, T: float = 1.0, zeta: float = 1.0, theta: float = 1.0
    ) -> "Swing":
        """Multiply the parameters by factors."""
        return Swing(K=self.K * K, T=self.T * T, zeta=self.zeta * zeta, theta=self.theta * theta)


def swing_of(process: Process) -> Swing | None:
    """Read a process as one swing; None where it is another.

    Parameters
    ----------
    process : Process
        Process model. [s]
    """
    match process:
        case TransferFunction(numerator=(n,), denominator=(d2, d1, d0)) if d0 and d2 / d0 > 0:
            T = (d2 / d0) ** 0.5
            zeta = d1 / d0 / (2 * T)
            return Swing(K=n / d0, T=T, zeta=zeta, theta=process.theta) if 0 < zeta < 1 else None
        case _:
            return None


def swings_of(processes: Sequence[Process]) -> tuple[Swing, ...] | None:
    """Read every process as a swing; None where one of them is another.

    Parameters
    ----------
    processes : sequence of Process
        Process models. [s]
    """
    found = [swing_of(process) for process in processes]
    swings = tuple(swing for swing in found if swing is not None)
    return swings if len(swings) == len(found) else None


def swing_margins(
    swings: Sequence[Swing], controllers: PIDBatch, *, sample_time: float = 0.0
) -> MarginBatch:
    """Find the margins of every loop around processes that swing by themselves.

    Parameters
    ----------
    swings : sequence of Swing, length p
        Processes.
    controllers : PIDBatch
        Controllers, of a shape that broadcasts with (p,).
    sample_time : float
        Scan time of the controllers; half of it counts as dead time. [s]
    """
    K, T, zeta, theta = np.array([(s.K, s.T, s.zeta, s.theta) for s in swings]).T
    none = np.zeros(len(swings))
    # Gain and dead time; the two poles come after as a factor of their own.
    alone = ProcessBatch(K=K, tau1=none, tau2=none, integrators=none.astype(np.intp), theta=theta)
    shape = common_shape(alone.shape, controllers.shape)
    whole = np.zeros(shape)
    b, c = ((value + whole).ravel() for value in (2 * zeta * T, T**2))
    loops = LagLoops.of(alone, controllers, np.asarray(sample_time / 2), shape)
    found = scan_margins(replace(loops, swings=((b, c),)))
    return MarginBatch(
        stable=found.stable.reshape(shape),
        gain=found.gain.reshape(shape),
        gain_reduction=found.gain_reduction.reshape(shape),
        phase=found.phase.reshape(shape),
        delay=found.delay.reshape(shape),
        Ms=found.Ms.reshape(shape),
        Mt=found.Mt.reshape(shape),
    )
