"""The one walk from a process and a controller to everything the classical toolbox says of them.

The command line, the REST service and a notebook all call this:

    from advice.analyse import analyse
    analysis = analyse(FOPDT(K=2, tau=120, theta=30), PID(Kc=0.45, Ti=135, Td=13.3))
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from loop.bode_integral import BodeIntegral, bode_integral
from loop.closed_loop_poles import ClosedLoopPoles, closed_loop_poles
from loop.compensators import Compensator, in_series
from loop.controller import PID
from loop.errors import INFINITELY_MANY, UnstableLoop
from loop.frequency_curves import Bandwidths, FrequencyCurves, bandwidths, frequency_curves
from loop.internal_stability import InternalStability, internal_stability
from loop.margins import Margins, margins
from loop.nyquist import NyquistCount, nyquist_count
from loop.process import LARGEST, Process
from loop.root_locus import RootLocus, root_locus
from loop.routh_hurwitz import RouthArray, characteristic_polynomial, routh_array
from tuning.beyond_pid import BeyondPID, beyond_pid
from tuning.load_limits import (
    CrossoverWindow,
    Disturbance,
    DisturbanceAnswer,
    LowestPeak,
    crossover_window,
    disturbance_answer,
    lowest_peak,
)
from tuning.performance_limits import (
    Feasibility,
    Limit,
    crossover_feasibility,
    fastest_crossover,
    performance_limits,
)
from tuning.profiles import DEFAULT_PROFILE, Profile, profile_named
from tuning.shortfall import missed_margins

Part = TypeVar("Part")


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """What the loop has to do; whatever is not stated is not asked.

    Attributes
    ----------
    load : float or None
        Largest load step at the process input. [OP]
    allowed : float or None
        Deviation of PV that may happen. [PV]
    frequency : float or None
        Highest frequency of the load. [rad/s]
    ramp : float or None
        Fastest lasting change of the load. [OP/s]
    unmodelled : float
        Lags and dead times that the model leaves out, together. [s]
    op_room : float or None
        How far the output can move from where it rests. [OP]
    set_point_change : float or None
        Largest change of the set point. [PV]
    relative_gain : float or None
        Relative gain of the pairing. [-]
    wc : float or None
        Gain crossover wanted. [rad/s]
    """

    load: float | None = None
    allowed: float | None = None
    frequency: float | None = None
    ramp: float | None = None
    unmodelled: float = 0.0
    op_room: float | None = None
    set_point_change: float | None = None
    relative_gain: float | None = None
    wc: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Analysis:
    """Everything said of one loop; a part that has no answer is None, and a note says why.

    Attributes
    ----------
    process : Process
        The process as it was stated.
    controller : PID
        Controller settings.
    compensators : tuple of Compensator
        Compensators in series.
    scan_time : float
        Scan time, half of which counts as dead time in everything here. [s]
    profile : Profile
        Limits to hold the margins to.
    unstable : int
        Closed-loop poles in the closed right half-plane.
    margins : Margins or None
        Margins; None for an unstable loop.
    passes : bool
        Whether the margins at the model keep the profile.
    bandwidths, curves, stability
        Frequency responses and internal stability; always there.
    nyquist, poles, locus, routh, bode
        None where the loop does not allow them.
    pade_order : int or None
        Order of the Padé approximation in Routh's array; None where it is exact or not there.
    limits : tuple of Limit
        What dead time, unstable poles and right half-plane zeros bound.
    fastest : float
        Highest crossover a PID can have with the profile's phase margin. [rad/s]
    feasibility, peak, window, beyond, disturbances
        Answers to the task.
    notes : tuple of str
        Why a part is missing.
    """

    process: Process
    controller: PID
    compensators: tuple[Compensator, ...]
    scan_time: float
    profile: Profile
    unstable: int
    margins: Margins | None
    passes: bool
    bandwidths: Bandwidths
    curves: FrequencyCurves
    stability: InternalStability
    nyquist: NyquistCount | None
    poles: ClosedLoopPoles | None
    locus: RootLocus | None
    routh: RouthArray | None
    pade_order: int | None
    bode: BodeIntegral | None
    limits: tuple[Limit, ...]
    fastest: float
    feasibility: Feasibility | None
    peak: LowestPeak | None
    window: CrossoverWindow | None
    beyond: BeyondPID
    disturbances: tuple[DisturbanceAnswer, ...]
    notes: tuple[str, ...]


def analyse(
    process: Process,
    controller: PID,
    *,
    compensators: Sequence[Compensator] = (),
    scan_time: float = 0.0,
    profile: str = DEFAULT_PROFILE,
    task: Task | None = None,
    points: int = 300,
    pade_order: int | None = None,
) -> Analysis:
    """Say everything the classical toolbox says of a loop, with exact dead time.

    Parameters
    ----------
    process : Process
        Process model, stable or not.
    controller : PID
        Controller settings; the loop need not be stable.
    compensators : sequence of Compensator
        Compensators in series with the controller.
    scan_time : float
        Scan time of the controller; half of it counts as dead time. [s]
    profile : str
        Name of the profile that the margins are held to.
    task : Task, optional
        What the loop has to do.
    points : int
        Frequencies of the curves, beside the crossovers.
    pade_order : int, optional
        Order of the Padé approximation that takes a dead time into Routh's array; without it a
        loop with dead time has no array.

    Raises
    ------
    ValueError
        A number cannot be.
    """
    if not 0 <= scan_time <= LARGEST:
        raise ValueError(f"scan_time must lie within 0 and {LARGEST:g} s, got {scan_time}")
    wanted, limits = task or Task(), profile_named(profile)
    held = replace(process, theta=process.theta + scan_time / 2) if scan_time else process
    whole = in_series(held, compensators)
    notes: list[str] = []
    stability = internal_stability(held, controller, compensators=compensators)
    if stability.unstable:
        notes.append(str(UnstableLoop(stability.unstable)))
    known = None if stability.unstable else margins(whole, controller)
    loops_on = stability.unstable == INFINITELY_MANY

    def part(name: str, work: Callable[[], Part]) -> Part | None:
        """Try a part that not every loop has."""
        try:
            return work()
        except (ValueError, UnstableLoop) as error:
            notes.append(f"{name}: {error}")
            return None

    return Analysis(
        process=process,
        controller=controller,
        compensators=tuple(compensators),
        scan_time=scan_time,
        profile=limits,
        unstable=stability.unstable,
        margins=known,
        passes=known is not None and not missed_margins(known, limits, held.theta),
        bandwidths=bandwidths(whole, controller),
        curves=frequency_curves(held, controller, compensators=compensators, points=points),
        stability=stability,
        nyquist=part("Nyquist count", lambda: nyquist_count(whole, controller)),
        poles=None
        if loops_on
        else part("Closed-loop poles", lambda: closed_loop_poles(whole, controller)),
        locus=None if loops_on else part("Root locus", lambda: root_locus(whole, controller)),
        routh=None
        if whole.theta and pade_order is None
        else part(
            "Routh's array",
            lambda: routh_array(
                characteristic_polynomial(
                    whole, controller, pade_order=pade_order if whole.theta else None
                )
            ),
        ),
        pade_order=pade_order if whole.theta else None,
        bode=None
        if known is None
        else part("Bode's integral", lambda: bode_integral(whole, controller)),
        limits=performance_limits(held),
        fastest=fastest_crossover(held, limits.phase),
        feasibility=None
        if wanted.wc is None
        else crossover_feasibility(
            held, wanted.wc, phase=limits.phase, Ms=limits.Ms, N=controller.N
        ),
        peak=None
        if wanted.load is None
        else lowest_peak(process, wanted.load, allowed=wanted.allowed),
        window=_window(held, wanted),
        beyond=beyond_pid(
            process,
            load=wanted.load,
            allowed=wanted.allowed,
            op_room=wanted.op_room,
            set_point_change=wanted.set_point_change,
            relative_gain=wanted.relative_gain,
        ),
        disturbances=()
        if known is None
        else _disturbances(held, controller, tuple(compensators), wanted),
        notes=tuple(notes),
    )


def _window(process: Process, task: Task) -> CrossoverWindow | None:
    if task.frequency is None and not task.unmodelled:
        return None
    return crossover_window(
        process,
        load=task.load or 0.0,
        frequency=task.frequency,
        allowed=task.allowed,
        unmodelled=task.unmodelled,
    )


def _disturbances(
    process: Process, controller: PID, compensators: tuple[Compensator, ...], task: Task
) -> tuple[DisturbanceAnswer, ...]:
    """What stays of a lasting step, ramp and sinusoid of the load, for a stable loop."""
    courses = []
    if task.load is not None:
        courses.append((Disturbance.STEP, task.load))
        if task.frequency is not None:
            courses.append((Disturbance.SINUSOID, task.load))
    if task.ramp is not None:
        courses.append((Disturbance.RAMP, task.ramp))
    return tuple(
        disturbance_answer(
            process,
            controller,
            course,
            size,
            frequency=task.frequency,
            compensators=compensators,
        )
        for course, size in courses
    )
