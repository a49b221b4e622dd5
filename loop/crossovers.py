"""Where a loop with dead time has gain 1, where its phase is -180°, and where both turn.

The axis is cut at every extreme of |L|, at every extreme of its phase and at every gain
crossover. Between two cuts both are monotone, so each crossing is bracketed and none is missed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from loop.bracket_solver import EXTREME, FINEST, solve_brackets
from loop.factors import FactoredLoop
from loop.signals import Real

POINTS_A_DECADE = 16
# Decades below the lowest and above the highest corner where a loop is at its asymptote.
ASYMPTOTE = 1e4
# A slope bends by less than this between points, so one above it cannot vanish unseen.
NEARLY_LEVEL = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A stretch of the axis where |L| is monotone and on one side of 1.

    Attributes
    ----------
    anchor : float
        The end where |L| is closest to 1. [rad/s]
    w180 : float
        The phase crossover nearest to it, NaN where the stretch has none. [rad/s]
    far : float
        The other end. [rad/s]
    """

    anchor: float
    w180: float
    far: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Crossovers:
    """Gain crossovers, and the stretches of monotone gain between them.

    Attributes
    ----------
    wc : ndarray, shape (n,)
        Frequencies where |L| = 1. [rad/s]
    runs : tuple of Run
        Stretches in ascending order; the first starts and the last ends at an asymptote.
    w : ndarray, shape (m,)
        Every frequency looked at, ascending. [rad/s]
    """

    wc: Real
    runs: tuple[Run, ...]
    w: Real


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GainCuts:
    """Frequencies that cut the axis into stretches of monotone |L| on one side of 1.

    Attributes
    ----------
    wc : ndarray, shape (n,)
        Frequencies where |L| = 1. [rad/s]
    turns : ndarray, shape (k,)
        Extremes of |L|. [rad/s]
    w : ndarray, shape (m,)
        Every frequency looked at, ascending, both among them. [rad/s]
    """

    wc: Real
    turns: Real
    w: Real


def gain_cuts(loop: FactoredLoop) -> GainCuts:
    """Find every gain crossover and every extreme of |L|.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop.
    """
    w = _scan(loop)
    w = np.union1d(w, near_turns(w[None], loop.gain_slope(w)[None])[1])
    turns = _sign_changes(loop.gain_slope, w, EXTREME)
    w = np.union1d(w, turns)
    wc = _sign_changes(loop.log_gain, w)
    return GainCuts(wc=wc, turns=turns, w=np.union1d(w, wc))


def crossovers(loop: FactoredLoop, cuts: GainCuts) -> Crossovers:
    """Find, between the gain crossovers, the phase crossovers that bound the gain.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop.
    cuts : GainCuts
        Its gain crossovers.
    """
    wc, turns = cuts.wc, cuts.turns
    w = np.union1d(cuts.w, near_turns(cuts.w[None], loop.phase_slope(cuts.w)[None])[1])
    w = np.union1d(w, _sign_changes(loop.phase_slope, w, EXTREME))
    size, phase = np.abs(loop.log_gain(w)), loop.phase(w)
    ends = np.unique(
        np.concatenate([[0, w.size - 1], np.searchsorted(w, np.concatenate([wc, turns]))])
    )
    runs = []
    for first, last in pairwise(ends):
        upwards = size[first] <= size[last]
        order = np.arange(first, last + 1)[:: 1 if upwards else -1]
        w180 = _first_phase_crossover(loop, w[order], phase[order])
        runs.append(Run(anchor=float(w[order[0]]), w180=w180, far=float(w[order[-1]])))
    return Crossovers(wc=wc, runs=tuple(runs), w=w)


def _first_phase_crossover(loop: FactoredLoop, w: Real, phase: Real) -> float:
    """First frequency in the order of w where the phase is an odd multiple of 180°, else NaN."""
    turn = np.floor((phase + math.pi) / (2 * math.pi))
    steps = np.flatnonzero(turn[1:] != turn[:-1])
    if not steps.size:
        return math.nan
    i = steps[0]
    level = 2 * math.pi * (turn[i] + (turn[i + 1] > turn[i])) - math.pi
    left, right = np.sort(w[i : i + 2])
    root = solve_brackets(
        lambda x: np.asarray(loop.phase(x) - level), np.array([left]), np.array([right])
    )
    return float(root[0])


def near_turns(w: Real, slope: Real) -> tuple[npt.NDArray[np.intp], Real]:
    """Find where a slope all but vanishes between points: two extremes may hide there.

    Parameters
    ----------
    w : ndarray, shape (n, m)
        Ascending frequencies. [rad/s]
    slope : ndarray, shape (n, m)
        Slopes over ln w.

    Returns
    -------
    row, w : ndarray, shape (k,)
        Lowest points of parabolas through three slopes each, in ln w, and their rows. [rad/s]
    """
    size = np.abs(slope)
    left, middle, right = size[:, :-2], size[:, 1:-1], size[:, 2:]
    row, at = np.nonzero((middle < NEARLY_LEVEL) & (middle < left) & (middle <= right))
    three = row[:, None], at[:, None] + np.arange(3)
    (v0, v1, v2), (s0, s1, s2) = np.log(w[three]).T, slope[three].T
    apart = (v1 > v0) & (v2 > v1)
    before = (s1 - s0) / np.where(apart, v1 - v0, 1.0)
    after = (s2 - s1) / np.where(apart, v2 - v1, 1.0)
    bend = after - before
    bent = apart & (before * after < 0)
    vertex = 0.5 * (v0 + v1) - 0.5 * (v2 - v0) * before / np.where(bent, bend, 1.0)
    return row[bent], np.exp(vertex[bent])


def _sign_changes(f: Callable[[Real], Real], w: Real, resolution: float = FINEST) -> Real:
    positive = f(w) >= 0
    at = np.flatnonzero(positive[1:] != positive[:-1])
    if not at.size:
        return np.array([])
    return solve_brackets(f, w[at], w[at + 1], resolution=resolution)


def _scan(loop: FactoredLoop) -> Real:
    """Frequencies that see every corner and every resonance of the loop. [rad/s]"""
    roots = np.concatenate([loop.zeros, loop.poles])
    corners = [float(x) for x in np.abs(roots[roots != 0])]
    if loop.theta > 0:
        corners.append(1 / loop.theta)
    if not corners:
        corners.append(math.exp(loop.log_k / max(loop.excess, 1)))
    ends = [min(corners), max(corners)]
    if loop.integrators:
        ends.append(_bounded_exp(loop.origin[1] / loop.integrators))
    if loop.excess:
        ends.append(_bounded_exp(loop.log_k / loop.excess))
    low, high = math.log10(min(ends) / ASYMPTOTE), math.log10(max(ends) * ASYMPTOTE)
    even = np.logspace(low, high, 2 + math.ceil((high - low) * POINTS_A_DECADE))
    return np.unique(np.concatenate([even, *(_around(root) for root in roots)]))


def _bounded_exp(x: float) -> float:
    """Exponential, kept within 1e-100 and 1e100."""
    return math.exp(min(max(x, -230.0), 230.0))


def _around(root: complex) -> Real:
    """Frequencies that resolve the peak of a lightly damped root, off the root itself. [rad/s]"""
    height, width = abs(root.imag), max(abs(root.real), 1e-12 * abs(root))
    if width >= height:
        return np.array([])
    offsets = width * 2.0 ** np.arange(-2, 1 + math.log2(height / width), 0.5)
    offsets = offsets[offsets < 0.9 * height]
    return np.concatenate([height - offsets, height + offsets])
