"""Which action closes a loop with negative feedback, unstable processes included."""

import numpy as np

from loop.controller import Action
from loop.factors import polynomial_roots
from loop.process import Process, gain_sign


def feedback_action(process: Process) -> Action:
    """Choose the action by the sign of the gain, turned for every real unstable pole.

    A process K/(tau s - 1) has the static gain -K, and yet it takes the reverse action for K > 0:
    the poles that feedback moves to the left turn the sign of d(0).

    Parameters
    ----------
    process : Process
        Process model.

    Examples
    --------
    >>> from loop.process import FOPDT, TransferFunction
    >>> feedback_action(FOPDT(K=-2, tau=120, theta=30)).value
    'direct'
    >>> feedback_action(TransferFunction((1.0,), (10.0, -1.0))).value
    'reverse'
    """
    poles = polynomial_roots(process.denominator)
    turns = int(np.sum((poles.imag == 0) & (poles.real > 0)))
    return Action.for_gain(gain_sign(process) * (-1.0) ** turns)
