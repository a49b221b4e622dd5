"""How long to simulate a loop, and how finely, so that a picture shows all of it."""

import math
from collections.abc import Sequence

import numpy as np

from loop.controller import PID
from loop.process import Process, gain_sign, rational_response, static_gain


def horizon(process: Process, controllers: Sequence[PID]) -> tuple[float, float]:
    """Choose length and step: long enough for the slowest loop to settle, fine for the fastest. [s]

    Parameters
    ----------
    process : Process
        Process model.
    controllers : sequence of PID
        Controllers that share a picture.
    """
    slow, fast = 0.0, math.inf
    for pid in controllers:
        stiffness = abs(gain_sign(process)) * pid.Kc * abs(_slope_or_gain(process))
        # An integral loop settles with Ti/(K Kc); a lag in front adds its own time. One around an
        # integrator settles with its slower root of s^2 + K Kc s + K Kc/Ti.
        if _integrating(process):
            tail = 2 * max(_finite(pid.Ti), 2 / stiffness)
        else:
            tail = pid.Ti / stiffness if pid.Ti < math.inf else 0.0
        lags = -process.denominator[-2] / process.denominator[-1] if _lagging(process) else 0.0
        slow = max(slow, 6 * tail, 4 * abs(lags), 12 * process.theta, 2 * _finite(pid.Ti))
        fast = min(fast, max(pid.filter_time, process.theta / 8))
    t_end = slow or 1.0
    steps = min(max(600.0, t_end / fast if fast > 0 else 0.0), 4_000.0)
    return t_end, t_end / steps


def _finite(Ti: float) -> float:
    return Ti if Ti < math.inf else 0.0


def _integrating(process: Process) -> bool:
    """Whether there is one integrator."""
    below = process.denominator
    return len(below) > 1 and below[-1] == 0 and below[-2] != 0


def _lagging(process: Process) -> bool:
    return len(process.denominator) > 1 and process.denominator[-1] != 0


def _slope_or_gain(process: Process) -> float:
    gain = static_gain(process)
    if math.isfinite(gain) and gain:
        return gain
    return float(np.abs(rational_response(process, np.array([1j]))[0]))
