"""Set-point weight and derivative filter, chosen by what they do to the loop."""

import math
from dataclasses import dataclass, replace

import numpy as np

from loop.controller import PID
from loop.experiment import Experiment
from loop.margins import Margins, margins
from loop.measures import step_measures
from loop.process import Process
from loop.simulation_batch import run_batch
from tuning.output_movement import OutputMovement, output_movement

WEIGHTS = np.linspace(1.0, 0.0, 21)
FILTER_RATIOS = (2.0, 3.0, 5.0, 8.0, 10.0, 15.0, 20.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightChoice:
    """A set-point weight and the overshoot that it leaves.

    Attributes
    ----------
    b : float
        Set-point weight of the proportional part. [-]
    overshoot : float
        Overshoot of a set-point step. [%]
    enough : bool
        Whether that is within the limit; b = 0 where it is not.
    """

    b: float
    overshoot: float
    enough: bool


def choose_set_point_weight(
    process: Process, pid: PID, *, most_overshoot: float = 5.0, scan_time: float, t_end: float
) -> WeightChoice:
    """Find the largest set-point weight whose overshoot stays within a limit, by simulation.

    The weight shapes the answer to the set point alone: margins and loads do not know it. Tried
    are 1, 0.95, 0.9 ... 0, all at once.

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings; its own b does not count.
    most_overshoot : float
        Overshoot that may be. [%]
    scan_time, t_end : float
        Scan time and length of the simulation. [s]

    Raises
    ------
    ValueError
        The limit is negative, or the loop grows without bound.
    """
    if not 0 <= most_overshoot < math.inf:
        raise ValueError(f"most_overshoot must not be negative, got {most_overshoot}")
    batch = run_batch(
        [process],
        [replace(pid, b=float(b)) for b in WEIGHTS],
        Experiment(t_end=t_end, dt=scan_time, sp=1.0),
    )
    if np.any(batch.diverged):
        raise ValueError("the loop grows without bound, so that no weight helps")
    overshoots = [
        step_measures(batch.t, batch.pv[:, i], batch.op[:, i], sp=1.0, pv0=0.0).overshoot
        for i in range(WEIGHTS.size)
    ]
    good = [i for i, overshoot in enumerate(overshoots) if overshoot <= most_overshoot]
    chosen = good[0] if good else WEIGHTS.size - 1
    return WeightChoice(b=float(WEIGHTS[chosen]), overshoot=overshoots[chosen], enough=bool(good))


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterRatio:
    """One ratio N of the derivative filter, with what it keeps and what it moves.

    Attributes
    ----------
    N : float
        Td over the filter's time constant. [-]
    margins : Margins
        Margins of the scanned loop.
    movement : OutputMovement
        What the noise does to the output.
    """

    N: float
    margins: Margins
    movement: OutputMovement


def filter_ratios(
    process: Process, pid: PID, *, scan_time: float, noise: float
) -> tuple[FilterRatio, ...]:
    """Put margins and output movement of the usual ratios N side by side.

    A larger N keeps more of the derivative's phase lead and lets more noise through: the gain at
    high frequency is Kc (1 + N).

    Parameters
    ----------
    process : Process
        Process model.
    pid : PID
        Controller settings with a derivative; its own N does not count.
    scan_time : float
        Scan time. [s]
    noise : float
        Standard deviation of the sensor's white noise. [PV]

    Raises
    ------
    UnstableLoop
        The loop is unstable for one of the ratios.
    ValueError
        There is no derivative, or a number is impossible.
    """
    if not pid.Td:
        raise ValueError("without a derivative there is no filter ratio to choose")
    rows = []
    for N in FILTER_RATIOS:
        own = replace(pid, N=N)
        rows.append(
            FilterRatio(
                N=N,
                margins=margins(process, own, sample_time=scan_time),
                movement=output_movement(process, own, scan_time=scan_time, noise=noise),
            )
        )
    return tuple(rows)
