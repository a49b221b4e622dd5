"""Plan a test of a process that integrates: pulses that bring PV back, their errors, their limits.

A level or a pressure that integrates does not settle: a step would carry it away. A pulse moves it
by a known amount and a pulse the other way brings it back. As for steps (`identification.planner`)
the test is made large and long enough for every process that is off the guess by the stated factor.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from identification.held_answers import integral_answer
from identification.held_input import HeldInput
from identification.planner import (
    ABORT,
    CONFIDENT,
    MOST_SAMPLES,
    SMALLEST_ANSWER,
    check_wishes,
)
from loop.process import IPDT
from loop.signals import Real

# A ramp of five dead times is what an integrator is recognised by; one more for safety.
RAMP = 6.0
# Without a dead time the fastest answer is a sample: so many of them make a pulse.
SAMPLES_A_PULSE, SAMPLES_A_DEAD_TIME = 60, 10
# Pulses: one and one back, that twice and four times over; a single one where OP has no room.
PULSES, SINGLE = (2, 4, 8), (1,)
# Where the output has little room the pulse may last so many times longer.
LONGEST = 8.0
REST = 0.5
# The dead time alone bounds the speed of a loop: beyond +25 % settings lose half of their room.
DEAD_TIME = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseWishes:
    """What is known of an integrating process before a test, and what is wanted of it.

    Attributes
    ----------
    guess : IPDT
        Process as far as anybody knows, with a dead time.
    noise : float
        Standard deviation of PV's noise. [PV]
    deviation : float
        How far PV may move from rest. [PV]
    precision : float
        Wanted half-width of the 95 % interval of K, as a part of it; that of theta is held to a
        quarter of it, or to the same if that is more. [-]
    factor : float
        K and theta may each be so many times larger or smaller than guessed. [-]
    room_up, room_down : float
        How far OP may move up and down. [OP]
    sample_time : float, optional
        Time between samples, where it cannot be chosen. [s]
    """

    guess: IPDT
    noise: float
    deviation: float
    precision: float = 0.1
    factor: float = 1.5
    room_up: float = math.inf
    room_down: float = math.inf
    sample_time: float | None = None

    def __post_init__(self) -> None:
        check_wishes(self)
        if self.guess.theta <= 0 and self.sample_time is None:
            raise ValueError("a guess without dead time needs the sample time of the record")

    def corners(self) -> list[IPDT]:
        """The guess, and the processes off it by the factor in every parameter."""
        g, f = self.guess, self.factor
        off = [IPDT(K=g.K * a, theta=g.theta * b) for a, b in product((1 / f, f), repeat=2)]
        return [g, *off]


@dataclass(frozen=True, slots=True, kw_only=True)
class PulsePlan:
    """A test by pulses.

    Attributes
    ----------
    step : float
        Size of every pulse. [OP]
    times : tuple of float
        When OP moves, from the start of the record. [s]
    levels : tuple of float
        OP after each move, less OP at rest. [OP]
    rest, hold, duration : float
        Time before the first pulse and after each, length of each, and in all. [s]
    sample_time : float
        Longest time between samples. [s]
    answer : float
        What a pulse moves PV by, if the guess is right. [PV]
    expected_errors, largest_errors : tuple of float
        Standard errors of K and theta if the guess is right, and the largest for a process off it.
        [PV/OP/s], [s]
    expected_width, largest_width : float
        Half-width of the 95 % interval of K as a part of it, likewise. [-]
    reaches : bool
        Whether what is wanted is reached even if the guess is off by the factor.
    abort_deviation : float
        Stop the test when PV is further from rest than this. [PV]
    abort_silence : float
        Stop when PV has not moved so long after the first move. [s]
    abort_time : float
        Stop when the test has taken so long. [s]
    remarks : tuple of str
        What to know before running it.
    """

    step: float
    times: tuple[float, ...]
    levels: tuple[float, ...]
    rest: float
    hold: float
    duration: float
    sample_time: float
    answer: float
    expected_errors: tuple[float, float]
    largest_errors: tuple[float, float]
    expected_width: float
    largest_width: float
    reaches: bool
    abort_deviation: float
    abort_silence: float
    abort_time: float
    remarks: tuple[str, ...]


def plan_pulses(wishes: PulseWishes) -> PulsePlan:
    """Plan the shortest test by pulses that reaches the wanted precision.

    A pulse lasts six of the longest dead times, so that the ramp is seen, and is as large as the
    allowed deviation permits for the largest gain; a pulse back, and more of both, are added until
    the errors are small enough.

    Parameters
    ----------
    wishes : PulseWishes
        What is known and wanted.

    Examples
    --------
    >>> tank = IPDT(K=0.002, theta=10.0)
    >>> plan = plan_pulses(PulseWishes(guess=tank, noise=0.05, deviation=2.0))
    >>> plan.hold, round(plan.step, 2), len(plan.times), plan.reaches
    (90.0, 7.41, 4, True)
    """
    g, f = wishes.guess, wishes.factor
    sample_time = wishes.sample_time or g.theta / SAMPLES_A_DEAD_TIME / f
    hold = max(RAMP * f * g.theta, SAMPLES_A_PULSE * sample_time)
    room = max(wishes.room_up, wishes.room_down)
    step = wishes.deviation / (abs(g.K) * f * hold)
    limited = step > room
    if limited:
        step, hold = room, min(hold * step / room, LONGEST * hold)
    rest = REST * hold + 2 * f * g.theta
    first = 1.0 if wishes.room_up >= min(step, wishes.room_down) else -1.0
    both = min(wishes.room_up, wishes.room_down) >= step
    for pulses in PULSES if both else SINGLE:
        signs = [first if k % 2 == 0 else -first for k in range(pulses)]
        levels = step * np.array([level for sign in signs for level in (sign, 0.0)])
        times = np.array(
            [rest + k * (hold + rest) + part for k in range(pulses) for part in (0.0, hold)]
        )
        duration = rest + pulses * (hold + rest)
        errors = _errors(wishes, times, levels, duration, sample_time)
        widths = CONFIDENT * errors / _sizes(wishes)
        enough = widths[:, 0].max() <= wishes.precision
        enough &= widths[:, 1].max() <= max(DEAD_TIME, wishes.precision)
        if enough:
            break
    reaches, moved = bool(enough), abs(g.K) * step * hold
    return PulsePlan(
        step=step,
        times=tuple(times.tolist()),
        levels=tuple(levels.tolist()),
        rest=rest,
        hold=hold,
        duration=duration,
        sample_time=sample_time,
        answer=math.copysign(moved, g.K * first),
        expected_errors=_two(errors[0]),
        largest_errors=_two(errors.max(axis=0)),
        expected_width=float(widths[0, 0]),
        largest_width=float(widths[:, 0].max()),
        reaches=reaches,
        abort_deviation=ABORT * wishes.deviation,
        abort_silence=f * g.theta + f * SMALLEST_ANSWER * wishes.noise / (abs(g.K) * step),
        abort_time=1.5 * duration,
        remarks=_remarks(wishes, step, moved, limited=limited, both=both, reaches=reaches),
    )


def _errors(
    wishes: PulseWishes, times: Real, levels: Real, duration: float, sample_time: float
) -> Real:
    """Standard errors of K and theta for the guess, first, and the processes off it."""
    held = HeldInput(instants=times, levels=np.append(0.0, levels))
    count = int(duration / sample_time)
    used = min(count, MOST_SAMPLES)
    t = np.linspace(0.0, duration, used, endpoint=False)
    sd = wishes.noise * math.sqrt(used / count)
    found = []
    for process in wishes.corners():
        x = integral_answer(held, t, process.theta)
        passed = held.levels[(held.instants + process.theta).searchsorted(t, side="right")]
        # The output at which PV stands still is not known, so that a slope is fitted too.
        J = np.stack((x, -process.K * passed, np.ones_like(t), t))
        scale = np.linalg.norm(J, axis=1)
        information = (J / scale[:, None]) @ (J / scale[:, None]).T
        covariance = np.linalg.inv(information + 1e-12 * np.eye(4))
        found.append(sd * (np.sqrt(np.diag(covariance)) / scale)[:2])
    return np.array(found)


def _sizes(wishes: PulseWishes) -> Real:
    """What the errors of K and theta are held to; a dead time of nothing to a sample."""
    least = wishes.sample_time or 0.0
    return np.array([[abs(p.K), max(p.theta, least)] for p in wishes.corners()])


def _two(values: Real) -> tuple[float, float]:
    K, theta = values.tolist()
    return K, theta


def _remarks(
    wishes: PulseWishes, step: float, moved: float, *, limited: bool, both: bool, reaches: bool
) -> tuple[str, ...]:
    remarks = [
        f"a pulse moves PV by {moved:.3g} if the guess is right and by {moved * wishes.factor:.3g} "
        f"if the gain is {wishes.factor:g} times larger; PV stays there until the pulse back",
        "start with PV at rest, inflow and outflow equal: a drift is fitted, but eats room",
    ]
    if moved / wishes.factor < SMALLEST_ANSWER * wishes.noise:
        remarks.append(
            f"should the gain be {wishes.factor:g} times smaller, a pulse moves PV by "
            f"{moved / wishes.factor:.3g} only, {moved / wishes.factor / wishes.noise:.2g} times "
            "its noise: allow a larger deviation"
        )
    if limited:
        remarks.append(
            f"the room of OP and not the allowed deviation limits the pulse to {step:.3g}"
        )
    if not both:
        remarks.append(
            "OP has room in one direction only, so that one pulse is all there is: bring PV back "
            "by hand after the record"
        )
    if not reaches:
        remarks.append(
            f"the wanted ±{100 * wishes.precision:.2g} % are not reached: allow a larger "
            "deviation, sample faster or filter the noise"
        )
    return tuple(remarks)
