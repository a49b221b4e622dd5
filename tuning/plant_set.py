"""Plants on a grid of frequencies, for settings that must suit all of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from loop.controller import PID, Action
from loop.factors import FactoredLoop
from loop.process import Process, gain_sign
from loop.signals import Real

# The grid reaches from slow integral action to the second turn of the dead time: points even in
# ln w, and as many more even in w, as the turns are.
BELOW, ABOVE, POINTS, TURNING = 120.0, 6.0, 72, 40
# Phase at which a process is as fast as a loop around it can be; further below where it starts low,
# as two integrators do.
SPEED, LOSS = math.radians(-150.0), math.radians(60.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantSet:
    """Responses of p plants on a grid of frequencies; gain and dead time may be intervals.

    Attributes
    ----------
    w : ndarray, shape (k,)
        Frequencies, ascending. [rad/s]
    log_gain, phase : ndarray, shape (p, k)
        ln|G| and unwrapped arg G without dead time, K counted positive. [-], [rad]
    gain_low, gain_high : ndarray, shape (p,)
        Factors on the gain. [-]
    theta_low, theta_high : ndarray, shape (p,)
        Dead times, half the scan time included. [s]
    hold : float
        Half the scan time. [s]
    """

    w: Real
    log_gain: Real
    phase: Real
    gain_low: Real
    gain_high: Real
    theta_low: Real
    theta_high: Real
    hold: float

    @classmethod
    def of(
        cls,
        processes: Sequence[Process],
        speed: float,
        *,
        gain_error: float = 0.0,
        theta_error: float = 0.0,
        hold: float = 0.0,
    ) -> Self:
        """Lay processes on a grid; the first is the model.

        Parameters
        ----------
        processes : sequence of Process
            Plants whose dead time and gain may be off by the errors.
        speed : float
            Frequency that the grid is laid around, of `fastest`. [rad/s]
        gain_error, theta_error : float
            Relative errors. [-]
        hold : float
            Half the scan time. [s]
        """
        w = _grid(processes, speed)
        loops = [_alone(process, 0.0) for process in processes]
        theta = np.array([process.theta for process in processes])
        one = np.ones(theta.size)
        return cls(
            w=w,
            log_gain=np.stack([loop.log_gain(w) for loop in loops]),
            phase=np.stack([loop.phase(w) + w * loop.theta for loop in loops]),
            gain_low=one * (1 - gain_error),
            gain_high=one * (1 + gain_error),
            theta_low=theta * (1 - theta_error) + hold,
            theta_high=theta * (1 + theta_error) + hold,
            hold=hold,
        )


def fastest(process: Process, hold: float = 0.0) -> float | None:
    """Frequency where the phase of a process passes -150°; None where it never does.

    Parameters
    ----------
    process : Process
        Process model.
    hold : float
        Half the scan time. [s]

    Returns
    -------
    float or None
        [rad/s]
    """
    loop = _alone(process, hold)
    corners = [float(a) for a in np.abs(np.concatenate([loop.zeros, loop.poles])) if a]
    if loop.theta > 0:
        corners.append(1 / loop.theta)
    if not corners:
        return None
    w = np.geomspace(min(corners) / 1e3, max(corners) * 1e3, 4000)
    phase = loop.phase(w)
    late = phase < min(SPEED, float(phase[0]) - LOSS)
    return float(w[np.argmax(late)]) if late.any() else None


def _alone(process: Process, delay: float) -> FactoredLoop:
    """The process with a controller of gain 1 that has the right action."""
    action = Action.for_gain(gain_sign(process))
    return FactoredLoop.of(process, PID(Kc=1.0, action=action), delay=delay)


def _grid(processes: Sequence[Process], speed: float) -> Real:
    """Points that grow smoothly denser, and dense about lightly damped roots of the model."""
    fine = np.geomspace(speed / BELOW, speed * ABOVE, 2000)
    place = POINTS * np.linspace(0.0, 1.0, fine.size) + TURNING * fine / fine[-1]
    w = np.interp(np.arange(place[0], place[-1]), place, fine)
    loop = _alone(processes[0], 0.0)
    near = [w]
    for root in np.concatenate([loop.zeros, loop.poles]):
        if root.imag > 2 * abs(root.real):
            width = max(abs(root.real), 1e-4 * root.imag)
            offsets = width * np.geomspace(0.25, 0.9 * root.imag / width, 16)
            near += [root.imag - offsets, root.imag + offsets]
    return np.unique(np.concatenate(near))
