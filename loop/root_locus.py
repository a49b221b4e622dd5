"""Root locus with exact dead time: closed-loop poles over a factor on the loop gain."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from loop.bracket_solver import solve_brackets
from loop.closed_loop_poles import (
    HIGHEST_TURN,
    Rectangle,
    default_rectangle,
    gain_sensitivity,
    nodes_for,
    poles_within,
)
from loop.controller import PID
from loop.crossovers import gain_cuts
from loop.factors import FactoredLoop
from loop.process import Process
from loop.signals import Complex, Real

# Two poles further apart than this part of the picture do not belong to one branch.
LONGEST_JUMP = 0.2
POINTS_A_TURN = 8
MOST_POINTS = 200_000
DEFAULT_GAINS = 61


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RootLocus:
    """Branches of the root locus.

    Attributes
    ----------
    k : ndarray, shape (n,)
        Factors on the loop gain, ascending; 1 is the loop as it stands. [-]
    branches : ndarray of complex, shape (n, m)
        One branch a column; NaN where it is outside the picture. [rad/s]
    poles, zeros : ndarray of complex
        Open-loop poles, where branches start, and zeros, where some end. [rad/s]
    crossings : tuple of (k, w)
        Every factor within the range at which a pole pair crosses the imaginary axis, and its
        frequency; 0 for a real pole through the origin. [-], [rad/s]
    rectangle : Rectangle
        The picture.
    """

    k: Real
    branches: Complex
    poles: Complex
    zeros: Complex
    crossings: tuple[tuple[float, float], ...]
    rectangle: Rectangle


def root_locus(
    process: Process,
    controller: PID,
    *,
    k: Real | None = None,
    rectangle: Rectangle | None = None,
) -> RootLocus:
    """Follow the closed-loop poles over a factor on the loop gain.

    At every factor the roots of d + k n e^(-theta s) are found exactly; the branch that a root
    continues is the one whose tangent ds/d ln k points nearest to it. No Padé approximation.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings.
    k : ndarray, shape (n,), optional
        Ascending positive factors; 0.01 to 10 in 61 steps if not given, less where infinitely
        many poles would be unstable there. [-]
    rectangle : Rectangle, optional
        The picture; around the gain crossover if not given.

    Raises
    ------
    ValueError
        The factors do not ascend from above 0, or the picture is too large for the dead time.
    """
    loop = FactoredLoop.of(process, controller)
    largest = _largest_gain(loop)
    if k is None:
        top = min(10.0, 0.9 * largest) or 10.0
        k = np.geomspace(1e-3 * top, top, DEFAULT_GAINS)
    k = np.asarray(k, dtype=float)
    if k.size < 2 or not k[0] > 0 or not np.all(np.isfinite(k)) or np.any(np.diff(k) <= 0):
        raise ValueError("the factors on the gain must be positive and ascend, two or more of them")
    if k[-1] >= largest:
        raise ValueError(
            f"from {largest:.4g} times the gain on infinitely many poles are unstable; "
            "ask for smaller factors"
        )
    crossings = _crossings(loop, float(k[0]), float(k[-1]))
    view = rectangle or _picture(loop, _with_gain(loop, float(k[-1])), crossings)
    nodes = nodes_for(loop, view) if loop.theta else 0
    found = [poles_within(_with_gain(loop, factor), view, nodes) for factor in k]
    return RootLocus(
        k=k,
        branches=_linked(loop, k, found, view),
        poles=loop.poles,
        zeros=loop.zeros,
        crossings=crossings,
        rectangle=view,
    )


def _largest_gain(loop: FactoredLoop) -> float:
    """Factor from which |L| stays at 1 or above at high frequency around a dead time. [-]"""
    if not loop.theta or loop.excess > 0:
        return math.inf
    return math.exp(-loop.log_k) if loop.excess == 0 else 0.0


def _with_gain(loop: FactoredLoop, k: float) -> FactoredLoop:
    return replace(loop, log_k=loop.log_k + math.log(k))


def _picture(
    loop: FactoredLoop, loudest: FactoredLoop, crossings: tuple[tuple[float, float], ...]
) -> Rectangle:
    if loop.theta:
        view = default_rectangle(loop)
        highest = 1.3137 * max((w for _, w in crossings), default=0.0)
        return replace(
            view,
            height=max(view.height, min(highest, HIGHEST_TURN / loop.theta)),
            right=max(view.right, default_rectangle(loudest).right),
        )
    cuts = gain_cuts(loop)
    roots = np.abs(np.concatenate([loop.poles, loop.zeros]))
    unit = max(float(np.max(roots, initial=0.0)), float(np.max(cuts.wc, initial=0.0))) or 1.0
    return Rectangle(left=-3 * unit, right=3 * unit, height=3 * unit)


def _linked(loop: FactoredLoop, k: Real, found: list[Complex], view: Rectangle) -> Complex:
    """Sort the roots of all factors into branches."""
    limit = LONGEST_JUMP * math.hypot(view.right - view.left, view.height)
    columns: list[Complex] = []
    ends: list[int] = []  # the column each root of the step before belongs to
    for i, roots in enumerate(found):
        owners = [-1] * roots.size
        if i and ends and roots.size:
            before = found[i - 1]
            tangent = gain_sensitivity(_with_gain(loop, float(k[i - 1])), before)
            ahead = before + tangent * math.log(k[i] / k[i - 1])
            # Where the tangent runs away, at a meeting of branches, the root itself is nearer.
            gap = np.minimum(np.abs(ahead[:, None] - roots), 2 * np.abs(before[:, None] - roots))
            for old, heir in zip(*linear_sum_assignment(gap), strict=True):
                if abs(before[old] - roots[heir]) <= limit:
                    owners[heir] = ends[old]
        for new, owner in enumerate(owners):
            if owner < 0:
                owners[new] = len(columns)
                columns.append(np.full(k.size, np.nan, dtype=complex))
            columns[owners[new]][i] = roots[new]
        ends = owners
    return np.stack(columns, axis=1) if columns else np.empty((k.size, 0), dtype=complex)


def _crossings(loop: FactoredLoop, low: float, high: float) -> tuple[tuple[float, float], ...]:
    """Every gain at which a root stands on the axis: where L is real and negative."""
    found = []
    sign, log_size = loop.origin
    if loop.integrators == 0 and sign < 0 and low <= math.exp(-log_size) <= high:
        found.append((math.exp(-log_size), 0.0))
    w = gain_cuts(loop).w
    if loop.theta:
        # Beyond here k |L| < 1 for every k in the range.
        loud = w[loop.log_gain(w) >= -math.log(high)]
        top = float(loud[-1]) * 1.5 if loud.size else 0.0
        count = math.ceil(top * loop.theta / (2 * math.pi) * POINTS_A_TURN)
        if count > MOST_POINTS:
            raise ValueError(
                f"at {high:g} times the gain the loop turns {count / POINTS_A_TURN:.3g} times "
                "before it is small; ask for smaller factors"
            )
        w = np.union1d(w[w <= max(top, w[0])], np.linspace(0, top, count + 1)[1:])
    phase = loop.phase(w)
    turn = np.floor((phase + math.pi) / (2 * math.pi))
    at = np.flatnonzero(turn[1:] != turn[:-1])
    if at.size:
        level = 2 * math.pi * np.maximum(turn[at], turn[at + 1]) - math.pi
        w180 = solve_brackets(lambda v: np.asarray(loop.phase(v) - level), w[at], w[at + 1])
        gains = np.exp(np.clip(-loop.log_gain(w180), -700.0, 700.0))
        inside = (gains >= low) & (gains <= high)
        found += list(zip(gains[inside].tolist(), w180[inside].tolist(), strict=True))
    return tuple(sorted(found))
