"""The one walk from settings to what they will do: simulated before anybody types them.

The command line, the REST service and a notebook all call these functions:

    from advice.scenario import SetPointChange
    from advice.what_if import what_if
    answer = what_if(process, {"new": new, "now": now}, [SetPointChange(size=5.0)])
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from advice.fan import Fan, fan_of, uncertain_processes
from advice.horizon import horizon
from advice.scenario import (
    Conditions,
    Event,
    LoadChange,
    Replay,
    SetPointChange,
    Transfer,
    experiment_of,
    replay_of,
)
from loop.batch import ProcessBatch
from loop.controller import PID
from loop.errors import LoopDiverged, UnstableLoop
from loop.experiment import Experiment
from loop.measures import (
    LoadMeasures,
    StepMeasures,
    load_measures,
    step_measures,
    total_variation,
)
from loop.process import Process
from loop.recorded_disturbance import RecordedDisturbance, recorded_disturbance
from loop.signals import Real
from loop.simulation import Response, run
from tuning.output_movement import OutputMovement, output_movement

# Two or three seconds of work: a run takes about two microseconds a scan, a fan a tenth of that.
MOST_SCANS = 1_000_000
MOST_FAN_SCANS = 20_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """What the output did.

    Attributes
    ----------
    travel : float
        Sum of all moves. [OP]
    largest_move : float
        Largest move in one scan. [OP]
    reversals : int
        Changes of direction. [-]
    at_limit : float
        Part of the scans at a limit of the range. [-]
    """

    travel: float
    largest_move: float
    reversals: int
    at_limit: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorMeasures:
    """How far PV was from the set point over a whole run.

    Attributes
    ----------
    mean, sd, largest : float
        Mean of sp - pv, its standard deviation, and the largest of either sign. [PV]
    IAE : float
        Sum of |sp - pv| dt. [PV s]
    """

    mean: float
    sd: float
    largest: float
    IAE: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """One controller in one event.

    Attributes
    ----------
    name : str
        Name of the controller.
    pid : PID
        Its settings.
    response : Response or None
        What the loop did; None where it grew without bound.
    measures : StepMeasures, LoadMeasures, ErrorMeasures or None
        From the true PV, which noise and resolution of the sensor do not touch.
    effort : Effort or None
        What the output did.
    bump : float or None
        Largest move of the output at the transfer, beyond one scan of integral action. [OP]
    fan : Fan or None
        The same event on every process of the uncertainty set.
    trouble : str
        Why there is no response; empty where there is one.
    """

    name: str
    pid: PID
    response: Response | None = None
    measures: StepMeasures | LoadMeasures | ErrorMeasures | None = None
    effort: Effort | None = None
    bump: float | None = None
    fan: Fan | None = None
    trouble: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """All controllers in one event.

    Attributes
    ----------
    event : Event
        What happened.
    runs : tuple of Run
        One for every controller.
    replayed : RecordedDisturbance or None
        The record of a replay.
    recorded_measures : ErrorMeasures or None
        What the record itself reached, to compare a replay with.
    """

    event: Event
    runs: tuple[Run, ...]
    replayed: RecordedDisturbance | None = None
    recorded_measures: ErrorMeasures | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WhatIf:
    """What settings will do.

    Attributes
    ----------
    process : Process
        Process of the runs.
    conditions : Conditions
        What was between the settings and the process.
    scan_time, t_end : float
        Scan time and length of the runs; a replay is as long as its record. [s]
    draws : int
        Processes in the fan, 0 for no fan. [-]
    answers : tuple of Answer
        One for every event.
    movements : dict of OutputMovement
        What the noise does to the output of each controller in a day; empty without noise, and
        without those whose loop is unstable.
    """

    process: Process
    conditions: Conditions
    scan_time: float
    t_end: float
    draws: int
    answers: tuple[Answer, ...]
    movements: dict[str, OutputMovement]


def what_if(
    process: Process,
    controllers: Mapping[str, PID],
    events: Sequence[Event],
    *,
    conditions: Conditions | None = None,
    draws: Real | None = None,
) -> WhatIf:
    """Run every controller through every event.

    Parameters
    ----------
    process : Process
        Process model; a fan needs FOPDT, SOPDT, IPDT or DoubleIntegrator.
    controllers : mapping from name to PID
        Settings to compare, such as the new and the running ones.
    events : sequence of Event
        What happens to the loop.
    conditions : Conditions, optional
        Scan time, limits, noise, valve and so on.
    draws : ndarray, shape (k, p), optional
        Other processes that the data allow, parameters in the order of the process's own; every
        set-point and load change is run on each of them.

    Raises
    ------
    ValueError
        There is nothing to run, a setting is impossible, or the runs would take too long.
    """
    if not controllers or not events:
        raise ValueError("a simulation needs at least one controller and one event")
    conditions = conditions or Conditions()
    long, fine = horizon(process, list(controllers.values()))
    scan_time, t_end = conditions.scan_time or fine, conditions.t_end or long
    others = None if draws is None else uncertain_processes(process, draws)
    count = 0 if others is None else others.shape[0]
    _check_work(t_end, scan_time, len(controllers) * len(events), count)
    _check_waiting(process.theta, scan_time, 1)
    if others is not None:
        _check_waiting(float(np.max(others.theta)), scan_time, count)
    return WhatIf(
        process=process,
        conditions=conditions,
        scan_time=scan_time,
        t_end=t_end,
        draws=0 if others is None else others.shape[0],
        answers=tuple(
            _answer(event, process, controllers, conditions, (t_end, scan_time), others)
            for event in events
        ),
        movements=_movements(process, controllers, conditions, scan_time),
    )


def _check_work(t_end: float, scan_time: float, runs: int, draws: int) -> None:
    scans = t_end / scan_time
    if not 1 <= scans <= MOST_SCANS / runs or scans * runs * draws > MOST_FAN_SCANS:
        raise ValueError(
            f"{t_end:.6g} s at a scan time of {scan_time:.6g} s are {scans:.6g} scans, in {runs} "
            f"runs on {max(draws, 1)} processes; possible are 1 to {MOST_SCANS:,} scans over all "
            f"runs, and {MOST_FAN_SCANS:,} with a fan. Change t_end or scan_time"
        )


def _check_waiting(theta: float, scan_time: float, draws: int) -> None:
    """Refuse a dead time of so many scans that the outputs on their way would fill the memory."""
    most = min(MOST_SCANS, MOST_FAN_SCANS / draws)
    if theta / scan_time > most:
        raise ValueError(
            f"a dead time of {theta:.6g} s is {theta / scan_time:.6g} scans of {scan_time:.6g} s; "
            f"possible are {most:,.0f}. Change scan_time"
        )


def _movements(
    process: Process, controllers: Mapping[str, PID], given: Conditions, scan_time: float
) -> dict[str, OutputMovement]:
    found = {}
    for name, pid in controllers.items() if given.noise else ():
        with suppress(UnstableLoop, ValueError):  # lost, or too slow against its scan to be summed
            found[name] = output_movement(
                process, pid, scan_time=scan_time, noise=given.noise, pv_filter=given.pv_filter
            )
    return found


def _answer(
    event: Event,
    process: Process,
    controllers: Mapping[str, PID],
    conditions: Conditions,
    length: tuple[float, float],
    others: ProcessBatch | None,
) -> Answer:
    t_end, dt = length
    if isinstance(event, Replay):
        dt = conditions.scan_time or event.record.sample_time
        replayed = recorded_disturbance(event.record, process, dt=dt)
        t_end = (replayed.pv.size - 1) * dt
        _check_work(t_end, dt, len(controllers), 0)
        experiment = replay_of(replayed, conditions, t_end)
        others = None
    else:
        replayed, experiment = None, experiment_of(event, conditions, t_end, dt)
    runs = tuple(
        _run(name, pid, event, process, experiment, others) for name, pid in controllers.items()
    )
    recorded = None if replayed is None else _errors(replayed.sp - replayed.pv, dt)
    return Answer(event=event, runs=runs, replayed=replayed, recorded_measures=recorded)


def _run(
    name: str,
    pid: PID,
    event: Event,
    process: Process,
    experiment: Experiment,
    others: ProcessBatch | None,
) -> Run:
    steps = isinstance(event, SetPointChange | LoadChange)
    fan = fan_of(others, pid, experiment) if steps and others is not None else None
    try:
        response = run(process, pid, experiment)
    except LoopDiverged as reason:
        return Run(name=name, pid=pid, fan=fan, trouble=str(reason))
    return Run(
        name=name,
        pid=pid,
        response=response,
        measures=_measures(event, response, experiment),
        effort=_effort(response, experiment),
        bump=_bump(pid, response, experiment) if isinstance(event, Transfer) else None,
        fan=fan,
    )


def _measures(
    event: Event, response: Response, experiment: Experiment
) -> StepMeasures | LoadMeasures | ErrorMeasures:
    t, pv, op = response.t, response.true_pv, response.op
    match event:
        case SetPointChange(size=size):
            return step_measures(
                t, pv, op, sp=experiment.pv0 + size, pv0=experiment.pv0, op_before=experiment.op0
            )
        case LoadChange():
            return load_measures(t, pv, op, sp=experiment.pv0, op_before=experiment.op0)
        case _:
            return _errors(response.sp - pv, experiment.dt)


def _errors(error: Real, dt: float) -> ErrorMeasures:
    return ErrorMeasures(
        mean=float(error.mean()),
        sd=float(error.std()),
        largest=float(np.max(np.abs(error))),
        IAE=float(np.abs(error).sum() * dt),
    )


def _effort(response: Response, experiment: Experiment) -> Effort:
    moves = np.diff(response.op, prepend=experiment.op0)
    ways = np.sign(moves[moves != 0])
    low, high = experiment.limits.low, experiment.limits.high
    return Effort(
        travel=total_variation(response.op, before=experiment.op0),
        largest_move=float(np.max(np.abs(moves))),
        reversals=int(np.count_nonzero(np.diff(ways))),
        at_limit=float(np.mean((response.op <= low) | (response.op >= high))),
    )


def _bump(pid: PID, response: Response, experiment: Experiment) -> float:
    """Move at the first scan in automatic, less the integral action of one scan."""
    assert experiment.manual is not None  # noqa: S101 - a transfer starts in manual
    k = int(np.argmax(response.t >= experiment.manual.until))
    error = (response.sp - response.pv)[k]
    move = abs(float(response.op[k] - response.op[k - 1]))
    return max(move - pid.Kc * abs(float(error)) * experiment.dt / pid.Ti, 0.0)
