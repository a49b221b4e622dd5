"""Stiction seen directly, where the valve position or the flow through it is known."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real
from monitoring.basis import Basis, graded, refusal
from monitoring.stiction_result import StictionVerdict

FEWEST_MOVES = 30
# The position rests where it makes less than this part of the move that OP asks for.
RESTING = 0.1
STICKS_FROM, FREE_BELOW = 0.4, 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class StemRests:
    """How often the stem rests while OP moves, and how far it then jumps.

    Attributes
    ----------
    rests : float or None
        Part of the moves of OP during which the position rests. [-]
    jump : float or None
        Median move of the position after a rest of two samples and more. [position]
    verdict : StictionVerdict
        Stiction from 0.4, none below 0.15.
    basis : Basis
        What this rests on.
    """

    rests: float | None
    jump: float | None
    verdict: StictionVerdict
    basis: Basis


def stem_rests(op: Real, position: Real, *, smallest_move: float) -> StemRests:
    """Count rests of the stem; an own definition in the spirit of Yamashita's patterns.

    It needs the position or a fast flow. A slow process variable rests less and lags more, and
    would accuse an aggressive loop.

    Parameters
    ----------
    op, position : ndarray, shape (n,)
        Output, and valve position or flow, without gaps. [OP], [position]
    smallest_move : float
        Move of OP between samples that counts; take it above the noise of the position. [OP]
    """
    settings = (("smallest move, OP", smallest_move), ("resting, part of the move", RESTING))
    moved = np.abs(np.diff(op)) >= smallest_move
    count = int(np.count_nonzero(moved))
    if not smallest_move > 0:
        raise ValueError(f"smallest_move must be positive, got {smallest_move}")
    if count < FEWEST_MOVES:
        return StemRests(
            rests=None, jump=None, verdict=StictionVerdict.UNDECIDED,
            basis=refusal(f"OP moves {count} times, fewer than {FEWEST_MOVES}", settings=settings),
        )  # fmt: skip
    steps = np.abs(np.diff(position))
    travel = float(np.ptp(position))
    scale = travel / float(np.ptp(op))
    still = steps <= RESTING * scale * np.maximum(np.abs(np.diff(op)), smallest_move)
    rests = float(np.count_nonzero(still & moved) / count)
    after = still[:-2] & still[1:-1] & ~still[2:]
    jumps = steps[2:][after]
    verdict = StictionVerdict.UNDECIDED
    if rests >= STICKS_FROM or rests < FREE_BELOW:
        verdict = StictionVerdict.STICTION if rests >= STICKS_FROM else StictionVerdict.NONE
    return StemRests(
        rests=rests,
        jump=float(np.median(jumps)) if jumps.size else None,
        verdict=verdict,
        basis=graded(1.0, settings=settings),
    )
