"""Closed-loop poles of a loop with dead time: exact roots of d(s) + n(s) e^(-theta s).

There are infinitely many, in a chain that runs to the left; those in a rectangle are found, and
their number is proven by the principle of the argument.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from loop.controller import PID
from loop.crossovers import crossovers, gain_cuts
from loop.errors import UnstableLoop
from loop.factors import FactoredLoop, polynomial_roots
from loop.process import Process
from loop.signals import Complex, Flags, Real
from loop.stability import count_unstable_poles
from loop.transport_line import expanded, transport_line_poles
from loop.winding import turning

# The view by default: this many times the crossover, and no further than so many turns of the
# dead time and so many powers of e, which its discretisation still resolves.
FRAME = 10.0
HIGHEST_TURN, FURTHEST_LEFT = 40.0, 12.0
FEWEST_NODES = 24
MOST_NODES = 400
NEWTON_STEPS = 40
# A start value that moves further than this, over its size, was no approximation of a root.
NEAR = 1e-2
ROOT = 1e-9
# A zero this close to a pole, over its size, cancels it: the root between them cannot be told.
CANCELS = 1e-7
# How much of the right half-plane to show beside the left.
RIGHT_SHOWN = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Rectangle:
    """Part of the s-plane, symmetric about the real axis.

    Attributes
    ----------
    left, right : float
        Real parts within. [rad/s]
    height : float
        Largest size of the imaginary part. [rad/s]
    """

    left: float
    right: float
    height: float

    def __post_init__(self) -> None:
        edges = (self.left, self.right, self.height)
        if not (all(map(math.isfinite, edges)) and self.left < self.right and self.height > 0):
            raise ValueError(
                "a rectangle needs left below right and a positive height, "
                f"got {self.left}, {self.right} and {self.height}"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedLoopPoles:
    """Closed-loop poles, slowest first.

    Attributes
    ----------
    poles : ndarray of complex, shape (n,)
        All poles in the rectangle, by falling real part. [rad/s]
    residual : ndarray, shape (n,)
        |d + n e^(-theta s)| over |d| + |n e^(-theta s)| at each: 1 is no root, rounding is. [-]
    rectangle : Rectangle or None
        Where they were looked for; None without dead time, where these are all.
    """

    poles: Complex
    residual: Real
    rectangle: Rectangle | None


def closed_loop_poles(
    process: Process, controller: PID, *, rectangle: Rectangle | None = None
) -> ClosedLoopPoles:
    """Find the closed-loop poles of a loop with exact dead time.

    The delay is a transport line; discretised at Chebyshev points it gives start values by one
    eigenvalue problem [1]_. Newton's method takes each to a root of the exact equation, and the
    turns of d + n e^(-theta s) around the rectangle say how many there are.

    Parameters
    ----------
    process : Process
        Process model.
    controller : PID
        Controller settings; the loop need not be stable.
    rectangle : Rectangle, optional
        Where to look, for a loop with dead time; around the gain crossover if not given.

    Raises
    ------
    UnstableLoop
        |L| stays at 1 or above at high frequency around a dead time: infinitely many unstable.
    ValueError
        The rectangle is too large for the dead time, or a root lies on its edge.

    References
    ----------
    .. [1] D. Breda, S. Maset, R. Vermiglio, "Pseudospectral differencing methods for
       characteristic roots of delay differential equations", SIAM J. Sci. Comput. 27 (2005)
       482-495 (from memory; here only start values come from it).
    """
    loop = FactoredLoop.of(process, controller)
    if not loop.theta:
        poles = _polynomial_roots(loop)
        return ClosedLoopPoles(poles=poles, residual=residual(loop, poles), rectangle=None)
    if loop.excess < 0 or (loop.excess == 0 and loop.log_k >= 0):
        raise UnstableLoop(count_unstable_poles(loop, gain_cuts(loop)))
    view = rectangle or default_rectangle(loop)
    nodes = nodes_for(loop, view)
    seen, hidden = _without_cancellations(loop)
    expected = _count(seen, view) + _inside(hidden, view).size
    while True:
        poles = poles_within(loop, view, nodes)
        if poles.size == expected:
            return ClosedLoopPoles(poles=poles, residual=residual(loop, poles), rectangle=view)
        nodes *= 2
        if nodes > MOST_NODES:
            raise ValueError(
                f"{expected} poles lie in the rectangle, of which {poles.size} were found; "
                "ask for a smaller one"
            )


def poles_within(loop: FactoredLoop, view: Rectangle, nodes: int) -> Complex:
    """Find closed-loop poles from a discretisation with so many nodes, without proof of all.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop; without dead time all poles are found.
    view : Rectangle
        Where to look.
    nodes : int
        Chebyshev points along the delay, as `nodes_for` advises.
    """
    if not loop.theta:
        return _inside(_polynomial_roots(loop), view)
    seen, hidden = _without_cancellations(loop)
    starts = transport_line_poles(seen, nodes)
    margin = NEAR * (np.abs(starts) + 1 / loop.theta)
    # Eigenvalues far outside are the discretisation's own, and lead nowhere.
    found = _refined(seen, starts[_within(starts, view, margin)])
    return _sorted(_inside(np.concatenate([found, hidden]), view))


def _without_cancellations(loop: FactoredLoop) -> tuple[FactoredLoop, Complex]:
    """Take out poles that a zero hides, as Ti = tau does: each stays a pole of the closed loop."""
    zeros, hidden = list(loop.zeros), []
    poles = []
    for pole in loop.poles:
        near = next((z for z in zeros if abs(z - pole) <= CANCELS * abs(pole)), None)
        if near is None:
            poles.append(pole)
        else:
            zeros.remove(near)
            hidden.append(pole)
    if not hidden:
        return loop, np.array([], dtype=complex)
    seen = replace(loop, zeros=np.array(zeros, complex), poles=np.array(poles, complex))
    return seen, np.array(hidden, dtype=complex)


def default_rectangle(loop: FactoredLoop) -> Rectangle:
    """Choose a view around the gain crossover with the unstable poles, as high as 40/theta.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop with dead time.
    """
    cuts = gain_cuts(loop)
    roots = np.abs(loop.poles[loop.poles != 0])
    unit = float(cuts.wc[-1]) if cuts.wc.size else float(np.min(roots, initial=1 / loop.theta))
    runs = crossovers(loop, cuts).runs
    w180 = max((run.w180 for run in runs if not math.isnan(run.w180)), default=0.0)
    right, furthest = _unstable_bounds(loop, unit)
    height = max(FRAME * unit, 2 * w180, 1.01 * furthest)
    height = min(height, HIGHEST_TURN / loop.theta)
    left = min(FRAME * unit, FURTHEST_LEFT / loop.theta)
    # Odd factors keep the edges off round numbers, where roots like to lie.
    right = max(right, RIGHT_SHOWN * left)
    return Rectangle(left=-1.0137 * left, right=1.0071 * right, height=1.0113 * height)


def _unstable_bounds(loop: FactoredLoop, unit: float) -> tuple[float, float]:
    """Largest real part and largest size that an unstable pole can have. [rad/s]

    Right of the axis |d| <= |n| e^(-theta Re s) at a pole.
    """
    sizes = np.abs(np.concatenate([loop.poles, loop.zeros, [unit]]))
    low, high = np.log10(np.min(sizes[sizes > 0])) - 2, np.log10(np.max(sizes)) + 6
    radius = np.logspace(low, high, math.ceil(20 * (high - low)))[:, None]
    zeros, poles = np.abs(loop.zeros), loop.poles
    # A real pole on the left is never closer than hypot(radius, pole).
    plain = np.where((poles.imag == 0) & (poles.real <= 0), np.hypot(radius, poles.real), 0.0)
    nearest = np.maximum(np.maximum(radius - np.abs(poles), plain), 1e-300)
    excess = loop.log_k + np.sum(np.log(radius + zeros), axis=1) - np.sum(np.log(nearest), axis=1)
    possible = np.flatnonzero(excess >= 0)
    if not possible.size:
        return unit, unit
    furthest = float(radius[min(possible[-1] + 1, radius.size - 1), 0])
    real = float(np.max(np.minimum(radius[:, 0], excess / loop.theta)[possible]))
    # Between two radii of the grid the bound may stand a little higher.
    return max(1.3 * real, 1e-3 * furthest), furthest


def nodes_for(loop: FactoredLoop, view: Rectangle) -> int:
    """Choose Chebyshev points that resolve e^(-theta s) over the whole rectangle.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop.
    view : Rectangle
        Where poles are wanted.

    Raises
    ------
    ValueError
        The rectangle is too large for the dead time.
    """
    size = loop.theta * math.hypot(max(-view.left, view.right), view.height)
    nodes = FEWEST_NODES + math.ceil(0.8 * size)
    if nodes > MOST_NODES or -view.left * loop.theta > 30:
        raise ValueError(f"the rectangle reaches {size:.3g} times 1/theta; ask for a smaller one")
    return nodes


def _polynomial_roots(loop: FactoredLoop) -> Complex:
    """Roots of d + n, for a loop without dead time."""
    d, n = expanded(loop.poles), expanded(loop.zeros)
    total = np.trim_zeros(np.polyadd(d, loop.sign * math.exp(loop.log_k) * n), "f")
    return _sorted(polynomial_roots(tuple(map(float, total))))


def _sorted(poles: Complex) -> Complex:
    return poles[np.lexsort((poles.imag, np.abs(poles.imag), -poles.real))]


def log_parts(loop: FactoredLoop, s: Complex) -> tuple[Complex, Complex]:
    """Logarithms of d(s) and of n(s) e^(-theta s), up to the sign of the latter."""
    tiny = 1e-300
    d, n = np.zeros(s.shape, dtype=complex), np.full(s.shape, loop.log_k, dtype=complex)
    for root in loop.poles:
        d = d + np.log(np.where(s == root, tiny, s - root))
    for root in loop.zeros:
        n = n + np.log(np.where(s == root, tiny, s - root))
    return d, n - loop.theta * s


def _scaled_parts(loop: FactoredLoop, s: Complex) -> tuple[Complex, Complex]:
    """Give d and n e^(-theta s), divided by the size of the larger."""
    d, n = log_parts(loop, s)
    largest = np.maximum(d.real, n.real)
    return np.asarray(np.exp(d - largest)), np.asarray(loop.sign * np.exp(n - largest))


def residual(loop: FactoredLoop, s: Complex) -> Real:
    """|d + n e^(-theta s)| over |d| + |n e^(-theta s)|. [-]"""
    seen, hidden = _without_cancellations(loop)
    d, n = _scaled_parts(seen, s)
    size = np.abs(d + n) / (np.abs(d) + np.abs(n))
    # A zero of the loop that hides a pole leaves that pole a root, exactly.
    return np.asarray(np.where(np.isin(s, hidden), 0.0, size))


def gain_sensitivity(loop: FactoredLoop, s: Complex) -> Complex:
    """ds/d ln k of closed-loop poles, for a factor k on the loop. [rad/s]

    -n e^(-theta s) / (d' + (n e^(-theta s))')

    Parameters
    ----------
    loop : FactoredLoop
        Open loop.
    s : ndarray of complex, shape (n,)
        Closed-loop poles. [rad/s]
    """
    _, n, slope = _slopes(loop, s)
    return np.asarray(-n / np.where(slope == 0, 1e-300, slope))


def _newton_step(loop: FactoredLoop, s: Complex) -> Complex:
    """-f/f' of f = d + n e^(-theta s)."""
    d, n, slope = _slopes(loop, s)
    return np.asarray(-(d + n) / np.where(slope == 0, 1e-300, slope))


