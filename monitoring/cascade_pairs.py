"""Cascades that nobody wrote down: one loop's output is another loop's set point."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real

# Part of the inner set point's variance that the outer output explains. A ratio or a bias station
# between the two is a straight line and leaves it at 1; what is only alike stays well below.
EXPLAINED = 0.98
FEWEST_SAMPLES = 50
# A set point that an operator moves twice a day is explained by any slow signal.
FEWEST_MOVES = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class CascadePair:
    """An outer loop that sets an inner loop's set point.

    Attributes
    ----------
    outer, inner : int
        Places of the loops, in the order given.
    explained : float
        Part of the inner set point's moves that the outer output explains. [-]
    """

    outer: int
    inner: int
    explained: float


def cascade_pairs(op: Real, sp: Real) -> tuple[CascadePair, ...]:
    """Find pairs whose outer output moves the inner set point.

    Moves from sample to sample are compared, not levels: two slow drifts look alike, two series of
    moves do not.

    Parameters
    ----------
    op : ndarray, shape (m, n)
        Outputs of m loops at the same instants, NaN where unknown. [OP]
    sp : ndarray, shape (m, n)
        Set points, NaN where unknown or where there is none. [PV]

    Returns
    -------
    tuple of CascadePair
        The best outer loop of each inner one.
    """
    outer_moves, inner_moves = np.diff(op, axis=1), np.diff(sp, axis=1)
    found = []
    for inner, moves in enumerate(inner_moves):
        if np.count_nonzero(np.nan_to_num(moves)) < FEWEST_MOVES:
            continue
        shares = [
            0.0 if outer == inner else _explained(outer_moves[outer], moves)
            for outer in range(op.shape[0])
        ]
        best = int(np.argmax(shares))
        if shares[best] >= EXPLAINED:
            found.append(CascadePair(outer=best, inner=inner, explained=shares[best]))
    return tuple(found)


def _explained(outer: Real, inner: Real) -> float:
    """Square of the correlation of two series of moves, where both are known."""
    known = np.isfinite(outer) & np.isfinite(inner)
    if np.count_nonzero(known) < FEWEST_SAMPLES:
        return 0.0
    a, b = outer[known], inner[known]
    size = float((a @ a) * (b @ b))
    return float(a @ b) ** 2 / size if size > 0 else 0.0
