"""Closed-loop simulation of many loops in one call."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID
from loop.digital_pid import AntiWindup, OutputLimits, scan_laws
from loop.experiment import Experiment, Manual, Signal
from loop.process import Process
from loop.sampled_process import sampled
from loop.scanning import DIVERGED, Course, scan_many
from loop.sensor_faults import SensorFault
from loop.signals import Flags, Real
from loop.valve import Valve

# Four arrays of eight bytes a sample: 1.6 GB.
MOST_SAMPLES = 50_000_000

Batch = TypeVar("Batch", ProcessBatch, PIDBatch)
Rows: TypeAlias = npt.NDArray[np.intp]


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
        Process variables without noise, at full resolution; the same array as `pv` where the
        sensors show just that. [PV]
    position : ndarray, shape (n, m)
        Positions of the valves; without friction the same array as `op`. [OP]
    diverged : ndarray of bool, shape (m,)
        Loops that grow without bound; their traces end at a bound of 1e30.
    """

    t: Real
    sp: Real
    pv: Real
    op: Real
    true_pv: Real
    position: Real
    diverged: Flags


def simulate_batch(
    processes: Sequence[Process] | ProcessBatch,
    controllers: Sequence[PID] | PIDBatch,
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
    valve: Valve | None = None,
    faults: Sequence[SensorFault] = (),
    pv_filter: float = 0.0,
    manual: Manual | None = None,
) -> BatchResponse:
    """Run m loops from rest through the same experiment, by the law of `simulate`.

    Parameters
    ----------
    processes : sequence of Process, or ProcessBatch
        Process models; a single one serves every controller.
    controllers : sequence of PID, or PIDBatch
        Controller settings; a single one serves every process. A PIDBatch runs with the set-point
        weights b = 1 and c = 0. Batches broadcast against each other, and the m loops are those of
        the common shape, the last axis first.
    t_end, dt, rng, resolution, limits, anti_windup, Tt, pv0, op0
        As in `simulate`, the same for all loops.
    valve
        As in `simulate`; a valve with arrays of shape (m,) gives every loop its own.
    faults, pv_filter, manual
        As in `simulate`, the same for all loops; spikes fall in other scans for every loop.
    sp, load, output_load, noise
        As in `simulate`; an array of shape (n, m) gives every loop its own. A noise given by its
        standard deviation is independent from loop to loop.

    Raises
    ------
    ValueError
        A setting is impossible, or processes and controllers do not make pairs.
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
        valve=valve,
        faults=faults,
        pv_filter=pv_filter,
        manual=manual,
    )
    return run_batch(processes, controllers, experiment)


def run_batch(
    processes: Sequence[Process] | ProcessBatch,
    controllers: Sequence[PID] | PIDBatch,
    experiment: Experiment,
) -> BatchResponse:
    """Run m loops from rest through the same experiment, by the law of `simulate`.

    Parameters
    ----------
    processes : sequence of Process, or ProcessBatch
        Process models; a single one serves every controller.
    controllers : sequence of PID, or PIDBatch
        Controller settings; a single one serves every process.
    experiment : Experiment
        What is done to the loops.

    Raises
    ------
    ValueError
        A setting is impossible, or processes and controllers do not make pairs.
    """
    shape = _common_shape(processes, controllers)
    loops = math.prod(shape)
    if loops * experiment.t.size > MOST_SAMPLES:
        raise ValueError(
            f"{experiment.t.size} scans of {loops} loops are more than {MOST_SAMPLES:,} samples; "
            "take fewer loops at a time or a longer dt"
        )
    if isinstance(processes, ProcessBatch):
        plant = sampled(_broadcast(processes, shape), experiment.dt)
    else:
        plant = sampled(processes, experiment.dt).take(_rows(processes, shape))
    law = scan_laws(
        _broadcast(controllers, shape) if isinstance(controllers, PIDBatch) else controllers,
        experiment.dt,
        anti_windup=experiment.anti_windup,
        Tt=experiment.Tt,
    )
    if not isinstance(controllers, PIDBatch):
        law = law.take(_rows(controllers, shape))
    course = Course.of(experiment, loops=loops)
    traces = scan_many(plant, law, course)
    pv0, op0 = experiment.pv0, experiment.op0
    diverged = np.zeros(loops, dtype=bool)
    if not -DIVERGED < traces.pv.min() <= traces.pv.max() < DIVERGED:
        diverged = ~np.all(np.abs(traces.pv) < DIVERGED, axis=0)
    op = _from_rest(traces.op, diverged, op0)
    true_pv = _from_rest(traces.true_pv, diverged, pv0)
    sticks, hidden = traces.position is not traces.op, traces.pv is not traces.true_pv
    return BatchResponse(
        t=experiment.t,
        sp=course.sp + pv0,
        pv=_from_rest(traces.pv, diverged, pv0) if hidden else true_pv,
        op=op,
        true_pv=true_pv,
        position=_from_rest(traces.position, diverged, op0) if sticks else op,
        diverged=diverged,
    )


def _common_shape(
    processes: Sequence[Process] | ProcessBatch, controllers: Sequence[PID] | PIDBatch
) -> tuple[int, ...]:
    shapes = [
        group.shape if isinstance(group, (ProcessBatch, PIDBatch)) else (len(group),)
        for group in (processes, controllers)
    ]
    try:
        shape = np.broadcast_shapes(*shapes)
    except ValueError:
        shape = (0,)
    if 0 in shape:
        raise ValueError(
            f"processes of shape {shapes[0]} and controllers of shape {shapes[1]} do not make "
            "pairs; give as many of each, or one of either"
        )
    return shape


def _broadcast(batch: Batch, shape: tuple[int, ...]) -> Batch:
    arrays = (np.broadcast_to(getattr(batch, item.name), shape) for item in fields(batch))
    return type(batch)(*arrays)


def _rows(items: Sequence[object], shape: tuple[int, ...]) -> Rows:
    """Item of every loop."""
    return np.broadcast_to(np.arange(len(items)), shape).ravel()


def _from_rest(trace: Real, diverged: Flags, rest: float) -> Real:
    """Add the value at rest, in place for speed; bound what grew beyond it."""
    if np.any(diverged):
        grown = np.nan_to_num(trace[:, diverged], nan=DIVERGED)
        trace[:, diverged] = np.clip(grown, -DIVERGED, DIVERGED)
    if rest:
        trace += rest
    return trace
