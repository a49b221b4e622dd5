"""Gain scheduling: settings by operating point, and whether they hold between the points."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from loop.controller import PID
from loop.errors import UnstableLoop
from loop.margins import Margins, margins
from loop.process import FOPDT
from tuning.profiles import DEFAULT_PROFILE, Profile, profile_named
from tuning.shortfall import missed_margins
from tuning.simc import simc_pi


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulePoint:
    """Settings at one operating point.

    Attributes
    ----------
    at : float
        Value of the scheduling variable. [its own unit]
    process : FOPDT
        Process there.
    pid : PID
        Settings there.
    margins : Margins
        Margins there.
    """

    at: float
    process: FOPDT
    pid: PID
    margins: Margins


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduleGap:
    """What happens between two neighbouring points.

    Attributes
    ----------
    low, high : float
        The two points. [its own unit]
    held_Ms : float
        Largest Ms where the settings of one point meet the process of the other, as happens when
        the schedule steps; infinite if that is unstable. [-]
    between_Ms : float
        Ms half way, with settings and process interpolated, as happens when it is a line. [-]
    steps, lines : bool
        Whether the profile holds with a stepping and with an interpolating schedule.
    """

    low: float
    high: float
    held_Ms: float
    between_Ms: float
    steps: bool
    lines: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class GainSchedule:
    """A schedule of settings.

    Attributes
    ----------
    points : tuple of SchedulePoint
        By rising scheduling variable.
    gaps : tuple of ScheduleGap
        One less.
    profile : Profile
        Limits they were held to.
    sentence : str
        The answer in words.
    """

    points: tuple[SchedulePoint, ...]
    gaps: tuple[ScheduleGap, ...]
    profile: Profile
    sentence: str


def gain_schedule(
    processes: Sequence[tuple[float, FOPDT]],
    *,
    rule: Callable[[FOPDT], PID] | None = None,
    profile: str = DEFAULT_PROFILE,
) -> GainSchedule:
    """Tune at every operating point and say whether the points are close enough.

    Parameters
    ----------
    processes : sequence of (float, FOPDT)
        Scheduling variable and process at each operating point, two or more.
    rule : callable, optional
        Settings for a process; SIMC PI with tau_c = 2 theta if not given.
    profile : str
        Name of the profile to hold the margins to.

    Raises
    ------
    ValueError
        There are fewer than two points, two at the same place, or the gain changes its sign.
    UnstableLoop
        Settings at a point do not even hold there.
    """
    ordered = sorted(processes, key=lambda item: item[0])
    places = [at for at, _ in ordered]
    if len(ordered) < 2 or len(set(places)) < len(places) or not all(map(math.isfinite, places)):
        raise ValueError(f"a schedule needs two or more different operating points, got {places}")
    if len({process.K > 0 for _, process in ordered}) > 1:
        raise ValueError("the process gain changes its sign: no schedule of gains covers that")
    tune = rule or (lambda process: simc_pi(process, 2 * process.theta))
    limits = profile_named(profile)
    points = []
    for at, process in ordered:
        pid = tune(process)
        points.append(SchedulePoint(at=at, process=process, pid=pid, margins=margins(process, pid)))
    gaps = tuple(_gap(low, high, limits) for low, high in pairwise(points))
    return GainSchedule(
        points=tuple(points), gaps=gaps, profile=limits, sentence=_sentence(gaps, limits)
    )


def _gap(low: SchedulePoint, high: SchedulePoint, profile: Profile) -> ScheduleGap:
    pairs = [(low.process, high.pid), (high.process, low.pid)]
    swapped = [(process, _kept(process, pid)) for process, pid in pairs]
    middle = FOPDT(
        K=_mean(low.process.K, high.process.K),
        tau=_mean(low.process.tau, high.process.tau),
        theta=_mean(low.process.theta, high.process.theta),
    )
    between = _kept(middle, _half_way(low.pid, high.pid))
    return ScheduleGap(
        low=low.at,
        high=high.at,
        held_Ms=max(math.inf if kept is None else kept.Ms for _, kept in swapped),
        between_Ms=math.inf if between is None else between.Ms,
        steps=all(_holds(process, kept, profile) for process, kept in swapped),
        lines=_holds(middle, between, profile),
    )


def _kept(process: FOPDT, pid: PID) -> Margins | None:
    try:
        return margins(process, pid)
    except UnstableLoop:
        return None


def _holds(process: FOPDT, kept: Margins | None, profile: Profile) -> bool:
    return kept is not None and not missed_margins(kept, profile, process.theta)


def _half_way(low: PID, high: PID) -> PID:
    return PID(
        Kc=_mean(low.Kc, high.Kc),
        Ti=_mean(low.Ti, high.Ti),
        Td=_mean(low.Td, high.Td),
        N=_mean(low.N, high.N),
        tauF=_mean(low.tauF, high.tauF),
        action=low.action,
    )


def _mean(a: float, b: float) -> float:
    return 0.5 * (a + b)


def _sentence(gaps: tuple[ScheduleGap, ...], profile: Profile) -> str:
    wide = [gap for gap in gaps if not gap.steps]
    if not wide:
        return f"The profile {profile.name} holds at every point and over every step between."
    said = "; ".join(f"{gap.low:g} to {gap.high:g}, Ms {gap.held_Ms:.3g}" for gap in wide)
    tail = "Interpolating holds there."
    if not all(gap.lines for gap in wide):
        tail = "Interpolating does not hold everywhere either: add points."
    return f"A stepping schedule leaves the profile {profile.name} between {said}. {tail}"
