"""Plan a step test before it is run: moves, holds, sample time, expected errors, abort limits.

The errors are those that the test will leave in a fit by least squares, from the Fisher information
of the planned moves. Because nobody plans a test on a process that is known, they are worked out
for every process that is off the guess by the stated factor, and the test is made large and long
enough for the worst of them.
"""

import math
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np

from identification.held_input import HeldInput, lag_response
from loop.process import FOPDT
from loop.signals import Real

# A hold of so many time constants shows 97 % of the final change.
HOLD = 3.5
# Samples of the shorter of time constant and dead time; a dead time far below the time constant
# does not ask for more samples than a fiftieth of it.
FINE, FINEST = 10.0, 50.0
# Rest before the first move, as a part of a hold, and in samples at least.
REST, REST_SAMPLES = 0.25, 20
# Moves to try: one step, up and back, up back down back, and that two and four times over.
MOVES = (1, 2, 4, 8, 16)
# PV may pass the allowed deviation by this part of it before the test is to be stopped; a process
# off by more than the stated factor would.
ABORT = 1.25
# An answer must stand out of the noise by so much for the test to be worth running.
SMALLEST_ANSWER = 5.0
CONFIDENT = 1.96
MOST_SAMPLES = 5000


class Limits(Protocol):
    """What every plan is given beside the process."""

    @property
    def noise(self) -> float:
        """Standard deviation of PV's noise. [PV]"""

    @property
    def deviation(self) -> float:
        """How far PV may move from rest. [PV]"""

    @property
    def precision(self) -> float:
        """Wanted half-width of the 95 % intervals. [-]"""

    @property
    def factor(self) -> float:
        """How many times parameters may be off. [-]"""

    @property
    def room_up(self) -> float:
        """How far OP may move up. [OP]"""

    @property
    def room_down(self) -> float:
        """How far OP may move down. [OP]"""

    @property
    def sample_time(self) -> float | None:
        """Time between samples. [s]"""


