"""Closed-loop simulation of many loops in one call."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits, scan_laws
from loop.experiment import Experiment, Signal
from loop.process import Process
from loop.sampled_process import sampled
from loop.scanning import DIVERGED, Course, scan_many
from loop.signals import Flags, Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BatchResponse:
    """What m simulated loops did.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Instants of the scans. [s]
    sp : ndarray, shape (n,) or (n, m)
        Set point. [PV]
    pv : ndarray, shape (n, m)
        Process variables as the sensors show them. [PV]
    op : ndarray, shape (n, m)
        Controller outputs, held until the next scan. [OP]
    true_pv : ndarray, shape (n, m)
        Process variables without noise, at full resolution. [PV]
    diverged : ndarray of bool, shape (m,)
        Loops that grow without bound; their traces end at a bound of 1e30.
    """

    t: Real
    sp: Real
    pv: Real
    op: Real
    true_pv: Real
    diverged: Flags


def simulate_batch(
    processes: Sequence[Process],
    controllers: Sequence[PID],
    *,
    t_end: float,
    dt: float,
    sp: Signal | None = None,
    load: Signal = 0.0,
    output_load: Signal = 0.0,
    noise: float | Real = 0.0,
    rng: np.random.Generator | None = None,
    resolution: float = 0.0,
    limits: OutputLimits | None = None,
    anti_windup: AntiWindup = AntiWindup.BACK_CALCULATION,
    Tt: float | None = None,
    pv0: float = 0.0,
    op0: float = 0.0,
) -> BatchResponse:
    """Run m loops from rest through the same experiment, by the law of `simulate`.

    Parameters
    ----------
    processes : sequence of Process, length m or 1
        Process models; a single one serves every controller.
    controllers : sequence of PID, length m or 1
        Controller settings; a single one serves every process.
    t_end, dt, rng, resolution, limits, anti_windup, Tt, pv0, op0
        As in `simulate`, the same for all loops.
    sp, load, output_load, noise
        As in `simulate`; an array of shape (n, m) gives every loop its own. A noise given by its
        standard deviation is independent from loop to loop.

    Raises
    ------
    ValueError
        A setting is impossible, or the lengths do not match.
    """
    experiment = Experiment(
        t_end=t_end,
        dt=dt,
        sp=sp,
        load=load,
        output_load=output_load,
        noise=noise,
        rng=rng,
        resolution=resolution,
        limits=limits or OutputLimits(),
        anti_windup=anti_windup,
        Tt=Tt,
        pv0=pv0,
        op0=op0,
    )
    loops = _common_length(len(processes), len(controllers))
    plant = sampled([*processes] * (loops // len(processes)), dt)
    law = scan_laws(
        [*controllers] * (loops // len(controllers)), dt, anti_windup=anti_windup, Tt=Tt
    )
    course = Course.of(experiment, loops=loops)
    traces = scan_many(plant, law, course)
    diverged = ~np.all(np.abs(traces.pv) < DIVERGED, axis=0)
    return BatchResponse(
        t=experiment.t,
        sp=course.sp + pv0,
        pv=_from_rest(traces.pv, diverged, pv0),
        op=_from_rest(traces.op, diverged, op0),
        true_pv=_from_rest(traces.true_pv, diverged, pv0),
        diverged=diverged,
    )


def _common_length(processes: int, controllers: int) -> int:
    longest = max(processes, controllers)
    if not (processes and controllers and {processes, controllers} <= {1, longest}):
        raise ValueError(
            f"{processes} processes and {controllers} controllers do not make pairs; "
            "give as many of each, or one of either"
        )
    return longest


def _from_rest(trace: Real, diverged: Flags, rest: float) -> Real:
    """Add the value at rest, in place for speed; bound what grew beyond it."""
    if np.any(diverged):
        grown = np.nan_to_num(trace[:, diverged], nan=DIVERGED)
        trace[:, diverged] = np.clip(grown, -DIVERGED, DIVERGED)
    trace += rest
    return trace
