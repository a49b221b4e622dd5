"""Loops that disturb each other: several controllers on one plant, and cascades."""

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from loop.controller import PID
from loop.digital_pid import scan_laws
from loop.experiment import Experiment
from loop.process import Process, TransferFunction
from loop.process_motion import motion_of_one
from loop.sampled_process import sampled
from loop.scanning import Course, Traces, one_loop
from loop.simulation import Response


def simulate_interacting(
    processes: Sequence[Sequence[Process | None]],
    controllers: Sequence[PID],
    experiments: Sequence[Experiment],
) -> tuple[Response, ...]:
    """Run m loops whose outputs move each other's process variables.

    pv_i = sum_j P_ij (position_j + load_j) + output_load_i, each part moved exactly between scans.

    Parameters
    ----------
    processes : sequence of m sequences of m Process or None
        `processes[i][j]` leads from output j to PV i; None for no influence.
    controllers : sequence of PID, length m
        Controller of every loop.
    experiments : sequence of Experiment, length m
        What is done to every loop, with its own valve, faults, limits and rest; all of the same
        length and scan time.

    Returns
    -------
    tuple of Response, length m
        What every loop did.

    Raises
    ------
    LoopDiverged
        A loop grows without bound.
    ValueError
        The numbers of processes, controllers and experiments differ, or the experiments do not
        run in step.
    """
    m = len(controllers)
    if not m or len(experiments) != m or [len(row) for row in processes] != [m] * m:
        raise ValueError(
            f"{m} controllers need {m} experiments and {m} rows of {m} processes, got "
            f"{len(experiments)} and rows of {[len(row) for row in processes]}"
        )
    dt = _common_scan_time(experiments)
    moves = [[_motion(process, dt) for process in row] for row in processes]
    ends: list[Traces] = []
    loops = [_loop(pid, item, ends) for pid, item in zip(controllers, experiments, strict=True)]
    u = [next(loop) for loop in loops]
    for _ in range(experiments[0].t.size):
        pv = [sum(move(v) for move, v in zip(row, u, strict=True)) for row in moves]
        for i, loop in enumerate(loops):
            with suppress(StopIteration):
                u[i] = loop.send(pv[i])
    return tuple(map(Response.of, ends, experiments))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CascadeResponse:
    """What a cascade did.

    Attributes
    ----------
    outer : Response
        Outer loop; its output is the set point of the inner loop. [inner PV]
    inner : Response
        Inner loop.
    """

    outer: Response
    inner: Response


def simulate_cascade(
    outer_process: Process,
    inner_process: Process,
    outer_controller: PID,
    inner_controller: PID,
    *,
    outer: Experiment,
    inner: Experiment,
) -> CascadeResponse:
    """Run an outer loop whose output is the set point of an inner loop, both in every scan.

    inner PV = Pi (position + inner load) + inner output load, and
    outer PV = Po Pi (position + inner load) + Po (outer load) + outer output load, moved exactly
    between scans. The inner output load is the sensor's: it does not move the outer PV.

    Parameters
    ----------
    outer_process, inner_process : Process
        From inner PV to outer PV, and from the output to inner PV.
    outer_controller, inner_controller : PID
        Controllers. The outer one is not told when the inner one is at a limit; give it the
        limits of the inner set point that the inner loop can follow.
    outer, inner : Experiment
        What is done to the loops; `op0` of the outer one is `pv0` of the inner one, which has no
        set point of its own. An outer valve is not possible.

    Raises
    ------
    LoopDiverged
        A loop grows without bound.
    ValueError
        The experiments do not fit each other.
    """
    dt = _common_scan_time([outer, inner])
    if outer.op0 != inner.pv0 or inner.sp is not None or outer.valve is not None:
        raise ValueError(
            "the output of the outer loop is the set point of the inner one: op0 of the outer "
            f"({outer.op0}) and pv0 of the inner ({inner.pv0}) must agree, the inner sp must be "
            "left out, and a valve belongs to the inner loop"
        )
    remote: list[float] = []
    ends: list[Traces] = []
    outer_loop = _loop(outer_controller, replace(outer, load=0.0), ends)
    inner_loop = _loop(inner_controller, inner, ends, _taken(remote))
    move_inner = _motion(inner_process, dt)
    move_outer = _motion(_series(outer_process, inner_process), dt)
    push_outer = _motion(outer_process, dt)
    remote.append(next(outer_loop))
    u = next(inner_loop)
    for load in outer.input_load(outer.t).tolist():
        pv_outer, pv_inner = move_outer(u) + push_outer(load), move_inner(u)
        with suppress(StopIteration):
            remote.append(outer_loop.send(pv_outer))
        with suppress(StopIteration):
            u = inner_loop.send(pv_inner)
    return CascadeResponse(outer=Response.of(ends[0], outer), inner=Response.of(ends[1], inner))


def _common_scan_time(experiments: Sequence[Experiment]) -> float:
    first = experiments[0]
    if any((item.dt, item.t_end) != (first.dt, first.t_end) for item in experiments):
        raise ValueError(
            "loops that run together need the same scan time and length, got "
            f"{[(item.dt, item.t_end) for item in experiments]}"
        )
    return first.dt


def _motion(process: Process | None, dt: float) -> Callable[[float], float]:
    """Motion of a process from rest; 0 for no process."""
    return motion_of_one(sampled([process], dt)) if process else lambda _: 0.0


def _series(first: Process, second: Process) -> TransferFunction:
    return TransferFunction(
        tuple(np.polymul(first.numerator, second.numerator)),
        tuple(np.polymul(first.denominator, second.denominator)),
        first.theta + second.theta,
    )


def _loop(
    pid: PID, experiment: Experiment, ends: list[Traces], remote_sp: Iterator[float] | None = None
) -> Generator[float, float, None]:
    """Run everything of one loop but its process; its traces go to `ends`."""
    law = scan_laws([pid], experiment.dt, anti_windup=experiment.anti_windup, Tt=experiment.Tt)
    ends.append((yield from one_loop(law, Course.of(experiment), remote_sp)))


def _taken(remote: list[float]) -> Iterator[float]:
    while True:
        yield remote.pop()
