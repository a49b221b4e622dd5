"""Branch and bound over frequency and time constants: how bad a margin can get in a box.

Every cell has a bound that no plant in it can pass, and its middle is a plant that was found. A
cell is dropped when its bounds are close enough to what was found, or keep a limit that was asked
for; the others are cut in four. What was dropped is never forgotten: the worst bound of all
dropped cells and of both ends of the axis is the bound for the box.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from loop.signals import Real
from tuning.box_bounds import badness
from tuning.uncertain_loop import Enclosure, UncertainLoop

# First cells in ln w: a third of an octave to an octave; cuts find everything narrower.
FIRST_WIDTH = 0.4
PARTS = 4
# Ends of the axis: |L| beyond 1/END or below END, and every root this far away.
END, APART = 2e-3, 1e3
FAR = 1e13


@dataclass(slots=True, kw_only=True, eq=False)
class Search:
    """State and result of one search.

    Attributes
    ----------
    found : ndarray, shape (5,)
        Worst badness met at a plant.
    bound : ndarray, shape (5,)
        Badness that no plant of the box passes.
    points : ndarray, shape (5, 1 + g)
        ln w and ln f of the plants met.
    cells : int
        Cells looked at.
    finished : bool
        Whether every cell was dropped within the budget.
    w_low, w_high : float
        Frequencies between which cells were laid; both ends were bounded apart. [rad/s]
    """

    found: Real
    bound: Real
    points: Real
    cells: int = 0
    finished: bool = True
    w_low: float = 0.0
    w_high: float = math.inf
    refuted: bool = field(default=False)


def search_box(
    loop: UncertainLoop,
    found: Real,
    *,
    tolerance: float,
    limits: Real,
    most_cells: int,
    stop_at: Real,
) -> Search:
    """Bound the badness of the five margins over a box.

    Parameters
    ----------
    loop : UncertainLoop
        The loop and its box.
    found : ndarray, shape (5,)
        Badness of some plants of the box, to start from.
    tolerance : float
        Relative distance of bound and found at which a cell is dropped. [-]
    limits : ndarray, shape (5,)
        Badness below which nothing needs to be known; 0 to bound everything.
    most_cells : int
        Cells to look at before giving up.
    stop_at : ndarray, shape (5,)
        Badness that ends the search when it is found; infinite for none.
    """
    low, high, ends = _first_cells(loop)
    search = Search(
        found=found.copy(),
        bound=ends.copy(),
        points=np.full((5, low.shape[1]), np.nan),
        w_low=math.exp(float(low[:, 0].min())),
        w_high=math.exp(float(high[:, 0].max())),
    )
    while low.size:
        where = loop.enclose(low, high)
        worst = badness(loop, where)
        search.cells += low.shape[0]
        middle = 0.5 * (low + high)
        _look(loop, search, middle)
        if np.any(search.found > stop_at) or math.isinf(search.found[0]):
            search.refuted = True
            search.bound = np.maximum(search.bound, np.maximum(search.found, worst.max(axis=1)))
            return search
        enough = np.maximum(search.found * (1 + tolerance), limits)
        open_ = np.any(worst > enough[:, None], axis=0)
        if search.cells + PARTS * np.count_nonzero(open_) > most_cells:
            search.finished = not open_.any()
            open_ = np.zeros_like(open_)
        if not open_.all():
            search.bound = np.maximum(search.bound, worst[:, ~open_].max(axis=1))
        low, high = _cut(low[open_], high[open_], where.pull[open_])
    search.bound = np.maximum(search.bound, search.found)
    return search


def _look(loop: UncertainLoop, search: Search, points: Real) -> None:
    """Keep the worst plants among some points."""
    there = badness(loop, loop.enclose(points, points))
    at = np.argmax(there, axis=1)
    values = there[np.arange(5), at]
    better = values > search.found
    search.found[better] = values[better]
    search.points[better] = points[at[better]]


def _cut(low: Real, high: Real, pull: Real) -> tuple[Real, Real]:
    """Cut every cell in four along the side that widens its enclosure most."""
    n = low.shape[0]
    rows, side = np.arange(n), np.argmax(pull, axis=1)
    edge = low[rows, side] + (high[rows, side] - low[rows, side]) * np.linspace(
        0.0, 1.0, PARTS + 1
    ).reshape(-1, 1)  # fmt: skip
    edge[-1] = high[rows, side]
    lows, highs = np.tile(low, (PARTS, 1, 1)), np.tile(high, (PARTS, 1, 1))
    lows[:, rows, side], highs[:, rows, side] = edge[:-1], edge[1:]
    return lows.reshape(-1, low.shape[1]), highs.reshape(-1, low.shape[1])


def _first_cells(loop: UncertainLoop) -> tuple[Real, Real, Real]:
    """Cells that cover the box between both ends of the axis, and the badness at the ends."""
    corners = np.log(np.abs(loop.roots))
    if loop.theta_high > 0:
        corners = np.append(corners, -math.log(loop.theta_high))
    if not corners.size:
        corners = np.zeros(1)
    moves = np.abs(np.concatenate([loop.low, loop.high])).max()
    v_low = float(corners.min() - moves) - math.log(APART)
    v_high = float(corners.max() + moves) + math.log(APART)
    if loop.order > 0:
        v_low = min(v_low, (loop.log_k + math.log(loop.gain_low * END)) / loop.order)
    high_log, reach = loop.asymptote
    if loop.excess > 0:
        v_high = max(v_high, (high_log + reach + math.log(loop.gain_high / END)) / loop.excess)
    cells = math.ceil((v_high - v_low) / FIRST_WIDTH)
    edges = np.linspace(v_low, v_high, cells + 1)
    low, high = (np.tile(a, (cells, 1)) for a in (loop.low, loop.high))
    low[:, 0], high[:, 0] = edges[:-1], edges[1:]
    return low, high, _ends(loop, v_low, v_high)


def _ends(loop: UncertainLoop, v_low: float, v_high: float) -> Real:
    """Bound the badness below the first and above the last cell.

    Each factor 1 - jw f/p is there within 1 +- 1/APART of 1 or of -jw f/p.
    """
    count = loop.roots.size
    slack = -count * math.log1p(-1 / APART)
    below = loop.log_k - loop.order * v_low
    high_log, reach = loop.asymptote
    above = high_log - loop.excess * v_high
    far = np.full((1, count), math.exp(v_high) * FAR)
    tail = loop.start + float((loop.angle(far) @ loop.weights)[0])
    # Around a dead time L turns for ever.
    turned = 4 * math.pi if loop.theta_high > 0 else 0.0
    late = loop.theta_high * math.exp(v_low)
    where = Enclosure(
        log_low=np.array(
            [
                below - slack if loop.order >= 0 else -math.inf,
                above - reach - slack if loop.excess <= 0 else -math.inf,
            ]
        ),
        log_high=np.array(
            [
                below + slack if loop.order <= 0 else math.inf,
                above + reach + slack if loop.excess >= 0 else math.inf,
            ]
        ),
        phase_low=np.array([loop.start - slack - late, tail - slack - turned]),
        phase_high=np.array([loop.start + slack, tail + slack]),
        late_high=np.array([loop.start + slack, tail + slack]),
        w_high=np.exp([v_low, v_high]),
        pull=np.zeros((2, 1)),
    )
    return np.asarray(badness(loop, where).max(axis=1))