def _slopes(loop: FactoredLoop, s: Complex) -> tuple[Complex, Complex, Complex]:
    """Give d, n e^(-theta s) and the slope of their sum, all over the same size."""
    d, n = _scaled_parts(loop, s)
    slope_d = _sum_of_inverses(s, loop.poles)
    slope_n = _sum_of_inverses(s, loop.zeros) - loop.theta
    return d, n, np.asarray(d * slope_d + n * slope_n)


def _sum_of_inverses(s: Complex, roots: Complex) -> Complex:
    gap = s[:, None] - roots
    return np.asarray(np.sum(1 / np.where(gap == 0, 1e-300, gap), axis=1))


def refine(loop: FactoredLoop, s: Complex) -> Complex:
    """Take approximate roots to exact ones by Newton's method.

    Parameters
    ----------
    loop : FactoredLoop
        Open loop.
    s : ndarray of complex, shape (n,)
        Approximations. [rad/s]
    """
    for _ in range(NEWTON_STEPS):
        step = _newton_step(loop, s)
        scale = np.abs(s) + (1 / loop.theta if loop.theta else 0.0)
        step = step * np.minimum(1.0, 0.5 * scale / np.maximum(np.abs(step), 1e-300))
        s = s + step
        if np.all(np.abs(step) <= 1e-15 * np.abs(s)):
            break
    return s


