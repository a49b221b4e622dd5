"""Plan a relay test before it is run: amplitude, hysteresis, period, swing, errors, limits."""

import math
from dataclasses import dataclass

import numpy as np

from identification.held_input import HeldInput
from identification.planner import ABORT, Wishes, planned_errors, relative_width, sample_time_for
from identification.relay_cycle import LimitCycle, limit_cycle
from loop.errors import NoLimitCycle
from loop.process import FOPDT
from loop.signals import Real

# The relay is biased by this part of its amplitude, which shows the static gain, where PV may move.
BIAS = 0.4
# Three standard deviations of noise: fewer let the relay chatter.
HYSTERESIS = 3.0
# Noise makes the relay switch early, which shortens the cycles and takes some of what they show:
# up to a fifth in simulation.
EARLY = 1.2
# The half swing must be twice the hysteresis, or the relay is all hysteresis.
CLEAR = 2.0
# Settled cycles to try, after two until all has settled, and a rest of two periods before.
CYCLES, TRANSIENT, REST = (4, 6, 10, 20), 2, 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RelayPlan:
    """A relay test to run.

    Attributes
    ----------
    amplitude, bias : float
        Half the distance of the two outputs, and their middle less OP at rest. [OP]
    hysteresis : float
        Half-width of the hysteresis about PV at rest. [PV]
    period, highest, lowest : float
        Expected cycle: length [s] and extremes of PV about rest [PV], if the guess is right.
    longest_period : float
        For the slowest process within the factor. [s]
    cycles : int
        Cycles to wait for, two transient ones among them.
    rest, duration : float
        Time at rest before the relay starts, and in all, if the guess is right. [s]
    sample_time : float
        Longest time between samples, and scan time of the relay. [s]
    expected_errors, largest_errors : tuple of float
        Standard errors of K, tau, theta if the guess is right, and the largest of each for a
        process off it by the factor. [PV/OP], [s], [s]
    expected_width, largest_width : float
        The same as the widest relative half-width of the 95 % intervals. [-]
    reaches : bool
        Whether the wanted precision is reached even if the guess is off by the factor.
    abort_deviation, abort_silence, abort_time : float
        Stop the test and put OP back when PV is further from rest [PV], when OP has not switched
        for so long [s], when the test has taken so long [s].
    remarks : tuple of str
        What to know before running it.
    """

    amplitude: float
    bias: float
    hysteresis: float
    period: float
    highest: float
    lowest: float
    longest_period: float
    cycles: int
    rest: float
    duration: float
    sample_time: float
    expected_errors: tuple[float, float, float]
    largest_errors: tuple[float, float, float]
    expected_width: float
    largest_width: float
    reaches: bool
    abort_deviation: float
    abort_silence: float
    abort_time: float
    remarks: tuple[str, ...]


def plan_relay(wishes: Wishes) -> RelayPlan:
    """Plan the shortest relay test that reaches the wanted precision.

    The hysteresis is three times the noise; the amplitude is as large as the allowed deviation
    permits for the process that swings most; cycles are added until the errors are small enough.

    Parameters
    ----------
    wishes : Wishes
        What is known and wanted.

    Raises
    ------
    NoLimitCycle
        Within the allowed deviation, or the room of OP, the relay does not cycle clear of the
        noise for every process near the guess; the sentence says what would do.
    ValueError
        The stated sample time is so long that the cycles would fall between the samples.

    Examples
    --------
    >>> heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    >>> plan = plan_relay(Wishes(guess=heater, noise=0.1, deviation=6.0))
    >>> plan.reaches, plan.highest < 6.0
    (True, True)
    """
    if wishes.guess.theta == 0:
        raise NoLimitCycle("Without dead time a relay cycles at its own scan; make a step test.")
    hysteresis = HYSTERESIS * wishes.noise
    amplitude = _amplitude(wishes, hysteresis)
    cycles = [_cycle(p, amplitude, hysteresis) for p in wishes.corners()]
    sample_time = wishes.sample_time or sample_time_for(wishes.guess, wishes.factor)
    shortest = min(cycle.period for cycle in cycles)
    if sample_time > shortest / 2:
        raise ValueError(
            f"sample_time must be at most {shortest / 2:.3g} s, half of the shortest cycle to be "
            f"expected, got {sample_time:.6g}"
        )
    for count in CYCLES:
        errors, widths = _errors(wishes, amplitude, cycles, count, sample_time)
        if widths.max() <= wishes.precision:
            break
    reaches = bool(widths.max() <= wishes.precision)
    guess, slowest = cycles[0], max(cycle.period for cycle in cycles)
    rest = REST * guess.period
    total = count + TRANSIENT
    return RelayPlan(
        amplitude=amplitude,
        bias=BIAS * amplitude,
        hysteresis=hysteresis,
        period=guess.period,
        highest=guess.highest,
        lowest=guess.lowest,
        longest_period=slowest,
        cycles=total,
        rest=rest,
        duration=rest + total * guess.period,
        sample_time=sample_time,
        expected_errors=_three(errors[0]),
        largest_errors=_three(errors.max(axis=0)),
        expected_width=float(widths[0]),
        largest_width=float(widths.max()),
        reaches=reaches,
        abort_deviation=ABORT * wishes.deviation,
        abort_silence=wishes.factor * slowest,
        abort_time=1.5 * (rest + total * slowest),
        remarks=_remarks(wishes, amplitude, reaches=reaches),
    )


