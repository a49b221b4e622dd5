"""Stability margins of a loop with dead time, without a Padé approximation."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from loop.bracket_solver import EXTREME, solve_brackets
from loop.controller import PID
from loop.crossovers import Crossovers, Run, crossovers, gain_cuts
from loop.errors import UnstableLoop
from loop.factors import FactoredLoop
from loop.process import LARGEST, Process
from loop.signals import Flags, Real
from loop.stability import count_unstable_poles

# Sizes of L beyond this are the same to the sensitivities; their squares still fit a float.
LARGEST_LOG_GAIN = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Margins:
    """Stability margins of the loop L = G C.

    Attributes
    ----------
    gain : float
        Gain margin: the smallest 1/|L| above 1 where L is real and negative; infinite where there
        is none. [-]
    gain_reduction : float
        The largest 1/|L| below 1 where L is real and negative: the factor on the gain at which a
        conditionally stable loop is lost; 0 where there is none. [-]
    phase : float
        Phase margin: the smallest turn of L, either way, that takes a point of gain 1 to -1;
        infinite where |L| never is 1. [°]
    delay : float
        Extra dead time that brings the loop to the stability limit, smallest over all gain
        crossovers; infinite where |L| never is 1. [s]
    Ms, Mt : float
        Largest |1/(1 + L)| and |L/(1 + L)| over all frequencies. [-]
    """

    gain: float
    gain_reduction: float
    phase: float
    delay: float
    Ms: float
    Mt: float


def margins(process: Process, controller: PID, *, sample_time: float | None = None) -> Margins:
    """Find the margins of a loop with exact dead time, after deciding that it is stable.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    sample_time : float, optional
        Scan time h of the controller; the hold adds h/2 of dead time. [s]

    Raises
    ------
    UnstableLoop
        The closed loop is unstable or on the stability limit.
    ValueError
        The sample time lies outside 0 to 1e9 s.

    Examples
    --------
    >>> from loop.process import FOPDT
    >>> found = margins(FOPDT(K=2, tau=120, theta=30), PID(Kc=0.45, Ti=135, Td=13.3))
    >>> round(found.gain, 5), round(found.phase, 4), round(found.Ms, 5)
    (7.28357, 84.2356, 1.16282)
    """
    return loop_margins(FactoredLoop.of(process, controller, delay=_hold_delay(sample_time)))


def loop_margins(loop: FactoredLoop) -> Margins:
    """Find the margins of a factored loop, after deciding that it is stable.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop.

    Raises
    ------
    UnstableLoop
        The closed loop is unstable or on the stability limit.
    """
    cuts = gain_cuts(loop)
    unstable = count_unstable_poles(loop, cuts)
    if unstable:
        raise UnstableLoop(unstable)
    found = crossovers(loop, cuts)
    inverse = _inverse_gains(loop, found)
    turn = np.mod(loop.phase(found.wc) + math.pi, 2 * math.pi)
    Ms, Mt = _peaks(loop, found)
    return Margins(
        gain=float(np.min(inverse[inverse > 1], initial=math.inf)),
        gain_reduction=float(np.max(inverse[inverse < 1], initial=0.0)),
        phase=math.degrees(np.min(np.minimum(turn, 2 * math.pi - turn), initial=math.inf)),
        delay=float(np.min(turn / found.wc, initial=math.inf)),
        Ms=Ms,
        Mt=Mt,
    )


def _hold_delay(sample_time: float | None) -> float:
    """Dead time that a zero-order hold adds, half the sample time. [s]"""
    if sample_time is None:
        return 0.0
    if not 0 <= sample_time <= LARGEST:
        raise ValueError(f"sample_time must lie within 0 and {LARGEST:g} s, got {sample_time}")
    return sample_time / 2


def _inverse_gains(loop: FactoredLoop, found: Crossovers) -> Real:
    """1/|L| at the phase crossovers that can bound the gain, both ends of the axis included."""
    w180 = np.array([run.w180 for run in found.runs])
    sizes = [loop.log_gain(w180[np.isfinite(w180)])]
    sign, log_size = loop.origin
    if loop.integrators == 0 and sign < 0:
        sizes.append(np.array([log_size]))
    if loop.excess == 0 and (loop.theta > 0 or loop.sign < 0):
        sizes.append(np.array([loop.log_k]))
    return np.asarray(np.exp(-np.clip(np.concatenate(sizes), -700.0, 700.0)))


def _peaks(loop: FactoredLoop, found: Crossovers) -> tuple[float, float]:
    """Largest |S| and |T|: at the ends of the axis, or where their slope changes its sign.

    From the end of a stretch where |L| is closest to 1 outwards, |1 + L| >= | |L| - 1 | only
    grows, so no peak beyond the first phase crossover can pass the value there.
    """
    inside = np.any([_within(found.w, run) for run in found.runs], axis=0)
    w = np.unique(np.concatenate([found.w[inside], *(_samples(run) for run in found.runs)]))
    S, T, rise_S, rise_T = _sensitivities(loop, w)
    S_peaks = _summits(w, rise_S, lambda v: _sensitivities(loop, v)[2])
    T_peaks = _summits(w, rise_T, lambda v: _sensitivities(loop, v)[3])
    S_ends, T_ends = _ends(loop)
    return (
        float(np.max(np.concatenate([S_ends, S, _sensitivities(loop, S_peaks)[0]]))),
        float(np.max(np.concatenate([T_ends, T, _sensitivities(loop, T_peaks)[1]]))),
    )


def _within(w: Real, run: Run) -> Flags:
    low, high = sorted((run.anchor, _end(run)))
    return np.asarray((w >= low) & (w <= high))


def _end(run: Run) -> float:
    return run.far if math.isnan(run.w180) else run.w180


def _samples(run: Run) -> Real:
    """Frequencies from the anchor to the phase crossover, dense at the anchor. [rad/s]"""
    end = _end(run)
    return np.concatenate(
        [
            np.geomspace(run.anchor, end, 65),
            np.linspace(run.anchor, end, 65),
            run.anchor + (end - run.anchor) * 2.0 ** -np.arange(1, 46),
        ]
    )


def _summits(w: Real, rise: Real, slope: Callable[[Real], Real]) -> Real:
    """Frequencies where a slope turns from rising to falling. [rad/s]"""
    at = np.flatnonzero((rise[:-1] > 0) & (rise[1:] <= 0))
    return solve_brackets(slope, w[at], w[at + 1], resolution=EXTREME)


def _sensitivities(loop: FactoredLoop, w: Real) -> tuple[Real, Real, Real, Real]:
    """|S|, |T| and numbers with the signs of their slopes."""
    r = np.exp(np.clip(loop.log_gain(w), -LARGEST_LOG_GAIN, LARGEST_LOG_GAIN))
    phase, rho, turn = loop.phase(w), loop.gain_slope(w), loop.phase_slope(w)
    cos, sin = np.cos(phase), np.sin(phase)
    distance = np.hypot(1 + r * cos, r * sin)
    rise_S = turn * sin - rho * (cos + r)
    rise_T = rho * (1 + r * cos) + r * turn * sin
    return 1 / distance, r / distance, rise_S, rise_T


def _ends(loop: FactoredLoop) -> tuple[Real, Real]:
    """Limits of |S| and |T| for w -> 0 and w -> infinity."""
    sign, log_size = loop.origin
    ends = [_limit(sign, log_size, loop.integrators)]
    # Around a dead time L turns for ever at high frequency and comes as close to -1 as its size.
    ends.append(_limit(-1.0 if loop.theta > 0 else loop.sign, loop.log_k, -loop.excess))
    S, T = zip(*ends, strict=True)
    return np.array(S), np.array(T)


def _limit(sign: float, log_size: float, growth: int) -> tuple[float, float]:
    if growth:
        return (0.0, 1.0) if growth > 0 else (1.0, 0.0)
    L = sign * math.exp(min(max(log_size, -LARGEST_LOG_GAIN), LARGEST_LOG_GAIN))
    return 1 / abs(1 + L), abs(L / (1 + L))
