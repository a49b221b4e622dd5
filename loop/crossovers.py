"""Where a loop with dead time has gain 1, where its phase is -180°, and where both turn.

The axis is cut at every extreme of |L|, at every extreme of its phase and at every gain
crossover. Between two cuts both are monotone, so each crossing is bracketed and none is missed.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from loop.factors import FactoredLoop
from loop.signals import Real

POINTS_A_DECADE = 16
# Decades below the lowest and above the highest corner where a loop is at its asymptote.
ASYMPTOTE = 1e4
# Accuracy of ln w: crossovers to the last digits; at an extreme, where values hardly change, less.
FINEST, EXTREME = 4e-16, 1e-10


def solve_brackets(
    f: Callable[[Real], Real], left: Real, right: Real, *, resolution: float = FINEST
) -> Real:
    """Solve f(w) = 0 in many brackets at once, by Chandrupatla's method in ln w [1]_.

    Parameters
    ----------
    f : callable
        Continuous function of an array of frequencies of shape (n,).
    left, right : ndarray, shape (n,)
        Brackets; f changes its sign within each. [rad/s]
    resolution : float
        Accuracy of ln w, relative where that is above 1. [-]

    Returns
    -------
    ndarray, shape (n,)
        Roots. [rad/s]

    References
    ----------
    .. [1] T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of
       a nonlinear function without using derivatives", Advances in Engineering Software 28 (1997)
       145-149.
    """
    b, a = np.log(left), np.log(right)
    fb, fa = f(left), f(right)
    c, fc, part = a.copy(), fa.copy(), np.full(a.shape, 0.5)
    for _ in range(200):
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        finest = resolution * np.maximum(np.abs(best), 1.0)
        if np.all((np.abs(b - a) <= 2 * finest) | (fa == 0) | (fb == 0)):
            break
        point = a + part * (b - a)
        value = f(np.exp(point))
        same = np.sign(value) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = point, value
        part = _next_part(a, b, c, fa, fb, fc, finest)
    return np.asarray(np.exp(np.where(np.abs(fa) < np.abs(fb), a, b)))


def _next_part(a: Real, b: Real, c: Real, fa: Real, fb: Real, fc: Real, finest: Real) -> Real:
    """Part of the bracket to step: inverse quadratic where that is safe, otherwise half."""
    ab, cb, fab, fcb, fca = a - b, c - b, fa - fb, fc - fb, fc - fa
    whole = (ab != 0) & (cb != 0) & (fab != 0) & (fcb != 0) & (fca != 0)
    ab, cb, fab, fcb, fca = (np.where(whole, d, 1.0) for d in (ab, cb, fab, fcb, fca))
    xi, phi = ab / cb, fab / fcb
    quadratic = whole & (phi * phi < xi) & ((1 - phi) ** 2 < 1 - xi)
    step = (fa / fab) * (fc / fcb) + (a - c) / ab * (fa / fca) * (fb / fcb)
    least = np.minimum(finest / np.abs(ab), 0.5)
    return np.asarray(np.clip(np.where(quadratic, step, 0.5), least, 1 - least))


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
    w = np.union1d(cuts.w, _sign_changes(loop.phase_slope, cuts.w, EXTREME))
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
