"""The graphical readings of a step response that engineers know, as cross-checks of the fit.

Each rests on two readings, a slope or an area. On a first-order answer without noise all agree;
how far apart they lie tells how much of a first-order answer it is.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from identification.two_point import passage
from loop.errors import LoopError, PoorExcitation
from loop.process import FOPDT
from loop.signals import Real

# Levels of the two-point methods; the constants follow from them, since a first-order answer passes
# p at theta - tau ln(1 - p).
LEVELS = {
    "Smith": (1 - math.exp(-1 / 3), 1 - math.exp(-1)),
    "Sundaresan-Krishnaswamy": (0.353, 0.853),
    "Viteckova": (0.33, 0.70),
    "Ho": (0.35, 0.85),
    "Chen-Yang": (0.33, 0.67),
    "Alfaro 123c": (0.25, 0.75),
    "Broida": (0.28, 0.40),
}
# Length of the stretch over which a slope is read, against the time from 28 % to 63 %.
WINDOW = 0.4
FEWEST = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodReading:
    """What one method reads off a step response.

    Attributes
    ----------
    method : str
        Its name.
    process : FOPDT or None
        Model; none where the method has no answer.
    remark : str
        Why there is none; empty where there is one.
    """

    method: str
    process: FOPDT | None
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How far the methods lie apart.

    Attributes
    ----------
    tau, theta, total : tuple of float
        Smallest and largest tau, theta and tau + theta of all methods with an answer. [s]
    """

    tau: tuple[float, float]
    theta: tuple[float, float]
    total: tuple[float, float]


def two_point_constants(first: float, second: float) -> tuple[float, float]:
    """Constants of tau = a (t2 - t1), theta = b t1 + (1 - b) t2 from the levels they are read at.

    a = 1/(ln(1 - p1) - ln(1 - p2)), b = -a ln(1 - p2).

    Parameters
    ----------
    first, second : float
        Levels p1 < p2 as parts of the whole change. [-]

    Examples
    --------
    >>> a, b = two_point_constants(0.353, 0.853)
    >>> round(a, 3), round(b, 3)
    (0.675, 1.294)
    """
    a = 1 / (math.log1p(-first) - math.log1p(-second))
    return a, -a * math.log1p(-second)


def step_methods(
    t: Real, pv: Real, *, step_at: float, op_change: float, pv_from: float, pv_to: float
) -> tuple[MethodReading, ...]:
    """Read a step response by all methods.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    pv : ndarray, shape (n,)
        Process values from the step to where the answer has settled. [PV]
    step_at : float
        When the output moved. [s]
    op_change : float
        By how much. [OP]
    pv_from, pv_to : float
        PV at rest before and after. [PV]

    Raises
    ------
    PoorExcitation
        PV ends where it began.
    """
    change = pv_to - pv_from
    if change == 0:
        raise PoorExcitation(f"PV ends where it began, at {pv_from:.4g}.")
    K = change / op_change
    since, part = t - step_at, (pv - pv_from) / change

    def two_points(levels: tuple[float, float]) -> tuple[float, float]:
        a, b = two_point_constants(*levels)
        first, second = (passage(since, part, level) for level in levels)
        return a * (second - first), b * first + (1 - b) * second

    ways = {name: partial(two_points, levels) for name, levels in LEVELS.items()}
    ways["tangent"] = partial(_tangent, since, part)
    ways["area"] = partial(_area, since, part)
    return tuple(_reading(name, K, read) for name, read in ways.items())


def _reading(name: str, K: float, read: Callable[[], tuple[float, float]]) -> MethodReading:
    try:
        tau, theta = read()
        # Noise can take a dead time of nothing a little below it.
        process = FOPDT(K=K, tau=tau, theta=max(theta, 0.0))
    except (LoopError, ValueError) as fact:
        return MethodReading(method=name, process=None, remark=str(fact))
    return MethodReading(method=name, process=process)


def _tangent(since: Real, part: Real) -> tuple[float, float]:
    """Steepest tangent: theta where it leaves the rest, tau how long it takes for the change."""
    early, late = (passage(since, part, level) for level in LEVELS["Smith"])
    width = max(WINDOW * (late - early), FEWEST * float(np.median(np.diff(since))))
    begin = np.searchsorted(since, since - width / 2)
    end = np.searchsorted(since, since + width / 2, side="right")
    sums = [np.append(0.0, np.cumsum(x)) for x in (since, part, since**2, since * part)]
    st, sp, stt, stp = (s[end] - s[begin] for s in sums)
    n = end - begin
    inside = (since >= width / 2) & (n >= FEWEST)
    power = np.where(inside, n * stt - st**2, 1.0)
    slope = np.where(inside, (n * stp - st * sp) / power, -np.inf)
    i = int(np.argmax(slope))
    if not slope[i] > 0:
        raise PoorExcitation("PV has no stretch that rises long enough to draw a tangent.")
    middle, level = float(st[i] / n[i]), float(sp[i] / n[i])
    return 1 / float(slope[i]), middle - level / float(slope[i])


def _area(since: Real, part: Real) -> tuple[float, float]:
    """Areas: Tar = int (1 - y), tau = e int_0^Tar y, theta = Tar - tau."""
    t = np.append(0.0, since[since > 0])
    y = np.append(0.0, part[since > 0])
    total = float(np.trapezoid(1 - y, t))
    if not 0 < total < t[-1]:
        raise PoorExcitation("The area over the answer is not that of a first-order one.")
    until = t < total
    at_total = float(np.interp(total, t, y))
    below = float(np.trapezoid(np.append(y[until], at_total), np.append(t[until], total)))
    tau = math.e * below
    return tau, total - tau


def spread(readings: tuple[MethodReading, ...]) -> Spread | None:
    """Smallest and largest answer of all methods, None where none has one.

    Parameters
    ----------
    readings : tuple of MethodReading
        What the methods read.
    """
    models = [r.process for r in readings if r.process is not None]
    if not models:
        return None

    def ends(values: list[float]) -> tuple[float, float]:
        return min(values), max(values)

    return Spread(
        tau=ends([m.tau for m in models]),
        theta=ends([m.theta for m in models]),
        total=ends([m.tau + m.theta for m in models]),
    )
