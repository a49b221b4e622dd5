"""What of OP's movement proportional and integral action explain, and the settings they show."""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real

# Moves are taken over so many samples: longer ones drown rounding, shorter ones tell the two
# actions apart.
STEPS = 3
# Settings beyond these parts of what the window can show count as this much.
LEAST, MOST = 1e-4, 1e4


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerMoves:
    """Fit of OP's moves by the change of the error and by its area, over three samples.

    Attributes
    ----------
    explained : float
        Root of the part of the moves that both explain. [-]
    proportional : float
        |Kc| times the standard deviation of the error over that of OP. [-]
    integral : float
        |Kc| times the window over Ti, times the same ratio. [-]
    Ti : float
        Integral time that the fit shows, between one sample and twenty windows. [samples]
    """

    explained: float
    proportional: float
    integral: float
    Ti: float


def controller_moves(op: Real, error: Real) -> ControllerMoves:
    """Fit what a PI controller does with its error to what OP did.

    The error of a record is what the controller saw, so that least squares is not disturbed by
    PV's noise. It is not an identification: rounding, averaging and a derivative are not minded.

    Parameters
    ----------
    op, error : ndarray, shape (n,)
        Signals without gaps, n > 3. [OP], [PV]
    """
    area = np.concatenate([[0.0], np.cumsum(error)])
    moves = op[STEPS:] - op[:-STEPS]
    change, piled = error[STEPS:] - error[:-STEPS], area[STEPS + 1 :] - area[1:-STEPS]
    Kc, rate = _two_by_two(change, piled, moves)
    left = moves - Kc * change - rate * piled
    power = float(moves @ moves)
    explained = 1 - float(left @ left) / power if power > 0 else 0.0
    spread = float(np.std(op))
    ratio = float(np.std(error)) / spread if spread > 0 else 0.0
    Ti = abs(Kc / rate) if rate != 0 else np.inf
    return ControllerMoves(
        explained=float(np.sqrt(max(explained, 0.0))),
        proportional=float(np.clip(abs(Kc) * ratio, LEAST, MOST)),
        integral=float(np.clip(abs(rate) * op.size * ratio, LEAST, MOST)),
        Ti=float(np.clip(Ti, 1.0, 20.0 * op.size)),
    )


def _two_by_two(a: Real, b: Real, target: Real) -> tuple[float, float]:
    """Least squares on two columns; on the second alone where they are one direction."""
    aa, bb, ab = float(a @ a), float(b @ b), float(a @ b)
    at, bt = float(a @ target), float(b @ target)
    determinant = aa * bb - ab * ab
    if not determinant > 1e-9 * aa * bb:
        return 0.0, bt / bb if bb > 0 else 0.0
    return (at * bb - bt * ab) / determinant, (bt * aa - at * ab) / determinant