def _refined(loop: FactoredLoop, starts: Complex) -> Complex:
    """Roots that start values lead to without moving far; conjugates made exact."""
    upper = starts[starts.imag >= -ROOT * np.abs(starts)]
    upper = np.where(upper.imag <= ROOT * np.abs(upper), upper.real.astype(complex), upper)
    # A start that sits on an open-loop pole cannot move from there.
    upper = upper + 1e-13 / loop.theta
    found = refine(loop, upper)
    scale = np.abs(upper) + 1 / loop.theta
    good = (np.abs(found - upper) <= NEAR * scale) & (residual(loop, found) < ROOT)
    found = found[good]
    real = np.abs(found.imag) <= 1e-11 * (np.abs(found) + 1 / loop.theta)
    flat = found[real].real.astype(complex)
    # A double root is known to 1e-8 only: one of its pair may end on the other side of the axis.
    pairs = found[~real].real + 1j * np.abs(found[~real].imag)
    return np.concatenate([flat, pairs, pairs.conj()])


def _inside(s: Complex, view: Rectangle) -> Complex:
    return s[_within(s, view, np.zeros(s.shape))]


def _within(s: Complex, view: Rectangle, margin: Real) -> Flags:
    wide = (s.real > view.left - margin) & (s.real < view.right + margin)
    return np.asarray(wide & (np.abs(s.imag) < view.height + margin))


def _count(loop: FactoredLoop, view: Rectangle) -> int:
    """Roots in the rectangle, by the turns of d + n e^(-theta s) around its upper half."""

    def f(s: Complex) -> Complex:
        d, n = _scaled_parts(loop, s)
        return np.asarray(d + n)

    turns = view.height * loop.theta / (2 * math.pi)
    up = np.linspace(0.0, 1.0, 200 + 16 * math.ceil(turns))
    # Roots crowd towards the real axis in slow loops; look there closely as well.
    up = np.union1d(up, np.geomspace(1e-8, 1.0, 200))
    across = np.linspace(0.0, 1.0, 200)
    right = view.right + 1j * view.height * up
    top = view.right + (view.left - view.right) * across + 1j * view.height
    left = view.left + 1j * view.height * up[::-1]
    upper = turning(f, np.concatenate([right, top[1:], left[1:]]))
    return round(upper / math.pi)