def _amplitude(wishes: Wishes, hysteresis: float) -> float:
    """Largest amplitude that keeps every process near the guess within the deviation. [OP]"""
    corners = wishes.corners()
    K = np.array([abs(p.K) for p in corners])
    left = np.array([math.exp(-p.theta / p.tau) for p in corners])  # 1/E
    # |extreme| = (1 + bias) m K (1 - 1/E) + eps/E
    swing = (1 + BIAS) * K * (1 - left)
    largest = float(np.min((wishes.deviation - hysteresis * left) / swing))
    # The relay goes up by (1 + bias) and down by (1 - bias) of its amplitude.
    amplitude = min(largest, wishes.room_up / (1 + BIAS), wishes.room_down / (1 - BIAS))
    # Half the swing, m K (1 - 1/E) + eps/E, is to be clear of the hysteresis, and so is where PV
    # heads for on the weaker side.
    clear = hysteresis * (CLEAR - left) / (K * (1 - left))
    least = float(max(np.max(clear), 1.01 * hysteresis / ((1 - BIAS) * np.min(K))))
    if amplitude < least:
        needed = float(np.max(least * swing + hysteresis * left))
        raise NoLimitCycle(
            f"An amplitude of {max(amplitude, 0.0):.3g} of OP, all that the allowed deviation and "
            f"the room of OP leave, does not make every process near the guess swing clear of a "
            f"hysteresis of {hysteresis:.3g} (three times the noise): {least:.3g} is needed, and "
            f"with it a deviation of {needed:.3g}. Allow that, or make a step test."
        )
    return amplitude


def _cycle(process: FOPDT, amplitude: float, hysteresis: float) -> LimitCycle:
    return limit_cycle(process, amplitude=amplitude, bias=BIAS * amplitude, hysteresis=hysteresis)


def _errors(
    wishes: Wishes,
    amplitude: float,
    cycles: list[LimitCycle],
    count: int,
    sample_time: float,
) -> tuple[Real, Real]:
    """Errors and widths for the guess, first, and every process off it by the factor."""
    errors, widths = [], []
    for process, cycle in zip(wishes.corners(), cycles, strict=True):
        rest, total = REST * cycle.period, count + TRANSIENT
        starts = rest + cycle.period * np.arange(total)
        instants = np.column_stack((starts, starts + cycle.high_time)).ravel()
        pattern = np.tile(amplitude * np.array([BIAS + 1, BIAS - 1]), total)
        found = planned_errors(
            process,
            HeldInput(instants=instants, levels=np.append(0.0, pattern)),
            duration=rest + total * cycle.period,
            sample_time=sample_time,
            noise=EARLY * wishes.noise,
        )
        errors.append(found)
        widths.append(relative_width(process, found))
    return np.array(errors), np.array(widths)


def _remarks(wishes: Wishes, amplitude: float, *, reaches: bool) -> tuple[str, ...]:
    remarks = [
        f"the relay starts from rest, with PV at its set point, at OP {BIAS * amplitude:+.3g} "
        f"± {amplitude:.3g} about OP at rest; record the rest before, which shows the gain"
    ]
    if not reaches:
        remarks.append(
            f"the wanted ±{100 * wishes.precision:.2g} % are not reached within {CYCLES[-1]} "
            "settled cycles: a step test shows K and tau better, a relay test theta and Ku"
        )
    return tuple(remarks)


def _three(values: Real) -> tuple[float, float, float]:
    K, tau, theta = values.tolist()
    return K, tau, theta
