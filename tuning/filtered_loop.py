"""A loop with a filter on PV, in the shape that margins take."""

from dataclasses import replace

import numpy as np

from loop.controller import PID
from loop.process import Process, TransferFunction


def with_pv_filter(process: Process, pid: PID, pv_filter: float) -> tuple[Process, PID]:
    """Put a first-order filter of PV into the loop; its place in the loop does not matter there.

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings; the filter becomes its lag where it has none.
    pv_filter : float
        Time constant of the filter, 0 for none. [s]
    """
    if pv_filter == 0:
        return process, pid
    if pid.tauF == 0:
        return process, replace(pid, tauF=pv_filter)
    slower = TransferFunction(
        tuple(process.numerator),
        tuple(np.polymul(process.denominator, (pv_filter, 1.0))),
        process.theta,
    )
    return slower, pid
