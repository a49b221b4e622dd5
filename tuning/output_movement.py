"""How much the sensor's noise moves the output, and with it the valve."""

import math
from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.errors import UnstableLoop
from loop.process import Process
from loop.sampled_response import sampled_response
from loop.signals import Real
from loop.stability import unstable_poles
from tuning.filtered_loop import with_pv_filter

DAY = 86_400.0
# The trapezoidal rule on the circle converges as soon as its points are closer than the poles are
# to it: the sum is doubled until it stands.
FEWEST, MOST = 2**11, 2**17
STANDS = 1e-7


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputMovement:
    """What white noise of the sensor does to the output of a loop in automatic.

    Attributes
    ----------
    sd : float
        Standard deviation of the output. [OP]
    move : float
        Mean size of its move in one scan. [OP]
    travel : float
        Sum of its moves in a day. [OP/day]
    reversals : float
        Changes of direction in a day. [1/day]
    """

    sd: float
    move: float
    travel: float
    reversals: float


def output_movement(
    process: Process, pid: PID, *, scan_time: float, noise: float, pv_filter: float = 0.0
) -> OutputMovement:
    """Work out what the sensor's noise does to the output, exactly for the scanned loop.

    Var u = s^2 mean |H|^2 and Var du = s^2 mean |(1 - 1/z) H|^2 over the unit circle, with
    H = -C/(1 + P C). For Gaussian noise a move has the mean size sqrt(2/pi) sd(du), and turns into
    its opposite with the probability arccos(r)/pi, r the correlation of successive moves.

    Limits, resolution and the valve's friction are left out: they make the movement smaller.

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings.
    scan_time : float
        Scan time; every scan has a new error. [s]
    noise : float
        Standard deviation of the noise. [PV]
    pv_filter : float
        Time constant of a first-order filter on PV, 0 for none. [s]

    Raises
    ------
    UnstableLoop
        The loop is unstable, so that the output has no spread.
    ValueError
        The scan time is not positive, or so short against the loop that the sum does not stand, or
        the noise is negative.
    """
    if not 0 < scan_time < math.inf:
        raise ValueError(f"scan_time must be positive, got {scan_time}")
    if not (0 <= noise < math.inf and 0 <= pv_filter < math.inf):
        raise ValueError(f"noise and pv_filter must not be negative, got {noise} and {pv_filter}")
    unstable = unstable_poles(*with_pv_filter(process, pid, pv_filter), delay=scan_time / 2)
    if unstable:
        raise UnstableLoop(unstable)
    n, powers = FEWEST, _powers(process, pid, scan_time, pv_filter, FEWEST)
    stands = False
    while not stands and n < MOST:
        n, before = 2 * n, powers
        powers = _powers(process, pid, scan_time, pv_filter, n)
        stands = bool(np.all(np.abs(powers - before) <= STANDS * powers[1]))
    if not stands:
        raise ValueError(
            f"scanned every {scan_time:.4g} s the loop is too slow for its output movement to be "
            f"summed from {MOST} points; state a longer scan time"
        )
    u, du, turned = (float(value) for value in powers)
    move = noise * math.sqrt(2 / math.pi * du)
    scans = DAY / scan_time
    return OutputMovement(
        sd=noise * math.sqrt(u),
        move=move,
        travel=scans * move,
        reversals=scans * math.acos(max(min(turned / du, 1.0), -1.0)) / math.pi,
    )


def _powers(process: Process, pid: PID, scan_time: float, pv_filter: float, n: int) -> Real:
    """Variances of the output and of its move, and the covariance of successive moves.

    For noise of variance 1, from n points on the upper half of the circle.
    """
    w = np.pi * (np.arange(n) + 0.5) / n
    found = sampled_response(process, pid, np.exp(1j * w), scan_time=scan_time, pv_filter=pv_filter)
    power = np.abs(found.noise_to_output) ** 2
    moves = 4 * np.sin(w / 2) ** 2 * power
    return np.array([power.mean(), moves.mean(), (moves * np.cos(w)).mean()])