def check_wishes(wishes: Limits) -> None:
    """Refuse limits that no test can keep.

    Parameters
    ----------
    wishes : Limits
        What is wanted of a test.

    Raises
    ------
    ValueError
        A number cannot be.
    """
    for name in ("noise", "deviation", "precision"):
        if not 0 < getattr(wishes, name) < math.inf:
            raise ValueError(f"{name} must be positive, got {getattr(wishes, name)}")
    if not 1 <= wishes.factor <= 5:
        raise ValueError(f"factor must lie within 1 and 5, got {wishes.factor}")
    room = wishes.room_up + wishes.room_down
    if not (wishes.room_up >= 0 and wishes.room_down >= 0 and room > 0):
        raise ValueError(
            "room_up and room_down must not be negative nor both 0, got "
            f"{wishes.room_up} and {wishes.room_down}"
        )
    if wishes.sample_time is not None and not 0 < wishes.sample_time < math.inf:
        raise ValueError(f"sample_time must be positive, got {wishes.sample_time}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What is known before a test, and what is wanted of it.

    Attributes
    ----------
    guess : FOPDT
        Process as far as anybody knows.
    noise : float
        Standard deviation of PV's noise. [PV]
    deviation : float
        How far PV may move from rest. [PV]
    precision : float
        Wanted half-width of the 95 % intervals: of K and tau relative to themselves, of theta
        relative to tau + theta. [-]
    factor : float
        K, tau and theta may each be so many times larger or smaller than guessed. [-]
    room_up, room_down : float
        How far OP may move up and down. [OP]
    sample_time : float, optional
        Time between samples, where it cannot be chosen. [s]
    """

    guess: FOPDT
    noise: float
    deviation: float
    precision: float = 0.1
    factor: float = 1.5
    room_up: float = math.inf
    room_down: float = math.inf
    sample_time: float | None = None

    def __post_init__(self) -> None:
        check_wishes(self)

    def corners(self) -> list[FOPDT]:
        """The guess, and the processes off it by the factor in every parameter."""
        g, f = self.guess, self.factor
        return [
            g,
            *(
                FOPDT(K=g.K * a, tau=g.tau * b, theta=g.theta * c)
                for a, b, c in product((1 / f, f), repeat=3)
            ),
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class StepPlan:
    """A step test to run.

    Attributes
    ----------
    step : float
        Size of every move. [OP]
    times : tuple of float
        When OP moves, from the start of the record. [s]
    levels : tuple of float
        OP after each move, less OP at rest. [OP]
    rest, hold, duration : float
        Time before the first move, after each, and in all. [s]
    sample_time : float
        Longest time between samples. [s]
    answer : float
        Final change of PV after the first move, if the guess is right. [PV]
    expected_errors, largest_errors : tuple of float
        Standard errors of K, tau, theta if the guess is right, and the largest of each for a
        process off it by the factor. [PV/OP], [s], [s]
    expected_width, largest_width : float
        The same as the widest relative half-width of the 95 % intervals, against which the wanted
        precision is held. [-]
    reaches : bool
        Whether the wanted precision is reached even if the guess is off by the factor.
    abort_deviation : float
        Stop the test and put OP back when PV is further from rest than this. [PV]
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
    expected_errors: tuple[float, float, float]
    largest_errors: tuple[float, float, float]
    expected_width: float
    largest_width: float
    reaches: bool
    abort_deviation: float
    abort_silence: float
    abort_time: float
    remarks: tuple[str, ...]


def plan_steps(wishes: Wishes) -> StepPlan:
    """Plan the shortest step test that reaches the wanted precision.

    The step is as large as the allowed deviation permits for the largest gain; a hold lasts
    theta + 3.5 tau of the slowest process; moves are added until the errors are small enough.

    Parameters
    ----------
    wishes : Wishes
        What is known and wanted.

    Examples
    --------
    >>> heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    >>> plan = plan_steps(Wishes(guess=heater, noise=0.2, deviation=9.0))
    >>> plan.step, len(plan.times), plan.reaches
    (3.0, 1, True)
    """
    g, f = wishes.guess, wishes.factor
    step = wishes.deviation / (abs(g.K) * f)
    room = max(wishes.room_up, wishes.room_down)
    limited = step > room
    step = min(step, room)
    hold = f * (g.theta + HOLD * g.tau)
    sample_time = wishes.sample_time or sample_time_for(g, f)
    rest = max(REST * hold, REST_SAMPLES * sample_time)
    first = 1.0 if wishes.room_up >= min(step, wishes.room_down) else -1.0
    both = min(wishes.room_up, wishes.room_down) >= step
    for moves in MOVES:
        pattern = [first, 0.0, -first if both else first, 0.0] * 4
        levels = step * np.array(pattern[:moves])
        errors, widths = _errors(wishes, levels, rest, hold, sample_time)
        if widths.max() <= wishes.precision:
            break
    reaches = bool(widths.max() <= wishes.precision)
    duration = rest + moves * hold
    return StepPlan(
        step=step,
        times=tuple(rest + hold * k for k in range(moves)),
        levels=tuple(levels.tolist()),
        rest=rest,
        hold=hold,
        duration=duration,
        sample_time=sample_time,
        answer=g.K * step * first,
        expected_errors=_three(errors[0]),
        largest_errors=_three(errors.max(axis=0)),
        expected_width=float(widths[0]),
        largest_width=float(widths.max()),
        reaches=reaches,
        abort_deviation=ABORT * wishes.deviation,
        abort_silence=f * f * (g.theta + g.tau),
        abort_time=1.5 * duration,
        remarks=_remarks(wishes, step, sample_time, limited=limited, reaches=reaches),
    )


def sample_time_for(guess: FOPDT, factor: float) -> float:
    """Longest sample time that still resolves the fastest process near the guess. [s]

    A tenth of the shorter of tau and theta, but no less than a fiftieth of tau.

    Parameters
    ----------
    guess : FOPDT
        Process as far as anybody knows.
    factor : float
        How many times faster it may be.
    """
    return min(guess.tau / FINE, max(guess.theta / FINE, guess.tau / FINEST)) / factor


def planned_errors(
    process: FOPDT, held: HeldInput, *, duration: float, sample_time: float, noise: float
) -> Real:
    """Standard errors of K, tau, theta that a test leaves in a least-squares fit.

    The inverse of the Fisher information J'J/noise^2, with J the slopes of PV with respect to K,
    tau, theta and PV at rest.

    Parameters
    ----------
    process : FOPDT
        Process.
    held : HeldInput
        Output of the test. [OP]
    duration, sample_time : float
        Length of the record and time between its samples. [s]
    noise : float
        Standard deviation of PV's noise, white. [PV]

    Returns
    -------
    ndarray, shape (3,)
        [PV/OP], [s], [s]
    """
    count = int(duration / sample_time)
    # Very many samples act like fewer that are each known better.
    used = min(count, MOST_SAMPLES)
    t = np.linspace(0.0, duration, used, endpoint=False)
    x, d_tau, d_theta = lag_response(held, t, process.tau, process.theta)
    J = np.stack((x, process.K * d_tau, process.K * d_theta, np.ones_like(t)))
    scale = np.linalg.norm(J, axis=1)
    scale[scale == 0] = 1.0
    information = (J / scale[:, None]) @ (J / scale[:, None]).T
    # A direction that the test does not show at all keeps a huge error instead of none.
    covariance = np.linalg.inv(information + 1e-12 * np.eye(4))
    sd = noise * math.sqrt(used / count) if count else math.inf
    return np.asarray(sd * (np.sqrt(np.diag(covariance)) / scale)[:3])


def relative_width(process: FOPDT, errors: Real) -> float:
    """Widest half-width of the 95 % intervals, as the verdict on a model counts it. [-]

    Parameters
    ----------
    process : FOPDT
        Process.
    errors : ndarray, shape (3,)
        Standard errors of K, tau, theta.
    """
    sizes = np.array([abs(process.K), process.tau, process.tau + process.theta])
    return float(np.max(CONFIDENT * errors / sizes))


def _errors(
    wishes: Wishes, levels: Real, rest: float, hold: float, sample_time: float
) -> tuple[Real, Real]:
    """Errors and widths for the guess, first, and every process off it by the factor."""
    held = HeldInput(instants=rest + hold * np.arange(levels.size), levels=np.append(0.0, levels))
    duration = rest + hold * levels.size
    errors, widths = [], []
    for process in wishes.corners():
        found = planned_errors(
            process, held, duration=duration, sample_time=sample_time, noise=wishes.noise
        )
        errors.append(found)
        widths.append(relative_width(process, found))
    return np.array(errors), np.array(widths)


def _remarks(
    wishes: Wishes, step: float, sample_time: float, *, limited: bool, reaches: bool
) -> tuple[str, ...]:
    remarks = [
        f"PV moves by {abs(wishes.guess.K) * step:.3g} if the guess is right and by "
        f"{abs(wishes.guess.K) * step * wishes.factor:.3g} if the gain is {wishes.factor:g} times "
        "larger"
    ]
    smallest = abs(wishes.guess.K) * step / wishes.factor
    if smallest < SMALLEST_ANSWER * wishes.noise:
        remarks.append(
            f"should the gain be {wishes.factor:g} times smaller, PV moves by {smallest:.3g} only, "
            f"{smallest / wishes.noise:.2g} times its noise: allow a larger deviation"
        )
    if limited:
        remarks.append(
            f"the room of OP and not the allowed deviation limits the step to {step:.3g}"
        )
    if not reaches:
        remarks.append(
            f"the wanted ±{100 * wishes.precision:.2g} % are not reached with {MOVES[-1]} moves: "
            "allow a larger deviation, sample faster or filter the noise"
        )
    fastest = min(wishes.guess.tau, max(wishes.guess.theta, wishes.guess.tau / 5)) / wishes.factor
    if sample_time > fastest / 3:
        remarks.append(
            f"samples every {sample_time:.3g} s are coarse for a process that may answer within "
            f"{fastest:.3g} s"
        )
    return tuple(remarks)


def _three(values: Real) -> tuple[float, float, float]:
    K, tau, theta = values.tolist()
    return K, tau, theta
