"""How loops disturb each other: relative gains of a plant, and the pairing they speak for.

The command line, the REST service and a notebook all call this:

    from advice.interaction import interaction_case
    case = interaction_case([[1.0, 0.5], [0.4, 2.0]])
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from advice.body import Body, numbers
from advice.display import digits
from loop.signals import Real
from tuning.beyond_pid import RGA_HIGH, RGA_LOW, relative_gains

# All pairings of so many loops are looked at one by one.
MOST_LOOPS = 7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InteractionCase:
    """Relative gains with the pairing that interacts least.

    Attributes
    ----------
    gains, relative : ndarray, shape (n, n)
        Static gains and relative gains, PV i by OP j. [PV/OP], [-]
    pairing : tuple of int
        For each PV the OP, from 0, whose relative gains are positive and nearest to 1; empty
        where no pairing has only positive ones. [-]
    interacts : bool
        Whether a relative gain of the pairing lies outside .67 to 1.5, or there is no pairing.
    """

    gains: Real
    relative: Real
    pairing: tuple[int, ...]
    interacts: bool


def interaction_case(gains: Sequence[Sequence[float]]) -> InteractionCase:
    """Find the relative gains of a plant and the pairing with the least interaction.

    Parameters
    ----------
    gains : sequence of sequences of float
        Static gain from OP j (column) to PV i (row). [PV/OP]

    Raises
    ------
    RuleNotApplicable
        The matrix is singular.
    ValueError
        It is not square, too large, or a number is not finite.
    """
    if len({len(row) for row in gains} | {len(gains)}) != 1 or not 2 <= len(gains) <= MOST_LOOPS:
        shape = f"{len(gains)} rows of {sorted({len(row) for row in gains})}"
        raise ValueError(f"gains must be a square of 2 to {MOST_LOOPS} loops, got {shape}")
    K = np.array(gains, dtype=np.float64)
    relative = relative_gains(K)
    rows = np.arange(len(gains))
    best: tuple[float, tuple[int, ...]] = (np.inf, ())
    for order in permutations(range(len(gains))):
        paired = relative[rows, list(order)]
        if np.all(paired > 0):
            # Twice the gain and half of it are as bad.
            best = min(best, (float(np.max(np.abs(np.log(paired)))), order))
    pairing = best[1]
    paired = relative[rows, list(pairing)] if pairing else np.array([-1.0])
    return InteractionCase(
        gains=K,
        relative=relative,
        pairing=pairing,
        interacts=bool(np.any((paired < RGA_LOW) | (paired > RGA_HIGH))),
    )


def interaction_body(case: InteractionCase) -> Body:
    """Relative gains as the JSON document of command line and API; loops count from 1."""
    return {
        "gains": numbers(case.gains),
        "relative_gains": numbers(case.relative),
        "pairing": [op + 1 for op in case.pairing] or None,
        "interacts": case.interacts,
        "sentences": list(interaction_sentences(case)),
    }


def interaction_sentences(case: InteractionCase) -> list[str]:
    """Relative gains in words."""
    rows = ["  ".join(digits(value, 3) for value in row) for row in case.relative.tolist()]
    sentences = [f"PV {i}: {row}" for i, row in enumerate(rows, start=1)]
    if not case.pairing:
        return [
            *sentences,
            "Every pairing has a loop whose gain turns its sign when the others close: single "
            "loops must not be used; decouple, or use model predictive control.",
        ]
    pairs = ", ".join(
        f"PV {i + 1} with OP {op + 1} ({digits(float(case.relative[i, op]), 3)})"
        for i, op in enumerate(case.pairing)
    )
    tail = (
        f"Outside {RGA_LOW} to {RGA_HIGH} the loops fight each other: make one much slower, "
        "decouple, or use model predictive control."
        if case.interacts
        else "Single loops will do."
    )
    return [*sentences, f"Least interaction: {pairs}. {tail}"]
