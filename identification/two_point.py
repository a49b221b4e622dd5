"""Smith's two-point method for a step response.

References
----------
.. [1] C. L. Smith, "Digital Computer Process Control," Intext Educational Publishers, 1972 (the
   method as it is cited in the field; the levels and the constants follow from the model).
"""

import math
from dataclasses import dataclass

import numpy as np

from loop.errors import NotSteady, PoorExcitation
from loop.process import FOPDT
from loop.signals import Real

# At theta + tau/3 and theta + tau after the step a first-order answer stands at these parts.
LEVEL_28, LEVEL_63 = 1 - math.exp(-1 / 3), 1 - math.exp(-1)


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoPoint:
    """Model from two points of one step response.

    Attributes
    ----------
    process : FOPDT
        Model.
    t28, t63 : float
        When PV passed 28.3 % and 63.2 % of its change, from the step on. [s]
    pv_from, pv_to : float
        PV before the step and after the answer. [PV]
    """

    process: FOPDT
    t28: float
    t63: float
    pv_from: float
    pv_to: float


def smith_two_point(
    t: Real, pv: Real, *, step_at: float, op_change: float, pv_from: float, pv_to: float
) -> TwoPoint:
    """Read first order plus dead time off a step response at 28.3 % and 63.2 % [1]_.

    tau = 1.5 (t63 - t28), theta = t63 - tau, K = (pv_to - pv_from)/op_change, both times counted
    from the step.

    A noisy PV passes a level several times; the median of its passages counts.

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
        PV ends where it began, or never passes a level.
    NotSteady
        PV passed 28.3 % before the step, or the two points stand in the wrong order: this is no
        first-order answer.

    Examples
    --------
    >>> t = np.arange(0.0, 300.0)
    >>> pv = 20 + 5 * np.where(t > 30, 1 - np.exp(-(t - 30) / 40), 0)
    >>> found = smith_two_point(t, pv, step_at=10, op_change=2, pv_from=20, pv_to=25).process
    >>> round(found.K, 3), round(found.tau, 1), round(found.theta, 1)
    (2.5, 40.0, 20.0)
    """
    change = pv_to - pv_from
    if change == 0:
        raise PoorExcitation(f"PV ends where it began, at {pv_from:.4g}.")
    part = (pv - pv_from) / change
    t28 = passage(t, part, LEVEL_28) - step_at
    t63 = passage(t, part, LEVEL_63) - step_at
    tau = 1.5 * (t63 - t28)
    theta = t63 - tau
    if tau <= 0 or t28 <= 0:
        raise NotSteady(
            f"PV stood at 28 % of its change {t28:.4g} s and at 63 % {t63:.4g} s after the step, "
            "which no first-order answer does."
        )
    return TwoPoint(
        # On a process without dead time noise can take theta a little below nothing.
        process=FOPDT(K=change / op_change, tau=tau, theta=max(theta, 0.0)),
        t28=t28,
        t63=t63,
        pv_from=pv_from,
        pv_to=pv_to,
    )


def passage(t: Real, part: Real, level: float) -> float:
    """Median of the upward passages of a level. [s]

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times. [s]
    part : ndarray, shape (n,)
        Answer as a part of its whole change. [-]
    level : float
        Level. [-]

    Raises
    ------
    PoorExcitation
        The answer never passes it.
    """
    above = part >= level
    up = np.flatnonzero(~above[:-1] & above[1:])
    if not up.size:
        raise PoorExcitation(f"PV never passes {level:.1%} of its change.")
    share = (level - part[up]) / (part[up + 1] - part[up])
    return float(np.median(t[up] + share * (t[up + 1] - t[up])))
